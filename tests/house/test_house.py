"""Rules of the house that a machine can check."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
TOP_LEVEL = {
    "pyproject.toml", "fmu_builder", "identification", "fmus", "tests", "README.md", "cosimulation", "docs",
    "Makefile", "LICENSE", "CHANGELOG.md", "DECISIONS.md", ".ci", "requirements.txt", ".gitignore",
}  # fmt: skip
LONGEST_FILE = 400
SOURCES = sorted(
    path
    for room in ("fmu_builder", "identification", "fmus", "cosimulation", "tests")
    for path in (ROOT / room).rglob("*")
    if path.suffix in {".py", ".c", ".h"}
)


def tracked_files() -> list[Path]:
    """Files that git knows, or would take."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listing = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / line for line in listing.stdout.splitlines() if (ROOT / line).is_file()]


def test_the_top_level_holds_what_the_architecture_names() -> None:
    assert {path.relative_to(ROOT).parts[0] for path in tracked_files()} <= TOP_LEVEL


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_a_file_fits_the_head(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= LONGEST_FILE


def test_test_files_have_different_names() -> None:
    names = [path.name for path in (ROOT / "tests").rglob("test_*.py")]
    assert sorted(names) == sorted(set(names))


def test_no_file_names_this_machine_or_a_registry() -> None:
    forbidden = re.compile(r"/work/|/root/|/home/\w|files\.pythonhosted|pypi\.org|registry\.npmjs|/opt/pypi")
    found = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in tracked_files()
        if path.suffix in {".py", ".c", ".h", ".md", ".toml", ".txt", ".json", ".html", ".jinja", ".cfg", ""}
        and path != Path(__file__)
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if forbidden.search(line)
    ]
    assert found == []


@pytest.mark.parametrize("command", [["ruff", "check", "."], ["ruff", "format", "--check", "."], ["mypy"]])
def test_linter_formatter_and_type_checker_are_silent(command: list[str]) -> None:
    result = subprocess.run([sys.executable, "-m", *command], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
