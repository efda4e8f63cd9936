"""Figures of the surrogate study's page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cosimulation.report.figures.drawing import INK, PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.page import Drawing

_WORST = 1000.0
"""Ratios beyond are drawn here."""


@dataclass(frozen=True)
class Optimum:
    """One run: final errors over the lowest that any of its starts reached.

    Attributes:
        shipped: Of the fit as it ships.
        random: Of random starts.
    """

    shipped: float
    random: Sequence[float]


def optima_figure(panels: Sequence[tuple[str, Sequence[Optimum]]]) -> Drawing:
    """Return a histogram of where searches end, random starts against the closed form, a panel per set."""
    edges = np.concatenate([[0.75], np.geomspace(1.0005, _WORST * 1.001, 30)])
    with drawing_style():
        figure = new_figure(3.2)
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for one, (wbm, runs) in zip(axes, panels, strict=True):
            groups = (
                ("random starts", [ratio for run in runs for ratio in run.random], PALETTE[1]),
                ("closed form, fallback included", [run.shipped for run in runs], PALETTE[0]),
            )
            for index, (label, ratios, colour) in enumerate(groups):
                counts, _ = np.histogram(np.clip(ratios, 1.0, _WORST), edges)
                share = 100.0 * counts / max(len(ratios), 1)
                one.stairs(
                    share, edges, fill=index == 0, color=colour, alpha=0.55 if index == 0 else 1.0,
                    linewidth=1.6, label=label,
                )  # fmt: skip
            one.set_xscale("log")
            one.xaxis.set_major_locator(LogLocator(10.0))
            one.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            one.xaxis.set_minor_formatter(NullFormatter())
            one.set_xlim(0.7, _WORST)
            one.set_title(f"white-box set {wbm}, {len(runs)} runs", color=INK)
            one.set_xlabel("final error over that of the best start")
        axes[0].set_ylabel("share of the searches [%]")
        axes[0].legend(loc="upper right")
        svg = inline_svg(figure, "study-optima", "Histogram of final errors of the frequency-response fit.")
    caption = (
        "Where searches end: relative error of the frequency response over that of the best start of "
        f"the same run. The first bar is the global optimum; what ends beyond {_WORST:g} is drawn there."
    )
    return Drawing(Markup(svg), caption)
