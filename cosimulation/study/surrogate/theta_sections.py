"""Theta of the surrogate study: beside the truth and Table 4.3, over the height, and what tells it."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cosimulation.report.figures.drawing import INK, PALETTE
from cosimulation.report.figures.theta import ThetaPanel, ThetaSeries, theta_figure
from cosimulation.report.surrogate import INFORMATION, THETAS, exponent, published_rows
from cosimulation.report.tables import Cell, number, significant
from cosimulation.report.tables import Row as TextRow
from cosimulation.study.page import Drawing, Section, TextTable
from cosimulation.study.surrogate.physics import THETA_ERROR, WHICH
from cosimulation.study.surrogate.settings import ACCEPTANCE_NOISE, SurrogateStudySettings
from cosimulation.study.tables import with_noise
from identification.surrogate import STRUCTURES

_EXACT = "exact, linearised white-box model"
_NONE = np.zeros(0)
_NUMBERS = re.compile(r"\[\d+\]| = \S+ \+- \S+( [^ ]+(?= cannot))?| \(correlation [^)]*\)")
_FISHER = """Exponents of ten of the Fisher information of every parameter, in its own unit, in every state,
the state in its standard deviation about rest; summed over the local models, median over the seeds
(thesis Table 5.2)."""
_AGREEMENT = """Standard error that one seed's data tell (median over the seeds) over the scatter over the
seeds: median over the local models, below it the smallest and the largest. One means that the errors tell
the truth; eight seeds know a scatter to 25 %. Seeds differ in excitation, too, and a linear chain of a
nonlinear reference follows the excitation: below one, the data of one seed do not show all of that. Random
linear plants, where noise is all there is, are the benchmark's: tests.benchmarks.surrogate_plants."""
_FEWEST_SEEDS = 3
Records = Sequence[Mapping[str, Any]]
_TEXT = """Theta of every local model, median over the seeds, beside the chain that behaves exactly as the
linearised white-box model (chain9). Behind \N{PLUS-MINUS SIGN} the standard error that one seed's data tell
(median over the seeds), in brackets the scatter over the seeds (standard deviation). The thesis identified
another reference from another start: the same letter need not be the same number."""


def noise_name(noise: str) -> str:
    """Return what is added to the name of a model for noise other than the acceptance recipe's."""
    if noise == ACCEPTANCE_NOISE:
        return ""
    return ", without noise" if noise == "none" else with_noise(noise)


def theta_sections(settings: SurrogateStudySettings, findings: Records) -> list[Section]:
    """Return the sections on theta of every configuration that is shown in detail."""
    thetas = [one for one in findings if "theta" in one]
    errors = [one for one in findings if one.get("measure") == THETA_ERROR]
    found = []
    for one in settings.configurations:
        if not one.detailed or one.surrogate is None:
            continue
        tables = []
        parameters = STRUCTURES[one.surrogate.structure].parameters
        relative = {parameter.name for parameter in parameters if parameter.scaling == "log"}
        for wbm in settings.sets:
            mine = [item for item in thetas if (item["route"], item["wbm"]) == (one.name, wbm)]
            for noise in one.noises:
                of_noise = [item for item in mine if item["noise"] == noise]
                if of_noise and noise != "none":
                    tables.append(_theta_table(wbm, noise, one.surrogate.structure, of_noise))
                    tables += agreement_tables(wbm, noise, of_noise)
            wrong = [
                item
                for item in errors
                if (item["route"], item["wbm"]) == (one.name, wbm) and item["parameter"] in relative
            ]
            if wrong:
                tables.append(_error_table(wbm, wrong))
        drawn = [
            _figure(wbm, one.name, one.surrogate.structure, findings)
            for wbm in settings.sets
            if wbm in one.sets
        ]
        found.append(Section(f"Theta of {one.name}", _TEXT, figures=drawn, text_tables=tables))
        found.append(_information(settings, one.name, findings))
    return found


def _figure(wbm: str, route: str, structure: str, findings: Records) -> Drawing:
    """Return theta over the height: medians with standard errors, a dot per seed, the truth as a line."""
    mine = [one for one in findings if (one.get("route"), one.get("wbm")) == (route, wbm)]
    thetas = [one for one in mine if "theta" in one and one["noise"] != "none"]
    panels = []
    for parameter in STRUCTURES[structure].parameters:
        series = [
            ThetaSeries(
                _EXACT, INK, "", _NONE, _NONE, _NONE, line=(np.array(one["heights"]), np.array(one["values"]))
            )
            for one in mine
            if one.get("exact") == parameter.name
        ]
        for place, (which, name) in enumerate(THETAS):
            chosen = [one for one in thetas if (one["theta"], one["parameter"]) == (which, parameter.name)]
            heights = sorted({one["height"] for one in chosen})
            at = [[one for one in chosen if one["height"] == height] for height in heights]
            series.append(
                ThetaSeries(
                    name,
                    PALETTE[place],
                    "os"[place],
                    np.array(heights),
                    np.array([np.median([one["value"] for one in items]) for items in at]),
                    np.array([_median_error(items) for items in at]),
                    dots=[(one["height"], one["value"]) for one in chosen],
                )
            )
        panels.append(ThetaPanel(parameter.name, parameter.unit, series))
    svg = theta_figure(f"study-{wbm}-{structure}", panels)
    caption = (
        f"Set {wbm}: movement of theta over the height (thesis Figure 4.8). Median over the seeds with the "
        "standard error that one seed's data tell; dots: every seed."
    )
    return Drawing(Markup(svg), caption)


def _median_error(items: Records) -> float:
    errors = [one["error"] for one in items if one["error"] is not None]
    return float(np.median(errors)) if errors else float("nan")


def _information(settings: SurrogateStudySettings, route: str, findings: Records) -> Section:
    """Return Table 5.2 in shape, without and with the coupling over time, and what cannot be told."""
    tables = []
    for wbm in settings.sets:
        mine = [one for one in findings if (one.get("route"), one.get("wbm")) == (route, wbm)]
        for kind, what in INFORMATION.items():
            chosen = [one for one in mine if one.get("information") == kind]
            names = list(dict.fromkeys(one["parameter"] for one in chosen))
            rows = []
            for state in dict.fromkeys(one["state"] for one in chosen):
                cells = [
                    exponent(
                        float(
                            np.median(
                                [
                                    one["value"]
                                    for one in chosen
                                    if (one["state"], one["parameter"]) == (state, name)
                                ]
                            )
                        )
                    )
                    for name in names
                ]
                rows.append(TextRow(state, tuple(cells)))
            if rows:
                tables.append(TextTable(f"White-box set {wbm}. {what}", "state", names, rows))
    words = _words(settings.sets, route, findings)
    if words:
        caption = (
            "What the data do not tell after output error, and of how many local models over all seeds: "
            "correlations of 0.95 and more, and remarks."
        )
        columns = [f"set {wbm}" for wbm in settings.sets]
        tables.append(TextTable(caption, "what", columns, words))
    return Section(f"Fisher information of {route}", _FISHER, text_tables=tables)


def _words(sets: Sequence[str], route: str, findings: Records) -> list[TextRow]:
    """Return correlations and remarks without their numbers, and for how many local models they hold."""
    counts: dict[str, Counter[str]] = {wbm: Counter() for wbm in sets}
    totals: Counter[str] = Counter()
    for one in findings:
        lines = (*one["correlated"], *one["remarks"]) if one.get("reason") == route else ()
        if lines:
            totals[one["wbm"]] += one["llms"]
            counts[one["wbm"]].update(_NUMBERS.sub("", line) for line in lines)
    order = sum(counts.values(), Counter())
    return [
        TextRow(line, tuple(Cell(f"{counts[wbm][line]} of {totals[wbm]}") for wbm in sets))
        for line, _ in order.most_common()
    ]


def _theta_table(wbm: str, noise: str, structure: str, items: Records) -> TextTable:
    heights = sorted({item["height"] for item in items})
    rows = []
    for parameter in STRUCTURES[structure].parameters:
        mine = [item for item in items if item["parameter"] == parameter.name]
        rows.append(TextRow(f"{parameter.name} [{parameter.unit}]", (Cell(parameter.description),), "group"))
        exact = {item["height"]: item["exact"] for item in mine}
        truth = tuple(Cell(significant(exact[height]), repr(exact[height])) for height in heights)
        rows.append(TextRow("exact, linearised white-box model", truth, "thesis"))
        for which in WHICH:
            chosen = [item for item in mine if item["theta"] == which]
            how = "; ".join(dict.fromkeys(item["found"] for item in chosen))
            cells = [_theta_cell([item for item in chosen if item["height"] == height]) for height in heights]
            rows.append(TextRow(f"{which}: {how}", tuple(cells)))
        rows += published_rows(parameter.name, len(heights))
    columns = [f"LLM {index + 1}, {height:g} m" for index, height in enumerate(heights)]
    return TextTable(f"White-box set {wbm}{noise_name(noise)}.", "parameter", columns, rows)


def _theta_cell(items: Records) -> Cell:
    """Return the median over the seeds, standard error and scatter, and the bounds it stands at."""
    values = np.array([item["value"] for item in items])
    errors = [item["error"] for item in items if item.get("error") is not None]
    small = []
    if errors:
        small.append(f"\N{PLUS-MINUS SIGN} {significant(float(np.median(errors)), 3)}")
    if len(values) > 1:
        small.append(f"({significant(float(values.std(ddof=1)), 3)})")
    bounds = sorted({item["bound"] for item in items if item["bound"]})
    value = float(np.median(values))
    return Cell(significant(value), repr(value), small=" ".join(small), note=" and ".join(bounds))


def agreement_tables(wbm: str, noise: str, items: Records) -> list[TextTable]:
    """Return standard errors over scatter, a row per theta, none for fewer than three seeds.

    Args:
        wbm: Name of the white-box set.
        noise: What was on the training data.
        items: Records of theta: parameter, height, value and error of every seed.
    """
    names = list(dict.fromkeys(item["parameter"] for item in items))
    rows = []
    for which in WHICH:
        cells = []
        for name in names:
            mine = [item for item in items if (item["theta"], item["parameter"]) == (which, name)]
            ratios = [
                ratio
                for height in sorted({item["height"] for item in mine})
                if (ratio := _agreement([item for item in mine if item["height"] == height])) is not None
            ]
            if ratios:
                ends = f"{number(min(ratios), 2)} .. {number(max(ratios), 2)}"
                middle = float(np.median(ratios))
                cells.append(Cell(number(middle, 2), repr(middle), small=ends))
            else:
                cells.append(Cell("none"))
        if any(cell.text != "none" for cell in cells):
            rows.append(TextRow(f"{which} theta", tuple(cells)))
    caption = f"White-box set {wbm}{noise_name(noise)}. {_AGREEMENT}"
    return [TextTable(caption, "standard error / scatter", names, rows)] if rows else []


def _agreement(items: Records) -> float | None:
    """Return the median standard error over the scatter of the same number over the seeds."""
    values = np.array([item["value"] for item in items])
    error = _median_error(items)
    if len(values) < _FEWEST_SEEDS or not np.isfinite(error) or not values.std() > 0.0:
        return None
    return float(error / values.std(ddof=1))


def _error_table(wbm: str, items: Records) -> TextTable:
    points = sorted({item["height"] for item in items})
    rows = []
    for noise, which in dict.fromkeys((item["noise"], item["which"]) for item in items):
        mine = [item for item in items if (item["noise"], item["which"]) == (noise, which)]
        rows.append(TextRow(f"{which} theta{noise_name(noise)}", (), "group"))
        for parameter in dict.fromkeys(item["parameter"] for item in mine):
            cells = []
            for height in points:
                chosen = [
                    item["value"]
                    for item in mine
                    if (item["parameter"], item["height"]) == (parameter, height)
                    and item["value"] is not None
                ]
                worst = number(max(chosen), 3) if len(chosen) > 1 else ""
                cells.append(
                    Cell(number(float(np.median(chosen)), 3), small=worst) if chosen else Cell("none")
                )
            rows.append(TextRow(parameter, tuple(cells)))
    caption = (
        f"White-box set {wbm}. How far theta is from the exact one [%]: median, below it the worst seed; "
        "parameters that cannot be zero."
    )
    return TextTable(caption, "parameter", [f"{height:g} m" for height in points], rows)
