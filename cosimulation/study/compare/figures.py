"""Figure 4.35: boxplots of the FIT of the contact force on all test signals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cosimulation.report import thesis
from cosimulation.report.figures.drawing import INK, MUTED, PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.compare.members import (
    LINEAR,
    LOLIMOT,
    LOW_PASS,
    OUTPUT,
    PARAMETER,
    SURROGATE,
    in_thesis,
)
from cosimulation.study.page import Drawing

COLOURS = {
    LINEAR: PALETTE[3], SURROGATE: PALETTE[2], OUTPUT: PALETTE[1], PARAMETER: PALETTE[0], LOW_PASS: "#6b6b6b",
    LOLIMOT: PALETTE[4],
}  # fmt: skip
DASHES: Mapping[str, Any] = {
    LINEAR: (0, (1, 1.2)), SURROGATE: (0, (5, 1.5, 1, 1.5)), OUTPUT: (0, (4, 1.5)), PARAMETER: "solid",
    LOW_PASS: (0, (7, 1.5)), LOLIMOT: (0, (2, 1)),
}  # fmt: skip
FAMILIES = {
    LINEAR: "white-box model linearised at one height, mean error subtracted",
    SURROGATE: "surrogate, 4 LLM, parameter blending",
    OUTPUT: "n4sid, 4 LLM, output blending",
    PARAMETER: "n4sid, 4 LLM, parameter blending",
    LOW_PASS: "n4sid in the thesis's configuration: low-pass, look-up table, output blending",
    LOLIMOT: "LOLIMOT on the pan-head's height, 4 LLM",
}
PUBLISHED = {
    "M21": thesis.SURROGATE.fits["F_p"],
    "M31": thesis.N4SID_OUTPUT.fits["F_p"],
    "M41": thesis.N4SID_PARAMETER.fits["F_p"],
    "T31": thesis.N4SID_OUTPUT.fits["F_p"],
}
"""FIT of F_p on whole-range validation data in the thesis [%] (Table 4.6)."""
_RAN_AWAY = -1e12
"""Stands for minus infinity where values are interpolated [%]."""
WORST = 100.0
"""What is left to 100 % FIT and more than this is drawn here on the logarithmic axis [%]."""


@dataclass(frozen=True)
class Box:
    """The FIT of one model on all test signals.

    Attributes:
        label: Its number.
        family: A key of `FAMILIES`.
        fits: [%], minus infinity where a run is not finite.
    """

    label: str
    family: str
    fits: Sequence[float]

    @property
    def quartiles(self) -> tuple[float, float, float, float, float]:
        """Smallest, lower quartile, median, upper quartile and largest FIT [%].

        Minus infinity is what a run that ran away has a part in.
        """
        finite = np.maximum(self.fits, _RAN_AWAY)
        found = np.percentile(finite, [0.0, 25.0, 50.0, 75.0, 100.0])
        low, first, middle, third, high = np.where(found < 0.01 * _RAN_AWAY, -np.inf, found).tolist()
        return low, first, middle, third, high


def boxplots(name: str, wbm: str, boxes: Sequence[Box]) -> Drawing:
    """Return Figure 4.35: FIT as the thesis draws it, and below what is left to 100 %, logarithmic.

    Args:
        name: Unique in the page.
        wbm: The white-box set.
        boxes: One per model, in the order of the abscissa.
    """
    with drawing_style():
        figure = new_figure(6.6)
        upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(1.0, 1.15))
        _boxes(upper, boxes, [np.maximum(box.fits, -WORST) for box in boxes])
        _boxes(lower, boxes, [np.minimum(100.0 - np.asarray(box.fits), WORST) for box in boxes])
        for place, box in enumerate(boxes):
            if box.label in PUBLISHED:
                upper.plot([place], [PUBLISHED[box.label]], "D", mfc="white", mec=INK, ms=5, zorder=5)
                lower.plot([place], [100.0 - PUBLISHED[box.label]], "D", mfc="white", mec=INK, ms=5, zorder=5)
        _mark_ours(upper, lower, sum(in_thesis(box.label) for box in boxes))
        upper.set_ylabel("FIT of $F_p$ [%]")
        upper.set_ylim(top=103.0)
        lower.set_ylabel("100 \N{MINUS SIGN} FIT of $F_p$ [%]")
        lower.set_yscale("log")
        lower.invert_yaxis()
        lower.yaxis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))
        lower.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        lower.yaxis.set_minor_formatter(NullFormatter())
        lower.set_xticks(range(len(boxes)), [box.label for box in boxes])
        lower.set_xlim(-0.6, len(boxes) - 0.4)
        figure.legend(handles=_legend(boxes), loc="outside lower center", ncols=1)
        svg = inline_svg(figure, name, _alternative(wbm, boxes))
    caption = (
        f"White-box set {wbm}. FIT of the contact force over {len(boxes[0].fits)} whole-range test signals "
        "of different slew rates and noise (thesis Figure 4.35): box from the lower to the upper quartile, "
        "stroke at the median, whiskers to the last value within one and a half boxes, rings beyond. Above "
        "as the thesis draws it; below what is left to 100 %, better models higher. The thesis prints no "
        "numbers with its figure; diamonds are its best FIT of such models on validation data (Table 4.6)."
    )
    return Drawing(Markup(svg), caption)


def _boxes(axes: Axes, boxes: Sequence[Box], values: Sequence[Any]) -> None:
    drawn = axes.boxplot(
        list(values), positions=range(len(boxes)), widths=0.62, patch_artist=True, manage_ticks=False,
        flierprops={"marker": "o", "ms": 3.0, "mfc": "none", "mew": 0.8},
        medianprops={"color": INK, "linewidth": 1.3},
    )  # fmt: skip
    for place, box in enumerate(boxes):
        colour = COLOURS[box.family]
        drawn["boxes"][place].set(facecolor=colour, edgecolor=colour, alpha=0.55)
        drawn["fliers"][place].set(markeredgecolor=colour)
        for one in (*drawn["whiskers"][2 * place : 2 * place + 2], *drawn["caps"][2 * place : 2 * place + 2]):
            one.set(color=colour)


def _mark_ours(upper: Axes, lower: Axes, count: int) -> None:
    """Part the models of the thesis's figure, `count` of them, from those that are only ours."""
    for axes in (upper, lower):
        axes.axvline(count - 0.5, color=MUTED, linewidth=0.8, linestyle=(0, (4, 3)))
    upper.annotate(
        "not in the thesis's figure",
        (count - 0.5, 0.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, 4),
        textcoords="offset points",
        va="bottom",
        color=MUTED,
        fontsize=8,
    )


def _legend(boxes: Sequence[Box]) -> list[Any]:
    shown = dict.fromkeys(box.family for box in boxes)
    handles: list[Any] = [Patch(color=COLOURS[one], alpha=0.55, label=FAMILIES[one]) for one in shown]
    mark = Line2D([], [], marker="D", mfc="white", mec=INK, ls="", ms=5, label="thesis, Table 4.6")
    return [*handles, mark]


def _alternative(wbm: str, boxes: Sequence[Box]) -> str:
    parts = [f"{box.label} {box.quartiles[0]:.2f} to {box.quartiles[4]:.2f}" for box in boxes]
    return (
        f"Boxplots of the FIT of the contact force, set {wbm}, smallest to largest [%]: {', '.join(parts)}."
    )
