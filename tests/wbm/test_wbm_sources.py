"""The sources in the FMU, compiled by somebody who knows none of our flags."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import fmpy
import numpy as np
import pytest
import ziglang

from fmi.exports import elf_symbols
from fmu_builder.compiler import cache_folder, host_platform
from fmu_builder.fmi2 import fmi_headers
from fmus.wbm import build_wbm

C_LIBRARY = {"calloc", "free", "memcpy", "memmove", "memset"}


def compile_plainly(folder: Path, binary: Path, level: str) -> None:
    program = Path(ziglang.__file__).parent / ("zig.exe" if sys.platform == "win32" else "zig")
    cache = str(cache_folder() / "zig")
    flags = ("-shared", "-fPIC", "-nostdlib", "-fno-sanitize=undefined")  # the last: a default of zig alone
    command = [str(program), "cc", level, *flags, f"-I{fmi_headers()}"]
    caches = {"ZIG_GLOBAL_CACHE_DIR": cache, "ZIG_LOCAL_CACHE_DIR": cache}
    source = str(folder / "sources" / "all.c")
    subprocess.run([*command, source, "-o", str(binary)], check=True, env={**os.environ, **caches})


@pytest.mark.skipif(host_platform() != "linux64", reason="reads ELF and loads what it links")
@pytest.mark.parametrize("level", ["-O0", "-O2"])
def test_sources_link_without_a_mathematics_library_to_the_same_bits(level: str, tmp_path: Path) -> None:
    path = build_wbm(tmp_path / "pantograph_wbm.fmu", (host_platform(),))
    inputs = np.rec.fromarrays([np.array([0.0, 0.5]), np.array([1.5, 1.6])], names=["time", "eta"])
    options = {"stop_time": 0.5, "output_interval": 0.01, "input": inputs}
    own = fmpy.simulate_fmu(str(path), **options)
    with zipfile.ZipFile(path) as archive:
        archive.extractall(tmp_path / "unpacked")
    binary = tmp_path / "unpacked" / "binaries" / host_platform() / "pantograph_wbm.so"
    original = binary.read_bytes()
    compile_plainly(tmp_path / "unpacked", binary, level)
    assert binary.read_bytes() != original
    _, undefined = elf_symbols(binary.read_bytes())
    assert undefined <= C_LIBRARY
    assert np.array_equal(fmpy.simulate_fmu(str(tmp_path / "unpacked"), **options), own)
