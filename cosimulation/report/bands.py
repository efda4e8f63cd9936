"""How far off a prediction is: tables of error bands, and what of the test data lies inside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cosimulation.bands import output_units
from cosimulation.report.tables import Cell, Row, number, significant
from cosimulation.report.verdict import percent
from cosimulation.report.views import ModelView, SetView
from cosimulation.scoring import DECIDING_SIGNAL
from fmu_builder.parameter_set import ParameterSet, ResidualBands
from identification.residuals import SPECIFIED, Inside, inside


@dataclass(frozen=True)
class BandTable:
    """Error bands of one output of one model.

    Attributes:
        title: Of the model, or the output.
        caption: What the figures are.
        scheduling: Name and unit of what the rows range over.
        unit: Of the output.
        columns: Titles of the bands of frequency.
        rows: One per height.
        tested: Whether the last column tells what of the test data lies inside.
        summary: What the figures say, in a sentence or two.
        best: Whether it is the best model of its set.
    """

    title: str
    caption: str
    scheduling: str
    unit: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    tested: bool
    summary: str
    best: bool = False


def model_tables(parameter_set: ParameterSet) -> list[BandTable]:
    """Return the error bands of a parameter set, a table per output."""
    return [_table(parameter_set, one, one.output, None) for one in parameter_set.residual_bands]


def set_tables(view: SetView) -> list[BandTable]:
    """Return the error bands of the contact force beside test data, the best model first.

    Not of a model whose mean error is subtracted after the simulation: its bands are those of its FMU, which
    cannot do that.
    """
    found = []
    for model in sorted(view.models, key=lambda one: one is not view.best):
        bands = model.bands
        if bands is not None:
            best = model is view.best
            found.append(_table(model.parameter_set, bands, model.title, _tested(view, model, bands), best))
    return found


def without_bands(view: SetView) -> tuple[str, ...]:
    """Return the titles of the models that `set_tables` leaves out."""
    return tuple(model.title for model in view.models if model.bands is None)


def outside_rows(view: SetView) -> tuple[Row, ...]:
    """Return a row per model: share of time out of the trained range on validation and on test data."""
    return tuple(
        Row(model.title, tuple(_share(model.runs[split].out_of_range) for split in ("validation", "test")))
        for model in view.models
    )


def _share(value: float | None) -> Cell:
    return Cell("not told") if value is None else Cell(percent(100.0 * value, 2), repr(value))


def _tested(view: SetView, model: ModelView, bands: ResidualBands) -> Inside:
    with np.errstate(over="ignore", invalid="ignore"):
        return inside(
            bands,
            view.sample_time,
            view.reference("eta"),
            view.reference(DECIDING_SIGNAL),
            model.output(DECIDING_SIGNAL),
        )


def _table(
    parameter_set: ParameterSet, bands: ResidualBands, title: str, tested: Inside | None, best: bool = False
) -> BandTable:
    scheduling = parameter_set.inputs[parameter_set.scheduling_index]
    unit = output_units(parameter_set)[bands.output]
    return BandTable(
        title,
        f"What {100.0 * bands.coverage:g} % of the errors of {bands.output} on held-out data"
        f" ({', '.join(bands.held_out)}) do not exceed, by height and band of frequency; in small print"
        " amplitude (model over reference) and phase (model less reference) in that band.",
        f"{scheduling.name} [{scheduling.unit}]",
        unit,
        tuple(f"{low:g} to {high:g} Hz" for low, high in pairwise(bands.frequencies)),
        tuple(_rows(bands, tested)),
        tested is not None,
        " ".join(filter(None, (_specified(bands), _kept(bands, tested)))),
        best,
    )


def _rows(bands: ResidualBands, tested: Inside | None) -> list[Row]:
    rows = []
    for index, (low, high) in enumerate(pairwise(bands.positions)):
        cells = [Cell(f"{bands.seconds[index]:.1f}", repr(bands.seconds[index])), _bound(bands.total[index])]
        answers = zip(bands.bound[index], bands.amplitude[index], bands.phase[index], strict=True)
        cells += [_bound(bound, _answer(amplitude, phase)) for bound, amplitude, phase in answers]
        if tested is not None:
            share = float(tested.total[index])
            told = np.isfinite(share)
            cells.append(Cell(percent(100.0 * share), repr(share)) if told else Cell("no data"))
        rows.append(Row(f"{low:g} to {high:g}", tuple(cells)))
    return rows


def _bound(value: float | None, small: str = "") -> Cell:
    return Cell("no data") if value is None else Cell(significant(value, 3), repr(value), small=small)


def _answer(amplitude: float | None, phase: float | None) -> str:
    if amplitude is None or phase is None:
        return ""
    return f"{amplitude:.3f}, {number(round(float(np.degrees(phase)), 2) + 0.0)}\N{DEGREE SIGN}"


def _specified(bands: ResidualBands) -> str:
    """Say how amplitude and phase match up to the specified frequency."""
    columns = [k for k, high in enumerate(bands.frequencies[1:]) if high <= SPECIFIED]

    def told(entries: Sequence[Sequence[float | None]]) -> list[float]:
        return [value for row in entries for k in columns if (value := row[k]) is not None]

    amplitudes, phases = told(bands.amplitude), np.degrees(told(bands.phase))
    if not amplitudes:
        return ""
    rows = zip(pairwise(bands.positions), bands.amplitude, strict=True)
    heights = [f"{low:g} to {high:g}" for (low, high), row in rows if told([row])]
    elsewhere = len(heights) < len(bands.amplitude)
    return (
        f"Up to {bands.frequencies[columns[-1] + 1]:g} Hz the amplitude is {min(amplitudes):.3f} to"
        f" {max(amplitudes):.3f} times that of the reference, the phase off by"
        f" {number(float(np.abs(phases).max()))}\N{DEGREE SIGN} at most, in the mean over a band."
        + (f" Only the heights {', '.join(heights)} tell it." if elsewhere else "")
    )


def _kept(bands: ResidualBands, tested: Inside | None) -> str:
    if tested is None or not np.isfinite(tested.whole):
        return ""
    shares = 100.0 * tested.total[np.isfinite(tested.total)]
    return (
        f"On test data {percent(100.0 * tested.whole)} of the errors are inside their height's bound"
        f" ({percent(float(shares.min()))} to {percent(float(shares.max()))} by height), where the bands"
        f" promise {100.0 * bands.coverage:g} %."
    )
