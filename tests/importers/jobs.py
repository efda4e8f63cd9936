"""What an importer of others is asked to run, and what it must answer.

Every importer runs in a process of its own (`run_ecos.py`, `run_libcosim.py`): it is given a `Job` as JSON
and prints its rows, so that a crash in somebody's library is a failed test and not the end of all tests.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import fmpy
import numpy as np
from fmpy.fmi2 import FMU2Slave
from fmu_runner import QUIET

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Job:
    """Communication steps of equal length with FMUs by name; variables are called "fmu::variable".

    Attributes:
        fmus: Path of every FMU.
        outputs: What is read after every step.
        starts: Start values, of inputs, too.
        driven: Inputs that get a value before every step.
        rows: These values, [N][len(driven)].
        connections: (output, input): after every step the output's value goes to the input.
        step: Communication step [s].
    """

    fmus: Mapping[str, str]
    outputs: tuple[str, ...]
    starts: Mapping[str, float] = field(default_factory=dict)
    driven: tuple[str, ...] = ()
    rows: Sequence[Sequence[float]] = ()
    connections: tuple[tuple[str, str], ...] = ()
    step: float = 0.001

    def by_importer(self, script: str, *arguments: str) -> tuple[np.ndarray, str]:
        """Outputs after every step [N, len(outputs)] by an importer of others, and what else it printed."""
        command = [sys.executable, str(FOLDER / script), *arguments]
        run = subprocess.run(
            command, input=json.dumps(asdict(self)), capture_output=True, text=True, timeout=120
        )
        assert run.returncode == 0, run.stdout + run.stderr
        *printed, answer = run.stdout.splitlines()
        return np.array(json.loads(answer)), "\n".join(printed) + run.stderr

    def by_hand(self, reads_before_transfer: bool = False) -> np.ndarray:
        """The same, each FMU instance driven call by call through fmpy.

        An importer may read the outputs before it hands them on: F_p then goes with the eta before.
        """
        slaves, references = {}, {}
        for name, path in self.fmus.items():
            description = fmpy.read_model_description(path)
            references |= {f"{name}::{v.name}": v.valueReference for v in description.modelVariables}
            slaves[name] = FMU2Slave(
                guid=description.guid,
                unzipDirectory=fmpy.extract(path),
                modelIdentifier=description.coSimulation.modelIdentifier,
                instanceName=name,
            )
            slaves[name].instantiate(callbacks=QUIET)
            slaves[name].setupExperiment(startTime=0.0)
        self._set(slaves, references, self.starts)
        for slave in slaves.values():
            slave.enterInitializationMode()
        for _ in self.connections:
            self._transfer(slaves, references)
        for slave in slaves.values():
            slave.exitInitializationMode()
        found = []
        for number, row in enumerate(self.rows):
            self._set(slaves, references, dict(zip(self.driven, row, strict=True)))
            for slave in slaves.values():
                slave.doStep(number * self.step, self.step)
            if not reads_before_transfer:
                self._transfer(slaves, references)
            found.append([self._get(slaves, references, name) for name in self.outputs])
            self._transfer(slaves, references)
        for slave in slaves.values():
            slave.freeInstance()
        return np.array(found)

    def _transfer(self, slaves: Mapping, references: Mapping) -> None:
        for source, sink in self.connections:
            self._set(slaves, references, {sink: self._get(slaves, references, source)})

    @staticmethod
    def _set(slaves: Mapping, references: Mapping, values: Mapping[str, float]) -> None:
        for name, value in values.items():
            slave = slaves[name.split("::")[0]]
            (slave.setReal if isinstance(value, float) else slave.setInteger)([references[name]], [value])

    @staticmethod
    def _get(slaves: Mapping, references: Mapping, name: str) -> float:
        (value,) = slaves[name.split("::")[0]].getReal([references[name]])
        return value
