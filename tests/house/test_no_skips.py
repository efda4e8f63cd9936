"""A skipped test is a failure in CI, and only there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

TESTS = """
import pytest

@pytest.mark.skipif(True, reason="no such machine")
def test_marked(): pass

def test_decides_itself(): pytest.skip("no such program")

@pytest.mark.xfail(strict=True)
def test_known(): assert False

def test_right(): pass
"""


@pytest.mark.parametrize(("ci", "code"), [("true", 1), ("", 0)])
def test_a_skip_fails_in_ci_only(ci: str, code: int, tmp_path: Path) -> None:
    (tmp_path / "test_some.py").write_text(TESTS, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-rfs", "-p", "no_skips", "-p", "no:cacheprovider", "."]
    environment = {**os.environ, "CI": ci, "PYTHONPATH": str(Path(__file__).parents[1])}
    run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120)
    assert run.returncode == code, run.stdout
    expected = "1 failed, 1 passed, 1 xfailed, 1 error" if ci else "1 passed, 2 skipped, 1 xfailed"
    assert expected in run.stdout, run.stdout  # skipped while it is set up: an error
    assert "no such machine" in run.stdout and "no such program" in run.stdout
