"""The contact force over time: the whole run, and close up."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes

from cosimulation.report.figures.drawing import (
    INK,
    MUTED,
    PALETTE,
    REFERENCE_BAND,
    buckets,
    drawing_style,
    envelope,
    fit_text,
    inline_svg,
    mark_unscored,
    new_figure,
)
from cosimulation.report.views import ModelView, SetView
from identification.arrays import Array
from identification.validity import weights

CLOSE_UP_SECONDS = 1.5
_COLUMNS = 480
_ERROR_COLUMNS = 120
_ERROR_LIMITS = (0.1, 1e6)
"""Errors beyond are drawn at these ends of the logarithmic axis [N]."""


def overview_figure(view: SetView) -> str:
    """Return contact force, error of every model and validity functions over the whole test run."""
    with drawing_style():
        figure = new_figure(7.2)
        force, error, validity = figure.subplots(3, 1, sharex=True, height_ratios=(1.15, 1.15, 1.0))
        begin = float(view.time[view.scored.start])
        for axes in (force, error, validity):
            mark_unscored(axes, begin, label=axes is force)
        _bands(force, view)
        _errors(error, view)
        _validity(validity, view)
        validity.set_xlabel("time [s]")
        validity.set_xlim(0.0, float(view.time[-1]))
        handles, labels = error.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        alternative = (
            f"Contact force on test data, set {view.name}, over {view.time[-1]:.0f} s: reference and "
            f"{view.best.title}, largest error of every model, validity functions and contact height."
        )
        return inline_svg(figure, f"overview-{view.name}", alternative)


def _bands(axes: Axes, view: SetView) -> None:
    first, low, high = envelope(view.reference("F_p"), _COLUMNS)
    axes.fill_between(
        view.time[first], low, high, color=REFERENCE_BAND, linewidth=0, label="reference (minimum to maximum)"
    )
    best = view.best
    first, low, high = envelope(best.output("F_p"), _COLUMNS)
    axes.plot(view.time[first], low, color=best.colour, linewidth=0.8, label=f"{best.title} (the same)")
    axes.plot(view.time[first], high, color=best.colour, linewidth=0.8)
    axes.set_ylabel("contact force $F_p$ [N]")
    top = float(view.reference("F_p").max())
    axes.set_ylim(top=top * 1.45)
    axes.legend(loc="upper right", ncols=2, borderaxespad=0.2)


def _errors(axes: Axes, view: SetView) -> None:
    for model in view.models:
        first = buckets(len(view.time), _ERROR_COLUMNS)
        worst = np.maximum.reduceat(np.abs(model.error("F_p")), first)
        axes.semilogy(
            view.time[first],
            np.clip(worst, *_ERROR_LIMITS),
            color=model.colour,
            linestyle=model.dashes,
            label=f"{model.title}: FIT {fit_text(model.fit('F_p'))}",
        )
    seconds = (view.time[-1] + view.sample_time) / _ERROR_COLUMNS
    axes.set_ylabel(f"largest |error| of $F_p$\nin {seconds:.2g} s [N]")
    axes.yaxis.set_major_formatter(lambda value, _: f"{value:g}")


def _validity(axes: Axes, view: SetView) -> None:
    eta = view.reference("eta")
    first = buckets(len(eta), _COLUMNS)
    time = view.time[first]
    shown = scheduled(view)
    if shown is not None:
        for index, share in enumerate(weights(shown.parameter_set.partition, eta[first]).T):
            colour = PALETTE[index % len(PALETTE)]
            axes.plot(time, share, color=colour, linewidth=1.3)
            peak = int(np.argmax(share))
            axes.annotate(
                rf"$\Phi_{{{index + 1}}}$",
                (time[peak], share[peak]),
                xytext=(0, 3),
                textcoords="offset points",
                ha="left" if peak == 0 else "center",
                color=colour,
                fontsize=9,
            )
        axes.set_title(f"validity of {shown.title}", fontsize=8.5, color=MUTED)
    axes.set_ylabel(r"validity $\Phi_i$ [1]")
    axes.margins(y=0.16)
    height = axes.twinx()
    height.plot(time, eta[first], color=INK, linewidth=1.0, linestyle=(0, (5, 2)))
    height.set_ylabel(r"contact height $\eta$ [m] (dashed)")
    height.spines["right"].set_visible(True)
    height.set_ylim(
        eta.min() - 0.1 * np.ptp(eta), eta.max() + 0.4 * np.ptp(eta)
    )  # below the label of its peak
    height.grid(visible=False)


def scheduled(view: SetView) -> ModelView | None:
    """Return the network whose validity functions are shown: the best model if it is one."""
    return max(view.networks, key=lambda model: model is view.best, default=None)


def close_up_window(view: SetView) -> slice:
    """Return the scored rows of `CLOSE_UP_SECONDS` around the best model's largest error."""
    length = min(round(CLOSE_UP_SECONDS / view.sample_time), len(view.time) - view.scored.start)
    scored_error = np.abs(view.best.error("F_p")[view.scored])
    worst = view.scored.start + int(np.argmax(scored_error))
    begin = int(np.clip(worst - length // 2, view.scored.start, len(view.time) - length))
    return slice(begin, begin + length)


def close_up_figure(view: SetView) -> str:
    """Return the contact force close up: a row per model, force on the left, error on the right."""
    rows = close_up_window(view)
    time = view.time[rows]
    reference = view.reference("F_p")[rows]
    with drawing_style():
        figure = new_figure(0.6 + 1.15 * len(view.models))
        grid = figure.subplots(
            len(view.models), 2, sharex=True, sharey="col", width_ratios=(1.6, 1.0), squeeze=False
        )
        for (force, error), model in zip(grid, view.models, strict=True):
            force.plot(time, reference, color=INK, linewidth=1.0, label="reference")
            force.plot(time, model.output("F_p")[rows], color=model.colour, linewidth=1.1, label="model")
            force.set_title(f"{model.title}: FIT {fit_text(model.fit('F_p'))}", fontsize=8.5)
            error.fill_between(time, model.error("F_p")[rows], color=model.colour, linewidth=0, alpha=0.55)
            error.axhline(0.0, color=MUTED, linewidth=0.6)
            worst = float(np.max(np.abs(model.error("F_p")[rows])))
            error.set_title(f"error, at most {worst:.3g} N here", fontsize=8.5)
        _close_up_axes(grid[-1], reference, time)
        middle = grid[len(view.models) // 2]
        middle[0].set_ylabel("contact force $F_p$ [N]")
        middle[1].set_ylabel("error of $F_p$ [N]")
        alternative = (
            f"Contact force from {time[0]:.2f} to {time[-1]:.2f} s, set {view.name}: reference and every "
            f"model with its error, around the largest error of {view.best.title}."
        )
        return inline_svg(figure, f"closeup-{view.name}", alternative)


def _close_up_axes(bottom: tuple[Axes, Axes], reference: Array, time: Array) -> None:
    """Scale both columns by the reference: a model that leaves it leaves the axes too."""
    low, high = float(reference.min()), float(reference.max())
    margin = 0.15 * (high - low)
    bottom[0].set_ylim(low - margin, high + margin)
    half = 0.5 * (high - low) + margin
    bottom[1].set_ylim(-half, half)
    for axes in bottom:
        axes.set_xlabel("time [s]")
        axes.set_xlim(float(time[0]), float(time[-1]))
        axes.locator_params(axis="x", nbins=8 if axes is bottom[0] else 4)
