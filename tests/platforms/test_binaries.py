"""Binaries of all eight platforms: what they offer and need, their bytes, the universal library of macOS."""

from __future__ import annotations

import shutil
import struct
import tomllib
import zipfile
from importlib import metadata
from pathlib import Path

import pytest

from fmi import lti
from fmi.test_fmi_package import FUNCTIONS
from fmu_builder import compiler
from fmu_builder.check.binaries import read_binary
from fmu_builder.compiler import TARGETS
from fmu_builder.errors import BuildError
from fmu_builder.fmi2 import DEFAULT_PLATFORMS, build_fmu
from fmu_builder.universal_library import universal_library
from platforms.mach_o import install_name, signature_complaints, slices

EIGHT = (
    *("linux64", "linux32", "aarch64-linux", "win64", "win32", "aarch64-windows"),
    *("darwin64", "aarch64-darwin"),
)
MACHINES = {
    **{"linux64": ["x86_64"], "linux32": ["x86"], "aarch64-linux": ["aarch64"]},
    **{"win64": ["x86_64"], "win32": ["x86"], "aarch64-windows": ["aarch64"]},
    **{"darwin64": ["x86_64", "aarch64"], "aarch64-darwin": ["aarch64"]},
}
INTEL, ARM = 0x01000007, 0x0100000C


def binaries_of(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        names = [name for name in archive.namelist() if name.startswith("binaries/")]
        return {name.split("/")[1]: archive.read(name) for name in names}


@pytest.fixture(scope="module")
def binaries(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return binaries_of(lti.build(tmp_path_factory.mktemp("eight") / "lti_test.fmu", DEFAULT_PLATFORMS))


def test_all_eight_platforms_are_the_default(binaries: dict[str, bytes]) -> None:
    assert set(EIGHT) == set(DEFAULT_PLATFORMS) == set(binaries) == set(TARGETS)


@pytest.mark.parametrize("platform", EIGHT)
def test_exactly_the_functions_of_fmi_and_nothing_but_the_heap(
    binaries: dict[str, bytes], platform: str
) -> None:
    found = read_binary(binaries[platform])
    assert [one.machine for one in found] == MACHINES[platform]
    for one in found:
        assert one.exported == FUNCTIONS
        assert one.versions == {}
        if one.format == "PE":
            assert [name.lower() for name in one.libraries] == ["kernel32.dll"]
        else:
            assert one.needed - {"dyld_stub_binder"} == {"calloc", "free"}
            assert all(name == "/usr/lib/libSystem.B.dylib" for name in one.libraries)


def test_same_bytes_on_rebuild_and_from_another_folder(
    binaries: dict[str, bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fmu_builder.compiler.kept", lambda *_: None)  # compiled anew
    elsewhere = tmp_path / "with a space" / "lti_c"
    shutil.copytree(lti.C_FOLDER, elsewhere)
    again = build_fmu(
        lti.INTERFACE, lti.MODEL_HASH, elsewhere / "all.c", (elsewhere,), {}, tmp_path / "x.fmu", EIGHT[::-1]
    )
    found = binaries_of(again)
    assert {name for name in EIGHT if found[name] != binaries[name]} == set()
    assert not any(str(tmp_path).encode() in content for content in found.values())


def test_universal_library_holds_both_slices(binaries: dict[str, bytes]) -> None:
    found = slices(binaries["darwin64"])
    assert list(found) == [INTEL, ARM]
    for processor, page in ((INTEL, 4096), (ARM, 16384)):
        offset, alignment, library = found[processor]
        assert alignment == page
        assert offset % page == 0
        assert install_name(library) == "@rpath/lti_test.dylib"
    assert found[ARM][2] == binaries["aarch64-darwin"]


def test_code_for_apples_processors_is_signed(binaries: dict[str, bytes]) -> None:
    for library in (slices(binaries["darwin64"])[ARM][2], binaries["aarch64-darwin"]):
        assert signature_complaints(library) == []
        for place in (4096, len(library) // 2):
            damaged = bytearray(library)
            damaged[place] ^= 1
            assert len(signature_complaints(bytes(damaged))) == 1


def test_universal_libraries_of_nonsense_are_refused() -> None:
    thin = struct.pack("<III", 0xFEEDFACF, INTEL, 3) + b"\0" * 64
    for wrong in ([b"", thin], [thin, thin], [thin, b"\x7fELF" + b"\0" * 60]):
        with pytest.raises(BuildError, match="universal library"):
            universal_library(wrong)


def test_the_compiler_is_the_pinned_one(monkeypatch: pytest.MonkeyPatch) -> None:
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8"))
    assert f"ziglang=={compiler.PINNED}" in project["project"]["dependencies"]
    compiler._zig.cache_clear()
    monkeypatch.setattr(metadata, "version", lambda _name: "0.99.0")
    with pytest.raises(BuildError, match=f"ziglang=={compiler.PINNED}"):
        compiler._zig()
    monkeypatch.undo()
    compiler._zig.cache_clear()
    assert compiler._zig()[1] == compiler.PINNED
