"""Opens what the settings of a sweep name and says everything that does not fit, before anything runs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import fmus
from cosimulation.fmu_driver import converted_start
from cosimulation.fmu_file import OpenFmu, open_fmu, same_unit
from cosimulation.settings import PANTOGRAPH_UNITS
from cosimulation.sweep.plan import Bench, Model, Signal
from cosimulation.sweep.settings import ModelSettings, ParameterSettings, SignalSettings, SweepSettings
from fmu_builder.errors import LlmnError, Problem, SettingsError
from identification.data_set import DataSet

_DRAWN = ("eta", "M_pa")
_FLAG = "in_range"


def open_bench(settings: SweepSettings) -> tuple[SweepSettings, Bench]:
    """Return the settings with every value in the type of its parameter, and what workers need.

    Raises:
        SettingsError: FMUs, files, parameters and signals that cannot be used or do not fit each other, all.
    """
    found: list[Problem] = []
    signals = [_signal(item, found) for item in settings.signals]
    parameters = list(settings.parameters)
    models = [
        _model(item, f"models[{number + 1}]", settings, parameters, signals, found)
        for number, item in enumerate(settings.models)
    ]
    reference = None
    if settings.reference is not None:
        reference = _model(settings.reference, "reference", settings, parameters, signals, found)
    opened = tuple(item for item in models if item is not None)
    bench = Bench(opened, tuple(item for item in signals if item is not None), reference)
    if not found:
        found += _unscored(settings, bench)
    if found:
        raise SettingsError(found)
    return settings.model_copy(update={"parameters": tuple(parameters)}), bench


def _signal(item: SignalSettings, found: list[Problem]) -> Signal | None:
    if item.file is None:
        return Signal(item, None)
    try:
        return Signal(item, DataSet.load(item.file))
    except LlmnError as refused:
        found += refused.problems
        return None


def _model(
    item: ModelSettings,
    place: str,
    settings: SweepSettings,
    parameters: list[ParameterSettings],
    signals: Sequence[Signal | None],
    found: list[Problem],
) -> Model | None:
    """Open one FMU; problems go to `found`, values in the type of their parameter into `parameters`."""
    try:
        path = fmus.path(item.fmu) if item.fmu in fmus.NAMES else Path(item.fmu)
        with open_fmu(path) as fmu:
            before = len(found)
            found += _wrong_values(fmu, item, place)
            for number, one in enumerate(parameters):
                of_reference = place == "reference" and one.reference
                if of_reference or (
                    place != "reference" and (one.models is None or item.label in one.models)
                ):
                    parameters[number] = _typed(fmu, item, one, found)
            ours = {theirs: name for name, theirs in item.names.items()}
            real = [one for one in fmu.description.modelVariables if one.type == "Real"]
            inputs = {ours.get(one.name, one.name): one for one in real if one.causality == "input"}
            outputs = tuple(ours.get(one.name, one.name) for one in real if one.causality == "output")
            if len(found) == before:
                for signal in signals:
                    if signal is not None:
                        found += _wrong_signal(fmu, item, inputs, signal)
            watched = any(
                one.name == _FLAG and one.type == "Boolean" for one in fmu.description.modelVariables
            )
            return Model(item, path.name, path, fmu.sha256, tuple(inputs), outputs, watched)
    except LlmnError as refused:
        found += refused.problems
        return None


def _wrong_values(fmu: OpenFmu, item: ModelSettings, place: str) -> list[Problem]:
    """Return what is wrong with the names of signals and the start values."""
    found: list[Problem] = []
    try:
        fmu.require(item.names.values(), table=f"{place}.names")
    except LlmnError as refused:
        found += refused.problems
    for name, value in item.start_values.items():
        try:
            fmu.require([name], table=f"{place}.start_values")
            converted_start(fmu, name, value)
        except LlmnError as refused:
            found += refused.problems
    return found


def _typed(
    fmu: OpenFmu, item: ModelSettings, one: ParameterSettings, found: list[Problem]
) -> ParameterSettings:
    """Return a parameter whose numbers have the type of the FMU's variable."""
    place = f"parameter {one.name!r} of {fmu.path.name}"
    try:
        fmu.require([one.name], table="parameters, or say of which models it is")
        variable = fmu.variable(one.name)
        if variable.causality != "parameter" or variable.variability not in ("fixed", "tunable"):
            what = f"is of causality {variable.causality!r} and variability {variable.variability!r}"
            found.append(Problem(place, what, "Vary fixed or tunable parameters"))
        if one.name in item.start_values:
            found.append(Problem(place, "stands in start_values as well", "Leave it out of one of them"))
        if one.values is None:
            if variable.type != "Real":
                what = f"is of type {variable.type}, and only a Real has a range"
                found.append(Problem(place, what, "Give values"))
            return one
        values = tuple(converted_start(fmu, one.name, value) for value in one.values)
        if len(set(values)) < len(values):
            found.append(Problem(place, "has two values that are one", "Leave one of them out"))
        return one.model_copy(update={"values": values}) if variable.type == "Real" else one
    except LlmnError as refused:
        found += refused.problems
        return one


def _wrong_signal(
    fmu: OpenFmu, item: ModelSettings, inputs: dict[str, object], signal: Signal
) -> list[Problem]:
    """Return which inputs of an FMU a signal does not drive, drives in another unit, or should not drive."""
    record = signal.record
    names = _DRAWN if record is None else record.names
    units = PANTOGRAPH_UNITS if record is None else dict(zip(record.names, record.units, strict=True))
    place = f"signal {signal.settings.name!r}"
    found = []
    for name, variable in inputs.items():
        theirs = item.names.get(name, name)
        started = theirs in item.start_values
        if name not in names and not started:
            what = f"has no column {name!r}, an input of {fmu.path.name}"
            mend = "Name the input in names, or give it a start value"
            found.append(Problem(place, what, mend))
        elif name in names and started:
            what = f"drives {name!r}, an input of {fmu.path.name} that has a start value"
            found.append(Problem(place, what, "Leave the start value out"))
        elif name in names and not same_unit(getattr(variable, "unit", None), units.get(name)):
            what = (
                f"has {name!r} in {units.get(name)!r}, {fmu.path.name} in {getattr(variable, 'unit', None)!r}"
            )
            found.append(Problem(place, what, "Convert the column, or write the unit that it is in"))
    return found


def _unscored(settings: SweepSettings, bench: Bench) -> list[Problem]:
    """Return the outputs asked for that a run would not have."""
    found = []
    for model in bench.models:
        for signal in bench.signals:
            have = bench.scored(model, signal, settings.outputs)
            for name in settings.outputs:
                if name not in have:
                    place = f"outputs, {name!r}"
                    what = f"is not had both by {model.file} and by what signal {signal.settings.name!r} is"
                    mend = "Give a reference or a record that has it, or leave it out"
                    found.append(Problem(place, f"{what} compared with", mend))
    return found
