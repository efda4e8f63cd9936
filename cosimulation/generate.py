"""Reference data: any FMU driven by the recipe of the settings, or recorded files in its place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.data_folder import FORMAT, DataFolder, Experiment
from cosimulation.fmu_driver import FloatArray, StartValue, running_fmu
from cosimulation.fmu_file import OpenFmu, open_fmu, same_unit
from cosimulation.progress import SILENT, Reporter
from cosimulation.result_folder import result_folder
from cosimulation.settings import ExperimentSettings, GenerateSettings
from fmu_builder.errors import DataError, Problem, SettingsError
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, whole_range_inputs, with_measurement_noise
from identification.static_map import StaticMap, from_data


def generate_data(settings: GenerateSettings, reporter: Reporter = SILENT) -> Path:
    """Make all experiments of the settings and write them as a data folder.

    Args:
        settings: What to make.
        reporter: Told how far it is.

    Returns:
        The folder written.

    Raises:
        SettingsError: The settings do not fit together.
        FmuError: The FMU lacks a mapped signal, or reports an error.
        DataError: A recorded file cannot be used.
        OutputError: The folder cannot be written.
    """
    _check(settings)
    with result_folder(settings.output, FORMAT) as folder:
        make_data(settings, reporter).save(folder)
    return settings.output


def make_data(settings: GenerateSettings, reporter: Reporter = SILENT) -> DataFolder:
    """Make all experiments of the settings in memory; see `generate_data`."""
    _check(settings)
    origin: dict[str, Any] = {
        "settings": settings.model_dump(mode="json", exclude={"output": True, "reference": {"fmu"}})
    }
    recorded = _recorded_experiments(settings)
    with ExitStack() as stack:
        fmu = stack.enter_context(open_fmu(settings.reference.fmu)) if settings.reference.fmu else None
        if fmu is not None:
            fmu.require(settings.signals.inputs.values(), "input", "Real")
            fmu.require(settings.signals.outputs.values(), kind="Real")
            _require_units(
                settings, fmu.path.name, {name: fmu.variable(name).unit for name in _mapped(settings)}
            )
            known = fmu.description
            origin["reference"] = {"model": known.modelName, "guid": known.guid, "sha256": fmu.sha256}
        driven = [item for item in settings.experiments if item.file is None]
        steps = sum(round((item.duration or 0.0) / settings.excitation.sample_time) for item in driven)
        with reporter.bar("reference data", max(steps, 1)) as advance:
            experiments = [
                recorded.get(index) or _simulated(settings, item, index, fmu, advance)
                for index, item in enumerate(settings.experiments)
            ]
        static_map = _static_map(settings, fmu, experiments)
    return DataFolder(
        tuple(settings.signals.inputs),
        tuple(settings.signals.outputs),
        tuple(experiments),
        static_map,
        origin,
    )


def _check(settings: GenerateSettings) -> None:
    problems = []
    if not settings.experiments:
        problems.append(Problem("experiments", "there are none", "Add [[experiments]] tables"))
    if settings.reference.fmu is None:
        for item in settings.experiments:
            if item.file is None:
                what = "has neither a file nor a reference FMU to drive"
                problems.append(Problem(f"experiment {item.name!r}", what, "Give reference.fmu, or a file"))
    others = settings.signals.others
    if len(others) > 1 and any(item.file is None for item in settings.experiments):
        what = f"only one input beside the height can be drawn, not {len(others)} ({', '.join(others)})"
        mend = "Hold the rest by reference.start_values, or give recorded files"
        problems.append(Problem("signals.inputs", what, mend))
    for name in sorted(set(settings.static_map.operating_point) - set(others)):
        mend = f"Name one of {', '.join(others) or 'none'}"
        problems.append(Problem(f"static_map.operating_point.{name}", "is no input beside the height", mend))
    names = [item.name for item in settings.experiments]
    for name in sorted({name for name in names if names.count(name) > 1}):
        problems.append(
            Problem(f"experiment {name!r}", "appears more than once", "Give every one its own name")
        )
    if problems:
        raise SettingsError(problems)


def _mapped(settings: GenerateSettings) -> dict[str, str]:
    """Return the name in the FMU or file -> our name."""
    signals = settings.signals
    return {theirs: ours for ours, theirs in (*signals.inputs.items(), *signals.outputs.items())}


def _require_units(settings: GenerateSettings, place: str, found: Mapping[str, str | None]) -> None:
    """Refuse a signal whose unit contradicts that of a pantograph's signal, unless the settings state it."""
    ours = _mapped(settings)
    problems = []
    for name, unit in found.items():
        expected = "" if ours[name] in settings.signals.units else settings.signals.unit(ours[name])
        if not same_unit(unit, expected):
            what = f"is in {unit!r}, but {ours[name]} is in {expected!r}"
            mend = f"Convert it, or say what it is in: signals.units = {{ {ours[name]} = ... }}"
            problems.append(Problem(f"{place}, {name!r}", what, mend))
    if problems:
        raise DataError(problems)


def _units(settings: GenerateSettings, names: Sequence[str]) -> tuple[str, ...]:
    return tuple(settings.signals.unit(name) for name in names)


def _inputs(settings: GenerateSettings, item: ExperimentSettings, index: int) -> DataSet:
    """Return drawn inputs: the path of the height, and the steps of the other input if there is one."""
    duration, chosen = item.duration or 0.0, settings.excitation
    if item.kind == "operating_point":
        height = item.height or 0.0
        drawn = operating_point_inputs(height, settings.seed, (index,), duration, chosen, item.name)
    else:
        limits = (item.low, item.high)
        drawn = whole_range_inputs(
            settings.seed, (index,), duration, *limits, chosen, item.name, item.slew_rate
        )
    names = (settings.signals.scheduling, *settings.signals.others)
    values = drawn.values[:, : len(names)]
    return DataSet(item.name, drawn.sample_time, names, _units(settings, names), values, drawn.header)


def _simulated(
    settings: GenerateSettings, item: ExperimentSettings, index: int, fmu: OpenFmu | None, advance: Any
) -> Experiment:
    """Drive the FMU with freshly drawn inputs; measurement noise goes on training data only."""
    if fmu is None:
        raise SettingsError.of(f"experiment {item.name!r}", "has no FMU to drive", "Give reference.fmu")
    signals = settings.signals
    data = _inputs(settings, item, index)
    with running_fmu(fmu, item.name) as instance:
        outputs = instance.run(
            data.matrix(signals.inputs),
            tuple(signals.inputs.values()),
            tuple(signals.outputs.values()),
            settings.excitation.sample_time,
            settings.reference.start_values,
            advance,
        )
    names = tuple(signals.outputs)
    data = data.with_columns(names, _units(settings, names), outputs)
    deviations = _noise(settings, data)
    if item.split == "train" and deviations:
        data = with_measurement_noise(data, deviations, settings.seed, (index,))
    return Experiment(item.name, item.kind, item.split, item.height, data)


def _noise(settings: GenerateSettings, data: DataSet) -> dict[str, float]:
    by_unit = {"m": settings.noise.position, "m/s": settings.noise.velocity}
    units = dict(zip(data.names, data.units, strict=True))
    deviations = {name: by_unit.get(units[name], 0.0) for name in settings.signals.outputs}
    return {name: value for name, value in deviations.items() if value > 0.0}


def _recorded_experiments(settings: GenerateSettings) -> dict[int, Experiment]:
    """Return the experiments that come from files by their place in the settings.

    Raises:
        DataError: All problems of all files, before anything is simulated.
    """
    read: dict[int, Experiment] = {}
    found: list[Problem] = []
    for index, item in enumerate(settings.experiments):
        if item.file is not None:
            try:
                read[index] = _recorded(settings, item)
            except DataError as refused:
                found += refused.problems
    if found:
        raise DataError(found)
    return read


def _recorded(settings: GenerateSettings, item: ExperimentSettings) -> Experiment:
    """Read a file and give its columns our names."""
    mapping = {**settings.signals.inputs, **settings.signals.outputs}
    recorded = DataSet.load(item.file or Path()).select(mapping.values())
    _require_units(settings, str(item.file), dict(zip(recorded.names, recorded.units, strict=True)))
    units = tuple(
        settings.signals.unit(name) or unit for name, unit in zip(mapping, recorded.units, strict=True)
    )
    data = DataSet(item.name, recorded.sample_time, tuple(mapping), units, recorded.values, recorded.header)
    return Experiment(item.name, item.kind, item.split, item.height, data)


def _static_map(
    settings: GenerateSettings, fmu: OpenFmu | None, experiments: Sequence[Experiment]
) -> StaticMap | None:
    method = settings.static_map.method
    if method == "automatic":
        method = "initialise" if fmu is not None else "regression"
    names = tuple(settings.signals.outputs)
    if method == "regression":
        train = [item.data for item in experiments if item.split == "train" and item.kind == "whole_range"]
        return (
            from_data(train, settings.signals.scheduling, operating_point(settings), names) if train else None
        )
    if fmu is None:
        mend = "Use method = 'regression'"
        raise SettingsError.of("static_map.method", f"{method!r} needs a reference FMU", mend)
    heights = np.linspace(settings.static_map.low, settings.static_map.high, settings.static_map.heights)
    values = steady_states(settings, fmu, heights, settle=method == "settle")
    return StaticMap(heights, values, names)


def operating_point(settings: GenerateSettings) -> dict[str, float]:
    """Return the operating point of every input but the height."""
    known = settings.static_map.operating_point
    return {name: known.get(name, settings.excitation.torque) for name in settings.signals.others}


def steady_states(
    settings: GenerateSettings, fmu: OpenFmu, heights: FloatArray, settle: bool = False
) -> FloatArray:
    """Return the outputs of the FMU at rest, [len(heights), outputs], at the operating point of the torque.

    Args:
        settings: Names, torque and start values.
        fmu: Whose steady states.
        heights: Of the contact wire [m].
        settle: Simulate with constant inputs instead of trusting that the FMU initialises at rest.

    Raises:
        FmuError: A height cannot be reached.
    """
    signals = settings.signals
    scheduling = signals.scheduling
    step = settings.excitation.sample_time
    rows = round(settings.static_map.settling_time / step) if settle else 1
    values = np.empty((len(heights), len(signals.outputs)))
    for index, height in enumerate(heights):
        point: Mapping[str, StartValue] = {scheduling: float(height), **operating_point(settings)}
        inputs = np.tile([float(point[name]) for name in signals.inputs], (rows, 1))
        with running_fmu(fmu, f"static_{index}") as instance:
            outputs = instance.run(
                inputs,
                tuple(signals.inputs.values()),
                tuple(signals.outputs.values()),
                step,
                settings.reference.start_values,
            )
        values[index] = outputs[-1]
    return values
