"""A result takes the place of an earlier result, and of nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosimulation.result_folder import result_folder
from fmu_builder.errors import OutputError


def write(path: Path, text: str) -> None:
    with result_folder(path, "mark.json") as folder:
        (folder / "mark.json").write_text(text, encoding="utf-8")


def test_an_earlier_result_is_replaced_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "one"
    write(path, "first")
    (path / "left over").write_text("of the first run", encoding="utf-8")
    write(path, "second")
    assert [item.name for item in path.iterdir()] == ["mark.json"]
    assert (path / "mark.json").read_text(encoding="utf-8") == "second"


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    write(tmp_path / "new", "first")
    assert (tmp_path / "new" / "mark.json").is_file()


def test_somebody_elses_files_stay(tmp_path: Path) -> None:
    precious = tmp_path / "mine" / "thesis.txt"
    precious.parent.mkdir()
    precious.write_text("years of work", encoding="utf-8")
    with pytest.raises(OutputError, match="no earlier run wrote"):
        write(tmp_path / "mine", "first")
    assert precious.read_text(encoding="utf-8") == "years of work"
    assert [item.name for item in tmp_path.rglob("*")] == ["mine", "thesis.txt"]


def test_a_mark_of_that_name_but_of_another_origin_is_none(tmp_path: Path) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "mark.json").write_text("{}", encoding="utf-8")
    with pytest.raises(OutputError, match="no earlier run wrote"), result_folder(mine, "mark.json", "ours"):
        pass
    (mine / "mark.json").write_text('{"format": "ours"}', encoding="utf-8")
    with result_folder(mine, "mark.json", "ours") as folder:
        (folder / "mark.json").write_text("ours again", encoding="utf-8")
    assert (mine / "mark.json").read_text(encoding="utf-8") == "ours again"


def test_a_file_stays_a_file(tmp_path: Path) -> None:
    path = tmp_path / "notes"
    path.write_text("a file", encoding="utf-8")
    with pytest.raises(OutputError, match="is a file"):
        write(path, "first")
    assert path.read_text(encoding="utf-8") == "a file"


@pytest.mark.parametrize("name", [".", "..", "../here"])
def test_the_folder_a_user_stands_in_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    with pytest.raises(OutputError, match="working folder"):
        write(Path(name), "first")
    assert [item.name for item in tmp_path.rglob("*")] == ["here"]
