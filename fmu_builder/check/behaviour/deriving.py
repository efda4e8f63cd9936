"""Derivatives that an FMU says it provides or uses."""

from __future__ import annotations

import ctypes

from fmu_builder.check.behaviour.diary import Diary
from fmu_builder.check.behaviour.instance import STATUS_NAMES, WARNING, Instance, Library, references
from fmu_builder.check.behaviour.plan import Plan, PlannedVariable
from fmu_builder.check.finding import Severity, standard

_DIRECTIONAL = standard("2.1.9")
_INTERPOLATION = standard("4.2.1")
_STEPS = 5
_LONG_STEP = 10
_MOST_INPUTS = 8
_PROBE = 1e-4  # of an input's size
_APART = 0.01


def derivatives(plan: Plan, diary: Diary) -> None:
    """Input derivatives must have an effect, directional derivatives be those of the outputs."""
    library = Library(plan)
    if "canInterpolateInputs" in plan.abilities and plan.inputs:
        _input_derivatives(library, diary)
    if "providesDirectionalDerivative" in plan.abilities:
        for variable in plan.inputs[:_MOST_INPUTS]:
            _directional(library, diary, variable)


def _running(library: Library) -> Instance | None:
    instance = Instance(library)
    instance.begin()
    instance.set_inputs(library.plan.moved())
    return instance if instance.run(_STEPS, library.plan.step) is not None else None


def _input_derivatives(library: Library, diary: Diary) -> None:
    plan = library.plan
    diary.doing("fmi2SetRealInputDerivatives", _INTERPOLATION)
    held, sloped = _running(library), _running(library)
    if held is None or sloped is None:
        return
    count = len(plan.inputs)
    duration = _LONG_STEP * plan.step
    away = [target - (v.start or 0.0) for v, target in zip(plan.inputs, plan.moved(), strict=True)]
    slopes = (ctypes.c_double * count)(*(0.2 * step / duration for step in away))
    orders = (ctypes.c_int * count)(*([1] * count))
    status = library.SetRealInputDerivatives(sloped.component, sloped.inputs, count, orders, slopes)
    if status > WARNING:
        what = f"returns {STATUS_NAMES[min(status, 5)]} although canInterpolateInputs is true"
        mend = "Use the derivatives, or declare canInterpolateInputs=false"
        diary.find(
            Severity.ERROR, "input-derivatives", "fmi2SetRealInputDerivatives", what, _INTERPOLATION, mend
        )
        return
    for instance in (held, sloped):
        if instance.step(_STEPS * plan.step, duration) > WARNING:
            return
    if any(away) and held.get_outputs() == sloped.get_outputs():
        what = f"has no effect within a step of {duration:g} s, although canInterpolateInputs is true"
        mend = "Advance the inputs with their derivatives, or declare canInterpolateInputs=false"
        diary.find(
            Severity.WARNING, "input-derivatives", "fmi2SetRealInputDerivatives", what, _INTERPOLATION, mend
        )


def _directional(library: Library, diary: Diary, variable: PlannedVariable) -> None:
    """Compare with what setting the input a little up and down does to the outputs at once."""
    plan = library.plan
    diary.doing(f"fmi2GetDirectionalDerivative with respect to {variable.name!r}", _DIRECTIONAL)
    instance = _running(library)
    if instance is None:
        return
    _, value = instance.get(variable)
    step = _PROBE * max(variable.size, abs(value))
    moved = []
    for target in (value + step, value - step):
        if instance.set(variable, target) > WARNING or (outputs := instance.get_outputs()) is None:
            return
        moved.append(outputs)
    instance.set(variable, value)
    for column, output in enumerate(plan.outputs):
        if output.depends_on is None or variable.name not in output.depends_on:
            continue
        expected = (moved[0][column] - moved[1][column]) / (2.0 * step)
        status, found = directional_derivative(instance, output, variable)
        place = f"d {output.name} / d {variable.name}"
        if status > WARNING:
            what = (
                f"fails with {STATUS_NAMES[min(status, 5)]}, although {output.name!r} names this dependency"
            )
            mend = "Provide it for all declared dependencies, or declare providesDirectionalDerivative=false"
            diary.find(Severity.ERROR, "directional-derivative", place, what, _DIRECTIONAL, mend)
        elif not abs(found - expected) <= _APART * max(abs(found), abs(expected), 1e-9):
            what = f"is {found:g}, but setting the input moves the output by {expected:g} per unit"
            mend = "Return the partial derivative at the present point"
            diary.find(Severity.ERROR, "directional-derivative", place, what, _DIRECTIONAL, mend)


def directional_derivative(
    instance: Instance, unknown: PlannedVariable, known: PlannedVariable
) -> tuple[int, float]:
    """Return status and d unknown / d known."""
    seed, answer = (ctypes.c_double * 1)(1.0), (ctypes.c_double * 1)()
    status = instance.library.GetDirectionalDerivative(
        instance.component, references([unknown]), 1, references([known]), 1, seed, answer
    )
    return int(status), float(answer[0])
