"""What the driver does with an FMU: fixed sequences of calls, the same on every platform."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import fmpy
import numpy as np

from platforms.machines import bits

STEPS = (1.0, 0.5, 0.25, 2.0, 5.0, 10.0, 0.7, 1000.0 / 60.0)
"""Communication step sizes [ms]."""

DURATION = 0.12  # s
MODEL_EXCHANGE, CO_SIMULATION = 0, 1
CLAMP = 2  # of out_of_range


@dataclass
class Fmu:
    """An FMU on disk and what the scenarios need to know of it."""

    path: Path
    sample_time: float  # s
    changed: tuple[tuple[str, float], ...] = ()  # parameters and other values for them

    def __post_init__(self) -> None:
        description = fmpy.read_model_description(str(self.path))
        self.guid: str = description.guid
        self.identifier: str = description.coSimulation.modelIdentifier
        self.states: int = description.numberOfContinuousStates
        self.references = {v.name: v.valueReference for v in description.modelVariables}

    @property
    def readable(self) -> int:
        """Number of Reals from the first variable on: inputs and outputs stand first."""
        return int(self.references["F_p"]) + 1


def begin(fmu: Fmu, kind: int, changed: bool = False, policy: int = 0) -> Iterator[str]:
    yield f"new {kind} {fmu.guid}"
    yield from change(fmu) if changed else ()
    yield from (f"integer {fmu.references['out_of_range']} {policy}",) if policy else ()
    yield from (
        "setup",
        "enter",
        f"real 0 {bits(1.4)}",
        f"real 1 {bits(1290.25)}",
        "exit",
        f"get 0 {fmu.readable}",
    )


def change(fmu: Fmu, factor: float = 1.0) -> Iterator[str]:
    for name, value in fmu.changed:
        yield f"real {fmu.references[name]} {bits(value * factor)}"


def inputs(time: float) -> Iterator[str]:
    """The wire and the torque swing; libm's sine is that of the machine that writes the commands."""
    yield f"real 0 {bits(1.4 + 0.02 * math.sin(31.0 * time))}"
    yield f"real 1 {bits(1310.9 + 40.0 * math.sin(17.0 * time + 0.3))}"


def moving(fmu: Fmu, step: float, changed: bool = False) -> Iterator[str]:
    """Co-simulation with inputs that change at every communication point, one of them with its derivative."""
    yield from begin(fmu, CO_SIMULATION, changed)
    for k in range(max(4, math.ceil(DURATION / step))):
        yield from inputs(k * step)
        yield f"rate 0 {bits(0.62 * math.cos(31.0 * k * step))}"
        if changed and k == 3:
            yield from change(fmu, 1.03125)
        yield f"step {bits(k * step)} {bits(step)}"
        yield f"get 0 {fmu.readable}"
    yield from ("save", f"slope {fmu.references['F_p']} 0", "free")


def held(fmu: Fmu, step: float) -> Iterator[str]:
    """Co-simulation with inputs that are set once, after the start."""
    yield from begin(fmu, CO_SIMULATION)
    yield from inputs(0.05)
    for k in range(math.ceil(DURATION / step)):
        yield f"step {bits(k * step)} {bits(step)}"
        yield f"get 0 {fmu.readable}"
    yield "free"


def ticks(fmu: Fmu, step: float) -> list[int]:
    """Ticks done after each of the steps of `held`."""
    ends = np.arange(1, math.ceil(DURATION / step) + 1) * step
    return [math.floor(end / fmu.sample_time + 0.01) for end in ends]


def integrated(fmu: Fmu, step: float) -> Iterator[str]:
    """Model exchange of a model with continuous states: the driver's own explicit Euler steps."""
    yield from begin(fmu, MODEL_EXCHANGE)
    yield from ("events", "continuous")
    for k in range(60):
        yield from inputs(k * step)
        yield f"euler {fmu.states} {bits((k + 1) * step)} {bits(step)}"
        yield f"get 0 {fmu.readable}"
        yield f"slope {fmu.references['F_p']} {fmu.references['xi']}"
    yield from ("save", "free")


def sampled(fmu: Fmu) -> Iterator[str]:
    """Model exchange of a network: a time event at every tick."""
    yield from begin(fmu, MODEL_EXCHANGE)
    yield from ("events", "continuous")
    for k in range(60):
        yield f"time {bits((k + 1) * fmu.sample_time)}"
        yield from ("event", *inputs(k * fmu.sample_time), "events", "continuous", f"get 0 {fmu.readable}")
    yield from ("save", "free")


def clamped(fmu: Fmu) -> Iterator[str]:
    """Co-simulation with inputs held at their limits: both swing far beyond, and faster than in training."""
    yield from begin(fmu, CO_SIMULATION, policy=CLAMP)
    for k in range(120):
        yield f"real 0 {bits(1.4 + 1.5 * math.sin(31e-3 * k))}"
        yield f"real 1 {bits(1310.9 + 900.0 * math.sin(0.17 * k + 0.3))}"
        yield f"step {bits(k * 1e-3)} {bits(1e-3)}"
        yield f"get 0 {fmu.readable}"
        yield f"slope {fmu.references['F_p']} 0"
    yield from ("save", "free")


def continued(fmu: Fmu, saved: str) -> Iterator[str]:
    """Co-simulation from a state that somebody has saved at the end of `moving` with 1 ms."""
    yield from begin(fmu, CO_SIMULATION)
    yield f"restore {saved}"
    start = max(4, math.ceil(DURATION / 1e-3))
    for k in range(start, start + 20):
        yield from inputs(k * 1e-3)
        yield f"step {bits(k * 1e-3)} {bits(1e-3)}"
        yield f"get 0 {fmu.readable}"
    yield from ("save", "free")


def all_of(fmu: Fmu) -> dict[str, Sequence[str]]:
    """Every scenario of an FMU by its name."""
    found: dict[str, Sequence[str]] = {}
    for milliseconds in STEPS:
        found[f"moving-{milliseconds:.4g}ms"] = list(moving(fmu, milliseconds * 1e-3))
        found[f"held-{milliseconds:.4g}ms"] = list(held(fmu, milliseconds * 1e-3))
    if fmu.changed:
        found["parameters"] = list(moving(fmu, 1e-3, changed=True))
    if fmu.states:
        found["model-exchange"] = list(integrated(fmu, 2e-4))
    else:
        found["model-exchange"] = list(sampled(fmu))
        found["clamped"] = list(clamped(fmu))
    return found
