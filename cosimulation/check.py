"""`llmn check`: FMUs judged one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from cosimulation.progress import SILENT, Reporter
from fmu_builder.check import Options, Report, check_fmu, check_image


@dataclass(frozen=True)
class CheckResult:
    """The reports on one FMU or several."""

    reports: tuple[Report, ...]

    @property
    def passed(self) -> bool:
        """Whether no FMU has an error."""
        return all(report.passed for report in self.reports)

    def summary(self) -> dict[str, object]:
        """Return the result as JSON types."""
        return {"passed": self.passed, "reports": [report.summary() for report in self.reports]}

    def text(self) -> str:
        """Return the result for a person."""
        return "\n".join(report.text() for report in self.reports)


def check_files(
    files: Sequence[Path], static: bool = False, time_limit: float = 60.0, reporter: Reporter = SILENT
) -> CheckResult:
    """Check FMUs one by one; of several, the sources are also linked into one image.

    Args:
        files: The FMUs.
        static: Look at the files only.
        time_limit: Of each experiment with a binary [s].
        reporter: Where progress goes.
    """
    options = Options(behaviour=not static, sources=not static, time_limit=time_limit)
    reports = []
    for file in files:
        reporter.say(f"checking {file}")
        reports.append(check_fmu(file, options))
    if len(files) > 1 and not static:
        image = check_image(files, time_limit)
        reports.extend([image] if image.checked else [])
    return CheckResult(tuple(reports))
