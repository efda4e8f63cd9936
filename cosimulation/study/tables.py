"""What the pages of the studies show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cosimulation.pantograph import SIGNALS
from cosimulation.study import figures, order
from cosimulation.study.blending import (
    BlendingSettings,
    Configuration,
    OwnOperatingPoint,
    TableSettings,
)
from cosimulation.study.data import NOISES
from cosimulation.study.page import Cell, Drawing, Row, Section, Table

Records = Sequence[Mapping[str, Any]]
Shown = Mapping[tuple[Any, ...], Mapping[str, Sequence[float | None]]]
"""FIT over the seeds by configuration and signal; None where a model ran away."""
_OWN = """One local model at its own operating point, scored on fresh data of that point: what the estimator
reaches before anything is blended. The yardstick is the white-box model's exact linearisation there."""

_FULL_ORDER = {
    "reflect": "Without noise nothing determines the surplus poles of a full-order model: those outside the "
    "unit circle are reflected into it.",
    "none": "Full-order models with poles outside the unit circle run away.",
}


def statistics(fits: Sequence[float | None]) -> Cell:
    """Return median and worst of some FIT values; None counts as minus infinity."""
    values = [-np.inf if fit is None else float(fit) for fit in fits]
    if not values:
        return float("nan"), None
    return float(np.median(values)), float(min(values)) if len(values) > 1 else None


def order_sections(
    settings: order.OrderSettings, records: list[dict[str, Any]], _: list[dict[str, Any]]
) -> list[Section]:
    """Return one section per white-box set: FIT over the order, full and reduced, for every signal."""
    sections = []
    for wbm in settings.sets:
        found = []
        for noise in settings.noises:
            for signal in reversed(SIGNALS):
                for route in (order.FULL, order.REDUCED):
                    shown = order.table(records, wbm, signal, route, noise)
                    what = "full order" if route == order.FULL else f"reduced to {settings.reduced_to} states"
                    over = "Median over the seeds." if len(settings.seeds) > 1 else "One seed."
                    caption = f"FIT of {signal} [%], {what}{with_noise(noise)}. {over}"
                    rows = [
                        Row(name, [(value, None) for value in cells])
                        for name, cells in zip(shown["data_sets"], shown["cells"], strict=True)
                    ]
                    columns = [f"n = {number}" for number in shown["orders"]]
                    found.append(Table(caption, "data set", columns, rows))
        text = (
            "One local model at its own operating point, scored on the other data set of that point. TV: "
            "identified on the training set and scored on the validation set; VT: the other way round. "
            + _FULL_ORDER[settings.stabilisation]
        )
        sections.append(Section(f"White-box set {wbm}", text, found))
    return sections


def blending_sections(
    settings: BlendingSettings, records: list[dict[str, Any]], _: list[dict[str, Any]]
) -> list[Section]:
    """Return one section per table of the settings, and one of the local models at their own points."""
    shown = by_configuration(records)
    sections = []
    for wanted in settings.tables:
        tables = [_networks(settings, wanted, wbm, shown) for wbm in settings.sets]
        drawn = _figure(settings, wanted, shown)
        sections.append(Section(wanted.title, wanted.text, [table for table in tables if table.rows], drawn))
    if settings.own_operating_point:
        own = [_own(settings, wbm, shown) for wbm in settings.sets]
        sections.append(Section("Local models at their own operating points", _OWN, own))
    return sections


def by_configuration(records: Records) -> Shown:
    """Return FIT values on test data by (set, route, number of models, noise, data set) and signal."""
    found: dict[tuple[Any, ...], dict[str, list[float | None]]] = {}
    for item in records:
        if item["split"] == "test":
            key = tuple(item[name] for name in ("wbm", "route", "llms", "noise", "data_set"))
            found.setdefault(key, {}).setdefault(item["signal"], []).append(item["fit"])
    return found


def with_noise(noise: str) -> str:
    """Return what is added to the name of a model for its measurement noise."""
    return "" if noise == "none" else f", noise of {noise}"


def _members(
    settings: BlendingSettings, wanted: TableSettings, wbm: str
) -> Iterator[tuple[Configuration, int, str]]:
    """Yield configuration, number of models and noise of the rows: by name, then number, then noise."""
    inside = [
        one
        for one in settings.configurations
        if wbm in one.sets and (wanted.name in one.tables or not one.tables)
    ]
    for name in dict.fromkeys(one.name for one in inside):
        cells = [(count, noise, one) for one in inside if one.name == name for count in one.llms
                 for noise in one.noises]  # fmt: skip
        sizes = list(NOISES)
        for count, noise, one in sorted(cells, key=lambda cell: (cell[0], sizes.index(cell[1]))):
            if wanted.llms is not None and count not in wanted.llms:
                continue
            if noise == "none" or wanted.every_noise:
                yield one, count, noise


def _networks(settings: BlendingSettings, wanted: TableSettings, wbm: str, shown: Shown) -> Table:
    if wanted.figure == "over_llms":
        return _over_llms(settings, wanted, wbm, shown)
    numbers = wanted.llms or ()
    one_number = len(numbers) == 1
    rows = []
    for one, count, noise in _members(settings, wanted, wbm):
        name = one.name + ("" if one_number else f", {count} LLM") + with_noise(noise)
        signals = shown.get((wbm, one.name, count, noise, "wr_test"), {})
        rows.append(_row(name, signals, one))
    caption = fit_caption(wbm, len(settings.seeds)) + (f" {numbers[0]} LLM." if one_number else "")
    return Table(caption, "configuration", SIGNALS, rows)


def _over_llms(settings: BlendingSettings, wanted: TableSettings, wbm: str, shown: Shown) -> Table:
    """Return FIT of the contact force only: a row per configuration, a column per number of models."""
    members = list(_members(settings, wanted, wbm))
    counts = sorted({count for _, count, _ in members})
    rows = []
    for name, noise in dict.fromkeys((one.name, noise) for one, _, noise in members):
        found = [shown.get((wbm, name, count, noise, "wr_test"), {}).get("F_p", []) for count in counts]
        yardstick = any(one.models == "linearisation" for one, _, _ in members if one.name == name)
        rows.append(Row(name + with_noise(noise), [statistics(fits) for fits in found], yardstick))
    caption = fit_caption(wbm, len(settings.seeds), "FIT of the contact force F_p")
    return Table(caption, "configuration", [f"{count} LLM" for count in counts], rows)


def _own(settings: BlendingSettings, wbm: str, shown: Shown) -> Table:
    points = dict.fromkeys(key[-1] for key in shown if key[0] == wbm and key[-1] != "wr_test")
    rows = []
    for own in settings.own_operating_point:
        for noise in (noise for noise in NOISES if noise in own.noises):
            for point in points:
                signals = shown.get((wbm, own.route, 1, noise, point), {})
                name = f"{own.route}, {point}{with_noise(noise)}"
                rows.append(_row(name, signals, own))
    return Table(fit_caption(wbm, len(settings.seeds)), "local model", SIGNALS, rows)


def fit_caption(wbm: str, seeds: int, what: str = "FIT") -> str:
    """Return what a table of FIT values shows."""
    over = ": median over the seeds, below it the worst" if seeds > 1 else ", one seed"
    return f"White-box set {wbm}. {what} on test data [%]{over}."


def _row(
    name: str, signals: Mapping[str, Sequence[float | None]], one: Configuration | OwnOperatingPoint
) -> Row:
    cells = [statistics(signals.get(signal, [])) for signal in SIGNALS]
    return Row(name, cells, one.models == "linearisation")


def _figure(settings: BlendingSettings, wanted: TableSettings, shown: Shown) -> list[Drawing]:
    if wanted.figure is None:
        return []
    panels = []
    for wbm in settings.sets:
        curves: dict[str, figures.Curve] = {}
        for one, count, noise in _members(settings, wanted, wbm):
            fits = shown.get((wbm, one.name, count, noise, "wr_test"), {}).get("F_p", [])
            name = one.name + with_noise(noise)
            curve = curves.setdefault(name, figures.Curve(name, one.models == "linearisation", {}))
            curve.errors[count] = [100.0 - fit for fit in fits if fit is not None]
        panels.append(figures.Panel(wbm, list(curves.values())))
    if wanted.figure == "over_llms":
        return [figures.over_llms(f"study-{wanted.name}", panels)]
    return [figures.seeds(f"study-{wanted.name}", panels)]
