"""Tables of the report: rows with the numbers as they are, and texts beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cosimulation.pantograph import SIGNALS, operating_point_name
from cosimulation.report import thesis
from cosimulation.report.modes import Mode, compared, mode_name, modes_of_set
from cosimulation.report.verdict import MINUS, times
from cosimulation.report.views import ModelView, SetView

_RED, _YELLOW, _GREEN = (246, 168, 158), (250, 236, 165), (160, 214, 160)


@dataclass(frozen=True)
class Cell:
    """One figure of a table.

    Attributes:
        text: As shown.
        value: As it is in scores.json, exact; "" where there is none.
        colour: Background, "" for none.
        small: A second, smaller figure.
        note: Shown behind it.
    """

    text: str
    value: str = ""
    colour: str = ""
    small: str = ""
    note: str = ""


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        head: Name of the row.
        cells: Its figures.
        kind: "ours", "thesis", "mark" (ours, recommended) or "group".
    """

    head: str
    cells: tuple[Cell, ...]
    kind: str = "ours"


def number(value: float, digits: int = 2) -> str:
    """Return a number with a fixed number of decimals and a typographic minus, which zero has not."""
    return f"{value:z.{digits}f}".replace("-", MINUS) if np.isfinite(value) else "not finite"


def significant(value: float, digits: int = 4) -> str:
    """Return a number with some significant digits, without an exponent where that is short."""
    if value != 0.0 and not 1e-3 <= abs(value) < 1e6:
        mantissa, exponent = f"{value:.{digits - 2}e}".split("e")
        return f"{mantissa}e{int(exponent)}".replace("-", MINUS)
    decimals = digits - 1 - int(np.floor(np.log10(abs(value)))) if value != 0.0 else 0
    return number(value, min(max(decimals, 0), 4))


def colour_of(fit: float) -> str:
    """Return red at 0, yellow at 50 and green at 100 % (thesis Figure 4.20), light enough for dark text."""
    share = float(np.clip(fit, 0.0, 100.0)) / 50.0
    low, high, part = (_RED, _YELLOW, share) if share <= 1.0 else (_YELLOW, _GREEN, share - 1.0)
    mixed = [round(a + (b - a) * part) for a, b in zip(low, high, strict=True)]
    return "#" + "".join(f"{channel:02x}" for channel in mixed)


def fit_rows(view: SetView) -> tuple[Row, ...]:
    """Return a row per model: FIT of every signal, largest error of F_p; thesis rows between."""
    rows = []
    for model in view.models:
        cells = [_fit_cell(model, signal) for signal in SIGNALS]
        worst = model.max_error("F_p")
        small = number(model.max_error("F_p", "validation"), 1)
        cells.append(Cell(number(worst, 1), _exact(model, "F_p", "max_error"), small=small))
        rows.append(Row(model.title, tuple(cells), "mark" if model.recommended else "ours"))
        if model.published is not None:
            fits = model.published.fits
            published = [
                Cell(number(fits[name]), repr(fits[name]), colour_of(fits[name])) for name in SIGNALS
            ]
            rows.append(Row(model.published.title, (*published, Cell("")), "thesis"))
    return tuple(rows)


def _exact(model: ModelView, signal: str, field: str) -> str:
    value = model.records["test", signal][field]
    return "" if value is None else repr(value)


def _fit_cell(model: ModelView, signal: str) -> Cell:
    fit = model.fit(signal)
    validation = number(model.fit(signal, "validation"))
    return Cell(number(fit), _exact(model, signal, "fit"), colour_of(fit), validation)


def pole_rows(view: SetView) -> tuple[Row, ...]:
    """Return frequency and damping ratio of every mode at every operating point, reference and models."""
    rows = []
    for point in modes_of_set(view):
        place = f"{operating_point_name(point.height)}, {point.height:g} m"
        rows.append(Row(place, (), "group"))
        rows.append(Row("linearised white-box model", tuple(map(_mode_cell, point.reference))))
        for model in compared(view):
            cells = [_mode_cell(mode) for mode in point.models[model.title]]
            others = "; ".join(_other_pole(mode) for mode in point.others[model.title])
            head = f"{model.title}, also {others}" if others else model.title
            rows.append(Row(head, tuple(cells)))
    return tuple(rows)


def mode_names(view: SetView) -> tuple[str, ...]:
    """Return the names of the reference's modes, empty without linearisations."""
    points = modes_of_set(view)
    count = len(points[0].reference) if points else 0
    return tuple(mode_name(index, count) for index in range(count))


def _mode_cell(mode: Mode | None) -> Cell:
    if mode is None:
        return Cell("none")
    return Cell(f"{mode.frequency:.3f}", repr(mode.frequency), small=number(mode.damping, 4))


def _other_pole(mode: Mode) -> str:
    kind = f"pair, damping {mode.damping:.3f}" if mode.oscillates else "real"
    return f"{mode.frequency:.3g} Hz ({kind})"


def step_rows(sets: Sequence[SetView], steps: Sequence[dict[str, object]]) -> tuple[Row, ...]:
    """Return step times: the white-box FMU, then every model on every set, beside Table 4.4."""
    named = {model.candidate.name: (model, view) for view in sets for model in view.models}
    others = [item for item in steps if item["fmu"] not in named]
    rows = [_step_row(f"white-box model ({item['fmu']})", item, "white_box") for item in others]
    for view in sets:
        rows.append(Row(f"set {view.name}", (), "group"))
        for model in view.models:
            if model.step_time is not None:
                rows.append(_step_row(model.title, dict(model.step_time), model.parameter_set.kind))
    return tuple(rows)


def _step_row(title: str, item: dict[str, object], kind: str) -> Row:
    own, python = float(str(item["own_ns"])), float(str(item["python_ns"]))
    factor, speed = float(str(item["real_time_factor"])), float(str(item["speed_up"]))
    published = thesis.REAL_TIME_FACTORS.get(kind)
    cells = (
        Cell(number(own, 1), repr(own)),
        Cell(number(python, 0), repr(python)),
        Cell(significant(factor, 3), repr(factor)),
        Cell(times(speed), repr(speed)),
        Cell(f"{published[0]:.3g} \N{EN DASH} {published[1]:.3g}" if published else ""),
    )
    return Row(title, cells)
