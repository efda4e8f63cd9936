"""Figures of the studies' pages: what is left to 100 % FIT of the contact force, on a logarithmic axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from cosimulation.report.figures.drawing import INK, MUTED, PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.page import Drawing

LARGEST = 100.0
"""Errors beyond (a FIT below zero) are drawn here [%]."""
_AXIS = "100 \N{MINUS SIGN} FIT of $F_p$ [%]"
_BETTER = "less is better"


@dataclass(frozen=True)
class Curve:
    """One configuration.

    Attributes:
        name: For the legend.
        yardstick: Whether it is there to measure the others by.
        errors: Number of local models -> 100 - FIT [%] of every seed.
    """

    name: str
    yardstick: bool
    errors: dict[int, list[float]]


@dataclass(frozen=True)
class Panel:
    """The configurations on one white-box set."""

    wbm: str
    curves: Sequence[Curve]


def over_llms(name: str, panels: Sequence[Panel]) -> Drawing:
    """Return the error over the number of local models: median, and a band from best to worst seed."""
    with drawing_style():
        figure = new_figure(4.2)
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for one, panel in zip(axes, panels, strict=True):
            for index, curve in enumerate(panel.curves):
                _curve(one, curve, PALETTE[index % len(PALETTE)])
            one.set_title(f"white-box set {panel.wbm}")
            one.set_xlabel("local models")
            one.set_xticks(sorted({count for curve in panel.curves for count in curve.errors}))
            one.set_yscale("log")
            _percent(one.yaxis)
        axes[0].set_ylabel(f"{_AXIS}, {_BETTER}")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        svg = inline_svg(figure, name, _alternative("over the number of local models", panels))
    caption = (
        "What is left to 100 % FIT of the contact force on test data over the number of local models: "
        "median over the seeds, band from the best to the worst seed. Dashed: exact linearisations."
    )
    return Drawing(Markup(svg), caption)


def _curve(axes: Axes, curve: Curve, colour: str) -> None:
    counts = sorted(count for count, errors in curve.errors.items() if errors)
    errors = [np.minimum(curve.errors[count], LARGEST) for count in counts]
    middle = [float(np.median(values)) for values in errors]
    low, high = ([float(choose(values)) for values in errors] for choose in (np.min, np.max))
    dashes = (0, (4, 2)) if curve.yardstick else "solid"
    colour = INK if curve.yardstick else colour
    axes.plot(counts, middle, color=colour, linestyle=dashes, marker="o", ms=3.5, label=curve.name)
    if not curve.yardstick:
        axes.fill_between(counts, low, high, color=colour, alpha=0.15, linewidth=0)


def seeds(name: str, panels: Sequence[Panel]) -> Drawing:
    """Return a strip per configuration: a dot per seed, a stroke at the median."""
    rows = max(sum(len(curve.errors) for curve in panel.curves) for panel in panels)
    with drawing_style():
        figure = new_figure(0.9 + 0.21 * rows)
        axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
        for one, panel in zip(axes, panels, strict=True):
            labels: list[str] = []
            for curve in panel.curves:
                colour = MUTED if curve.yardstick else PALETTE[0]
                for errors in curve.errors.values():
                    row, drawn = len(labels), np.minimum(errors, LARGEST)
                    labels.append(curve.name)
                    if drawn.size:
                        one.plot(drawn, np.full(drawn.size, row), "o", color=colour, ms=4, alpha=0.45, mew=0)
                        one.plot([np.median(drawn)], [row], "|", color=INK, ms=9, mew=1.4)
            one.set_yticks(range(len(labels)), labels)
            one.set_ylim(len(labels) - 0.4, -0.6)
            one.tick_params(axis="y", length=0, labelcolor=INK)
            one.set_title(f"white-box set {panel.wbm}")
            one.set_xscale("log")
            one.set_xlabel(f"{_AXIS}, {_BETTER}")
            _percent(one.xaxis)
        svg = inline_svg(figure, name, _alternative("of every configuration", panels))
    caption = (
        "What is left to 100 % FIT of the contact force on test data: a dot per seed, a stroke at the "
        "median; grey: exact linearisations. What is worse than 0 % FIT is drawn at 100."
    )
    return Drawing(Markup(svg), caption)


def _percent(axis: object) -> None:
    """Label a logarithmic axis by plain numbers."""
    axis.set_major_locator(LogLocator(10.0, (1.0, 2.0, 5.0)))  # type: ignore[attr-defined]
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))  # type: ignore[attr-defined]
    axis.set_minor_formatter(NullFormatter())  # type: ignore[attr-defined]


def _alternative(over: str, panels: Sequence[Panel]) -> str:
    parts = []
    for panel in panels:
        best = [
            (float(np.median(errors)), f"{curve.name}, {count} LLM")
            for curve in panel.curves
            if not curve.yardstick
            for count, errors in curve.errors.items()
            if errors
        ]
        if best:
            error, name = min(best)
            parts.append(f"Set {panel.wbm}: smallest median {error:.3g} % by {name}.")
    return f"Error of the contact force on test data {over}. " + " ".join(parts)
