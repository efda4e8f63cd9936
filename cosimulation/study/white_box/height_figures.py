"""Figures of the height from modes: its error over the length of the record, and over the height."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import FuncFormatter, NullFormatter

from cosimulation.report.figures.drawing import INK, PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.page import Drawing

Records = Sequence[Mapping[str, Any]]
_DASHES: tuple[Any, ...] = ("solid", (0, (4, 2)), (0, (1, 1.5)))
_LEAST = 1e-4


def over_duration(panels: Mapping[str, Records]) -> Drawing:
    """Return median and largest error of the height over the length of the record, a panel per set.

    Args:
        panels: By white-box set: height errors from all modes.
    """
    with drawing_style():
        figure = new_figure(3.9)
        grid = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for axes, (wbm, records) in zip(grid, panels.items(), strict=True):
            routes = list(dict.fromkeys(one["route"] for one in records))
            noises = list(dict.fromkeys(one["noise"] for one in records))
            for route, noise in dict.fromkeys((one["route"], one["noise"]) for one in records):
                mine = [one for one in records if (one["route"], one["noise"]) == (route, noise)]
                durations = sorted({one["duration"] for one in mine})
                errors = [[_drawn(one) for one in mine if one["duration"] == d] for d in durations]
                colour = PALETTE[routes.index(route)]
                label = f"{route}, " + ("no noise" if noise == "none" else noise)
                axes.plot(
                    durations, [np.median(one) for one in errors], color=colour, marker="o", ms=3,
                    linestyle=_DASHES[noises.index(noise) % len(_DASHES)], label=label,
                )  # fmt: skip
                axes.plot(durations, [max(one) for one in errors], "v", color=colour, ms=4, mfc="none")
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xticks(durations, [f"{d:g}" for d in durations])
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.set_title(f"white-box set {wbm}")
            axes.set_xlabel("length of the record [s]")
        grid[0].set_ylabel("error of the height [m]")
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        svg = inline_svg(
            figure, "height-duration", "Error of the height from modes over the record's length."
        )
    caption = (
        "Error of the height inferred from the three modes over the length of the record: lines are medians "
        "over all records, triangles the largest error. A height that could not be inferred counts 2 m."
    )
    return Drawing(Markup(svg), caption)


def _drawn(record: Mapping[str, Any]) -> float:
    return 2.0 if record["value"] is None else max(float(record["value"]), _LEAST)


def over_height(
    curves: Mapping[str, Mapping[str, Any]], errors: Mapping[str, Records], route: str
) -> Drawing:
    """Return the standard deviation to expect over the height, with the errors of one route's records.

    Args:
        curves: By white-box set: what `deviation_curve` found.
        errors: By white-box set: height errors from all modes in the longest records.
        route: Which they are.
    """
    with drawing_style():
        figure = new_figure(3.9)
        grid = figure.subplots(1, len(curves), sharey=True, squeeze=False)[0]
        for axes, (wbm, found) in zip(grid, curves.items(), strict=True):
            for index, (name, curve) in enumerate(found["curves"].items()):
                together = "," in name
                values = np.array([np.nan if value is None else value for value in curve])
                axes.plot(
                    found["heights"], values, color=INK if together else PALETTE[index],
                    linewidth=1.8 if together else 1.0,
                    label=f"foretold, modes {name}" if together else f"foretold, mode {name} alone",
                )  # fmt: skip
            points = [(one["height"], _drawn(one)) for one in errors[wbm]]
            axes.plot(
                *zip(*points, strict=True),
                "o",
                color=PALETTE[4],
                ms=3,
                mew=0,
                label=f"error of a record, {route}",
            )
            axes.set_yscale("log")
            axes.set_ylim(1e-3, 4.0)
            axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.set_title(f"white-box set {wbm}, {found['duration']:g} s")
            axes.set_xlabel("height [m]")
        grid[0].set_ylabel("deviation, error [m]")
        handles, labels = grid[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        svg = inline_svg(
            figure, "height-deviation", "Standard deviation of the height to expect, over the height."
        )
    caption = (
        "How well modes can tell the height where the wire's motion is not measured: standard deviation to "
        "expect from each mode alone and from all, and the errors of single records. A mode's curve goes up "
        "where its frequency turns round or hardly moves."
    )
    return Drawing(Markup(svg), caption)
