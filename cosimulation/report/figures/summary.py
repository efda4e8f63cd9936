"""The result at a glance: FIT of the contact force of every model on every white-box set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from cosimulation.report import thesis
from cosimulation.report.figures.drawing import INK, MUTED, drawing_style, fit_text, inline_svg, new_figure
from cosimulation.report.views import SetView


def summary_figure(sets: Sequence[SetView]) -> str:
    """Return a dot plot: a row per model, a panel per set; dots are test data, rings validation."""
    rows = max(len(view.models) for view in sets)
    with drawing_style():
        figure = new_figure(0.95 + 0.34 * rows)
        panels = figure.subplots(1, len(sets), sharey=True, squeeze=False)[0]
        for axes, view in zip(panels, sets, strict=True):
            _panel(axes, view)
        titles = [model.title for model in sets[0].models]
        panels[0].set_yticks(range(len(titles)), titles)
        panels[0].set_ylim(len(titles) - 0.4, -0.6)
        return inline_svg(figure, "summary", _alternative(sets))


def _panel(axes: Axes, view: SetView) -> None:
    best = thesis.BEST_CONTACT_FORCE
    axes.axvline(best, color=INK, linewidth=1.0, linestyle=(0, (4, 2)), zorder=1)
    axes.annotate(
        f"thesis's best {best:g}",
        (best, 0.0),
        xycoords=("data", "axes fraction"),
        xytext=(-4, 4),
        textcoords="offset points",
        ha="right",
        color=INK,
        fontsize=8,
    )
    for row, model in enumerate(view.models):
        test, validation = model.fit("F_p"), model.fit("F_p", "validation")
        shown = float(np.clip(test, 0.0, 100.0))
        axes.plot([0.0, shown], [row, row], color=model.colour, linewidth=2.2, alpha=0.35, zorder=2)
        axes.plot(
            [np.clip(validation, 0.0, 100.0)], [row], "o", mfc="white", mec=model.colour, ms=7.5, zorder=3
        )
        axes.plot([shown], [row], "o" if test >= 0.0 else "<", color=model.colour, ms=5.5, zorder=4)
        axes.annotate(
            fit_text(test),
            (1.0, row),
            xycoords=("axes fraction", "data"),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
            fontweight="bold" if model is view.best else "normal",
            annotation_clip=False,
        )
    axes.set_xlim(0.0, 102.0)
    axes.set_title(f"white-box set {view.name}")
    axes.set_xlabel("FIT of $F_p$ [%]")
    axes.grid(visible=False, axis="y")
    axes.tick_params(axis="y", length=0, labelcolor=INK)
    axes.spines["left"].set_color(MUTED)


def _alternative(sets: Sequence[SetView]) -> str:
    parts = []
    for view in sets:
        fits = ", ".join(f"{model.title} {fit_text(model.fit('F_p'))}" for model in view.models)
        parts.append(f"Set {view.name}: {fits}.")
    return "FIT of the contact force on test data. " + " ".join(parts)
