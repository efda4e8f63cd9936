"""What fmpy's validator says and the checks here have not said already."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

from fmu_builder.check.archive import DESCRIPTION
from fmu_builder.check.finding import Finding, Severity, standard

_LINE = re.compile(r"\bline (\d+)\b")
_QUOTED = re.compile(r'"([^"]+)"')


def _places(findings: list[Finding]) -> tuple[set[str], str]:
    """Return the lines that have a finding, and all their words."""
    text = "\n".join(f"{finding.place} {finding.what}" for finding in findings)
    return set(_LINE.findall(text)), text


def _is_said(problem: str, findings: list[Finding]) -> bool:
    """Whether a problem speaks of a line, a variable or a list that already has a finding."""
    lines, words = _places(findings)
    if set(_LINE.findall(problem)) & lines:
        return True
    lists = ("Outputs", "InitialUnknowns", "Derivatives")
    quoted = [text for text in _QUOTED.findall(problem) if text not in ("output", "derivative")]
    subjects = [*quoted, *(name for name in lists if name in problem)]
    if not subjects and not _LINE.search(problem):  # fmpy's own exception over a broken description
        return bool(findings)
    return any(subject in words for subject in subjects)


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
    mend = "Mend the description; this is the validator's own message"
    return [
        Finding(Severity.ERROR, "fmpy", DESCRIPTION, f"fmpy says: {problem}", standard("2.2"), mend)
        for problem in _complaints(folder)
        if not _is_said(problem, errors)
    ]
