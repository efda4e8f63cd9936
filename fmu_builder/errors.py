"""Errors a user can act on: every one names the place, what is wrong there and how to mend it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self


def printable(text: str) -> str:
    """Return a text that a terminal shows and does not obey, whoever wrote it."""
    return "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in text)


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong.

    Attributes:
        place: Where, in the user's words (a file, a key, a variable, a row).
        what: What is wrong there.
        mend: What to do about it.
    """

    place: str
    what: str
    mend: str

    def __str__(self) -> str:
        lines = f"{self.place}: {self.what}. {self.mend}.".split("\n")
        return "\n".join(map(printable, lines))


class LlmnError(Exception):
    """Base of every error that is meant for a user; carries all problems found at once.

    Args:
        problems: One problem or several; never empty.
    """

    def __init__(self, problems: Problem | Iterable[Problem]) -> None:
        found = (problems,) if isinstance(problems, Problem) else tuple(problems)
        if not found:
            raise ValueError("an LlmnError needs at least one problem")
        self.problems: tuple[Problem, ...] = found
        super().__init__("\n".join(str(problem) for problem in found))

    def __reduce__(self) -> tuple[type[Self], tuple[tuple[Problem, ...]]]:
        """Let an error pass from a worker process to the one that reports it."""
        return type(self), (self.problems,)

    @classmethod
    def of(cls, place: str, what: str, mend: str) -> Self:
        """Return the error for a single problem."""
        return cls(Problem(place, what, mend))


class SettingsError(LlmnError, ValueError):
    """A settings file or a command-line value cannot be used."""


class DataError(LlmnError, ValueError):
    """A data set cannot be read, or cannot serve the purpose."""


class ParameterSetError(LlmnError, ValueError):
    """A parameter set is not a valid LLMN parameter set."""


class CertificateError(LlmnError, ValueError):
    """A certificate of stability does not prove what it claims, or none can be had."""


class IdentificationError(LlmnError, ArithmeticError):
    """No model can be identified from the data as asked."""


class FmuError(LlmnError, RuntimeError):
    """An FMU cannot be opened, does not fit, or reported an error while it ran."""


class BuildError(LlmnError, RuntimeError):
    """An FMU or a compiled recursion could not be built."""


class OutputError(LlmnError, OSError):
    """A result cannot be written."""


class SweepError(LlmnError, RuntimeError):
    """A sweep cannot go on; what it has recorded stays."""
