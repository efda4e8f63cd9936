"""Side by side: an FMU co-simulated on the inputs of recorded experiments, and what it gets right."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.fmu_driver import FloatArray, running_fmu
from cosimulation.fmu_file import OpenFmu, open_fmu, same_unit
from cosimulation.progress import SILENT, Reporter
from fmu_builder.errors import DataError, ParameterSetError, Problem, SettingsError
from fmu_builder.files import write_text
from fmu_builder.parameter_set import ParameterSet, load
from identification.data_set import DataSet, load_all
from identification.residuals import inside
from identification.scores import records

IN_RANGE = "in_range"
"""Boolean output of a network: whether it is inside the range it was trained in."""


@dataclass(frozen=True)
class CoSimulation:
    """One FMU run on one experiment.

    Attributes:
        signals: Outputs that both the FMU and the experiment have.
        outputs: What the FMU gave, [N, len(signals)].
        reference: What the experiment holds, the same shape.
        seconds: Wall time of the run.
        steps: Number of doStep calls.
        out_of_range: Share of the time that the FMU's `in_range` was false; None: it has no such output.
    """

    signals: tuple[str, ...]
    outputs: FloatArray
    reference: FloatArray
    seconds: float
    steps: int
    out_of_range: float | None = None


@dataclass(frozen=True)
class Validation:
    """Scores of one FMU.

    Attributes:
        fmu: Name of its file.
        records: Score records.
        out_of_range: Share of time out of the trained range by experiment; of an FMU that tells it.
        inside: By experiment and output, share of errors inside the FMU's own error bands; of one that has
            them.
    """

    fmu: str
    records: tuple[dict[str, Any], ...]
    out_of_range: Mapping[str, float] = field(default_factory=dict)
    inside: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def summary(self) -> dict[str, object]:
        """Return the result for a machine."""
        return {
            "fmu": self.fmu,
            "scores": list(self.records),
            "out_of_range": dict(self.out_of_range),
            "inside_bands": {name: dict(shares) for name, shares in self.inside.items()},
        }

    def text(self) -> str:
        """Return the result for a person: one line per experiment and signal."""
        lines = [f"{self.fmu}", f"{'experiment':<24}{'signal':<12}{'FIT %':>10}{'max error':>14}"]
        for item in self.records:
            fit = "-" if item["fit"] is None else f"{item['fit']:.2f}"
            worst = "-" if item["max_error"] is None else f"{item['max_error']:.6g}"
            lines.append(f"{item['data_set']:<24}{item['signal']:<12}{fit:>10}{worst:>14}")
        lines += [
            f"{name}: out of the trained range {100.0 * share:.2f} % of the time"
            for name, share in self.out_of_range.items()
        ]
        lines += [
            f"{name}: {100.0 * share:.1f} % of the errors of {signal} inside the error bands of the FMU"
            for name, shares in self.inside.items()
            for signal, share in shares.items()
        ]
        return "\n".join(lines)

    def save(self, path: Path) -> None:
        """Write the records as JSON, at once or not at all."""
        write_text(path, json.dumps(list(self.records), indent=1) + "\n")


def mapped_signals(fmu: OpenFmu, data: DataSet) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the inputs of the FMU and those outputs of it that the data set has.

    Raises:
        DataError: The data set lacks an input of the FMU, or shares no output with it.
    """
    variables = fmu.description.modelVariables
    real = [item for item in variables if item.type == "Real"]
    inputs = tuple(item.name for item in real if item.causality == "input")
    outputs = tuple(item.name for item in real if item.causality == "output" and item.name in data.names)
    place = f"data set {data.name!r}"
    units = dict(zip(data.names, data.units, strict=True))
    problems = [
        Problem(
            place, f"has no column {name!r}, an input of {fmu.path.name}", "Name the column like the input"
        )
        for name in inputs
        if name not in data.names
    ]
    for item in variables:
        if item.causality == "input" and item.type != "Real" and item.name in data.names:
            what = f"has a column {item.name!r}, which is an input of type {item.type} of {fmu.path.name}"
            problems.append(Problem(place, what, "Leave the column out; only Real inputs are driven"))
        if item.name in (*inputs, *outputs) and not same_unit(item.unit, units.get(item.name)):
            what = f"has {item.name!r} in {units[item.name]!r}, {fmu.path.name} in {item.unit!r}"
            problems.append(Problem(place, what, "Convert the column, and write the FMU's unit in its title"))
    if not outputs:
        offered = ", ".join(item.name for item in real if item.causality == "output")
        problems.append(
            Problem(place, "has no column to compare with", f"Name columns like outputs: {offered}")
        )
    if problems:
        raise DataError(problems)
    return inputs, outputs


def co_simulate(
    fmu: OpenFmu,
    data: DataSet,
    start_values: Mapping[str, float | int | bool | str] | None = None,
    advance: Any = None,
) -> CoSimulation:
    """Run an FMU on the inputs of a data set.

    Raises:
        DataError: See `mapped_signals`.
        FmuError: The FMU reports an error.
    """
    inputs, outputs = mapped_signals(fmu, data)
    flags = _range_flags(fmu)
    with running_fmu(fmu, "validate") as instance:
        begin = time.perf_counter()
        values = instance.run(
            data.matrix(inputs), inputs, outputs, data.sample_time, start_values, advance, flags
        )
        seconds = time.perf_counter() - begin
        outside = float(np.mean(instance.flags[:, 0] == 0)) if flags else None
    return CoSimulation(outputs, values, data.matrix(outputs), seconds, len(data) - 1, outside)


def _range_flags(fmu: OpenFmu) -> tuple[str, ...]:
    """Return the Boolean output that tells whether an FMU is inside its trained range, if it has it."""
    return tuple(
        item.name
        for item in fmu.description.modelVariables
        if (item.name, item.type, item.causality) == (IN_RANGE, "Boolean", "output")
    )


def validate_fmu(
    path: Path,
    data_files: Sequence[Path],
    reference: Path | None = None,
    reference_start: Mapping[str, float | int | bool | str] | None = None,
    reporter: Reporter = SILENT,
) -> Validation:
    """Co-simulate an FMU on recorded inputs and score every output it shares with the reference.

    Args:
        path: The FMU.
        data_files: Experiments, .npz or .csv.
        reference: FMU that gives the outputs to compare with; the recorded outputs by default.
        reference_start: Start values of the reference FMU.
        reporter: Told how far it is.

    Raises:
        FmuError: An FMU cannot be opened or reports an error.
        DataError: An experiment cannot be read, or does not fit an FMU.
        SettingsError: Start values without a reference FMU.
    """
    if reference_start and reference is None:
        mend = "Give --reference, or leave --start out"
        raise SettingsError.of("--start", "is of the reference FMU, and there is none", mend)
    experiments = load_all(data_files)
    if reference is not None:
        with open_fmu(reference) as fmu:
            experiments = [_with_outputs_of(fmu, data, reference_start or {}) for data in experiments]
    found: list[dict[str, Any]] = []
    outside: dict[str, float] = {}
    kept: dict[str, dict[str, float]] = {}
    with open_fmu(path) as fmu:
        _refuse_unfit(fmu, experiments)
        known = _own_bands(fmu)
        with reporter.bar(f"co-simulating {path.name}", sum(map(len, experiments))) as advance:
            for data in experiments:
                run = co_simulate(fmu, data, advance=advance)
                labels = {"model": fmu.description.modelName, "data_set": data.name, "recommended": True}
                found += records(run.reference, run.outputs, run.signals, labels)
                if run.out_of_range is not None:
                    outside[data.name] = run.out_of_range
                if known is not None and (shares := _inside(known, data, run)):
                    kept[data.name] = shares
    return Validation(path.name, tuple(found), outside, kept)


def _own_bands(fmu: OpenFmu) -> ParameterSet | None:
    """Return the parameter set in an FMU if it holds error bands; None where there is none to be read."""
    place = Path(fmu.folder) / "resources" / "parameter_set.json"
    try:
        found = load(place) if place.is_file() else None
    except ParameterSetError:  # of another program, or another version of this one: scores do not need it
        return None
    return found if found is not None and found.residual_bands else None


def _inside(parameter_set: ParameterSet, data: DataSet, run: CoSimulation) -> dict[str, float]:
    """Return by output which share of errors lies inside the bands; nothing of outputs without data there."""
    shares = {}
    for bands in parameter_set.residual_bands:
        if bands.output in run.signals:
            column = run.signals.index(bands.output)
            height = data.column(parameter_set.partition.scheduling)
            share = inside(
                bands, data.sample_time, height, run.reference[:, column], run.outputs[:, column]
            ).whole
            if math.isfinite(share):
                shares[bands.output] = share
    return shares


def _refuse_unfit(fmu: OpenFmu, experiments: Sequence[DataSet]) -> None:
    """Refuse experiments that do not fit an FMU, all of them, before the first one runs."""
    found: list[Problem] = []
    for data in experiments:
        try:
            mapped_signals(fmu, data)
        except DataError as refused:
            found += refused.problems
    if found:
        raise DataError(found)


def _with_outputs_of(
    fmu: OpenFmu, data: DataSet, start_values: Mapping[str, float | int | bool | str]
) -> DataSet:
    """Return the inputs of a data set with the outputs that a reference FMU gives for them."""
    real = [item for item in fmu.description.modelVariables if item.type == "Real"]
    inputs = tuple(item.name for item in real if item.causality == "input")
    outputs = tuple(item.name for item in real if item.causality == "output")
    with running_fmu(fmu, "reference") as instance:
        values = instance.run(data.matrix(inputs), inputs, outputs, data.sample_time, start_values)
    units = tuple(item.unit or "" for item in real if item.causality == "output")
    return data.select(inputs).with_columns(outputs, units, values)
