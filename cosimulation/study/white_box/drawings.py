"""Figures that need the data themselves, drawn beside them: surfaces, static map, paths of the poles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.lines import Line2D

import fmus
from cosimulation.linearise import Linearisation
from cosimulation.pantograph import TORQUE, operating_point_name
from cosimulation.report.figures.drawing import (
    INK,
    MUTED,
    PALETTE,
    SYMBOLS,
    drawing_style,
    inline_svg,
    new_figure,
)
from cosimulation.report.figures.poles import draw_z_plane
from cosimulation.report.modes import Mode, matched, model_poles, modes
from cosimulation.study.white_box.poles import ModePaths
from cosimulation.study.white_box.resonances import HIGHEST, StepResonances
from cosimulation.study.white_box.static import StaticMap, gain, lift
from identification.arrays import Array
from identification.excitation import ACCEPTANCE
from identification.height import ModeTable

Record = dict[str, Any]
_SURFACES = ("xi_dot", "zeta_dot", "F_p")
_HEIGHT = "height [m]"
_MARKERS = ("x", "+")
_MARGIN = 0.14


def surfaces(wbm: str, found: StepResonances, table: ModeTable) -> Record:
    """Return the spectra of the step responses over the height, and the peaks found in them."""
    reached = found.heights + (found.heights[1] - found.heights[0])
    half = 0.5 * (reached[1] - reached[0])
    with drawing_style():
        figure = new_figure(6.0)
        grid = figure.subplots(2, 2, sharex=True, sharey=True)
        for axes, signal in zip(grid.flat, _SURFACES, strict=False):
            axes.imshow(
                found.surfaces[signal], origin="lower", aspect="auto", interpolation="none", cmap="viridis",
                norm=PowerNorm(0.5, 0.0, 1.0),
                extent=(0.0, found.frequencies[-1], reached[0] - half, reached[-1] + half),
            )  # fmt: skip
            axes.set_title(f"|DFT| of {SYMBOLS[signal]} over its largest entry")
            axes.grid(visible=False)
        _peaks(grid[1, 1], found, reached, table)
        for axes in grid[1]:
            axes.set_xlabel("frequency [Hz]")
        for axes in grid[:, 0]:
            axes.set_ylabel("height after the step [m]")
        grid[0, 0].set_xlim(0.0, HIGHEST)
        svg = inline_svg(
            figure, f"surfaces-{wbm}", f"Spectra of step responses over the height, white-box set {wbm}."
        )
    caption = (
        f"White-box set {wbm}: discrete Fourier transforms of the responses to steps of the contact height "
        "(thesis Figures 2.5 to 2.7), square root of the share as colour, and the peaks found in them beside "
        "|s| / 2 pi of the linearised model."
    )
    return {"drawing": "surfaces", "wbm": wbm, "svg": str(svg), "caption": caption}


def _peaks(axes: Axes, found: StepResonances, reached: Array, table: ModeTable) -> None:
    for (_, signal), peaks in found.peaks.items():
        if signal in _SURFACES:
            index = _SURFACES.index(signal)
            axes.plot(peaks, reached, _MARKERS[0] if index else "o", color=PALETTE[index], ms=3.5, mfc="none")
    axes.plot(table.frequencies, table.heights, color=MUTED, linewidth=0.8)
    handles = [
        Line2D(
            [], [], ls="", marker=_MARKERS[0] if k else "o", mfc="none", color=PALETTE[k], ms=4, label=name
        )
        for k, name in enumerate(SYMBOLS[signal] for signal in _SURFACES)
    ]
    handles.append(Line2D([], [], color=MUTED, lw=0.8, label="linearised"))
    axes.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.13, 0.02), fontsize=7.5)
    axes.set_title("peaks")


def statics(wbm: str, found: StaticMap, linearisations: Sequence[Linearisation]) -> Record:
    """Return contact force at rest over height and over torque, critical torque and slope."""
    heights = np.array([one.input_operating_point[one.inputs.index("eta")] for one in linearisations])
    with drawing_style():
        figure = new_figure(5.6)
        grid = figure.subplots(2, 2)
        for index, row in enumerate(np.linspace(0, found.torques.size - 1, 5).round().astype(int)):
            label = f"{found.torques[row]:.0f} N$\\,$m"
            grid[0, 0].plot(found.heights, found.force[:, row], color=PALETTE[index], label=label)
        for index, row in enumerate(np.linspace(0, found.heights.size - 1, 3).round().astype(int)):
            label = f"{found.heights[row]:.2f} m"
            grid[0, 1].plot(found.torques, found.force[row], color=PALETTE[index], label=label)
        grid[1, 0].plot(found.heights, found.critical, color=INK, label="$F_p = 0$, exact")
        levers = [one for one in map(lift, linearisations) if one is not None]
        slope = np.array([gain(one, "F_p", "M_pa") for one in linearisations])
        if levers:
            crossing = TORQUE - np.interp(heights, found.heights, found.at_operating_point) * np.array(levers)
            grid[1, 0].plot(heights, crossing, color=MUTED, ls=(0, (4, 2)), label="along $1/z_1$")
            grid[1, 1].plot(heights, 1.0 / np.array(levers), color=MUTED, ls=(0, (4, 2)), label="$1/z_1$")
        grid[1, 1].plot(heights, slope, color=INK, label="$dF_p/dM_{pa}$ at rest")
        for axes in (grid[0, 0], grid[1, 0], grid[1, 1]):
            axes.set_xlabel(_HEIGHT)
        grid[0, 1].set_xlabel("$M_{pa}$ [N m]")
        for axes, label in zip(
            grid.flat, ("$F_p$ [N]", "$F_p$ [N]", "critical $M_{pa}$ [N m]", "slope [N/(N m)]"), strict=True
        ):
            axes.set_ylabel(label)
            place = {"loc": "lower center", "ncols": 3} if axes is grid[0, 0] else {"loc": "best"}
            axes.legend(fontsize=7.5, **place)
        grid[0, 0].set_ylim(bottom=min(0.0, float(found.force.min())))
        svg = inline_svg(figure, f"static-{wbm}", f"Contact force at rest, white-box set {wbm}.")
    caption = (
        f"White-box set {wbm}: contact force at rest over height and torque (thesis Figure 2.4), the torque "
        "at which it vanishes, and its slope over the torque."
    )
    return {"drawing": "static", "wbm": wbm, "svg": str(svg), "caption": caption}


def paths(wbm: str, found: ModePaths, at: ModePaths) -> Record:
    """Return the paths of the poles with the height in the z plane, and a zoom on every mode."""
    networks = {name: _network_modes(name) for name, own in fmus.NETWORKS.items() if own == wbm}
    with drawing_style():
        figure = new_figure(7.0)
        grid = figure.add_gridspec(2, found.table.modes, height_ratios=(1.35, 1.0))
        whole = figure.add_subplot(grid[0, :])
        for column in range(found.table.modes):
            zoom = figure.add_subplot(grid[1, column])
            for axes in (whole, zoom):
                _path(axes, found, at, column)
            _network_poles(zoom, at, column, networks)
            _frame(zoom, found, at, column)
        draw_z_plane(whole, ACCEPTANCE.sample_time)
        handles = [Line2D([], [], color=PALETTE[0], label="linearised, arrow: upwards in height")]
        handles.append(
            Line2D([], [], color=INK, marker="o", mfc="none", ls="", ms=5, label="at OP25 .. OP85")
        )
        handles += [
            Line2D([], [], color=PALETTE[4], marker=mark, ls="", label=f"network {name}")
            for mark, name in zip(_MARKERS, networks, strict=False)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=2)
        svg = inline_svg(figure, f"paths-{wbm}", f"Paths of the poles over the height, white-box set {wbm}.")
    caption = (
        f"White-box set {wbm}: poles of the linearised model, held for 1 ms, over the operating range "
        "(thesis Figure 2.8), one zoom per mode."
    )
    return {"drawing": "paths", "wbm": wbm, "svg": str(svg), "caption": caption}


def _network_modes(name: str) -> list[list[Mode]]:
    """Return the oscillating modes of every local model of a network that ships."""
    sample_time = ACCEPTANCE.sample_time
    return [
        [mode for mode in modes(model_poles(one), sample_time) if mode.oscillates]
        for one in fmus.network(name).local_models
    ]


def _network_poles(axes: Axes, at: ModePaths, column: int, networks: dict[str, list[list[Mode]]]) -> None:
    """Draw the poles of local models that go with the linearisations at the same operating points."""
    for mark, points in zip(_MARKERS, networks.values(), strict=False):
        for row, found in enumerate(points[: len(at.poles)]):
            reference = [
                Mode(complex(pole), float(frequency), float(damping))
                for pole, frequency, damping in zip(
                    at.poles[row], at.table.frequencies[row], at.table.dampings[row], strict=True
                )
            ]
            mode = matched(reference, found)[column]
            if mode is not None:
                axes.plot(mode.pole.real, mode.pole.imag, mark, color=PALETTE[4], ms=5, mew=1.2, zorder=4)


def _path(axes: Axes, found: ModePaths, at: ModePaths, column: int) -> None:
    path = found.poles[:, column]
    axes.plot(path.real, path.imag, color=PALETTE[0])
    marked = at.poles[:, column]
    axes.plot(marked.real, marked.imag, "o", mfc="none", mec=INK, ms=5, zorder=3)
    k = int(0.55 * path.size)
    axes.annotate(
        "", (path[k + 2].real, path[k + 2].imag), (path[k].real, path[k].imag),
        arrowprops={"arrowstyle": "-|>", "color": PALETTE[0], "mutation_scale": 11.0},
    )  # fmt: skip


def _frame(axes: Axes, found: ModePaths, at: ModePaths, column: int) -> None:
    """Fit a zoom round the path of a mode and name the operating points."""
    path = found.poles[:, column]
    for values, limit in ((path.real, axes.set_xlim), (path.imag, axes.set_ylim)):
        low, high = float(values.min()), float(values.max())
        middle, half = 0.5 * (low + high), max((0.5 + _MARGIN) * (high - low), 2e-4)
        limit(middle - half, middle + half)
    for row in (0, len(at.poles) - 1):
        pole = at.poles[row, column]
        left = pole.real <= sum(axes.get_xlim()) / 2.0
        axes.annotate(
            operating_point_name(float(at.table.heights[row])), (pole.real, pole.imag),
            xytext=(7 if left else -7, 0), textcoords="offset points", fontsize=7.5, color=MUTED,
            ha="left" if left else "right", va="center",
        )  # fmt: skip
    axes.set_title(f"mode {found.names[column]}")
    axes.set_xlabel("Re z [1]")
    axes.locator_params(axis="x", nbins=3)
    axes.locator_params(axis="y", nbins=5)
    axes.ticklabel_format(useOffset=False)
    if column == 0:
        axes.set_ylabel("Im z [1]")
