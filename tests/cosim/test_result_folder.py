"""A result takes the place of an earlier result, and of nothing else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cosimulation.demo import run_demo
from cosimulation.result_folder import result_folder
from cosimulation.study import run_study
from fmu_builder.errors import OutputError

KIND = "kind of result 1"


def write(path: Path, text: str, kind: str = KIND) -> None:
    with result_folder(path, kind) as folder:
        (folder / "part").mkdir()
        (folder / "part" / "result.txt").write_text(text, encoding="utf-8")


def files(path: Path) -> list[str]:
    return sorted(item.relative_to(path).as_posix() for item in path.rglob("*") if item.is_file())


def test_an_earlier_result_is_replaced_as_a_whole(tmp_path: Path) -> None:
    path = tmp_path / "runs" / "one"
    write(path, "first")
    (path / "part" / "result.txt").unlink()
    (path / "empty").mkdir()
    write(path, "second")
    assert files(path) == ["files.txt", "part/result.txt"] and not (path / "empty").exists()
    assert (path / "part" / "result.txt").read_text(encoding="utf-8") == "second"
    assert (path / "files.txt").read_text(encoding="utf-8") == f"{KIND}\npart/result.txt\n"


@pytest.mark.parametrize("name", ["notes.txt", "part/notes.txt"])
def test_what_a_user_put_into_an_earlier_result_stays(tmp_path: Path, name: str) -> None:
    path = tmp_path / "one"
    write(path, "first")
    (path / name).write_text("mine", encoding="utf-8")
    with pytest.raises(OutputError, match=f"no earlier run wrote \\({name}\\)"):
        write(path, "second")
    assert (path / name).read_text(encoding="utf-8") == "mine"
    assert (path / "part" / "result.txt").read_text(encoding="utf-8") == "first"


def test_a_result_of_another_kind_stays(tmp_path: Path) -> None:
    write(tmp_path / "one", "first")
    with pytest.raises(OutputError, match="no earlier run wrote"):
        write(tmp_path / "one", "second", "another kind 1")
    assert (tmp_path / "one" / "part" / "result.txt").read_text(encoding="utf-8") == "first"


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "new").mkdir()
    write(tmp_path / "new", "first")
    assert (tmp_path / "new" / "part" / "result.txt").is_file()


def test_somebody_elses_files_stay(tmp_path: Path) -> None:
    precious = tmp_path / "mine" / "thesis.txt"
    precious.parent.mkdir()
    precious.write_text("years of work", encoding="utf-8")
    with pytest.raises(OutputError, match="no earlier run wrote"):
        write(tmp_path / "mine", "first")
    assert precious.read_text(encoding="utf-8") == "years of work"
    assert [item.name for item in tmp_path.rglob("*")] == ["mine", "thesis.txt"]


@pytest.mark.parametrize("text", ["", "{}", "thesis.txt\n", "\xff"])
def test_a_file_of_that_name_but_of_another_origin_is_no_listing(tmp_path: Path, text: str) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "files.txt").write_text(text, encoding="latin-1")
    with pytest.raises(OutputError, match="no earlier run wrote"):
        write(mine, "first")
    assert files(mine) == ["files.txt"]


@pytest.mark.parametrize("start", [run_demo, lambda path: run_study("order", path)])
def test_neither_demo_nor_study_replaces_somebody_elses_scores(tmp_path: Path, start: Any) -> None:
    mine = tmp_path / "mine"
    mine.mkdir()
    (mine / "scores.json").write_text("[]", encoding="utf-8")
    with pytest.raises(OutputError, match="no earlier run wrote"):
        start(mine)
    assert files(tmp_path) == ["mine/scores.json"]


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
