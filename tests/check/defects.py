"""Making a defective FMU from a right one: one planted change at a time."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path

from fmu_builder.check import Finding, Options, Report, check_fmu

STATIC = Options(behaviour=False, sources=False)


def entries_of(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        return {entry.filename: archive.read(entry) for entry in archive.infolist()}


def write(path: Path, entries: Iterable[tuple[str | zipfile.ZipInfo, bytes]]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for entry, content in entries:
            archive.writestr(entry, content)
    return path


def with_description(fmu: Path, target: Path, change: Callable[[str], str]) -> Path:
    """Copy an FMU with another modelDescription.xml; the change must change something."""
    entries = entries_of(fmu)
    text = entries["modelDescription.xml"].decode()
    changed = change(text)
    assert changed != text
    return write(target, {**entries, "modelDescription.xml": changed.encode()}.items())


def replaced(right: str, wrong: str, places: int = 1) -> Callable[[str], str]:
    """A change that replaces every one of the `places` where `right` stands."""

    def change(text: str) -> str:
        assert text.count(right) == places, f"{right!r} is there {text.count(right)} times"
        return text.replace(right, wrong)

    return change


def rules(report: Report) -> set[str]:
    return {finding.rule for finding in report.findings}


def finding(fmu: Path, rule: str, options: Options = STATIC) -> Finding:
    """Check an FMU and return its first finding of this rule."""
    report = check_fmu(fmu, options)
    found = [item for item in report.findings if item.rule == rule]
    assert found, f"{rule} is not among: {report.text()}"
    return found[0]
