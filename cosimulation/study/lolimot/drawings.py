"""The figure of the LOLIMOT study: where a blend of own state-space systems soars (thesis Figure 4.6)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from cosimulation.report.figures.drawing import INK, PALETTE, drawing_style, inline_svg, new_figure
from identification.arrays import Array
from identification.data_set import DataSet

_NAMES = {"regressors": "states in common (NMSS)", "modal": "own modal states"}
_MOST_POINTS = 4000


def soaring_figure(
    name: str,
    test: DataSet,
    shares: Array,
    rest: Array,
    blends: Mapping[str, tuple[Array, Array, Array, Array]],
) -> str:
    """Return the figure as inline SVG.

    Args:
        name: Of the figure on its page.
        test: Data with phi_1 [rad] and eta [m].
        shares: Validities, shape (rows, M).
        rest: phi_1 of the reference at rest over the heights [rad].
        blends: Form to simulated phi_1 (rows,), heights (H,), spectral radii (H,) and phi_1 at rest (H,).
    """
    step = max(1, -(-len(test) // _MOST_POINTS))
    time, reference = test.time[::step], test.column("phi_1")
    low, high = float(reference.min()), float(reference.max())
    with drawing_style():
        figure = new_figure(7.4)
        grid = figure.add_gridspec(3, 2, height_ratios=(1.5, 0.7, 1.2))
        record, validity = figure.add_subplot(grid[0, :]), figure.add_subplot(grid[1, :])
        static, radius = figure.add_subplot(grid[2, 0]), figure.add_subplot(grid[2, 1])
        record.plot(time, reference[::step], color=INK, lw=2.4, alpha=0.35, label="white-box model")
        for form, colour in zip(blends, (PALETTE[0], PALETTE[4]), strict=False):
            simulated, heights, radii, own = blends[form]
            record.plot(time, simulated[::step], color=colour, lw=0.9, label=_NAMES[form])
            static.plot(heights, own, color=colour, lw=1.1)
            radius.semilogy(heights, 1.0 - np.minimum(radii, 1.0), color=colour, lw=1.1)
        static.plot(next(iter(blends.values()))[1], rest, color=INK, lw=2.4, alpha=0.35)
        for index, share in enumerate(shares.T):
            colour = PALETTE[index % len(PALETTE)]
            validity.plot(time, share[::step], color=colour, lw=0.9, label=f"{index + 1}")
        for axes in (record, static):
            axes.set_ylim(low - 0.6 * (high - low), high + 0.6 * (high - low))
            axes.set_ylabel(r"$\varphi_1$ [rad]")
        record.legend(loc="lower center", ncols=3)
        validity.set_ylabel("validity [1]")
        validity.set_xlabel("time [s]")
        for axes in (record, validity):
            axes.set_xlim(0.0, float(time[-1]))
        static.set_xlabel("height [m], at rest")
        radius.set_xlabel("height [m], held")
        radius.set_ylabel("1 - largest |pole| [1]")
        what = "Angle of the lower arm: white-box model and two blends of local ARX models, with validities."
        return inline_svg(figure, name, what)
