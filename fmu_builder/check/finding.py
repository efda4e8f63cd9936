"""What a check says about an FMU."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict, dataclass
from enum import StrEnum

from fmu_builder.errors import printable


class Severity(StrEnum):
    """An error breaks the standard or a simulation, a warning troubles some importers, a note informs."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"


_RANK = {severity: rank for rank, severity in enumerate(Severity)}


def standard(section: str) -> str:
    """Return how a section of the standard is cited."""
    return f"FMI 2.0.4, {section}"


def practice(whose: str) -> str:
    """Return how a rule is cited that stands not in the standard but in the habits of importers."""
    return f"not in FMI 2.0.4: {whose}"


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong with an FMU, or that keeps it out of some tool.

    Attributes:
        severity: How bad it is.
        rule: Short fixed name of the rule, for machines.
        place: Where: a file in the archive with its line, a variable, a binary, a call.
        what: What is wrong there.
        paragraph: Where the rule stands.
        mend: What to do about it.
    """

    severity: Severity
    rule: str
    place: str
    what: str
    paragraph: str
    mend: str

    def __str__(self) -> str:
        return printable(f"{self.severity}: {self.place}: {self.what} ({self.paragraph}). {self.mend}.")


@dataclass(frozen=True)
class Report:
    """All findings on one FMU, the worst first.

    Attributes:
        fmu: File name of the FMU.
        findings: What was found.
        checked: What was looked at, in words; a part that could not be run is not among them.
    """

    fmu: str
    findings: tuple[Finding, ...]
    checked: tuple[str, ...]

    @classmethod
    def of(cls, fmu: str, findings: list[Finding], checked: list[str]) -> Report:
        """Return the report of these findings, each once and the worst first."""
        once = dict.fromkeys(findings)
        return cls(fmu, tuple(sorted(once, key=lambda item: _RANK[item.severity])), tuple(checked))

    @property
    def passed(self) -> bool:
        """Whether there is no error; warnings and notes may be there."""
        return all(finding.severity is not Severity.ERROR for finding in self.findings)

    def counts(self) -> dict[str, int]:
        """Return the number of findings by severity."""
        found = Counter(finding.severity for finding in self.findings)
        return {severity.value: found[severity] for severity in Severity}

    def summary(self) -> dict[str, object]:
        """Return the report as JSON types."""
        return {
            "fmu": self.fmu,
            "passed": self.passed,
            "counts": self.counts(),
            "checked": list(self.checked),
            "findings": [asdict(finding) for finding in self.findings],
        }

    def text(self) -> str:
        """Return the report for a person: one line per finding and a line of counts."""
        numbers = ", ".join(f"{count} {name}{'s' * (count != 1)}" for name, count in self.counts().items())
        lines = [str(finding) for finding in self.findings]
        what = ", ".join(self.checked) or "nothing"
        return "\n".join([*lines, f"{printable(self.fmu)}: {numbers}; checked: {what}"])
