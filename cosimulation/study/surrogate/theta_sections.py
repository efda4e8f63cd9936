"""Theta of the surrogate study: beside the truth and Table 4.3, over the height, and what tells it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosimulation.report import thesis
from cosimulation.report.tables import Cell, number, significant
from cosimulation.report.tables import Row as TextRow
from cosimulation.study.page import Section, TextTable
from cosimulation.study.surrogate.physics import THETA_ERROR, WHICH
from cosimulation.study.surrogate.settings import SurrogateStudySettings
from cosimulation.study.tables import with_noise
from identification.surrogate import STRUCTURES

Records = Sequence[Mapping[str, Any]]
_TEXT = """Theta of every local model, median over the seeds, beside the chain that behaves exactly as the
linearised white-box model (chain9; a parameter that this structure lacks is zero there or not). Behind
\N{PLUS-MINUS SIGN} the standard error that one seed's data tell (median over the seeds), then the scatter over
the seeds (standard deviation). The thesis identified another reference from another start: the same letter need
not be the same number."""


def theta_sections(settings: SurrogateStudySettings, findings: Records) -> list[Section]:
    """Return the sections on theta of every configuration that is shown in detail."""
    thetas = [one for one in findings if "theta" in one]
    errors = [one for one in findings if one.get("measure") == THETA_ERROR]
    found = []
    for one in settings.configurations:
        if not one.detailed or one.surrogate is None:
            continue
        tables = []
        for wbm in settings.sets:
            mine = [item for item in thetas if (item["route"], item["wbm"]) == (one.name, wbm)]
            for noise in one.noises:
                of_noise = [item for item in mine if item["noise"] == noise]
                if of_noise and noise != "none":
                    tables.append(_theta_table(wbm, noise, one.surrogate.structure, of_noise))
            wrong = [item for item in errors if (item["route"], item["wbm"]) == (one.name, wbm)]
            if wrong:
                tables.append(_error_table(wbm, wrong))
        found.append(Section(f"Theta of {one.name}", _TEXT, text_tables=tables))
    return found


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
        published = thesis.SURROGATE_PARAMETERS.get(parameter.name, ())
        unit = ""
        if not published and parameter.name == "b_M":
            published = tuple(1.0 / value for value in thesis.SURROGATE_PARAMETERS["r_M"])
            unit = ", 1/r_M"
        if len(published) == len(heights):
            cells = [Cell(number(value), repr(value)) for value in published]
            rows.append(TextRow(f"thesis, Table 4.3{unit}", tuple(cells), "thesis"))
    columns = [f"LLM {index + 1}, {height:g} m" for index, height in enumerate(heights)]
    return TextTable(f"White-box set {wbm}{with_noise(noise)}.", "parameter", columns, rows)


def _theta_cell(items: Records) -> Cell:
    """Return the median over the seeds, standard error and scatter, and on how many seeds it is at a bound."""
    values = np.array([item["value"] for item in items])
    errors = [item["error"] for item in items if item.get("error") is not None]
    small = []
    if errors:
        small.append(f"\N{PLUS-MINUS SIGN} {significant(float(np.median(errors)), 3)}")
    if len(values) > 1:
        small.append(f"scatter {significant(float(values.std(ddof=1)), 3)}")
    bounds = sorted({item["bound"] for item in items if item["bound"]})
    value = float(np.median(values))
    return Cell(significant(value), repr(value), small=", ".join(small), note=" and ".join(bounds))


def _error_table(wbm: str, items: Records) -> TextTable:
    points = sorted({item["height"] for item in items})
    rows = []
    for noise, which in dict.fromkeys((item["noise"], item["which"]) for item in items):
        mine = [item for item in items if (item["noise"], item["which"]) == (noise, which)]
        rows.append(TextRow(f"{which} theta{with_noise(noise) or ', without noise'}", (), "group"))
        for parameter in dict.fromkeys(item["parameter"] for item in mine):
            cells = []
            for height in points:
                chosen = [
                    item["value"]
                    for item in mine
                    if (item["parameter"], item["height"]) == (parameter, height) and item["value"] is not None
                ]
                worst = number(max(chosen), 3) if len(chosen) > 1 else ""
                cells.append(Cell(number(float(np.median(chosen)), 3), small=worst) if chosen else Cell("none"))
            rows.append(TextRow(parameter, tuple(cells)))
    caption = f"White-box set {wbm}. How far theta is from the exact one [%]: median, below it the worst seed."
    return TextTable(caption, "parameter", [f"{height:g} m" for height in points], rows)
