"""Tables of the pages: ours, and the thesis's beside or below."""

from __future__ import annotations

import numpy as np

from cosimulation.pantograph import SIGNALS, operating_point_name
from cosimulation.report import thesis
from cosimulation.report.tables import Cell, Row, colour_of, number, significant
from cosimulation.study.compare.drawings import POLES
from cosimulation.study.compare.figures import PUBLISHED
from cosimulation.study.compare.members import LINEAR, ONE_N4SID, ONE_SURROGATE, in_thesis
from cosimulation.study.compare.results import SetResults, family_of
from cosimulation.study.compare.settings import CompareSettings
from cosimulation.study.compare.task import BATCH, LOOP, RELATIVE_ERROR, WHITE_BOX
from cosimulation.study.page import Row as FitRow
from cosimulation.study.page import Table, TextTable

_VALIDATION, _TRAINING = "wr_validation", "wr_train"
_SHORT = {
    "M1": "linearised", "M2": "surrogate", "M3": "n4sid, OB", "M4": "n4sid, PB", "T3": "n4sid, OB, LPF, LUT",
    "L1": "LOLIMOT",
}  # fmt: skip
_TIMED_IN_THESIS = {
    WHITE_BOX: "white_box",
    "M21": "surrogate",
    "M31": "n4sid",
    "T31": "n4sid",
    "L11": "lolimot",
}
_BLENDINGS = "OB and PB: output and parameter blending"


def named(label: str) -> str:
    """Return a model's number with what it is."""
    return "white-box model" if label == WHITE_BOX else f"{label} {_SHORT[label[:2]]}"


def fit_cell(fit: float) -> Cell:
    """Return a FIT [%] with its colour."""
    return Cell(number(fit), repr(fit), colour_of(fit))


def published(label: str) -> Cell:
    """Return the thesis's best FIT of F_p of such a model, empty where it has none."""
    return Cell(number(PUBLISHED[label]) if label in PUBLISHED else "")


def _below(figure: str) -> str:
    """Return a figure of the thesis to stand below ours, nothing where it has none."""
    return f"thesis\N{NO-BREAK SPACE}{figure}" if figure else ""


def quartiles(results: SetResults) -> TextTable:
    """Return the numbers of Figure 4.35."""
    rows: list[Row] = []
    for box in results.boxes():
        if not in_thesis(box.label) and not any(row.kind == "group" for row in rows):
            rows.append(Row("not in the thesis's figure", (), "group"))
        errors = [results.measured(RELATIVE_ERROR, box.label, one.name) for one in results.settings.signals()]
        worst = Cell(number(max(errors), 1), repr(max(errors)))
        rows.append(Row(named(box.label), (*map(fit_cell, box.quartiles), worst, published(box.label))))
    columns = ("smallest", "lower quartile", "median", "upper quartile", "largest", "largest error", "thesis")
    caption = (
        f"FIT of F_p over {len(results.settings.slew_rates)} test signals [%]; largest error of F_p on any "
        "of them in percent of the largest force; the thesis's best FIT on validation data (Table 4.6). "
        f"{_BLENDINGS}; LPF, LUT: with the thesis's low-pass and look-up table."
    )
    return TextTable(caption, "model", columns, rows)


def every_signal(results: SetResults) -> Table:
    """Return the FIT of every model on every test signal."""
    return Table(
        "FIT of F_p of every test signal [%], by the speed of the wire [m/s].",
        "model",
        [f"{rate:g}" for rate in results.settings.slew_rates],
        [FitRow(box.label, [(fit, None) for fit in box.fits]) for box in results.boxes()],
    )


def test_signals(settings: CompareSettings) -> TextTable:
    """Return what the test signals are."""
    rows = []
    for one in settings.signals():
        rate = one.slew_rate or 0.0
        way = rate * settings.signal_duration
        cells = (Cell(f"{rate:g}"), Cell(number(way)), Cell(number(way / (one.high - one.low))))
        rows.append(Row(one.name, cells))
    caption = f"The test signals, {settings.signal_duration:g} s each."
    return TextTable(caption, "signal", ("speed [m/s]", "way [m]", "passes of the range"), rows)


def real_time(results: SetResults) -> TextTable:
    """Return Table 4.4."""
    settings = results.settings
    name, point = operating_point_name(settings.operating_point), _point(settings)
    records = (f"{point}_train", f"{point}_validation", _TRAINING, _VALIDATION)
    timed = dict.fromkeys(one["model"] for one in results.findings if one.get("measure") == BATCH)
    reference = results.measured(BATCH, WHITE_BOX, _VALIDATION)
    rows = []
    for label in timed:
        theirs = thesis.REAL_TIME_FACTORS_BY_DATA.get(_TIMED_IN_THESIS.get(label, ""))
        cells = []
        for index, record in enumerate(records):
            factor = results.measured(BATCH, label, record)
            known = theirs[index] if theirs else None
            small = _below("" if known is None else f"{known:g}")
            cells.append(Cell(significant(factor, 3), repr(factor), small=small))
        loop = results.measured(LOOP, label, _VALIDATION)
        speed = reference / results.measured(BATCH, label, _VALIDATION)
        cells += [Cell(significant(loop, 3), repr(loop)), Cell(number(speed, 1), repr(speed))]
        rows.append(Row(named(label), tuple(cells)))
    columns = (f"{name}, T", f"{name}, V", "WR, T", "WR, V", "fmpy's loop", "against WBM")
    caption = (
        f"Real-time factor [1] on training (T) and validation (V) data, {settings.duration:g} s at the "
        f"operating point, {settings.whole_range_duration:g} s through the whole range (WR), by one batch "
        "call; by fmpy's own loop on the last of them; and how many times faster than the white-box model."
    )
    return TextTable(caption, "FMU", columns, rows)


def signals(results: SetResults) -> TextTable:
    """Return Table 4.5."""
    settings = results.settings
    name, point = operating_point_name(settings.operating_point), _point(settings)
    training, validation = f"{point}_train", f"{point}_validation"
    wanted = (
        (f"surrogate, 1 LLM, {name}, T", ONE_SURROGATE, training, thesis.ONE_SURROGATE_TRAINING),
        (f"surrogate, 1 LLM, {name}, V", ONE_SURROGATE, validation, thesis.ONE_SURROGATE),
        ("surrogate, 4 LLM, WR, T", "M21", _TRAINING, thesis.SURROGATE_TRAINING),
        ("surrogate, 4 LLM, WR, V", "M21", _VALIDATION, thesis.SURROGATE),
        (f"n4sid, 1 LLM, {name}, T", ONE_N4SID, training, thesis.ONE_N4SID_TRAINING),
        (f"n4sid, 1 LLM, {name}, V", ONE_N4SID, validation, thesis.ONE_N4SID),
        ("n4sid, 4 LLM, OB, WR, V", "M31", _VALIDATION, thesis.N4SID_OUTPUT),
        ("n4sid, 4 LLM, PB, WR, V", "M41", _VALIDATION, thesis.N4SID_PARAMETER),
    )
    rows = []
    for title, label, record, theirs in wanted:
        cells = []
        for signal in SIGNALS:
            ours = fit_cell(results.fit(label, record, signal))
            cells.append(Cell(ours.text, ours.value, ours.colour, _below(number(theirs.fits[signal]))))
        rows.append(Row(title, tuple(cells)))
    caption = f"FIT [%]. WR: whole range; {_BLENDINGS}; T: training, V: validation data."
    return TextTable(caption, "model, data", SIGNALS, rows)


def contact_force(results: SetResults) -> TextTable:
    """Return Table 4.6."""
    by_family: dict[str, list[str]] = {}
    for label in results.labels:
        by_family.setdefault(family_of(label), []).append(label)
    rows = []
    for family, labels in by_family.items():
        fits = [results.fit(label, _VALIDATION) for label in labels]
        best = labels[int(np.argmax(fits))]
        error = results.measured(RELATIVE_ERROR, best, _VALIDATION)
        theirs = thesis.LARGEST_RELATIVE_ERRORS.get(family)
        cells = (
            fit_cell(max(fits)),
            Cell(best),
            fit_cell(float(np.median(fits))),
            Cell(str(len(labels))),
            Cell("not legible") if family == LINEAR else published(labels[0]),
            Cell(number(error, 1), repr(error)),
            Cell("" if theirs is None else f"{theirs:g}"),
        )
        rows.append(Row(_SHORT[labels[0][:2]], cells))
    columns = ("best FIT", "of", "median", "models", "thesis", "largest error", "thesis")
    caption = (
        "FIT of F_p [%] on whole-range validation data, and the thesis's best; largest error of F_p of our "
        "best in percent of the largest force, and the thesis's maximum relative error, of which it does not "
        "say what it is relative to."
    )
    return TextTable(caption, "model", columns, rows)


def modes(results: SetResults) -> TextTable:
    """Return frequency and damping of the local models' modes."""
    found = results.drawing(POLES)
    columns = [f"mode {mode}" for mode in found["modes"]]
    return TextTable("Modes at the operating points.", "operating point, model", columns, found["rows"])


def _point(settings: CompareSettings) -> str:
    return f"op_{round(1000 * settings.operating_point):04d}"
