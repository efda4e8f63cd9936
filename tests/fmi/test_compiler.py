"""The one door to the C compiler."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import pytest

from fmu_builder import compiled_cache, compiler
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


def test_libraries_are_kept_by_content_and_damaged_ones_made_anew(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []

    def compiled(job: compiler._Job, platform: str, name: str) -> bytes:
        made.append(platform)
        return f"{platform} {name} {job.defines}".encode()

    monkeypatch.setattr(compiler, "_compiled", compiled)

    def build(offset: str = "1.0", stem: str = "numbers") -> dict[str, bytes]:
        return compiler.compile_shared_libraries(
            source, stem, ("linux64", "win64"), (tmp_path / "in clude",), {"OFFSET": offset}
        )

    first = build()
    assert build() == first and sorted(made) == ["linux64", "win64"]
    for other in ({"offset": "2.0"}, {"stem": "other"}):
        made.clear()
        assert build(**other) != first and len(made) == 2
    folder = compiler.cache_folder() / "libraries"
    for damage in (lambda b: b[:-1], lambda b: b[:40] + b"?" + b[41:], lambda b: b"", lambda b: b + b"x"):
        made.clear()
        for path in folder.iterdir():
            path.write_bytes(damage(path.read_bytes()))
        assert build() == first and len(made) == 2
    all_of = ({}, {"offset": "2.0"}, {"stem": "other"})
    for options in all_of:
        build(**options)
    made.clear()
    one, two = sorted(folder.iterdir())[:2]
    content = one.read_bytes()
    one.write_bytes(two.read_bytes())
    two.write_bytes(content)  # whole, but of something else
    for options in all_of:
        build(**options)
    assert len(made) == 2


def test_a_damaged_native_library_is_replaced(source: Path) -> None:
    assert _scaled(source) == 7.0
    (library,) = (compiler.cache_folder() / "native").iterdir()
    good = library.read_bytes()
    library.unlink()
    library.write_bytes(good[: len(good) // 2])
    assert _scaled(source) == 7.0
    assert library.read_bytes() == good


def test_the_cache_does_not_grow_for_ever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiled_cache, "MOST", 6)
    monkeypatch.setattr(compiled_cache, "LEFT", 4)
    keys = [compiled_cache.key_of((bytes([k]),)) for k in range(7)]
    for k, key in enumerate(keys):
        compiled_cache.keep(tmp_path / "c", key, bytes(k))
        if (tmp_path / "c" / key).exists():
            os.utime(tmp_path / "c" / key, (k, k))
    left = [compiled_cache.kept(tmp_path / "c", key) for key in keys]
    assert left == [None, None, None, *(bytes(k) for k in (3, 4, 5, 6))]
    compiled_cache.keep(tmp_path / "c" / keys[3] / "no folder", keys[0], b"")
    assert compiled_cache.kept(tmp_path / "c" / keys[3] / "no folder", keys[0]) is None


def test_memory_functions_are_built_in(source: Path) -> None:
    library = load_native("numbers", source, (source.parent / "in clude",), {"OFFSET": "0.0"})
    block = ctypes.c_double * 200
    target, content = block(), block(*range(200))
    library.copy(target, content)
    assert list(target) == list(range(200))


@pytest.mark.parametrize("platform", list(TARGETS))
def test_same_bytes_from_another_folder(source: Path, platform: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(compiler, "kept", lambda *_: None)  # compiled anew
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
