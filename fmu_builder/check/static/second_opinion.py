"""What fmpy's validator says and the checks here have not said already."""

from __future__ import annotations

import contextlib
import io
import re
from dataclasses import dataclass
from pathlib import Path

from fmu_builder.check.archive import DESCRIPTION
from fmu_builder.check.finding import Finding, Severity, standard

_LINE = re.compile(r"\bline (\d+)\b")
_LISTS = ("Outputs", "InitialUnknowns", "Derivatives")
_NAMES = re.compile(r"'([^']*)'|\"([^\"]*)\"")
_QUOTED = re.compile(r'"([^"]+)"')


@dataclass(frozen=True)
class _Said:
    """The lines and names that findings speak of."""

    lines: frozenset[str]
    names: frozenset[str]
    nothing: bool

    @classmethod
    def by(cls, findings: list[Finding]) -> _Said:
        texts = [f"{finding.place} {finding.what}" for finding in findings]
        lines = frozenset(line for text in texts for line in _LINE.findall(text))
        names = {name for text in texts for pair in _NAMES.findall(text) for name in pair if name}
        return cls(
            lines, frozenset(names | {name for name in _LISTS if any(name in t for t in texts)}), not texts
        )

    def covers(self, problem: str) -> bool:
        """Whether a problem speaks of a line, a variable or a list that already has a finding."""
        lines = set(_LINE.findall(problem))
        quoted = [text for text in _QUOTED.findall(problem) if text not in ("output", "derivative")]
        subjects = {*quoted, *(name for name in _LISTS if name in problem)}
        if not subjects and not lines:  # fmpy's own exception over a broken description
            return not self.nothing
        return bool(lines & self.lines or subjects & self.names)


def _complaints(folder: Path) -> list[str]:
    """Return what fmpy's validator says but on names, whose grammar takes it seconds (see names.py)."""
    from fmpy import read_model_description  # slow to import: only when an FMU is checked
    from fmpy.model_description import ValidationError

    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            read_model_description(str(folder), validate=True, validate_model_structure=True)
    except ValidationError as reason:
        return list(reason.problems)
    except Exception as reason:  # whatever a broken description makes it raise
        return [str(reason)]
    return []


def second_opinion(folder: Path, findings: list[Finding]) -> list[Finding]:
    """Return fmpy's complaints about a description that no finding covers.

    fmpy stops at the first kind of mistake, so that it rarely adds to a list that is not empty.

    Args:
        folder: Where the FMU is unpacked.
        findings: What has been found so far.
    """
    errors = [finding for finding in findings if finding.severity is Severity.ERROR]
    said = _Said.by(errors)
    mend = "Mend the description; this is the validator's own message"
    return [
        Finding(Severity.ERROR, "fmpy", DESCRIPTION, f"fmpy says: {problem}", standard("2.2"), mend)
        for problem in _complaints(folder)
        if not said.covers(problem)
    ]
