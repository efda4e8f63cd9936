"""The one door to the C compiler."""

from __future__ import annotations

import ctypes
from pathlib import Path

import pytest

from fmu_builder import compiler
from fmu_builder.compiler import TARGETS, compile_shared_library, host_platform, load_native
from fmu_builder.errors import BuildError

SOURCE = """
#include "numbers.h"
typedef struct { double cells[200]; } Block;
EXPORTED double scaled(double x);
EXPORTED double scaled(double x) { return FACTOR * x + OFFSET; }
EXPORTED void copy(Block *target, const Block *source);
EXPORTED void copy(Block *target, const Block *source) { *target = *source; }
static int secret(void) { return 1; }
"""


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "in clude").mkdir()
    (tmp_path / "in clude" / "numbers.h").write_text("#define FACTOR 3.0\n")
    (tmp_path / "unity file.c").write_text(SOURCE)
    cache = tmp_path / "cache"
    zig_cache = compiler.cache_folder() / "zig"
    (cache).mkdir()
    (cache / "zig").symlink_to(zig_cache, target_is_directory=True)
    monkeypatch.setattr(compiler, "cache_folder", lambda: cache)
    return tmp_path / "unity file.c"


def _scaled(source: Path, offset: str = "1.0") -> float:
    library = load_native("numbers", source, (source.parent / "in clude",), {"OFFSET": offset})
    library.scaled.restype = ctypes.c_double
    return library.scaled(ctypes.c_double(2.0))


def test_native_library_follows_source_header_and_definitions(source: Path) -> None:
    kept = compiler.cache_folder() / "native"
    assert _scaled(source) == 7.0
    assert _scaled(source) == 7.0
    assert len(list(kept.iterdir())) == 1
    assert _scaled(source, "-4.0") == 2.0
    (source.parent / "in clude" / "numbers.h").write_text("#define FACTOR 5.0\n")
    assert _scaled(source) == 11.0
    source.write_text(SOURCE.replace("FACTOR * x", "FACTOR - x"))
    assert _scaled(source) == 4.0
    assert len(list(kept.iterdir())) == 4


def test_memory_functions_are_built_in(source: Path) -> None:
    library = load_native("numbers", source, (source.parent / "in clude",), {"OFFSET": "0.0"})
    block = ctypes.c_double * 200
    target, content = block(), block(*range(200))
    library.copy(target, content)
    assert list(target) == list(range(200))


@pytest.mark.parametrize("platform", ["linux64", "win64", "darwin64", "aarch64-darwin", "aarch64-linux"])
def test_same_bytes_from_another_folder(source: Path, platform: str) -> None:
    results = []
    for folder in ("a", "b c"):
        copy = source.parent / folder / "unity.c"
        copy.parent.mkdir()
        copy.write_text(source.read_text())
        (copy.parent / "numbers.h").write_text("#define FACTOR 3.0\n")
        output = source.parent / ("out " + folder) / ("name" + TARGETS[platform].suffix)
        compile_shared_library(copy, output, platform, defines={"OFFSET": "0.5"})
        results.append(output.read_bytes())
        assert [path.name for path in output.parent.iterdir()] == [output.name]
    assert results[0] == results[1]
    assert str(source.parent).encode() not in results[0]


def test_source_that_does_not_compile_is_shown(source: Path, tmp_path: Path) -> None:
    with pytest.raises(BuildError) as caught:
        compile_shared_library(source, tmp_path / "x.so", "linux64", (tmp_path / "in clude",))
    assert "OFFSET" in str(caught.value)
    assert "unity file.c" in str(caught.value)
    assert not (tmp_path / "x.so").exists()


def test_long_complaints_are_cut(source: Path, tmp_path: Path) -> None:
    source.write_text("".join(f"int f{k}(void) {{ return unknown_{k}; }}\n" for k in range(40)))
    with pytest.raises(BuildError) as caught:
        compile_shared_library(source, tmp_path / "x.so", "linux64")
    assert "more lines" in str(caught.value)
    assert len(str(caught.value).splitlines()) < 20


def test_wrong_arguments_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="platform amiga: is not known"):
        compile_shared_library(tmp_path / "a.c", tmp_path / "x.so", "amiga")
    with pytest.raises(BuildError, match="does not exist"):
        compile_shared_library(tmp_path / "a.c", tmp_path / "x.so", "linux64")
    with pytest.raises(BuildError, match="does not exist"):
        load_native("a", tmp_path / "a.c")


def test_missing_compiler_says_how_to_get_it(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compiler._zig.cache_clear()
    monkeypatch.setattr(compiler, "find_spec", lambda _name: None)
    with pytest.raises(BuildError, match=r"pip install ziglang"):
        compile_shared_library(source, tmp_path / "x.so", "linux64")
    compiler._zig.cache_clear()


def test_folder_that_cannot_be_written_falls_back(source: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (compiler.cache_folder() / "native").write_text("a file where the folder should be")
    assert _scaled(source) == 7.0


def test_host_is_a_target() -> None:
    assert host_platform() in TARGETS
