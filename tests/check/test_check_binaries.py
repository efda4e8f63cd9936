"""The readers of libraries against another reader and other tools, and defects planted in binaries."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from check.defects import STATIC, entries_of, finding, write
from check.planted import with_binary
from fmi import lti
from fmi.exports import elf_symbols, pe_symbols
from fmu_builder.check import Severity, check_fmu, libraries
from fmu_builder.check.binaries import Binary, BinaryError, read_binary
from fmu_builder.check.functions import COMMON, OF_INTERFACE
from fmu_builder.check.libraries import PLATFORMS
from fmu_builder.compiler import TARGETS, host_platform

FUNCTIONS = COMMON.union(*OF_INTERFACE.values())


@pytest.fixture(scope="module")
def all_platforms(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return lti.build(tmp_path_factory.mktemp("all") / "lti_test.fmu", tuple(TARGETS))


def libraries_of(fmu: Path) -> dict[str, bytes]:
    return {name.split("/")[1]: c for name, c in entries_of(fmu).items() if name.startswith("binaries/")}


def test_every_platform_is_read_and_has_no_finding(all_platforms: Path) -> None:
    report = check_fmu(all_platforms, STATIC)
    assert report.findings == (), report.text()
    for platform, content in libraries_of(all_platforms).items():
        first, *others = read_binary(content)
        assert (first.format, first.machine) == PLATFORMS[platform][:2]
        assert [other.machine for other in others] == (["aarch64"] if platform == "darwin64" else [])
        assert all(binary.exported == FUNCTIONS for binary in (first, *others))


def test_symbols_are_those_another_reader_finds(all_platforms: Path) -> None:
    binaries = libraries_of(all_platforms)
    for platform in ("linux64", "aarch64-linux"):
        (binary,) = read_binary(binaries[platform])
        assert (set(binary.exported), set(binary.needed)) == elf_symbols(binaries[platform])
    (binary,) = read_binary(binaries["win64"])
    assert (set(binary.exported), set(binary.libraries)) == pe_symbols(binaries["win64"])


@pytest.mark.skipif(not shutil.which("gcc") or not shutil.which("readelf"), reason="needs gcc and readelf")
@pytest.mark.skipif(not host_platform().startswith("linux"), reason="gcc makes ELF libraries on Linux")
@pytest.mark.parametrize("hash_style", ["sysv", "gnu"])
def test_versions_and_libraries_are_those_readelf_prints(hash_style: str, tmp_path: Path) -> None:
    source = tmp_path / "a.c"
    source.write_text(
        "#include <math.h>\n#include <stdio.h>\n"
        'double f(double x) { puts("x"); return exp(x) + log(x); }\n'
        '__attribute__((visibility("hidden"))) int hidden = 3;\n'
    )
    library = tmp_path / "a.so"
    style = f"-Wl,--hash-style={hash_style},-z,execstack"
    subprocess.run(["gcc", "-shared", "-fPIC", "-O0", style, source, "-lm", "-o", library], check=True)
    (binary,) = read_binary(library.read_bytes())
    printed = subprocess.run(
        ["readelf", "--wide", "--dyn-syms", "--dynamic", library], capture_output=True, text=True, check=True
    ).stdout
    needed = dict(re.findall(r"FUNC\s+GLOBAL DEFAULT\s+UND (\w+)@(\w+[\w.]*)", printed))
    assert {"exp", "log", "puts"} <= set(needed) <= binary.needed
    by_name = {name: version for version, names in binary.versions.items() for name in names}
    assert by_name == needed
    assert list(binary.libraries) == re.findall(r"\(NEEDED\).*\[(.*)\]", printed)
    assert "f" in binary.exported and "hidden" not in binary.exported
    assert binary.remarks == {"executable stack": "yes"}


def test_a_missing_function_is_found(right_fmu: Path, tmp_path: Path) -> None:
    right = "FMI2_Export COLD fmi2Status fmi2CancelStep("
    fmu = with_binary(right_fmu, tmp_path, (("stepping.c", right, "fmi2Status cancel_step("),), "linux64")
    found = finding(fmu, "missing-function")
    assert found.place == "binaries/linux64/lti_test.so" and "fmi2CancelStep" in found.what


def test_a_libm_symbol_is_found(right_fmu: Path, tmp_path: Path) -> None:
    right = "    return lti_A[row][0] * model->state[0]"
    wrong = (
        "    double exp(double);\n    return 1e-300 * exp(model->state[1]) + lti_A[row][0] * model->state[0]"
    )
    found = finding(
        with_binary(right_fmu, tmp_path, (("lti_model.c", right, wrong),), "linux64"), "libm-symbol"
    )
    assert found.severity is Severity.ERROR and "exp" in found.what


def test_other_exports_are_found(right_fmu: Path, tmp_path: Path) -> None:
    right = "static double lti_forcing("
    changes = (("lti_model.c", right, "EXPORTED double lti_forcing("),)
    fmu = with_binary(right_fmu, tmp_path, changes, "linux64")
    assert "lti_forcing" in finding(fmu, "other-exports").what


def _swapped(entries: dict[str, bytes]) -> dict[str, bytes]:
    windows, linux = "binaries/win64/lti_test.dll", "binaries/linux64/lti_test.so"
    return {**entries, windows: entries[linux], linux: entries[windows]}


DEFECTS = {
    "library of another platform": ("binary-platform", _swapped),
    "library of another name": (
        "binary-name",
        lambda entries: {name.replace("/lti_test.so", "/other.so"): c for name, c in entries.items()},
    ),
    "no library at all": (
        "binary-format",
        lambda entries: {**entries, "binaries/linux64/lti_test.so": b"#!/bin/sh\n"},
    ),
    "unknown platform": ("platform-folder", lambda entries: {**entries, "binaries/amiga/lti_test": b""}),
    "nothing to run": (
        "no-binary",
        lambda entries: {
            name: re.sub(rb"<SourceFiles>.*?</SourceFiles>", b"", content, flags=re.DOTALL)
            for name, content in entries.items()
            if not name.startswith(("binaries/", "sources/"))
        },
    ),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_planted_defect_is_found(defect: str, right_fmu: Path, tmp_path: Path) -> None:
    rule, change = DEFECTS[defect]
    assert finding(write(tmp_path / "lti_test.fmu", change(entries_of(right_fmu)).items()), rule).place


FACTS = {
    "glibc-level": Binary(
        "ELF", "x86_64", FUNCTIONS, libraries=("libc.so.6",), versions={"GLIBC_2.29": ("exp",)}
    ),
    "needed-library": Binary("ELF", "x86_64", FUNCTIONS, libraries=("libc.so.6", "libblas.so.3")),
    "python-symbol": Binary("ELF", "x86_64", FUNCTIONS, frozenset({"PyErr_Occurred"}), ("libc.so.6",)),
    "undefined-symbol": Binary("ELF", "x86_64", FUNCTIONS, frozenset({"cvode_step"})),
    "executable-stack": Binary("ELF", "x86_64", FUNCTIONS, remarks={"executable stack": "yes"}),
    "unsigned": Binary("Mach-O", "aarch64", FUNCTIONS, remarks={"unsigned": "yes"}),
    "install-name": Binary("Mach-O", "x86_64", FUNCTIONS, remarks={"install name": "/build/x.dylib"}),
}


@pytest.mark.parametrize("rule", FACTS)
def test_what_a_target_may_lack_is_found(rule: str, right_fmu: Path, monkeypatch) -> None:
    monkeypatch.setattr(libraries, "read_binary", lambda _content: [FACTS[rule]])
    assert finding(right_fmu, rule).mend


def test_the_old_glibc_is_none_too_new(right_fmu: Path, monkeypatch) -> None:
    old = Binary("ELF", "x86_64", FUNCTIONS, libraries=("libc.so.6",), versions={"GLIBC_2.2.5": ("free",)})
    monkeypatch.setattr(libraries, "read_binary", lambda _content: [old])
    assert "glibc-level" not in {item.rule for item in check_fmu(right_fmu, STATIC).findings}


def test_damaged_libraries_give_messages_only(all_platforms: Path) -> None:
    draw = random.Random(7)
    refused = 0
    for content in libraries_of(all_platforms).values():
        for _ in range(150):
            damaged = bytearray(content)
            for _ in range(draw.randint(1, 20)):
                damaged[draw.randrange(min(len(damaged), 4096))] = draw.randrange(256)
            if draw.random() < 0.3:
                del damaged[draw.randrange(len(damaged)) :]
            try:
                read_binary(bytes(damaged))
            except BinaryError:
                refused += 1
    assert refused > 100


def test_a_universal_library_is_read_slice_by_slice(all_platforms: Path) -> None:
    binaries = libraries_of(all_platforms)
    universal = binaries["darwin64"]
    assert [binary.machine for binary in read_binary(universal)] == ["x86_64", "aarch64"]
    assert all(binary.exported == FUNCTIONS for binary in read_binary(universal))
    with pytest.raises(BinaryError):
        read_binary(universal[:5000])


def test_offsets_beyond_all_numbers_are_refused() -> None:
    with pytest.raises(BinaryError, match="outside the file"):
        read_binary(b"\x7fELF\x02\x01\x01" + bytes(9) + b"\x03\0" + b"\xff" * 60)
