"""Everything that is checked about one FMU, in order."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fmu_builder.check.archive import inspect_archive, unpack
from fmu_builder.check.behaviour.runner import behaviour_findings
from fmu_builder.check.description import Description, read_description
from fmu_builder.check.finding import Finding, Report
from fmu_builder.check.libraries import library_findings
from fmu_builder.check.sources import source_findings
from fmu_builder.check.static import (
    header_findings,
    name_findings,
    second_opinion,
    structure_findings,
    unit_findings,
    variable_findings,
)


@dataclass(frozen=True)
class Options:
    """What to check beside the files themselves.

    Attributes:
        behaviour: Run the binary for this machine, each experiment in a process of its own.
        experiments: Names of the experiments with the binary, all when None; "load" and "run" always are.
        sources: Compile and link the sources.
        time_limit: Of one experiment [s].
    """

    behaviour: bool = True
    experiments: tuple[str, ...] | None = None
    sources: bool = True
    time_limit: float = 60.0


def check_fmu(path: Path, options: Options = Options()) -> Report:
    """Look at an FMU from all sides and return all findings at once.

    Nothing of the FMU runs in this process, and nothing is written but to temporary folders.

    Args:
        path: An FMU, anybody's.
        options: What to leave out.
    """
    findings = inspect_archive(path)
    checked = ["archive"]
    if any(finding.rule in ("archive", "archive-bomb") for finding in findings):
        return Report.of(path.name, findings, checked)
    with tempfile.TemporaryDirectory(prefix="llmn-check-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        findings.extend(unpack(path, folder))
        findings.extend(_unpacked_findings(folder, options, checked))
    return Report.of(path.name, findings, checked)


def _behaviour(
    description: Description, folder: Path, options: Options, checked: list[str]
) -> Iterator[Finding]:
    return behaviour_findings(description, folder, options.time_limit, checked, options.experiments)


def _unpacked_findings(folder: Path, options: Options, checked: list[str]) -> list[Finding]:
    description, findings = read_description(folder)
    if description is None:
        return findings
    findings.extend(header_findings(description, folder))
    findings.extend(unit_findings(description))
    findings.extend(variable_findings(description))
    findings.extend(structure_findings(description))
    findings.extend(name_findings(description))
    findings.extend(second_opinion(folder, findings))
    checked.append("description")
    findings.extend(library_findings(description, folder))
    checked.append("binaries")
    if options.sources and any(description.sources.values()):
        findings.extend(source_findings(description, folder, options.time_limit))
        checked.append("sources")
    if options.behaviour:
        findings.extend(_behaviour(description, folder, options, checked))
    return findings
