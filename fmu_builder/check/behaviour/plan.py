"""What the process that runs an FMU has to know about it: plain data, handed over as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

DEFAULT_STEP = 0.001
_NUDGE = 0.05


@dataclass(frozen=True)
class PlannedVariable:
    """A variable of the FMU.

    Attributes:
        reference: Its value reference.
        position: Its 1-based place in the description.
        size: How large it typically is.
        depends_on: Names of what acts on it at once; None: not known.
        derivative_of: Position of the state whose derivative it is.
    """

    name: str
    reference: int
    position: int
    type: str
    causality: str
    variability: str
    start: float | None
    minimum: float | None
    maximum: float | None
    size: float
    depends_on: tuple[str, ...] | None
    derivative_of: int | None

    def moved(self, scale: float) -> float:
        """Return a value a little away from the start, inside the limits; `scale` 0 is the start itself."""
        start = self.start or 0.0
        low, high = self.minimum, self.maximum
        bounded = low is not None and high is not None and math.isfinite(high - low) and high > low
        span = high - low if bounded and low is not None and high is not None else self.size
        step = scale * span
        return start - step if high is not None and start + step > high else start + step


@dataclass(frozen=True)
class Plan:
    """An FMU for the experiments.

    Attributes:
        library: Path of the binary for this machine.
        guid: What the description says.
        resources: URI of the resources folder.
        kind: 1 for co-simulation, 0 for model exchange.
        step: Communication step to work with [s].
        variables: All variables.
        derivatives: Positions of the state derivatives, in the order of ModelStructure.
        indicators: Number of event indicators.
        abilities: Capability flags of the description that are true.
        budget: How long an experiment may keep calculating [s].
        found: What earlier experiments have found out.
    """

    library: str
    guid: str
    resources: str
    kind: int
    step: float
    variables: tuple[PlannedVariable, ...]
    derivatives: tuple[int, ...]
    indicators: int
    abilities: tuple[str, ...]
    budget: float
    found: dict[str, Any]

    @property
    def can_step(self) -> bool:
        """Whether it is for co-simulation."""
        return self.kind == 1

    @property
    def inputs(self) -> list[PlannedVariable]:
        """The Real inputs."""
        return [v for v in self.variables if v.causality == "input" and v.type == "Real"]

    @property
    def outputs(self) -> list[PlannedVariable]:
        """The Real outputs, or all Real variables that are not set from outside when there are none."""
        real = [v for v in self.variables if v.type == "Real"]
        outputs = [v for v in real if v.causality == "output"]
        return outputs or [v for v in real if v.causality == "local" and v.variability == "continuous"]

    @property
    def derivative_variables(self) -> list[PlannedVariable]:
        """The state derivatives, in the order of the states."""
        by_position = {variable.position: variable for variable in self.variables}
        return [by_position[position] for position in self.derivatives]

    @property
    def states(self) -> list[PlannedVariable]:
        """The continuous states."""
        by_position = {variable.position: variable for variable in self.variables}
        return [
            by_position[v.derivative_of] for v in self.derivative_variables if v.derivative_of is not None
        ]

    def moved(self, share: float = 1.0) -> list[float]:
        """Return a value per input, away from its start as far as the FMU has been found to bear."""
        scale = float(self.found.get("scale", _NUDGE)) * share
        return [variable.moved(scale) for variable in self.inputs]

    def to_json(self) -> str:
        """Return the plan as text."""
        return json.dumps(dataclasses.asdict(self))

    @classmethod
    def from_json(cls, path: Path) -> Plan:
        """Read a plan."""
        content = json.loads(path.read_text(encoding="utf-8"))
        variables = tuple(
            PlannedVariable(**{**item, "depends_on": _names(item["depends_on"])})
            for item in content["variables"]
        )
        lists = {name: tuple(content[name]) for name in ("derivatives", "abilities")}
        return cls(**{**content, **lists, "variables": variables})


def _names(value: list[str] | None) -> tuple[str, ...] | None:
    return None if value is None else tuple(value)
