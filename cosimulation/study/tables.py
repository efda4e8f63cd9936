"""What the pages of the studies show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cosimulation.pantograph import SIGNALS
from cosimulation.study import order
from cosimulation.study.page import Cell, Section, Table

Records = Sequence[Mapping[str, Any]]
KINDS = {False: "Networks on whole-range test data", True: "One local model at its own operating point"}


def statistics(fits: Sequence[float | None]) -> Cell:
    """Return median and worst of some FIT values; None counts as minus infinity."""
    values = [-np.inf if fit is None else float(fit) for fit in fits]
    if not values:
        return float("nan"), None
    return float(np.median(values)), float(min(values))


def order_sections(settings: order.OrderSettings, records: list[dict[str, Any]]) -> list[Section]:
    """Return one section per white-box set: FIT over the order, full and reduced, for every signal."""
    sections = []
    for wbm in settings.sets:
        found = []
        for noise in settings.noises:
            for signal in reversed(SIGNALS):
                for route in (order.FULL, order.REDUCED):
                    shown = order.table(records, wbm, signal, route, noise)
                    what = route if route == order.FULL else f"reduced to {settings.reduced_to} states"
                    caption = (
                        f"FIT of {signal} [%], {what}, noise on training data: {noise}. Median over seeds."
                    )
                    rows = [
                        (name, [(value, None) for value in cells])
                        for name, cells in zip(shown["data_sets"], shown["cells"], strict=True)
                    ]
                    columns = [f"n = {number}" for number in shown["orders"]]
                    found.append(Table(caption, "data set", columns, rows))
        text = (
            "One local model at its own operating point, scored on the other data set of that point. TV: "
            "identified on the training set and scored on the validation set; VT: the other way round."
        )
        sections.append(Section(f"White-box set {wbm}", text, found))
    return sections


def blending_sections(settings: Any, records: list[dict[str, Any]]) -> list[Section]:
    """Return one section per white-box set: all configurations, all signals, median and worst."""
    sections = []
    for wbm in settings.sets:
        chosen = [item for item in records if item["wbm"] == wbm and item["split"] == "test"]
        noises = list(dict.fromkeys(item["noise"] for item in chosen))
        found = []
        for noise in noises:
            with_noise = [item for item in chosen if item["noise"] == noise]
            for local, kind in KINDS.items():
                group = [item for item in with_noise if (item["data_set"] != "wr_test") == local]
                if group:
                    caption = f"{kind}; noise on training data: {noise}. Median, below it the worst seed."
                    found.append(Table(caption, "configuration", list(SIGNALS), _rows(group, local)))
        text = "FIT [%] of every configuration; tuned on training data, never on test data."
        sections.append(Section(f"White-box set {wbm}", text, found))
    return sections


def _rows(group: Records, by_data_set: bool) -> list[tuple[str, list[Cell]]]:
    """Return one row per configuration (and operating point), best contact force first."""
    names: dict[tuple[Any, ...], dict[str, list[float | None]]] = {}
    for item in group:
        key = (item["route"], item["llms"], item["data_set"] if by_data_set else None)
        names.setdefault(key, {}).setdefault(item["signal"], []).append(item["fit"])
    rows = []
    for (route, llms, data_set), signals in names.items():
        label = f"{route}, {data_set}" if by_data_set else f"{route}, {llms} LLM"
        rows.append((label, [statistics(signals.get(signal, [])) for signal in SIGNALS]))
    return sorted(rows, key=lambda row: -row[1][-1][0])
