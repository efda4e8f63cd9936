"""What the page of the white-box study shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cosimulation.report.tables import Cell, Row, number
from cosimulation.study.page import Drawing, Section, TextTable
from cosimulation.study.white_box.height import CURVE, ERROR
from cosimulation.study.white_box.height_figures import over_duration, over_height
from cosimulation.study.white_box.poles import MODE, PIECES, STEP
from cosimulation.study.white_box.resonances import FOUND
from cosimulation.study.white_box.settings import WhiteBoxSettings
from cosimulation.study.white_box.table_2_1 import STATISTICS

Records = Sequence[Mapping[str, Any]]
_RESONANCES = """Responses of the white-box FMU to steps of the contact height from rest, transformed as the
thesis does; in every band the highest peak. Small figures below ours are those of thesis Table 2.1. Set A is
calibrated to that table, so it is a check of the simulation, not a prediction; set Blow keeps a soft
collector head, which pins the highest resonance. The thesis found no f_H in F_p; here it is there."""
_STATIC = """Contact force at rest. The thesis: nearly independent of the height, nearly linear in the torque.
The slope at rest differs a little from 1/z1, because the elastic knee gives way."""
_POLES = """The white-box FMU linearised through its directional derivatives at many heights. The thesis: the
entries of the discrete matrices and the poles change in a continuous fashion. Of a path without jumps the
largest step halves when the heights are twice as dense; with a jump it stays."""
_HEIGHT = """The thesis (2.1.3) sees the potential to infer the height from the modes. Here it is built: modes
are identified from a short record at a height nobody tells, its mean removed, and compared with the modes of
the linearised model over the height. Where the wire's motion is measured, the modes come out sharp. Where it
is the unmeasured noise that drives the modes, their frequencies scatter by sqrt(zeta f / (2 pi T)), and so
does the height, as far as its curve foretells. The thesis expects two heights for one f_H, and f_M to decide
between them; of these sets f_L (A) and f_M (Blow) turn round, at low heights, and f_H falls throughout (A) or
hardly moves at all (Blow). At low heights all three modes of A stand nearly still: there the height of a wire
that is not measured stays uncertain, however the modes are weighed."""


def sections(settings: WhiteBoxSettings, _: Records, findings: Records) -> list[Section]:
    """Return the sections of the page.

    Args:
        settings: Of the study.
        findings: Records that begin with `measure`, `drawing` or `information`.
    """
    by_set = {wbm: [one for one in findings if one.get("wbm") == wbm] for wbm in settings.sets}
    return [
        Section(
            "Resonances of step responses",
            _RESONANCES,
            figures=_drawn(by_set, "surfaces"),
            text_tables=[_resonances(wbm, found) for wbm, found in by_set.items()],
        ),
        Section("At rest", _STATIC, figures=_drawn(by_set, "static"), text_tables=[_static(by_set)]),
        Section(
            "Poles over the operating range",
            _POLES,
            figures=_drawn(by_set, "paths"),
            text_tables=[
                *(_modes(wbm, found) for wbm, found in by_set.items()),
                _paths(by_set),
                _steps(by_set),
            ],
        ),
        _height(settings, by_set),
    ]


def _drawn(by_set: Mapping[str, Records], what: str) -> list[Drawing]:
    return [
        Drawing(Markup(one["svg"]), one["caption"])
        for found in by_set.values()
        for one in found
        if one.get("drawing") == what
    ]


def _measured(found: Records, measure: str) -> list[Mapping[str, Any]]:
    return [one for one in found if one.get("measure") == measure]


def _resonances(wbm: str, found: Records) -> TextTable:
    cells = {(one["band"], one["signal"], one["statistic"]): one for one in _measured(found, FOUND)}
    signals = list(dict.fromkeys(signal for _, signal, _ in cells))
    rows: list[Row] = []
    for band in dict.fromkeys(band for band, _, _ in cells):
        rows.append(Row(f"{band} [Hz]", (), "group"))
        for statistic in STATISTICS:
            shown = tuple(_resonance(cells[band, signal, statistic]) for signal in signals)
            rows.append(Row(statistic, shown))
    steps = max(one["steps"] for one in cells.values())
    caption = f"White-box set {wbm}: resonances of up to {steps} steps; below ours the thesis's (Table 2.1)."
    return TextTable(caption, "", signals, rows)


def _resonance(one: Mapping[str, Any]) -> Cell:
    ours = "none" if one["value"] is None else number(one["value"], 3)
    theirs = "none" if one["thesis"] is None else number(one["thesis"], 3)
    both = one["value"] is not None and one["thesis"] is not None
    apart = f" ({round(one['value'] - one['thesis'], 3) + 0.0:+.3f})" if both else ""
    return Cell(ours, small=theirs + apart.replace("-", "\N{MINUS SIGN}"))


def _static(by_set: Mapping[str, Records]) -> TextTable:
    rows: list[Row] = []
    quantities: dict[str, str] = {}
    for found in by_set.values():
        quantities |= {one["quantity"]: one["unit"] for one in _measured(found, "static")}
    for quantity, unit in quantities.items():
        digits = 4 if unit == "N/(N.m)" else 2
        cells = []
        for found in by_set.values():
            mine = {
                one["statistic"]: one["value"]
                for one in _measured(found, "static")
                if one["quantity"] == quantity
            }
            cells += [
                Cell(number(mine[key], digits)) if mine else Cell("none") for key in ("lowest", "highest")
            ]
        rows.append(Row(f"{quantity} [{unit}]", tuple(cells)))
    columns = [f"{wbm}, {what}" for wbm in by_set for what in ("lowest", "highest")]
    return TextTable(
        "Figures at rest over the operating range; F_p, slope and 1/z1 at the torque's operating point.",
        "",
        columns,
        rows,
    )


def _modes(wbm: str, found: Records) -> TextTable:
    mine = _measured(found, MODE)
    names = list(dict.fromkeys(one["mode"] for one in mine))
    rows = []
    for point in dict.fromkeys(one["point"] for one in mine):
        cells: list[Cell] = []
        for one in (one for one in mine if one["point"] == point):
            pole = f"{one['real']:.6f} + {one['imag']:.6f}j"
            cells += [Cell(number(one["value"], 3), small=pole), Cell(number(one["damping"], 4))]
        rows.append(Row(point, tuple(cells)))
    columns = [text for name in names for text in (f"f {name} [Hz], pole", f"damping {name}")]
    return TextTable(
        f"White-box set {wbm}: modes of the linearised model, f = |s| / 2 pi.", "", columns, rows
    )


def _paths(by_set: Mapping[str, Records]) -> TextTable:
    rows = []
    for wbm, found in by_set.items():
        for one in _measured(found, PIECES):
            texts = (
                f"{one['low']:.3f} .. {one['high']:.3f}",
                "rises" if one["rises"] else "falls",
                f"{one['least_slope']:.4f} .. {one['largest_slope']:.3f}",
                str(one["value"]),
            )
            rows.append(Row(f"{wbm}, mode {one['mode']}", tuple(Cell(text) for text in texts)))
    columns = (
        "frequency [Hz]",
        "from lowest to highest height",
        "|df/dh| [Hz/m]",
        "most heights of one frequency",
    )
    return TextTable("How the modes move with the height.", "", columns, rows)


def _steps(by_set: Mapping[str, Records]) -> TextTable:
    rows = [
        Row(f"{wbm}, {one['path']}", (Cell(number(one["value"], 3)),))
        for wbm, found in by_set.items()
        for one in _measured(found, STEP)
    ]
    caption = (
        "Largest step of a path over that with half as many heights: 0.5 of a path without jumps, 1 with one."
    )
    return TextTable(caption, "", ("ratio",), rows)


def _height(settings: WhiteBoxSettings, by_set: Mapping[str, Records]) -> Section:
    errors = {wbm: _measured(found, ERROR) for wbm, found in by_set.items()}
    curves = {wbm: one for wbm, found in by_set.items() for one in found if one.get("information") == CURVE}
    everything = {wbm: max((one["modes"] for one in mine), key=len) for wbm, mine in errors.items()}
    longest = max(settings.height.durations)
    together = {wbm: [one for one in mine if one["modes"] == everything[wbm]] for wbm, mine in errors.items()}
    blind = settings.height.routes[-1].name
    quiet = settings.height.noises[0]
    dots = {
        wbm: [one for one in mine if (one["duration"], one["route"], one["noise"]) == (longest, blind, quiet)]
        for wbm, mine in together.items()
    }
    return Section(
        "The height from the modes",
        _HEIGHT,
        figures=[over_duration(together), over_height(curves, dots, blind)],
        text_tables=[
            *(_by_duration(wbm, mine) for wbm, mine in together.items()),
            _foretold(together),
            *(_by_modes(wbm, mine, longest) for wbm, mine in errors.items()),
        ],
    )


def _by_duration(wbm: str, errors: Records) -> TextTable:
    durations = sorted({one["duration"] for one in errors})
    rows = []
    for route, noise in dict.fromkeys((one["route"], one["noise"]) for one in errors):
        mine = [one for one in errors if (one["route"], one["noise"]) == (route, noise)]
        cells = tuple(_error([one for one in mine if one["duration"] == duration]) for duration in durations)
        rows.append(Row(_named(route, noise), cells))
    caption = f"White-box set {wbm}: error of the height from all modes [m], median; below it the largest."
    return TextTable(caption, "measured; noise", [f"{duration:g} s" for duration in durations], rows)


def _foretold(by_set: Mapping[str, Records]) -> TextTable:
    """Return errors over the standard deviations that the estimator gave with them, rms over all records."""
    durations = sorted({one["duration"] for mine in by_set.values() for one in mine})
    rows = []
    for wbm, errors in by_set.items():
        for route, noise in dict.fromkeys((one["route"], one["noise"]) for one in errors):
            cells = []
            for duration in durations:
                ratios = [
                    one["value"] / one["foretold"]
                    for one in errors
                    if (one["route"], one["noise"], one["duration"]) == (route, noise, duration)
                    and one["value"] is not None
                    and one["foretold"]
                ]
                rms = float(np.sqrt(np.mean(np.square(ratios)))) if ratios else float("nan")
                cells.append(Cell(number(rms, 2)))
            rows.append(Row(f"{wbm}, {_named(route, noise)}", tuple(cells)))
    caption = (
        "Error of the height over the standard deviation foretold with it, root mean square: about 1 where "
        "the formula holds, less where measured inputs explain what drives the modes."
    )
    return TextTable(caption, "measured; noise", [f"{duration:g} s" for duration in durations], rows)


def _by_modes(wbm: str, errors: Records, longest: float) -> TextTable:
    mine = [one for one in errors if one["duration"] == longest]
    subsets = list(dict.fromkeys(one["modes"] for one in mine))
    rows = []
    for route, noise in dict.fromkeys((one["route"], one["noise"]) for one in mine):
        here = [one for one in mine if (one["route"], one["noise"]) == (route, noise)]
        rows.append(
            Row(
                _named(route, noise),
                tuple(_error([one for one in here if one["modes"] == m]) for m in subsets),
            )
        )
    caption = (
        f"White-box set {wbm}: which modes tell the height, records of {longest:g} s; error [m], median; "
        "below it the largest and in how many records a second height is nearly as likely."
    )
    return TextTable(caption, "measured; noise", [f"modes {subset}" for subset in subsets], rows)


def _error(records: Records) -> Cell:
    values = [2.0 if one["value"] is None else one["value"] for one in records]
    doubtful = sum(1 for one in records if one["others"])
    small = number(max(values), 3) + (f", {doubtful} of {len(values)} ambiguous" if doubtful else "")
    return Cell(number(float(np.median(values)), 4), small=small)


def _named(route: str, noise: str) -> str:
    return f"{route}; " + ("no noise" if noise == "none" else noise)
