"""Machines that can run the FMUs' binaries here, natively or emulated, and the driver on each of them."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from fmu_builder.compiler import FREESTANDING, TARGETS, host_platform, run_compiler
from fmu_builder.fmi2 import fmi_headers

DRIVER = Path(__file__).parent / "driver.c"
RUNNABLE = ("linux64", "linux32", "aarch64-linux", "win64")
TIME_LIMIT = 300.0
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
NEEDS = {
    "linux64": "needs Linux on an x86-64 processor",
    "linux32": "needs the 32-bit C library (Debian: libc6-i386)",
    "aarch64-linux": "needs qemu-aarch64 and the C library for it (Debian: qemu-user libc6-arm64-cross)",
    "win64": "needs wine64 (Debian: wine64)",
}


def command_of(platform: str) -> list[str] | None:
    """Return what runs a program of this platform here, None where nothing does."""
    here = host_platform()
    if platform == here:
        return []
    if here != "linux64":
        return None
    if platform == "linux32":
        return [] if Path("/lib/ld-linux.so.2").exists() else None
    if platform == "aarch64-linux":
        qemu = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
        found = qemu is not None and (ARM_LIBRARIES / "lib" / "ld-linux-aarch64.so.1").exists()
        return [str(qemu), "-L", str(ARM_LIBRARIES)] if found else None
    wine = wine_program("wine64")
    return [wine] if wine is not None and platform == "win64" else None


def wine_program(name: str) -> str | None:
    """Return a program of Wine; Debian keeps the 64-bit ones in a folder of their own."""
    return shutil.which(name) or shutil.which(name, path="/usr/lib/wine")


def require(available: bool, what: str) -> None:
    """Skip a test that cannot run here."""
    if not available:
        pytest.skip(what)


@contextmanager
def environment_of(platform: str) -> Iterator[dict[str, str]]:
    """Give the environment of a platform: for Windows a world of its own that ends with the block."""
    if platform != "win64" or host_platform() == "win64":
        yield dict(os.environ)
        return
    with tempfile.TemporaryDirectory(prefix="llmn-wine-", ignore_cleanup_errors=True) as folder:
        environment = {
            **{name: value for name, value in os.environ.items() if name != "DISPLAY"},
            **{
                "WINEPREFIX": folder,
                "WINEDEBUG": "-all",
                "WINEDLLOVERRIDES": "mscoree,mshtml,winemenubuilder.exe=",
            },
        }
        try:
            yield environment
        finally:
            server = wine_program("wineserver64") or wine_program("wineserver")
            if server is not None:
                subprocess.run([server, "-k"], env=environment, timeout=60.0, check=False)
                subprocess.run([server, "-w"], env=environment, timeout=60.0, check=False)


class Machine:
    """One platform with a compiled driver."""

    def __init__(self, platform: str, folder: Path, environment: dict[str, str]) -> None:
        self.platform, self._environment = platform, environment
        self._command = command_of(platform) or []
        self._program = folder / f"driver-{platform}"
        flags = ["-target", TARGETS[platform].triple, "-std=c99", "-O1", "-ffp-contract=off", "-w"]
        flags += [f"-I{fmi_headers()}", str(DRIVER)]
        if platform.startswith("win"):
            self._program = self._program.with_suffix(".exe")
            flags += ["-nostdlib", "-ffreestanding", "-fno-builtin", "-fno-stack-protector"]
            flags += [
                f"-I{FREESTANDING}",
                str(FREESTANDING / "runtime.c"),
                "-lkernel32",
                "-Wl,-e,mainCRTStartup",
            ]
        else:
            flags += ["-D_GNU_SOURCE", "-ldl"]
        run = run_compiler([*flags, "-o", str(self._program)], folder, TIME_LIMIT)
        assert run.returncode == 0, run.stderr

    def path(self, path: Path) -> str:
        """Return a path as a program of this platform writes it."""
        wine = self.platform.startswith("win") and host_platform().startswith("linux")
        return "Z:" + str(path).replace("/", "\\") if wine else str(path)

    def run(self, commands: Sequence[str]) -> list[str]:
        """Return the lines that the driver prints for these commands."""
        run = subprocess.run(
            [*self._command, str(self._program)],
            input="\n".join(commands) + "\n",
            env=self._environment,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=TIME_LIMIT,
            check=False,
        )
        lines = run.stdout.splitlines()
        assert run.returncode == 0 and lines and lines[-1] == "done", (lines[-3:], run.stderr[-2000:])
        return lines[:-1]


def bits(value: float) -> str:
    """Return the driver's form of a number."""
    return struct.pack(">d", value).hex()


def number(text: str) -> float:
    """Return the number of the driver's form."""
    return float(struct.unpack(">d", bytes.fromhex(text))[0])
