"""Errors keep their problems wherever they go."""

from __future__ import annotations

import pickle

import pytest

from fmu_builder.errors import DataError, LlmnError, Problem


def test_an_error_survives_the_way_between_processes() -> None:
    error = DataError([Problem("file", "is empty", "Fill it"), Problem("row 3", "is NaN", "Cut it")])
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is DataError
    assert again.problems == error.problems
    assert str(again) == str(error) == "file: is empty. Fill it.\nrow 3: is NaN. Cut it."


def test_what_a_file_says_cannot_steer_a_terminal() -> None:
    problem = Problem("variable '\x1b[2J'", "is\tright to left: \u202e,\nin two lines", "Rename \ud800 it")
    shown = r"variable '\x1b[2J': is\tright to left: \u202e," + "\n" + r"in two lines. Rename \ud800 it."
    assert str(problem) == str(LlmnError(problem)) == shown


def test_an_error_without_a_problem_is_a_mistake_of_ours() -> None:
    with pytest.raises(ValueError, match="at least one problem"):
        LlmnError([])
