"""An archive is looked at before anything in it is unpacked or run."""

from __future__ import annotations

import shutil
import stat
import tempfile
import zipfile
from pathlib import Path

import pytest

from cosim.whole_path import WholePath
from cosimulation import fmu_file
from cosimulation.fmu_file import open_fmu
from fmu_builder.errors import FmuError


def archive(path: Path, entries: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as target:
        for name, content in entries.items():
            target.writestr(name, content)
    return path


def message(path: Path) -> str:
    with pytest.raises(FmuError) as caught, open_fmu(path):
        pass
    return str(caught.value)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    assert "there is no such FMU file" in message(tmp_path / "nothing.fmu")


def test_a_file_that_is_no_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "text.fmu"
    path.write_bytes(b"this is not a zip file")
    assert "not a readable FMU archive" in message(path)


@pytest.mark.parametrize(
    "name", ["../outside.txt", "binaries/../../outside.txt", "/outside.txt", "a\\b", "C:/x"]
)
def test_a_path_that_leads_out_is_refused_and_nothing_is_written(tmp_path: Path, name: str) -> None:
    path = archive(tmp_path / "evil.fmu", {"modelDescription.xml": b"<x/>", name: b"gotcha"})
    assert repr(name) in message(path)
    assert [item.name for item in tmp_path.iterdir()] == ["evil.fmu"]


def test_a_symbolic_link_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "link.fmu"
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("modelDescription.xml", b"<x/>")
        entry = zipfile.ZipInfo("resources/link")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        target.writestr(entry, "/etc/passwd")
    assert "symbolic link" in message(path)


def test_all_problems_are_told_at_once(tmp_path: Path) -> None:
    path = archive(tmp_path / "evil.fmu", {"../a": b"", "/b": b""})
    with pytest.raises(FmuError) as caught, open_fmu(path):
        pass
    assert len(caught.value.problems) == 3  # two paths, and no modelDescription.xml


def test_a_damaged_description_is_refused(tmp_path: Path) -> None:
    path = archive(tmp_path / "broken.fmu", {"modelDescription.xml": b"<fmiModelDescription fmiVer"})
    assert "modelDescription.xml cannot be used" in message(path)


def test_a_flipped_byte_is_found(tmp_path: Path) -> None:
    path = archive(tmp_path / "flipped.fmu", {"modelDescription.xml": b"<fmiModelDescription/>" * 50})
    content = bytearray(path.read_bytes())
    content[200] ^= 0xFF
    path.write_bytes(bytes(content))
    assert "damaged" in message(path) or "not a readable" in message(path)


def test_a_damaged_compressed_entry_is_found(tmp_path: Path) -> None:
    path = tmp_path / "flipped.fmu"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        target.writestr("modelDescription.xml", b"".join(b"<a%d/>" % number for number in range(300)))
    content = bytearray(path.read_bytes())
    for offset in range(60, 90):
        content[offset] = 0xFF
    path.write_bytes(bytes(content))
    assert str(path) in message(path)


def test_control_c_while_it_is_deleted_leaves_no_folder(
    blow: WholePath, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with (
        monkeypatch.context() as patched,
        pytest.raises(KeyboardInterrupt),
        open_fmu(blow.white_box) as fmu,
    ):
        patched.setattr(shutil, "rmtree", interrupted)
    assert fmu.folder.exists()
    fmu_file._delete_unpacked()  # what the end of the program does
    assert list(tmp_path.iterdir()) == []
