"""The same values after the same time, whatever the communication step, and for an hour."""

from __future__ import annotations

import math
import time as clock
from dataclasses import dataclass

from fmu_builder.check.behaviour.comparing import ROUNDING, Rows, difference, spans
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import STATUS_NAMES, WARNING, Instance, Library
from fmu_builder.check.behaviour.plan import Plan
from fmu_builder.check.finding import Severity, practice, standard

_COMPUTATION = standard("4.2.2")
FACTORS = (0.5, 0.25, 2.0, 5.0, 10.0, 0.7, 1000.0 / 60.0)
"""Communication steps as multiples of the proposed one: of 1 ms the steps users take."""

_HORIZON = 420
_ON_GRID = 1e-6
_TICK = 0.01  # part of a step within which two times are one
_HOUR = 3600.0
_MOST_STEPS = 3_600_000
_WINDOW = 100
_WINDOWS = 12
_COARSE = 10
_GROSS = 0.05


def step_sizes(plan: Plan, diary: Diary) -> None:
    """Constant inputs, many communication steps: the same values at the same times."""
    library = Library(plan)
    diary.doing(f"steps of {plan.step:g} s", _COMPUTATION)
    base = _constant(library, 1.0)
    if base is None:
        return
    held = _is_held(library, base)
    sizes = spans(plan.outputs, base)
    same_bits = True
    for factor in FACTORS:
        step = factor * plan.step
        diary.doing(f"steps of {step:g} s", _COMPUTATION)
        found = _constant(library, factor)
        if found is None:
            same_bits &= factor != _COARSE
            _refused(plan, diary, step)
            continue
        pairs = _pairs(base, found, factor, held)
        gap, name = difference([a for a, _ in pairs], [b for _, b in pairs], plan.outputs, sizes)
        same_bits &= gap == 0.0
        _judge(diary, gap, name, step, plan.step, held)
    diary.know(same_bits=same_bits)


def _constant(library: Library, factor: float) -> Rows | None:
    """Return the outputs at the start and after each step of a run with constant inputs."""
    plan = library.plan
    instance = Instance(library)
    instance.begin()
    instance.set_inputs(plan.moved())
    first = instance.get_outputs()
    rows = instance.run(int(_HORIZON / factor + _ON_GRID), factor * plan.step)
    instance.free()
    return None if rows is None or first is None else [first, *rows]


def _is_held(library: Library, base: Rows) -> bool:
    """Whether outputs stay between the proposed steps: a sampled model, whose ticks can be counted."""
    quarter = _constant(library, 0.25)
    if quarter is None:
        return False
    return all(quarter[k] == base[k // 4] for k in range(len(quarter)))


def _pairs(base: Rows, found: Rows, factor: float, held: bool) -> list[tuple[list[float], list[float]]]:
    """Return the rows that must agree: all of a sampled model, else those at common times."""
    pairs = []
    for k, row in enumerate(found):
        place = k * factor
        nearest = round(place)
        if held and math.floor(place + _TICK) < len(base):
            pairs.append((list(base[math.floor(place + _TICK)]), list(row)))
        elif abs(place - nearest) < _ON_GRID * max(place, 1.0) and nearest < len(base):
            pairs.append((list(base[nearest]), list(row)))
    return pairs


def _refused(plan: Plan, diary: Diary, step: float) -> None:
    variable = "canHandleVariableCommunicationStepSize" in plan.abilities
    what = f"refuses communication steps of {step:g} s"
    mend = "Serve any step: run the ticks that it reaches, none if it reaches none"
    severity = Severity.ERROR if variable else Severity.WARNING
    diary.find(severity, "step-size", "fmi2DoStep", what, _COMPUTATION, mend)


def _judge(diary: Diary, gap: float, name: str, step: float, base: float, held: bool) -> None:
    if gap == 0.0:
        return
    what = (
        f"with steps of {step:g} s instead of {base:g} s, at the same time and with the same inputs,"
        f" {name!r} differs by {100 * gap:.2g} % of its movement"
    )
    mend = "Keep an integer counter of ticks, and run all ticks that a step reaches within a small tolerance"
    if gap > (ROUNDING if held else _GROSS):
        diary.find(Severity.ERROR, "step-size", "fmi2DoStep", what, _COMPUTATION, mend)
    elif gap > 1e-6:
        diary.find(Severity.WARNING, "step-size", "fmi2DoStep", what, _COMPUTATION, mend)
    else:
        diary.find(Severity.NOTE, "step-size", "fmi2DoStep", what, practice("reproducibility"), mend)


@dataclass
class _Master:
    """A master that steps an instance; `time` is where it believes to be."""

    instance: Instance
    exact: bool
    steps: int = 0
    time: float = 0.0

    def advance(self, count: int, stride: int = 1) -> int:
        """Do `count` proposed steps, `stride` of them in one; return the worst status."""
        step = self.instance.plan.step
        do_step, component = self.instance.library.DoStep, self.instance.component
        worst = 0
        if self.exact:
            for k in range(self.steps, self.steps + count, stride):
                worst |= do_step(component, k * step, stride * step, 1)
            self.time = (self.steps + count) * step
        else:
            time = self.time
            for _ in range(count):
                worst |= do_step(component, time, step, 1)
                time += step
            self.time = time
        self.steps += count
        return worst


def hour(plan: Plan, diary: Diary) -> None:
    """A master that adds up its time for an hour: no tick may be lost or doubled."""
    library = Library(plan)
    total = int(min(round(_HOUR / plan.step), _MOST_STEPS))
    diary.doing(f"{total} steps of {plan.step:g} s, the time being the sum so far", _COMPUTATION)
    adding = _Master(Instance(library), exact=False)
    exact = _Master(Instance(library), exact=True)
    for master in (adding, exact):
        master.instance.begin()
        master.instance.set_inputs(plan.moved())
    compare = bool(plan.found.get("same_bits"))
    deadline = clock.monotonic() + plan.budget
    ticking: set[int] = set()
    for window in range(_WINDOWS + 1):
        moves = _window(diary, adding, exact, compare)
        if moves is None:
            return
        if window == 0:
            ticking = set.intersection(*moves)
        if ticking and not all(ticking & moved for moved in moves):
            _lost(diary, adding, "does nothing in a step, which at the start it never did")
            return
        if window == _WINDOWS:
            return
        target = (window + 1) * (total - 2 * _WINDOW) // _WINDOWS // _COARSE * _COARSE
        if not _go_on(adding, exact, target, deadline, compare):
            what = (
                f"was followed for {adding.time:.0f} s of model time, less than an hour: it takes"
                f" {plan.budget / max(adding.steps, 1) * 1e6:.3g} us per step"
            )
            mend = "Give the check more time (--time-limit) to follow it for the whole hour"
            diary.find(Severity.NOTE, "hour-cut", "an hour of model time", what, _COMPUTATION, mend)
            return


def _go_on(adding: _Master, exact: _Master, target: int, deadline: float, compare: bool) -> bool:
    """Step both masters to `target` steps with constant inputs; false when the time runs out or one fails."""
    while adding.steps < target:
        count = min(2000, target - adding.steps)
        if clock.monotonic() > deadline or adding.advance(count) > WARNING:
            return False
        if compare and exact.advance(count, _COARSE) > WARNING:
            return False
    return True


def _window(diary: Diary, adding: _Master, exact: _Master, compare: bool) -> list[set[int]] | None:
    """Do some steps with inputs that change in each; return which outputs each step itself has moved."""
    plan = adding.instance.plan
    moves: list[set[int]] = []
    for k in range(_WINDOW):
        before: list[float] | None = None
        for master in (adding, exact) if compare else (adding,):
            master.instance.set_inputs(plan.moved(0.2 + 0.1 * (k % 7)))
            before = before or master.instance.get_outputs()
            status = master.advance(1)
            if status > WARNING:
                name = STATUS_NAMES[min(status, 5)]
                what = f"returns {name} at {master.time:.9g} s to a master that adds up its time"
                mend = "Accept communication points that are off by rounding"
                diary.find(Severity.ERROR, "tick-lost", "fmi2DoStep", what, _COMPUTATION, mend)
                return None
        after = adding.instance.get_outputs()
        if compare and after != exact.instance.get_outputs():
            _lost(diary, adding, "differs from a run with exact times")
            return None
        moves.append({k for k, (a, b) in enumerate(zip(before or (), after or (), strict=True)) if a != b})
    for master in (adding, exact):
        master.instance.set_inputs(plan.moved())
    return moves


def _lost(diary: Diary, master: _Master, what: str) -> None:
    drift = master.time - master.steps * master.instance.plan.step
    whole = f"{what}, at {master.time:.6g} s of a master that adds up its time (off by {drift:.2g} s)"
    mend = "Count ticks as integers from the start time, with a tolerance of about a hundredth of a tick"
    diary.find(Severity.ERROR, "tick-lost", "fmi2DoStep", whole, _COMPUTATION, mend)
