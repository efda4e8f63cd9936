"""One small picture for a page that introduces the project."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cosimulation.report.figures.drawing import INK, drawing_style, fit_text, new_figure, svg_document
from cosimulation.report.views import SetView

SECONDS = 2.0


def picture(sets: Sequence[SetView]) -> str:
    """Return an SVG file: contact force of reference and best model on unseen data, a panel per set.

    The stretch shown is the middle of the scored data, not a chosen one.
    """
    with drawing_style():
        figure = new_figure(1.95 * len(sets) + 0.2, 8.0)
        panels = figure.subplots(len(sets), 1, sharex=True, squeeze=False)[:, 0]
        for axes, view in zip(panels, sets, strict=True):
            length = min(round(SECONDS / view.sample_time), len(view.time) - view.scored.start)
            begin = (view.scored.start + len(view.time) - length) // 2
            rows = slice(begin, begin + length)
            time = np.arange(length) * view.sample_time
            axes.plot(
                time, view.reference("F_p")[rows], color=INK, lw=2.6, alpha=0.35, label="white-box model"
            )
            best = view.best
            axes.plot(time, best.output("F_p")[rows], color="#d55e00", lw=1.1, label="network (FMU)")
            axes.set_title(
                f"white-box set {view.name}: {best.title}, FIT {fit_text(best.fit('F_p'))} on unseen data"
            )
            axes.set_ylabel("contact force [N]")
            axes.set_xlim(0.0, length * view.sample_time)
        panels[0].legend(loc="upper right", ncols=2, borderaxespad=0.1)
        panels[0].set_ylim(top=panels[0].get_ylim()[1] * 1.25)
        panels[-1].set_xlabel("time [s]")
        return svg_document(figure)
