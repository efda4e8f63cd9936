"""Figures of the study: error of the contact force and what the FMU says of it, over every cause."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes

from cosimulation.report.figures.drawing import PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.extrapolation.inputs import trained_region
from cosimulation.study.extrapolation.results import Results
from cosimulation.study.extrapolation.settings import Cause
from cosimulation.study.extrapolation.task import CLAMP, QUANTILE_MEASURE
from cosimulation.study.page import Drawing
from cosimulation.study.side_by_side import model_of

AXES = {
    "height": "height of the wire [m]",
    "speed": "largest speed of the wire's slow movement [m/s]",
    "noise": "wire noise (1: acceptance recipe)",
    "frequency": "frequency of the wire [Hz]",
    "torque": "mean torque [N.m]",
}
LOGARITHMIC = ("speed", "noise", "frequency")
WORST_FIT = 0.0
_INSIDE = "#dcefe0"
_DASHED = (0, (4, 2))
_LABEL_WIDTH = 0.07
"""Of a label on an abscissa, with some room beside it, in widths of the abscissa."""


def over_cause(results: Results, cause: Cause) -> Drawing:
    """Return error, FIT and share of time out of range over one cause, trained region shaded."""
    with drawing_style():
        figure = new_figure(5.8)
        grid = figure.subplots(
            3, len(results.sets), sharex=True, sharey="row", squeeze=False, height_ratios=(1.3, 1.3, 0.8)
        )
        for column, wbm in enumerate(results.sets):
            rows = [grid[row][column] for row in range(3)]
            for axes in rows:
                _shade(axes, cause, results.networks(wbm)[0])
            _curves(rows, results, cause, wbm)
            rows[0].set_yscale("log")
            rows[1].set_ylim(WORST_FIT, 102.0)
            rows[2].set_ylim(-4.0, 104.0)
            rows[0].set_title(f"white-box set {wbm}")
            rows[2].set_xlabel(AXES[cause.name])
            if cause.name in LOGARITHMIC:
                _ticks(rows[2], cause)
        for axes, label in zip(
            grid[:, 0],
            ("95 % of errors\nof $F_p$ [N]", "FIT of $F_p$ [%]", "out of range\n[% of time]"),
            strict=True,
        ):
            axes.set_ylabel(label)
        handles, labels = grid[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        caption = (
            f"Over {cause.name}: 95 % quantile of the error of the contact force, its FIT (what is worse "
            "than 0 is drawn there), and the share of time with in_range = false; median over the seeds. "
            "Green: trained region."
        )
        svg = inline_svg(figure, f"over-{cause.name}", caption)
    return Drawing(Markup(svg), caption)


def _shade(axes: Axes, cause: Cause, network: str) -> None:
    region = trained_region(network, cause)
    if region is not None:
        low = max(region[0], 0.5 * cause.values[0]) if cause.name in LOGARITHMIC else region[0]
        axes.axvspan(low, region[1], color=_INSIDE, linewidth=0, zorder=0)


def _curves(rows: list[Axes], results: Results, cause: Cause, wbm: str) -> None:
    values = list(cause.values)
    for colour, network in zip(PALETTE, results.networks(wbm), strict=False):
        for policy in results.policies:
            where = wbm, network, cause
            quantiles = [results.value(QUANTILE_MEASURE, *where, at, policy) for at in values]
            fits = [results.fit(*where, at, policy) for at in values]
            outside = [results.value("time out of range", *where, at, policy) for at in values]
            dashes = _DASHED if policy == CLAMP else "solid"
            label = model_of(network) + (f", {policy}" if len(results.policies) > 1 else "")
            for axes, points in zip(rows, (quantiles, np.maximum(fits, WORST_FIT), outside), strict=True):
                axes.plot(values, points, color=colour, linestyle=dashes, marker="o", ms=3, label=label)


def _ticks(axes: Axes, cause: Cause) -> None:
    """Label a logarithmic axis by the values that were tried, as many as there is room for."""
    axes.set_xscale("log")
    apart = (cause.values[-1] / cause.values[0]) ** _LABEL_WIDTH
    chosen: list[float] = []
    for value in cause.values:
        if not chosen or value / chosen[-1] >= apart:
            chosen.append(value)
    axes.set_xticks(chosen, [f"{value:g}" for value in chosen])
    axes.minorticks_off()
