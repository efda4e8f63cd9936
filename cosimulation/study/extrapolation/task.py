"""What the study runs: every cause, value by value, white-box model and networks, by every policy."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosimulation.fmu_file import OpenFmu
from cosimulation.pantograph import INPUTS, SIGNALS
from cosimulation.study.extrapolation.inputs import input_limits, inputs_of
from cosimulation.study.extrapolation.settings import Cause, ExtrapolationSettings
from cosimulation.study.side_by_side import (
    SAMPLE_TIME,
    WHITE_BOX,
    NetworkRun,
    Record,
    SideBySide,
    measured,
    network_labels,
    side_by_side,
)
from fmu_builder.errors import FmuError
from identification.arrays import Array
from identification.scores import records, scored_rows

WARN, CLAMP = "warn", "clamp"
POLICY_PARAMETER = "out_of_range"
QUANTILE_MEASURE = "95 % quantile of the error of F_p"
RATIO_MEASURE = "error against that inside"
_F_P = SIGNALS.index("F_p")


@dataclass(frozen=True)
class ExtrapolationTask:
    """All runs of one white-box set with one draw.

    Attributes:
        white_box: The white-box FMU.
        wbm: The white-box set.
        seed: Of the draw.
        settings: The study's.
    """

    white_box: Path
    wbm: str
    seed: int
    settings: ExtrapolationSettings


def tasks(settings: ExtrapolationSettings, white_box: Path) -> list[ExtrapolationTask]:
    """Return the independent tasks of the study."""
    return [
        ExtrapolationTask(white_box, wbm, seed, settings) for wbm in settings.sets for seed in settings.seeds
    ]


def run_task(task: ExtrapolationTask) -> list[Record]:
    """Return scores and findings."""
    found: list[Record] = []
    with side_by_side(task.wbm, task.white_box) as pair:
        for cause in task.settings.causes:
            if cause.name == "frequency" and task.seed != task.settings.seeds[0]:
                continue  # no draw has part in it
            runs = [record for value in cause.values for record in _value(task, pair, cause, value)]
            found += [*runs, *_against_inside(cause, runs)]
    return found


def policies(fmu: OpenFmu) -> tuple[str, ...]:
    """Return by which policies inputs out of range can be served; an FMU without the choice warns."""
    for variable in fmu.description.modelVariables:
        items = getattr(variable.declaredType, "items", None) or ()
        if variable.name == POLICY_PARAMETER and CLAMP in [item.name for item in items]:
            return WARN, CLAMP
    return (WARN,)


def situation(cause: str, value: float, policy: str) -> str:
    """Return the name of a record, under which its scores are."""
    return f"{cause} {value:g}, {policy}"


def _value(task: ExtrapolationTask, pair: SideBySide, cause: Cause, value: float) -> Iterator[Record]:
    """Yield what every network does at one value of a cause."""
    inputs = inputs_of(cause, value, task.settings, task.seed)
    labels = {
        "wbm": task.wbm,
        "network": WHITE_BOX,
        "seed": task.seed,
        "cause": cause.name,
        "at": value,
        "policy": WARN,
    }
    reference: Array | None = None
    try:
        reference = pair.reference(inputs)
    except FmuError as refused:
        yield {**measured("white-box model gave out", 1.0, "1", labels), "said": str(refused)}
    else:
        yield {**measured("white-box model gave out", 0.0, "1", labels), "said": ""}
        force = reference[scored_rows(len(reference)), _F_P]
        yield measured("standard deviation of F_p", float(force.std()), "N", labels)
    rate = float(np.abs(np.diff(inputs[:, INPUTS.index("eta")])).max()) / SAMPLE_TIME
    yield measured("largest rate of the wire from tick to tick", rate, "m/s", labels)
    for network, fmu in pair.networks.items():
        offered = policies(fmu)
        for policy in offered:
            start = {POLICY_PARAMETER: policy} if len(offered) > 1 else {}
            own = {**labels, "network": network, "policy": policy}
            try:
                run = pair.network(network, inputs, start)
            except FmuError as refused:
                yield {**measured("run that failed", 1.0, "1", own), "said": str(refused)}
                continue
            yield {**measured("run that failed", 0.0, "1", own), "said": ""}
            yield from _told(run, inputs, own)
            if reference is not None:
                yield from _compared(reference, run.outputs, own)
            if reference is not None and cause.name == "frequency":
                yield from _response(reference[:, _F_P], run.force, value, own)


def _told(run: NetworkRun, inputs: Array, labels: Record) -> Iterator[Record]:
    """Yield what the FMU says of its inputs, and whether it keeps silent about one beyond its limits."""
    low, high = input_limits(labels["network"])
    outside = ((inputs < low) | (inputs > high)).any(axis=1)
    yield measured("time out of range", 100.0 * float(np.mean(~run.in_range)), "%", labels)
    yield measured("time beyond the limits of the inputs", 100.0 * float(np.mean(outside)), "%", labels)
    silent = outside[:-1] & run.in_range[1:]  # in_range is about the inputs of the tick before
    yield measured("samples beyond the limits not told", float(np.sum(silent)), "1", labels)
    yield measured("largest |F_p| of the network", float(np.abs(run.force).max()), "N", labels)


def _compared(reference: Array, outputs: Array, labels: Record) -> Iterator[Record]:
    """Yield scores and errors of the contact force, both [N, 6]; the last 75 % count."""
    name = situation(labels["cause"], labels["at"], labels["policy"])
    scores = network_labels(labels["wbm"], labels["network"], name, labels["seed"])
    yield from records(reference, outputs, SIGNALS, scores)
    rows = scored_rows(len(outputs))
    theirs, ours = reference[rows, _F_P], outputs[rows, _F_P]
    error = np.abs(ours - theirs)
    yield measured(QUANTILE_MEASURE, float(np.quantile(error, 0.95)), "N", labels)
    yield measured("largest error of F_p", float(error.max()), "N", labels)
    yield measured("error of mean F_p", abs(float(ours.mean() - theirs.mean())), "N", labels)
    size = float(np.abs(outputs[:, _F_P]).max() / np.abs(reference[:, _F_P]).max())
    yield measured("largest |F_p| beside the white-box model's", size, "1", labels)


def _response(reference: Array, force: Array, frequency: float, labels: Record) -> Iterator[Record]:
    """Yield amplitude and phase of the contact force at a frequency beside the reference's."""
    ours, theirs = (phasor(one, frequency) for one in (force, reference))
    yield measured("amplitude of F_p beside the white-box model's", abs(ours / theirs), "1", labels)
    yield measured(
        "phase of F_p less the white-box model's", float(np.angle(ours / theirs, deg=True)), "deg", labels
    )


def phasor(signal: Array, frequency: float) -> complex:
    """Return amplitude and phase of a signal at a frequency [Hz], by least squares on the last 75 %."""
    rows = scored_rows(len(signal))
    phase = 2.0 * np.pi * frequency * SAMPLE_TIME * np.arange(len(signal))[rows]
    basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones(len(phase))])
    cosine, sine, _ = np.linalg.lstsq(basis, signal[rows], rcond=None)[0]
    return complex(cosine, -sine)


def _against_inside(cause: Cause, runs: Sequence[Record]) -> Iterator[Record]:
    """Yield every error over that of the same network and policy inside its trained region."""
    errors = [item for item in runs if item.get("measure") == QUANTILE_MEASURE and item["value"] is not None]
    inside = {
        (item["network"], item["policy"]): item["value"] for item in errors if item["at"] == cause.inside
    }
    for item in errors:
        if (base := inside.get((item["network"], item["policy"]))) is not None:
            labels = {key: item[key] for key in ("wbm", "network", "seed", "cause", "at", "policy")}
            yield measured(RATIO_MEASURE, item["value"] / base, "1", labels)
