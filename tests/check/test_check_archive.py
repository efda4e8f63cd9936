"""Archives that are damaged, hostile or untidy: findings only, and no file outside the target folder."""

from __future__ import annotations

import random
import stat
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from check.defects import STATIC, entries_of, finding, write
from fmu_builder.check import Severity, archive, check_fmu

Entries = dict[str | zipfile.ZipInfo, bytes]


def added(name: str, content: bytes = b"x", mode: int = 0o100644) -> Callable[[dict[str, bytes]], Entries]:
    def change(entries: dict[str, bytes]) -> Entries:
        entry = zipfile.ZipInfo("placeholder")
        entry.filename = entry.orig_filename = name  # the constructor would tidy it up
        entry.external_attr, entry.create_system = mode << 16, 3
        return {**entries, entry: content}

    return change


DEFECTS = {
    "backslash": ("archive-path", added("resources\\note.txt")),
    "absolute path": ("archive-path", added("/tmp/llmn-check-escape")),
    "climbs out": ("archive-path", added("resources/../../llmn-check-escape")),
    "drive": ("archive-path", added("C:/llmn-check-escape")),
    "symbolic link": ("archive-link", added("resources/link", b"/etc/passwd", stat.S_IFLNK | 0o777)),
    "device of Windows": ("archive-name", added("resources/aux.txt")),
    "dot and slash": ("archive-name", added("./resources/a.txt")),
    "no name": ("archive-name", added("")),
    "by-product": ("archive-leftover", added("binaries/win64/lti_test.pdb")),
    "upper and lower case": ("archive-case", added("resources/NOTE.txt")),
    "in a folder": ("archive-layout", lambda entries: {"fmu/" + name: c for name, c in entries.items()}),
    "no description": ("archive-layout", lambda entries: {"readme.txt": b"hello"}),
}


@pytest.mark.parametrize("defect", DEFECTS)
def test_planted_defect_is_found(defect: str, right_fmu: Path, tmp_path: Path) -> None:
    rule, change = DEFECTS[defect]
    target = tmp_path / "inner" / "lti_test.fmu"
    target.parent.mkdir()
    assert finding(write(target, change(entries_of(right_fmu)).items()), rule).place
    assert not list(tmp_path.rglob("*escape*"))
    assert not Path("/tmp/llmn-check-escape").exists()


def test_duplicate_entries_are_found(right_fmu: Path, tmp_path: Path) -> None:
    entries = entries_of(right_fmu)
    with pytest.warns(UserWarning, match="Duplicate name"):
        fmu = write(tmp_path / "a.fmu", [*entries.items(), ("modelDescription.xml", b"<other/>")])
    assert "2 times" in finding(fmu, "archive-duplicate").what


def test_a_bomb_is_not_unpacked(right_fmu: Path, tmp_path: Path) -> None:
    fmu = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in entries_of(right_fmu).items():
            packed.writestr(name, content)
        packed.writestr("resources/zeros", bytes(archive._RATIO_MATTERS + 1))
    assert "nothing was unpacked" in finding(fmu, "archive-bomb").what
    folder = tmp_path / "empty"
    folder.mkdir()
    assert archive.unpack(fmu, folder) == []
    assert list(folder.iterdir()) == []


def test_a_damaged_entry_is_named(right_fmu: Path, tmp_path: Path) -> None:
    content = bytearray(right_fmu.read_bytes())
    at = content.index(b"MIT\n")
    content[at] ^= 0xFF
    fmu = tmp_path / "lti_test.fmu"
    fmu.write_bytes(content)
    found = finding(fmu, "archive-damaged")
    assert "license.txt" in found.place and "CRC" in found.what


def test_encrypted_and_strangely_compressed_entries_are_found(right_fmu: Path, tmp_path: Path) -> None:
    fmu = tmp_path / "lti_test.fmu"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_LZMA) as packed:
        for name, content in entries_of(right_fmu).items():
            packed.writestr(name, content)
    assert finding(fmu, "archive-method").severity is Severity.ERROR


@pytest.mark.parametrize("content", [b"", b"PK", b"no zip at all", b"PK\x05\x06" + bytes(18)])
def test_what_is_no_archive_is_said(content: bytes, tmp_path: Path) -> None:
    fmu = tmp_path / "x.fmu"
    fmu.write_bytes(content)
    report = check_fmu(fmu)
    assert not report.passed
    assert report.text()


def test_a_missing_file_and_a_folder_are_said(tmp_path: Path) -> None:
    assert "no such FMU file" in finding(tmp_path / "none.fmu", "archive").what
    assert "no such FMU file" in finding(tmp_path, "archive").what


def test_random_damage_gives_messages_only(right_fmu: Path, tmp_path: Path) -> None:
    """Bytes flipped, cut and repeated all over the file, half of them in the directory at its end."""
    whole = right_fmu.read_bytes()
    directory = whole.index(b"PK\x01\x02")
    draw = random.Random(20261125)
    folder = tmp_path / "inner"
    folder.mkdir()
    fmu = folder / "lti_test.fmu"
    failed = 0
    for _ in range(150):
        content = bytearray(whole)
        low = directory if draw.random() < 0.5 else 0
        for _ in range(draw.randint(1, 12)):
            content[draw.randrange(low, len(content))] = draw.randrange(256)
        if draw.random() < 0.3:
            del content[draw.randrange(len(content)) :]
        fmu.write_bytes(content)
        failed += not check_fmu(fmu, STATIC).passed
    assert failed > 75
    assert sorted(tmp_path.rglob("*")) == [folder, fmu]
