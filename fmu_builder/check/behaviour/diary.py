"""What an experiment writes down while it runs, line by line, so that a crash leaves all that came before."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from fmu_builder.check.finding import Finding, Severity


class Diary:
    """The file of one experiment.

    Args:
        path: Where to write.
        skipped: Calls that ended an earlier attempt and are left out now.
    """

    def __init__(self, path: Path, skipped: tuple[str, ...] = ()) -> None:
        self._file = path.open("a", encoding="utf-8")
        self._skipped = skipped

    def _write(self, **content: Any) -> None:
        self._file.write(json.dumps(content) + "\n")
        self._file.flush()

    def doing(self, what: str, paragraph: str, severity: Severity = Severity.ERROR) -> bool:
        """Note what comes next, and whose rule a crash there breaks; false when it is to be left out."""
        if what in self._skipped:
            return False
        self._write(doing=what, paragraph=paragraph, severity=severity)
        return True

    def find(self, severity: Severity, rule: str, place: str, what: str, paragraph: str, mend: str) -> None:
        """Write a finding down."""
        self._write(finding=asdict(Finding(severity, rule, place, what, paragraph, mend)))

    def know(self, **facts: Any) -> None:
        """Hand facts over to the experiments that follow."""
        self._write(facts=facts)

    def done(self) -> None:
        """Write down that the experiment came to its end."""
        self._write(done=True)


def read_diary(path: Path) -> list[dict[str, Any]]:
    """Return the entries of a diary; a line that a crash has cut is left out."""
    entries = []
    for line in path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else ():
        try:
            entries.append(json.loads(line))
        except ValueError:
            continue
    return entries
