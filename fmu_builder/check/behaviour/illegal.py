"""Calls that are wrong: they must be refused with a message, and never crash."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from fmu_builder.check.behaviour.comparing import all_finite
from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import OK, STATUS_NAMES, WARNING, Instance, Library
from fmu_builder.check.behaviour.plan import Plan
from fmu_builder.check.finding import Severity, practice, standard

_VALUES = standard("2.1.7")
_COMPUTATION = standard("4.2.2")
_ORDER = standard("4.2.4")
_ROBUST = practice("robustness")
_NEVER_USED = 0xFFFFFFFF
_NAN, _INFINITY = float("nan"), float("inf")


@dataclass(frozen=True)
class _Call:
    """One wrong call on a running instance: `refuse` when it must be, `crash` how bad it is to crash."""

    name: str
    rule: str
    paragraph: str
    make: Callable[[Instance], int]
    refuse: Severity = Severity.ERROR
    crash: Severity = Severity.ERROR


def _number_access(verb: str, kind: str, reference: int) -> Callable[[Instance], int]:
    def make(instance: Instance) -> int:
        kinds: dict[str, Any] = {"Real": ctypes.c_double, "String": ctypes.c_char_p}
        cell = (kinds.get(kind, ctypes.c_int) * 1)()
        if kind == "String":
            cell[0] = b""
        function = getattr(instance.library, verb + kind)
        return int(function(instance.component, (ctypes.c_uint * 1)(reference), 1, cell))

    return make


def _unknown_references(plan: Plan) -> Iterator[_Call]:
    known = {variable.reference for variable in plan.variables}
    beyond = max(known, default=0) + 1000
    for verb in ("Get", "Set"):
        for kind in ("Real", "Integer", "Boolean", "String"):
            for reference in (_NEVER_USED, beyond) if kind == "Real" else (_NEVER_USED,):
                yield _Call(
                    f"fmi2{verb}{kind} of the unknown value reference {reference}",
                    "unknown-value-reference", _VALUES, _number_access(verb, kind, reference),
                )  # fmt: skip


def _settings(plan: Plan) -> Iterator[_Call]:
    """Values that may not be set now, or not at all."""
    calculated = next((v for v in plan.variables if v.type == "Real" and v.causality == "output"), None)
    fixed = next(
        (
            v
            for v in plan.variables
            if v.causality == "parameter" and v.variability == "fixed" and v.type == "Real"
        ),
        None,
    )
    if calculated is not None:
        yield _Call(
            f"setting the output {calculated.name!r}", "set-output", _VALUES,
            lambda instance: instance.set(calculated, 0.0), Severity.WARNING,
        )  # fmt: skip
    if fixed is not None and plan.can_step:
        yield _Call(
            f"setting the fixed parameter {fixed.name!r} after initialisation", "set-fixed", _VALUES,
            lambda instance: instance.set(fixed, fixed.start or 0.0), Severity.WARNING,
        )  # fmt: skip


def _steps(plan: Plan) -> Iterator[_Call]:
    def step(time: float, size: float) -> Callable[[Instance], int]:
        return lambda instance: instance.step(time, size)

    def after_terminate(instance: Instance) -> int:
        instance.library.Terminate(instance.component)
        return instance.step(0.0, plan.step)

    h = plan.step
    yield _Call("fmi2DoStep after fmi2Terminate", "step-after-terminate", _ORDER, after_terminate)
    yield _Call("fmi2DoStep with h = 0", "step-zero", _COMPUTATION, step(0.0, 0.0), Severity.WARNING)
    for size in (-h, _NAN, _INFINITY, -_INFINITY):
        yield _Call(f"fmi2DoStep with h = {size:g}", "step-illegal", _COMPUTATION, step(0.0, size))
    for time in (_NAN, _INFINITY):
        yield _Call(f"fmi2DoStep at the time {time:g}", "step-illegal", _COMPUTATION, step(time, h))


def _nulls(plan: Plan) -> Iterator[_Call]:
    """Missing arrays; to crash there is allowed by the standard and hated by users."""
    one = (ctypes.c_uint * 1)(plan.inputs[0].reference if plan.inputs else 0)
    cell = (ctypes.c_double * 1)()

    def real(verb: str, component: bool, vr: object, values: object) -> Callable[[Instance], int]:
        return lambda i: int(
            getattr(i.library, verb + "Real")(i.component if component else None, vr, 1, values)
        )

    calls: dict[str, Callable[[Instance], int]] = {}
    for verb in ("Get", "Set"):
        calls[f"fmi2{verb}Real with value references NULL"] = real(verb, True, None, cell)
        calls[f"fmi2{verb}Real with values NULL"] = real(verb, True, one, None)
        calls[f"fmi2{verb}Real of the instance NULL"] = real(verb, False, one, cell)
    if plan.can_step:
        calls["fmi2DoStep of the instance NULL"] = lambda i: int(i.library.DoStep(None, 0.0, plan.step, 1))
    if "canGetAndSetFMUstate" in plan.abilities:
        calls["fmi2GetFMUstate with NULL"] = lambda i: int(i.library.GetFMUstate(i.component, None))
        calls["fmi2SetFMUstate with NULL"] = lambda i: int(i.library.SetFMUstate(i.component, None))
    for name, make in calls.items():
        yield _Call(name, "null", _ROBUST, make, Severity.WARNING, Severity.WARNING)


def illegal_calls(plan: Plan, diary: Diary) -> None:
    """Make every wrong call on an instance of its own, then what is odd but allowed."""
    library = Library(plan)
    silent: list[str] = []
    steps = _steps(plan) if plan.can_step else ()
    for call in (*_unknown_references(plan), *_settings(plan), *steps, *_nulls(plan)):
        if not diary.doing(call.name, call.paragraph, call.crash):
            continue
        instance = Instance(library)
        instance.begin()
        instance.messages.clear()
        status = call.make(instance)
        if status <= WARNING:
            what = f"returns {STATUS_NAMES[status] if status >= OK else status}"
            mend = "Check arguments and mode first; return fmi2Error with a message and change nothing"
            diary.find(call.refuse, call.rule, call.name, what, call.paragraph, mend)
        elif not instance.messages and "instance NULL" not in call.name:
            silent.append(call.name)
        instance.free()
    if silent:
        what = f"is refused without a message to the logger, as are {len(silent) - 1} other wrong calls"
        mend = "Say what is wrong: the status alone tells a user nothing"
        diary.find(Severity.NOTE, "no-message", silent[0], what, standard("2.1.5"), mend)
    _not_numbers(library, diary)
    _odd_but_allowed(library, diary)


def _not_numbers(library: Library, diary: Diary) -> None:
    """NaN and infinity as inputs: refused, or at least not passed on as results."""
    plan = library.plan
    for value in (_NAN, _INFINITY):
        for variable in plan.inputs[:4]:
            call = f"setting {variable.name!r} to {value:g}"
            if not diary.doing(call, _VALUES):
                continue
            instance = Instance(library)
            instance.begin()
            status = instance.set(variable, value)
            if status <= WARNING:
                at_once = instance.get_outputs() or []
                later = (instance.run(3, plan.step) or []) if plan.can_step else []
                if not all_finite([at_once, *later]):
                    what = "is accepted, and outputs are not finite without an error"
                    mend = "Refuse values that are not finite with fmi2Error and a message"
                    diary.find(Severity.WARNING, "not-a-number", call, what, _ROBUST, mend)
            else:
                _still_usable(instance, diary, call)
            instance.free()


def _still_usable(instance: Instance, diary: Diary, call: str) -> None:
    plan = instance.plan
    if plan.can_step and instance.library.Reset(instance.component) <= WARNING:
        if instance.begin() <= WARNING and instance.step(0.0, plan.step) <= WARNING:
            return
        what, mend = "cannot be used again after fmi2Reset", "Let fmi2Reset clear an error"
        diary.find(Severity.WARNING, "error-stays", call, what, standard("2.1.3"), mend)


def _odd_but_allowed(library: Library, diary: Diary) -> None:
    plan = library.plan
    creation = standard("2.1.5")
    if diary.doing("fmi2FreeInstance(NULL)", creation):
        library.FreeInstance(None)
    for argument in ("callbacks", "name", "resources"):
        if diary.doing(f"fmi2Instantiate with {argument} NULL", _ROBUST, Severity.WARNING):
            given: dict[str, Any] = {argument: None}
            instance = Instance(library, **given)
            if instance.component:
                instance.begin()
            instance.free()
    if diary.doing("fmi2GetReal and fmi2SetReal of no variables", _VALUES):
        instance = Instance(library)
        instance.begin()
        for name in ("GetReal", "SetReal"):
            status = getattr(library, name)(instance.component, None, 0, None)
            if status > WARNING:
                call, mend = f"fmi2{name} of no variables", "Do nothing and return fmi2OK"
                reply = f"returns {STATUS_NAMES[min(status, 5)]}"
                diary.find(Severity.WARNING, "no-variables", call, reply, _VALUES, mend)
        instance.free()
    if plan.can_step and diary.doing("fmi2DoStep before initialisation", _ORDER):
        instance = Instance(library)
        if instance.step(0.0, plan.step) <= WARNING:
            mend = "Accept steps only after initialisation"
            call = "fmi2DoStep before initialisation"
            diary.find(Severity.ERROR, "step-too-early", call, "returns fmi2OK", _ORDER, mend)
        instance.free()
