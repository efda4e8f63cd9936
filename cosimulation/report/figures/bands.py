"""The contact force with its error band: on test data, and by height and frequency."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from matplotlib.axes import Axes

from cosimulation.report.figures.contact_force import close_up_window
from cosimulation.report.figures.drawing import (
    INK,
    MUTED,
    PALETTE,
    REFERENCE_BAND,
    drawing_style,
    envelope,
    inline_svg,
    new_figure,
)
from cosimulation.report.views import SetView
from fmu_builder.parameter_set import ResidualBands
from identification.residuals import counted_rows, total_bound

_COLUMNS = 480
_SECONDS = 0.3
"""Length of the close-up: the fastest mode swings seven times."""


def bands_figure(view: SetView) -> str:
    """Return the best model's force and error with its band on test data, and its bounds; "" for none."""
    bands = view.best.bands
    if bands is None:
        return ""
    with drawing_style():
        figure = new_figure(7.4)
        grid = figure.add_gridspec(3, 2, height_ratios=(1.0, 1.15, 1.0))
        _whole_run(figure.add_subplot(grid[0, :]), view, bands)
        _close_up(figure.add_subplot(grid[1, 0]), figure.add_subplot(grid[1, 1]), view, bands)
        _by_height(figure.add_subplot(grid[2, :]), bands, view.best.unit(bands.output))
        alternative = (
            f"Error of the contact force of {view.best.title} on test data, set {view.name}, between the"
            " bounds of its height; a close-up of force and error with the band; bounds by height and band of"
            " frequency."
        )
        return inline_svg(figure, f"bands-{view.name}", alternative)


def _whole_run(axes: Axes, view: SetView, bands: ResidualBands) -> None:
    error = view.best.error("F_p")
    begin = counted_rows(len(error), view.sample_time).start
    first, low, high = envelope(error[begin:], _COLUMNS)
    time = view.time[begin:][first]
    axes.fill_between(
        time, low, high, color=view.best.colour, linewidth=0, alpha=0.55, label="error (minimum to maximum)"
    )
    limit = total_bound(bands, view.reference("eta")[begin:][first])
    share = f"{100.0 * bands.coverage:g} % bound of the height"
    axes.plot(time, limit, color=INK, linewidth=1.1, label=share)
    axes.plot(time, -limit, color=INK, linewidth=1.1)
    top = 1.5 * max(float(np.abs(error[begin:]).max()), float(np.nanmax(limit, initial=0.0)))
    axes.set_ylim(-top, top)
    axes.set_xlim(0.0, float(view.time[-1]))
    axes.set_ylabel("error of $F_p$ [N]")
    axes.set_xlabel("time [s]")
    axes.legend(loc="upper right", ncols=2, borderaxespad=0.2)
    axes.set_title(f"{view.best.title}, whole test run", fontsize=8.5)


def _close_up(force: Axes, error: Axes, view: SetView, bands: ResidualBands) -> None:
    window = close_up_window(view)
    length = min(round(_SECONDS / view.sample_time), window.stop - window.start)
    begin = (window.start + window.stop - length) // 2
    rows = slice(begin, begin + length)
    time, reference = view.time[rows], view.reference("F_p")[rows]
    model = view.best.output("F_p")[rows]
    limit = total_bound(bands, view.reference("eta")[rows])
    for axes, zero in ((force, 0.0), (error, model)):
        axes.fill_between(
            time, model - limit - zero, model + limit - zero, color=view.best.colour, linewidth=0, alpha=0.3,
            label="model with its band",
        )  # fmt: skip
        axes.plot(time, model - zero, color=view.best.colour, linewidth=1.0)
        axes.plot(
            time, reference - zero, color=INK, linewidth=1.0, linestyle=(0, (4, 1.5)), label="reference"
        )
        axes.set_xlabel("time [s]")
        axes.set_xlim(float(time[0]), float(time[-1]))
        axes.locator_params(axis="x", nbins=4)
    force.set_ylabel("contact force $F_p$ [N]")
    error.set_ylabel("less the model [N]")
    force.set_title("around the largest error", fontsize=8.5)
    error.set_title("the same, the model subtracted", fontsize=8.5)
    low, high = force.get_ylim()
    force.set_ylim(low, high + 0.2 * (high - low))
    force.legend(loc="upper right", ncols=2, borderaxespad=0.2)


def _by_height(axes: Axes, bands: ResidualBands, unit: str) -> None:
    names = [f"{low:g} to {high:g} Hz" for low, high in pairwise(bands.frequencies)]
    series = [*zip(names, np.array(bands.bound, dtype=np.float64).T, PALETTE, strict=False)]
    series.append(("all", np.array(bands.total, dtype=np.float64), REFERENCE_BAND))
    width = 0.8 / len(series)
    places = np.arange(len(bands.total))
    for number, (name, sizes, colour) in enumerate(series):
        axes.bar(
            places + (number - 0.5 * (len(series) - 1)) * width,
            np.nan_to_num(sizes),
            width,
            color=colour,
            label=name,
        )
    ranges = [f"{low:g} to {high:g}" for low, high in pairwise(bands.positions)]
    axes.set_xticks(places, ranges)
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False, axis="x")
    axes.set_xlabel(r"contact height $\eta$ [m]")
    axes.set_ylabel(f"{100.0 * bands.coverage:g} % bound [{unit}]")
    axes.spines["bottom"].set_color(MUTED)
    axes.legend(loc="upper center", ncols=len(series), borderaxespad=0.1)
    axes.set_ylim(top=1.25 * axes.get_ylim()[1])
