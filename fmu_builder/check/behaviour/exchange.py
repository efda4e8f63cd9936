"""Model exchange: into continuous-time mode, states and derivatives, and what depends on what."""

from __future__ import annotations

import ctypes

from fmu_builder.check.behaviour.comparing import all_finite
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import STATUS_NAMES, WARNING, Instance, Library
from fmu_builder.check.behaviour.plan import Plan, PlannedVariable
from fmu_builder.check.finding import Severity, standard

_EVALUATION = standard("3.2.2")
_ORDER = standard("3.2.3")
_STRUCTURE = standard("2.2.8")
_MOST_ITERATIONS = 1000
_PROBE = 1e-6  # of a state's size


class _EventInfo(ctypes.Structure):
    _fields_ = (
        *((name, ctypes.c_int) for name in ("needed", "terminate", "nominals", "values", "has_next")),
        ("next", ctypes.c_double),
    )


class _Continuous:
    """An instance in continuous-time mode, with its states, derivatives and outputs."""

    def __init__(self, library: Library, instance: Instance) -> None:
        self.library, self.instance = library, instance
        self.count = len(library.plan.derivatives)

    def vector(self, function: str) -> list[float] | None:
        """Return states or derivatives, None when refused."""
        cells = (ctypes.c_double * max(self.count, 1))()
        status = getattr(self.library, function)(self.instance.component, cells, self.count)
        return cells[: self.count] if status <= WARNING else None

    def indicators(self) -> list[float] | None:
        """Return the event indicators, None when refused."""
        count = self.library.plan.indicators
        cells = (ctypes.c_double * max(count, 1))()
        status = self.library.GetEventIndicators(self.instance.component, cells, count)
        return cells[:count] if status <= WARNING else None

    def set_states(self, states: list[float]) -> int:
        """Set all states."""
        cells = (ctypes.c_double * max(self.count, 1))(*states)
        return int(self.library.SetContinuousStates(self.instance.component, cells, self.count))

    def observed(self) -> list[float] | None:
        """Return outputs and derivatives."""
        outputs, slopes = self.instance.get_outputs(), self.vector("GetDerivatives")
        return None if outputs is None or slopes is None else [*outputs, *slopes]


def model_exchange(plan: Plan, diary: Diary) -> None:
    """Start it as an integrator does, and see what moves when a state or an input moves."""
    library = Library(plan)
    diary.doing("starting for model exchange", _ORDER)
    instance = Instance(library)
    if not instance.component or instance.begin() > WARNING:
        said = f"; it says: {instance.messages[-1][:200]}" if instance.messages else ""
        mend = "Make it start with the GUID and the start values of the description"
        diary.find(Severity.ERROR, "instantiate", "model exchange", "does not start" + said, _ORDER, mend)
        return
    if not _first_event(library, diary, instance):
        return
    model = _Continuous(library, instance)
    diary.doing("states and derivatives", _EVALUATION)
    states, observed = model.vector("GetContinuousStates"), model.observed()
    if states is None or observed is None or not all_finite([states, observed]):
        what = "cannot be read, or are not finite, at the start"
        mend = "Compute them from the start values"
        diary.find(Severity.ERROR, "states", "states, derivatives or outputs", what, _EVALUATION, mend)
        return
    if model.set_states(states) > WARNING or model.vector("GetContinuousStates") != states:
        what, mend = "does not give back the states that were set", "Store what the integrator sets"
        diary.find(Severity.ERROR, "states", "fmi2SetContinuousStates", what, _EVALUATION, mend)
        return
    _indicators(model, diary, states)
    _dependencies(model, diary, states, observed)
    instance.free()


def _first_event(library: Library, diary: Diary, instance: Instance) -> bool:
    diary.doing("the event iteration at the start", _ORDER)
    info = _EventInfo(needed=1)
    for _ in range(_MOST_ITERATIONS):
        status = library.NewDiscreteStates(instance.component, ctypes.byref(info))
        if status > WARNING or not info.needed:
            break
    else:
        what, mend = (
            f"still asks for more after {_MOST_ITERATIONS} rounds",
            "Let the iteration come to an end",
        )
        diary.find(Severity.ERROR, "event-iteration", "fmi2NewDiscreteStates", what, _ORDER, mend)
        return False
    if status <= WARNING:
        status = library.EnterContinuousTimeMode(instance.component)
    if status > WARNING:
        what, mend = f"fails at the start with {STATUS_NAMES[min(status, 5)]}", "Let a simulation begin"
        diary.find(Severity.ERROR, "event-iteration", "event mode", what, _ORDER, mend)
        return False
    return True


def _indicators(model: _Continuous, diary: Diary, states: list[float]) -> None:
    """Read the event indicators as a root finder does: here, a little away, and here again."""
    plan = model.library.plan
    if not diary.doing(f"reading {plan.indicators} event indicators", _EVALUATION):
        return
    here = model.indicators()
    moved = [value + _PROBE * max(abs(value), of.size) for value, of in zip(states, plan.states, strict=True)]
    away = model.indicators() if model.set_states(moved) <= WARNING else here
    model.set_states(states)
    again = model.indicators()
    place = "fmi2GetEventIndicators"
    if here is None or away is None or again is None or not all_finite([here, away, again]):
        what = f"does not give {plan.indicators} numbers in continuous-time mode"
        mend = "Compute numberOfEventIndicators numbers from time, states and inputs; also when that is none"
        diary.find(Severity.ERROR, "event-indicators", place, what, _EVALUATION, mend)
    elif here != again:
        what = "gives other numbers for the same time, states and inputs"
        mend = "Let nothing but them act: solvers go back and forth to find a change of sign"
        diary.find(Severity.ERROR, "event-indicators", place, what, _EVALUATION, mend)


def _dependencies(model: _Continuous, diary: Diary, states: list[float], before: list[float]) -> None:
    plan = model.library.plan
    unknowns = [*plan.outputs, *plan.derivative_variables]
    for k, state in enumerate(plan.states):
        if not diary.doing(f"what moving the state {state.name!r} does", _STRUCTURE):
            continue
        moved = list(states)
        moved[k] += _PROBE * max(abs(states[k]), state.size)
        after = model.observed() if model.set_states(moved) <= WARNING else None
        model.set_states(states)
        _undeclared(diary, state, unknowns, before, after)
    for known in plan.inputs:
        if not diary.doing(f"what moving the input {known.name!r} does", _STRUCTURE):
            continue
        start = known.start or 0.0
        after = model.observed() if model.instance.set(known, known.moved(_PROBE)) <= WARNING else None
        model.instance.set(known, start)
        _undeclared(diary, known, unknowns, before, after)


def _undeclared(
    diary: Diary,
    known: PlannedVariable,
    unknowns: list[PlannedVariable],
    before: list[float],
    after: list[float] | None,
) -> None:
    for unknown, old, new in zip(unknowns, before, after or before, strict=True):
        if old != new and unknown.depends_on is not None and known.name not in unknown.depends_on:
            what = f"follows {known.name!r}, but its dependencies do not name it"
            mend = "Name every state and input that acts: solvers leave out what is not named"
            place = f"model exchange, {unknown.name!r}"
            diary.find(Severity.ERROR, "hidden-dependency", place, what, _STRUCTURE, mend)
