"""Runs every experiment in a process of its own and turns what happens to it into findings."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from fmu_builder.check.behaviour.diary import read_diary
from fmu_builder.check.behaviour.plan import DEFAULT_STEP, Plan, PlannedVariable
from fmu_builder.check.description import Description, ScalarVariable, integer, number
from fmu_builder.check.finding import Finding, Severity, practice, standard
from fmu_builder.compiler import TARGETS, host_platform
from fmu_builder.errors import BuildError

_NEEDED = ("load", "run")
_STARTING = ("load", "wrong GUID", "run")
_STEPPING = (
    "first output", "set and get", "derivatives", "state", "state in another process", "communication steps",
    "an hour",
)  # fmt: skip
_ANY = ("reset", "two instances", "illegal calls")
_EXCHANGE = "model exchange"
_MOST_ATTEMPTS = 25
_MOST_OUTPUT = 1 << 16
_BUDGET_SHARE = 0.5
_NAMES_OF_HOST = {"linux64": "x86_64-linux", "win64": "x86_64-windows", "darwin64": "x86_64-darwin"}


def library_for_host(description: Description, folder: Path, identifier: str) -> Path | None:
    """Return the binary that this machine can load, or None."""
    try:
        platform = host_platform()
    except BuildError:
        return None
    folders = (platform, _NAMES_OF_HOST.get(platform, platform))
    candidates = (folder / "binaries" / name / (identifier + TARGETS[platform].suffix) for name in folders)
    return next((path for path in candidates if path.is_file()), None)


def _planned(description: Description, variable: ScalarVariable) -> PlannedVariable:
    attributes = description.with_type(variable)
    start, low, high = (number(attributes.get(name)) for name in ("start", "min", "max"))
    nominal = number(attributes.get("nominal"))
    size = nominal if nominal is not None and nominal > 0.0 else abs(start or 0.0) or 1.0
    state = description.at(variable.state)
    entries = (*description.structure["Outputs"], *description.structure["Derivatives"])
    listed = [u.dependencies for u in entries if u.index == variable.position]
    named: set[str] | None = None
    if listed and None not in listed:
        positions = (position for dependencies in listed for position in dependencies or ())
        named = {v.name for v in map(description.at, positions) if v is not None}
    return PlannedVariable(
        name=variable.name,
        reference=variable.value_reference or 0,
        position=variable.position,
        type=variable.type,
        causality=variable.causality,
        variability=variable.variability,
        start=start if variable.type == "Real" else None,
        minimum=low,
        maximum=high,
        size=size,
        depends_on=None if named is None else tuple(sorted(named)),
        derivative_of=None if state is None else state.position,
    )


def _plan(description: Description, folder: Path, kind: str, library: Path, time_limit: float) -> Plan:
    attributes = description.interfaces[kind]
    derivatives = [description.at(unknown.index) for unknown in description.structure["Derivatives"]]
    usable = (variable for variable in description.variables if variable.value_reference is not None)
    return Plan(
        library=str(library),
        guid=description.attributes.get("guid", ""),
        resources=(folder / "resources").resolve().as_uri(),
        kind=int(kind == "CoSimulation"),
        step=description.default_step() or DEFAULT_STEP,
        variables=tuple(_planned(description, variable) for variable in usable),
        derivatives=tuple(v.position for v in derivatives if v is not None and "derivative" in v.own),
        indicators=max(integer(description.attributes.get("numberOfEventIndicators")) or 0, 0),
        abilities=tuple(name for name, value in attributes.items() if value in ("true", "1")),
        budget=_BUDGET_SHARE * time_limit,
        found={},
    )


@dataclass
class _Outcome:
    """How one process ended."""

    entries: list[dict[str, Any]]
    status: int
    timed_out: bool
    printed: str

    @property
    def finished(self) -> bool:
        return any("done" in entry for entry in self.entries)

    @property
    def last(self) -> dict[str, Any]:
        return next((entry for entry in reversed(self.entries) if "doing" in entry), {})


class _Listener(threading.Thread):
    """Empties what the process prints, keeping the beginning only."""

    def __init__(self, stream: Any) -> None:
        super().__init__(daemon=True)
        self.kept = b""
        self._stream = stream

    def run(self) -> None:
        while piece := self._stream.read1(_MOST_OUTPUT):
            self.kept += piece[: _MOST_OUTPUT - len(self.kept)]


def _end(process: subprocess.Popen[bytes]) -> None:
    """End a process and what it has started."""
    if sys.platform == "win32":
        process.kill()
    else:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            process.kill()
    process.wait()


def _attempt(plan: Plan, name: str, skipped: tuple[str, ...], time_limit: float) -> _Outcome:
    with tempfile.TemporaryDirectory(prefix="llmn-experiment-", ignore_cleanup_errors=True) as folder:
        plan_path, diary = Path(folder) / "plan.json", Path(folder) / "diary.jsonl"
        plan_path.write_text(plan.to_json(), encoding="utf-8")
        command = [sys.executable, "-m", "fmu_builder.check.behaviour.worker"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        process = subprocess.Popen(
            [*command, str(plan_path), name, str(diary), *skipped],
            cwd=folder,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        listener = _Listener(process.stdout)
        listener.start()
        timed_out = False
        try:
            process.wait(time_limit)
        except subprocess.TimeoutExpired:
            timed_out = True
        finally:
            _end(process)
        listener.join(2.0)
        printed = listener.kept.decode("utf-8", errors="replace").strip()
        return _Outcome(read_diary(diary), process.returncode, timed_out, printed)


def _end_finding(name: str, outcome: _Outcome, time_limit: float) -> Finding:
    """Say how a process ended that did not come to its end."""
    place = str(outcome.last.get("doing", name))
    paragraph = str(outcome.last.get("paragraph", standard("2.1")))
    severity = Severity(outcome.last.get("severity", Severity.ERROR))
    if outcome.timed_out:
        what, mend = (
            f"does not return within {time_limit:g} s",
            "Bound every loop; --time-limit gives more time",
        )
        return Finding(Severity.ERROR, "hang", place, what, paragraph, mend)
    if outcome.status < 0:
        try:
            how = f"crashes with {signal.Signals(-outcome.status).name}"
        except ValueError:
            how = f"crashes with signal {-outcome.status}"
    elif "Traceback" in outcome.printed:
        last = outcome.printed.splitlines()[-1][:300]
        mend = "Mend what the other findings name first"
        return Finding(Severity.ERROR, "experiment", place, f"could not be finished: {last}", paragraph, mend)
    else:
        how = f"ends the process with status {outcome.status}"
    mend = "Check arguments and return an error: a crash takes the importer down with it"
    return Finding(severity, "crash", place, how, paragraph, mend)


def _experiment(plan: Plan, name: str, time_limit: float) -> tuple[list[Finding], dict[str, Any], bool]:
    """Run an experiment, again without the call that ended it; return findings, facts, whether it printed."""
    findings: list[Finding] = []
    facts: dict[str, Any] = {}
    skipped: tuple[str, ...] = ()
    printed = False
    for _ in range(_MOST_ATTEMPTS):
        outcome = _attempt(plan, name, skipped, time_limit)
        for entry in outcome.entries:
            if "finding" in entry:
                given = entry["finding"]
                findings.append(Finding(**{**given, "severity": Severity(given["severity"])}))
            facts.update(entry.get("facts", {}))
        if outcome.finished:
            return findings, facts, printed or bool(outcome.printed)
        findings.append(_end_finding(name, outcome, time_limit))
        call = outcome.last.get("doing")
        if name != "illegal calls" or call is None or call in skipped or outcome.timed_out:
            break  # elsewhere the calls build on each other
        skipped = (*skipped, call)
    return findings, facts, printed


def _in_order(plan: Plan, chosen: tuple[str, ...] | None) -> Iterator[str]:
    for name in (*_STARTING, *(_STEPPING if plan.can_step else ()), *_ANY):
        if chosen is None or name in chosen or name in _NEEDED:
            yield name


def _exchange(
    description: Description, folder: Path, time_limit: float, checked: list[str]
) -> tuple[list[Finding], bool]:
    """Run the experiment on model exchange, which may have a library of its own."""
    identifier = description.identifier("ModelExchange")
    library = library_for_host(description, folder, identifier)
    if library is None:
        return [], False
    plan = _plan(description, folder, "ModelExchange", library, time_limit)
    findings, _, printed = _experiment(plan, _EXCHANGE, time_limit)
    checked.append(_EXCHANGE)
    return findings, printed


def behaviour_findings(
    description: Description,
    folder: Path,
    time_limit: float,
    checked: list[str],
    chosen: tuple[str, ...] | None = None,
) -> Iterator[Finding]:
    """Yield what the binary for this machine does wrong.

    Args:
        description: The description.
        folder: Where the FMU is unpacked.
        time_limit: Of one experiment [s].
        checked: Takes the names of the experiments that were done.
        chosen: Names of the experiments to do, all when None; the others need "load" and "run".
    """
    kind = next((name for name in ("CoSimulation", "ModelExchange") if name in description.interfaces), None)
    identifier = "" if kind is None else description.identifier(kind)
    library = library_for_host(description, folder, identifier)
    if kind is None or library is None:
        what = "holds no binary for this machine, so that its behaviour was not looked at"
        mend = "Check it on a machine it has a binary for, or add one for this platform"
        yield Finding(Severity.NOTE, "not-run", "archive", what, standard("2.3"), mend)
        return
    plan = _plan(description, folder, kind, library, time_limit)
    loud = False
    for name in _in_order(plan, chosen):
        findings, facts, printed = _experiment(plan, name, time_limit)
        yield from findings
        checked.append(name)
        loud |= printed
        plan = replace(plan, found={**plan.found, **facts})
        if (name == "load" and not facts.get("loaded")) or (name == "run" and not facts.get("runs")):
            break
    if "ModelExchange" in description.interfaces and (chosen is None or _EXCHANGE in chosen):
        findings, printed = _exchange(description, folder, time_limit, checked)
        yield from findings
        loud |= printed
    if loud:
        what, mend = "prints on stdout or stderr", "Speak through the logger only"
        yield Finding(Severity.NOTE, "prints", "binary for this machine", what, practice("importers"), mend)
