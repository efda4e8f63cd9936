"""Singular values of every local model against noise, and the order that was read from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from cosimulation.report.figures.drawing import INK, SYMBOLS, drawing_style, inline_svg, new_figure
from identification.arrays import Array
from identification.n4sid import LocalModels

_KEPT, _LEFT_OUT, _NOISE = "#0061a8", "#8a929d", "#a33b00"
_COLUMNS = 4
_ROW_HEIGHT = 2.15
_DEPTH_BELOW_NOISE = 1e-4
"""Share of the noise level down to which values are shown; below, rounding errors have the word."""


def singular_values_figure(local: LocalModels, name: str) -> str:
    """Return a panel per local model, and one more below it where a model of high order was reduced.

    Upper panels: strength of every singular value (see `identification.subspace.projection`) with the level
    that noise alone would show and the order. Lower panels: Hankel singular values and what the reduction
    kept of them.

    Args:
        local: Local models with the diagnostics of the estimator.
        name: Unique in the page.
    """
    count = len(local.models)
    columns = min(count, _COLUMNS)
    bands = -(-count // columns)
    reduced = any("hankel_singular_values" in model.diagnostics for model in local.models)
    rows = bands * (2 if reduced else 1)
    with drawing_style():
        figure = new_figure(0.55 + _ROW_HEIGHT * rows)
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes in grid.flat:
            axes.set_visible(False)
        for kind in range(2 if reduced else 1):
            panels = [grid[kind * bands + index // columns, index % columns] for index in range(count)]
            for index, (axes, model) in enumerate(zip(panels, local.models, strict=True)):
                axes.set_visible(True)
                (_hankel if kind else _strengths)(axes, model.diagnostics)
                if kind == 0:
                    axes.set_title(_place(local, index))
            _share_axes(panels, columns)
        _legend(figure)
        return inline_svg(figure, f"singular-values-{name}", _alternative(local))


def _place(local: LocalModels, index: int) -> str:
    scheduling = local.settings.scheduling
    unit = next(one.unit for one in local.signals[0] if one.name == scheduling)
    return f"{SYMBOLS.get(scheduling, scheduling)} = {local.centres[index]:g} {unit}".rstrip()


def _strengths(axes: Axes, found: dict[str, Any]) -> None:
    strengths, noise, order = np.array(found["strengths"]), found["noise_level"], found["order"]
    floor = noise * _DEPTH_BELOW_NOISE
    shown = max(int(np.sum(strengths > floor)) + 3, order + 6)  # a few at the bottom tell that there are more
    _split(axes, np.maximum(strengths[:shown], floor), order)
    axes.axhline(noise, color=_NOISE, linewidth=1.0, linestyle=(0, (4, 2)), zorder=1)
    axes.set_ylim(floor, 10.0 * strengths[0])
    unexplained = r"(1 - \sigma_i^2)" if found["weighting"] == "cva" else r"\overline{\sigma_{noise}^2}"
    axes.set_ylabel(rf"strength $\sigma_i^2 / {unexplained}$ [1]")
    axes.set_xlabel("singular value $i$")


def _hankel(axes: Axes, found: dict[str, Any]) -> None:
    values = np.array(found.get("hankel_singular_values", ()))
    if not values.size:
        axes.set_visible(False)
        return
    lowest = values[0] * 1e-9
    _split(axes, np.maximum(values, lowest), found["order"])
    axes.set_ylim(max(lowest, 0.3 * values[-1]), 10.0 * values[0])
    axes.set_ylabel("Hankel singular value [1]")
    axes.set_xlabel("balanced state $i$")


def _split(axes: Axes, values: Array, order: int) -> None:
    """Draw values on a logarithmic axis: those of the states that are kept, a line, the others."""
    number = np.arange(1, len(values) + 1)
    size = 4.0 if len(values) < 60 else 2.5
    axes.semilogy(number[:order], values[:order], "o", color=_KEPT, ms=size, zorder=3)
    axes.semilogy(number[order:], values[order:], "o", mfc="white", mec=_LEFT_OUT, ms=size, zorder=3)
    axes.axvline(order + 0.5, color=INK, linewidth=0.8, zorder=2)
    axes.annotate(
        f"order {order}",
        (order + 0.5, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(4, -3),
        textcoords="offset points",
        va="top",
        color=INK,
    )
    axes.set_xlim(0.0, len(values) + 1.0)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, integer=True))
    axes.grid(visible=False, axis="x")


def _share_axes(panels: list[Axes], columns: int) -> None:
    """Give panels that show the same one scale, and its labels to the outer ones."""
    shown = [axes for axes in panels if axes.get_visible()]
    low, high = (pick(axes.get_ylim()[k] for axes in shown) for k, pick in enumerate((min, max)))
    most = max(axes.get_xlim()[1] for axes in shown)
    for index, axes in enumerate(panels):
        axes.set_ylim(low, high)
        axes.set_xlim(0.0, most)
        if index % columns:
            axes.set_ylabel("")
            axes.tick_params(labelleft=False)


def _legend(figure: Figure) -> None:
    handles = [
        Line2D([], [], marker="o", ls="", color=_KEPT, ms=4, label="states of the model"),
        Line2D([], [], marker="o", ls="", mfc="white", mec=_LEFT_OUT, ms=4, label="left out"),
        Line2D([], [], color=_NOISE, lw=1.0, ls=(0, (4, 2)), label="what noise alone would show"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3)


def _alternative(local: LocalModels) -> str:
    parts = [
        f"{local.place(index)}: order {model.order} from {model.diagnostics['seen_block_rows']} block rows"
        for index, model in enumerate(local.models)
    ]
    return "Singular values of every local model against noise, logarithmic. " + "; ".join(parts) + "."
