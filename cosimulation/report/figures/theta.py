"""Movement of theta over the height, a panel per parameter (thesis Figure 4.8), with error bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from matplotlib.axes import Axes

from cosimulation.report.figures.drawing import INK, drawing_style, inline_svg, new_figure
from identification.arrays import Array

_COLUMNS = 4
_ROW_HEIGHT = 2.0
_APART = 0.02
"""Of the range: how far series stand apart, so that error bars do not hide one another."""


@dataclass(frozen=True)
class ThetaSeries:
    """One way to a parameter.

    Attributes:
        name: For the legend.
        colour: Of everything.
        marker: Of the local models.
        heights: Of the local models [m], (M,).
        values: In the parameter's unit, (M,).
        errors: Standard errors, (M,), NaN where there are none.
        dots: Further (height, value), drawn small.
        line: Heights and values of a curve, None for none.
    """

    name: str
    colour: str
    marker: str
    heights: Array
    values: Array
    errors: Array
    dots: Sequence[tuple[float, float]] = field(default_factory=tuple)
    line: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class ThetaPanel:
    """One parameter."""

    parameter: str
    unit: str
    series: Sequence[ThetaSeries]


def theta_figure(name: str, panels: Sequence[ThetaPanel]) -> str:
    """Return an inline SVG.

    Args:
        name: Unique in the page.
        panels: One per parameter.
    """
    rows = -(-len(panels) // _COLUMNS)
    with drawing_style():
        figure = new_figure(0.5 + _ROW_HEIGHT * rows)
        grid = figure.subplots(rows, _COLUMNS, squeeze=False, sharex=True)
        for axes in grid.flat[len(panels) :]:
            axes.set_visible(False)
        for index, (axes, panel) in enumerate(zip(grid.flat, panels, strict=False)):
            _draw(axes, panel)
            axes.set_title(f"{_symbol(panel.parameter)} [{panel.unit}]")
            if index + _COLUMNS >= len(panels):
                axes.set_xlabel("height \N{GREEK SMALL LETTER ETA} [m]")
                axes.tick_params(labelbottom=True)
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3)
        parameters = ", ".join(panel.parameter for panel in panels)
        return inline_svg(figure, f"theta-{name}", f"Movement of {parameters} over the height.")


def _draw(axes: Axes, panel: ThetaPanel) -> None:
    shown = []
    bars = [one for one in panel.series if one.values.size]
    span = max((float(np.ptp(one.heights)) for one in bars), default=0.0)
    for index, one in enumerate(panel.series):
        if one.line is not None:
            axes.plot(
                *one.line,
                color=one.colour,
                linewidth=1.0,
                alpha=0.8,
                label=None if one.values.size else one.name,
            )
            shown.append(one.line[1])
        if not one.values.size:
            continue
        shift = _APART * span * (bars.index(one) - 0.5 * (len(bars) - 1))
        errors = np.where(np.isfinite(one.errors), one.errors, 0.0)
        axes.errorbar(
            one.heights + shift, one.values, errors, color=one.colour, fmt=one.marker, ms=4.0, capsize=2.5,
            elinewidth=1.1, label=one.name, zorder=3 + index,
        )  # fmt: skip
        if one.dots:
            places = np.array(one.dots)
            axes.plot(places[:, 0] + shift, places[:, 1], ".", color=one.colour, ms=3.0, alpha=0.45, zorder=2)
            shown.append(places[:, 1])
        shown += [one.values]
    values = np.concatenate(shown)
    low, high = float(values.min()), float(values.max())
    margin = 0.25 * (high - low) or 0.05 * abs(high) or 1.0
    largest = [float(np.nanmax(one.errors)) for one in bars if np.isfinite(one.errors).any()]
    margin = max(margin, min(max(largest, default=0.0), 2.0 * (high - low) or margin))
    axes.set_ylim(low - margin, high + margin)
    if low < 0.0 < high:
        axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.locator_params(axis="y", nbins=5)


def _symbol(parameter: str) -> str:
    letter, _, index = parameter.partition("_")
    return f"${letter}_{{{index}}}$" if index else f"${letter}$"
