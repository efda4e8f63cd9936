"""What the page of the surrogate study shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup

from cosimulation.pantograph import SIGNALS
from cosimulation.report.tables import Cell
from cosimulation.report.tables import Row as TextRow
from cosimulation.study.page import Drawing, Row, Section, Table, TextTable
from cosimulation.study.surrogate.figures import Optimum, optima_figure
from cosimulation.study.surrogate.physics import FREQUENCY_ERROR
from cosimulation.study.surrogate.settings import (
    RECOMMENDED,
    ComparisonTable,
    SurrogateConfiguration,
    SurrogateStudySettings,
)
from cosimulation.study.surrogate.theta_sections import noise_name, theta_sections
from cosimulation.study.tables import Shown, by_configuration, fit_caption, statistics

Records = Sequence[Mapping[str, Any]]
_MODES = """Frequencies of the local models' modes against those of the white-box model linearised at the same
height through its own FMU: the difference in percent of the recommended theta's local models. Poles (thesis
Figure 4.33) and spectra at the operating points (Figures 4.16 to 4.18) are those of the first seed."""
_OPTIMA = """The frequency-response fit as it ships, which starts from the closed form and takes random starts
only where that fails, against random starts drawn within a pantograph's usual values. It misses the global
optimum if any start ends at a cost lower by more than a thousandth."""


def sections(settings: SurrogateStudySettings, scores: Records, findings: Records) -> list[Section]:
    """Return the sections of the page.

    Args:
        settings: Of the study.
        scores: Score records.
        findings: Records that begin with `reason`, `theta`, `measure`, `information`, `drawing`, `optima`.
    """
    shown = by_configuration(scores)
    found = [_comparison(settings, table, shown, findings) for table in settings.tables]
    found += theta_sections(settings, findings)
    found += [_modes(settings, findings)] if any(one.detailed for one in settings.configurations) else []
    found += [_optima(settings, findings)] if settings.local_optima else []
    return found


def _comparison(
    settings: SurrogateStudySettings, wanted: ComparisonTable, shown: Shown, findings: Records
) -> Section:
    """Return one comparison of FIT, and if asked for why each tuning stopped."""
    tables, reasons = [], []
    members = [one for one in settings.configurations if one.table == wanted.name]
    for wbm in settings.sets:
        rows = [
            Row(name, [statistics(shown.get(key, {}).get(signal, [])) for signal in SIGNALS], yardstick)
            for name, key, yardstick in _rows(members, wbm)
        ]
        tables.append(Table(fit_caption(wbm, len(settings.seeds)), "model, theta", SIGNALS, rows))
        if wanted.reasons:
            reasons.append(_reasons(members, wbm, findings))
    return Section(
        wanted.title,
        wanted.text,
        [one for one in tables if one.rows],
        text_tables=[r for r in reasons if r.rows],
    )


def _rows(members: Sequence[SurrogateConfiguration], wbm: str) -> Iterator[tuple[str, tuple[Any, ...], bool]]:
    """Yield name, key of the scores, and whether it is a yardstick."""
    for one in members:
        if wbm not in one.sets:
            continue
        for count in one.llms:
            for noise in one.noises:
                for route in one.routes:
                    name = f"{route}, {count} LLM{noise_name(noise)}"
                    yield name, (wbm, route, count, noise, "wr_test"), one.models == "linearisation"


def _reasons(members: Sequence[SurrogateConfiguration], wbm: str, findings: Records) -> TextTable:
    rows = []
    for one in members:
        for count in one.llms:
            mine = [
                item
                for item in findings
                if item.get("reason") == one.name and (item["wbm"], item["llms"]) == (wbm, count)
            ]
            for noise in dict.fromkeys(item["noise"] for item in mine):
                of_noise = [item for item in mine if item["noise"] == noise]
                texts = (_recommended(of_noise), _ended(of_noise), _bounds(of_noise), _starts(of_noise))
                name = f"{one.name}, {count} LLM{noise_name(noise)}"
                rows.append(TextRow(name, tuple(Cell(text) for text in texts)))
    caption = (
        f"White-box set {wbm}. Why each search stops where it does: parameters at a bound cannot go where "
        "the data pull them, over all seeds and local models of the recommended theta."
    )
    columns = ("recommended theta", "output error ended", "parameters at a bound", "frequency response from")
    return TextTable(caption, "model", columns, rows, prose=True)


def _recommended(items: Records) -> str:
    counts = Counter(item["recommended"] for item in items)
    return ", ".join(_share(name, count, len(items)) for name, count in counts.most_common())


def _share(name: str, count: int, total: int) -> str:
    return name if count == total else f"{name} ({count} of {total})"


def _ended(items: Records) -> str:
    steps = [item["steps"] for item in items if item["steps"] is not None]
    if not steps:
        return "not asked for"
    limit = sum(item["converged"] is False for item in items)
    span = f"{min(steps)}" if min(steps) == max(steps) else f"{min(steps)} to {max(steps)}"
    how = "cost no longer falls" if not limit else _share("limit of steps reached", limit, len(items))
    return f"{how}, {span} steps in the last stage"


def _bounds(items: Records) -> str:
    held = Counter(bound for item in items for row in item["bounds"] for bound in row.items())
    total = sum(len(item["bounds"]) for item in items)
    return ", ".join(f"{name} {side} {n} of {total}" for (name, side), n in held.most_common()) or "none"


def _starts(items: Records) -> str:
    counts = Counter(start for item in items for start in item["starts"])
    total = sum(counts.values())
    return ", ".join(f"{name} {count} of {total}" for name, count in counts.most_common())


def _modes(settings: SurrogateStudySettings, findings: Records) -> Section:
    tables = []
    errors = [
        one for one in findings if one.get("measure") == FREQUENCY_ERROR and one["which"] == RECOMMENDED
    ]
    for wbm in settings.sets:
        mine = [one for one in errors if one["wbm"] == wbm]
        modes = list(dict.fromkeys(one["mode"] for one in mine))
        rows = []
        for route, noise in dict.fromkeys((one["route"], one["noise"]) for one in mine):
            rows.append(TextRow(f"{route}{noise_name(noise)}", (), "group"))
            for point in dict.fromkeys(one["point"] for one in mine):
                chosen = [
                    one for one in mine if (one["route"], one["noise"], one["point"]) == (route, noise, point)
                ]
                rows.append(TextRow(point, tuple(_frequency(chosen, mode) for mode in modes)))
        caption = (
            f"White-box set {wbm}. Difference of frequency [%], worst of the seeds; below it the reference's "
            "frequency."
        )
        tables.append(TextTable(caption, "operating point", [f"mode {mode}" for mode in modes], rows))
    drawn = [
        Drawing(Markup(one["svg"]), one["caption"])
        for one in findings
        if one.get("drawing") in ("poles", "spectra")
    ]
    return Section(
        "Modes, poles and spectra", _MODES, figures=drawn, text_tables=[t for t in tables if t.rows]
    )


def _frequency(items: Records, mode: str) -> Cell:
    mine = [one for one in items if one["mode"] == mode]
    if not mine or any(one["value"] is None for one in mine):
        return Cell("none")
    return Cell(
        f"{max(one['value'] for one in mine):.3f}", small=f"{np.mean([o['reference'] for o in mine]):.3f} Hz"
    )


def _optima(settings: SurrogateStudySettings, findings: Records) -> Section:
    mine = [one for one in findings if "optima" in one]
    figure = optima_figure(
        [(wbm, [_optimum(one) for one in mine if one["wbm"] == wbm]) for wbm in settings.sets]
    )
    rows = []
    for wbm in settings.sets:
        found = [one for one in mine if one["wbm"] == wbm]
        missed = sum(_optimum(one).shipped > 1.0005 for one in found)
        blind = [ratio for one in found for ratio in _optimum(one).random]
        hits = 100.0 * float(np.mean(np.array(blind) <= 1.0005)) if blind else float("nan")
        fallback = Counter(one["fallback"] for one in found if one["fallback"])
        texts = (
            f"{len(found)}",
            f"{len(found) - missed}",
            "; ".join(f"{count}: {why}" for why, count in fallback.items()) or "never",
            f"{hits:.0f} % of {len(blind)}",
        )
        rows.append(TextRow(f"set {wbm}", tuple(Cell(text) for text in texts)))
    columns = ("runs", "at the global optimum", "random starts needed", "random starts that end there")
    caption = "A run is one data set at one operating point, with measurement noise."
    return Section(
        "Local optima", _OPTIMA, figures=[figure], text_tables=[TextTable(caption, "", columns, rows)]
    )


def _optimum(item: Mapping[str, Any]) -> Optimum:
    """Return final errors over the lowest that any start reached."""
    lowest = min([item["error"], *item["random"]])
    return Optimum(item["error"] / lowest, [error / lowest for error in item["random"]])
