"""Poles of the local models in the z plane beside those of the linearised reference (thesis Figure 4.33)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from cosimulation.pantograph import operating_point_name
from cosimulation.report.figures.drawing import INK, MUTED, drawing_style, inline_svg, new_figure
from cosimulation.report.modes import (
    Mode,
    OperatingPointModes,
    Poles,
    compared,
    mode_name,
    modes_of_set,
)
from cosimulation.report.views import SetView
from identification.arrays import Array

_MARKERS = ("x", "+", "^", "s", "D")
_LEAST_SPAN = 0.002
"""A zoom shows at least so much of the z plane in each direction."""


def poles_figure(view: SetView) -> str:
    """Return the upper half of the z plane near 1, and a zoom on every mode of the reference."""
    points = modes_of_set(view)
    count = len(points[0].reference) if points else 0
    with drawing_style():
        figure = new_figure(7.0)
        if not count or any(len(point.reference) != count for point in points):
            axes = figure.subplots()
            _whole(axes, view, points)
            return inline_svg(figure, f"poles-{view.name}", f"Poles in the z plane, set {view.name}.")
        grid = figure.add_gridspec(2, count, height_ratios=(1.35, 1.0))
        _whole(figure.add_subplot(grid[0, :]), view, points)
        for index in range(count):
            _zoom(figure.add_subplot(grid[1, index]), view, points, index, mode_name(index, count))
        figure.legend(handles=_legend(view), loc="outside lower center", ncols=2)
        return inline_svg(
            figure,
            f"poles-{view.name}",
            f"Poles of the local models and of the linearised white-box model, z plane, set {view.name}.",
        )


def _legend(view: SetView) -> list[Line2D]:
    handles = [
        Line2D([], [], marker="o", mfc="none", mec=INK, ls="", ms=8, label="linearised white-box model")
    ]
    for marker, model in zip(_MARKERS, compared(view), strict=False):
        handles.append(
            Line2D([], [], marker=marker, color=model.colour, ls="", ms=6, mew=1.5, label=model.title)
        )
    return handles


def draw_z_plane(axes: Axes, sample_time: float) -> None:
    """Draw the upper half of the z plane near 1: unit circle, lines of equal frequency and damping ratio."""
    for frequency in (5.0, 10.0, 15.0, 20.0, 25.0):
        damping = np.linspace(0.0, 0.12, 60)
        z = _pole(frequency, damping, sample_time)
        axes.plot(z.real, z.imag, color="#dfe3e8", linewidth=0.7, zorder=0)
        axes.annotate(
            f"{frequency:g} Hz",
            (z.real[0], z.imag[0]),
            xytext=(4, 0),
            textcoords="offset points",
            color=MUTED,
            fontsize=7.5,
            va="center",
        )
    for ratio in (0.0, 0.02, 0.05, 0.1):
        z = _pole(np.linspace(0.0, 26.5, 80), ratio, sample_time)
        axes.plot(
            z.real, z.imag, color=MUTED if ratio == 0.0 else "#dfe3e8", linewidth=1.0 if ratio == 0.0 else 0.7
        )
        if ratio:
            axes.annotate(
                f"{ratio:g}",
                (z.real[-1], z.imag[-1]),
                xytext=(0, 2),
                textcoords="offset points",
                color=MUTED,
                fontsize=7.5,
                ha="center",
            )
    axes.set_xlim(0.966, 1.0055)
    axes.set_ylim(-0.006, 0.182)
    axes.set_xlabel("Re z [1]")
    axes.set_ylabel("Im z [1]")
    axes.grid(visible=False)
    axes.set_title("upper half near z = 1: unit circle, lines of equal frequency and of equal damping ratio")


def _whole(axes: Axes, view: SetView, points: Sequence[OperatingPointModes]) -> None:
    for point in points:
        _draw(axes, view, point, everything=True)
    draw_z_plane(axes, view.sample_time)


def _pole(frequency: float | Array, damping: float | Array, sample_time: float) -> Poles:
    """Return the poles z of a frequency [Hz] and a damping ratio, one of them (points,)."""
    size, ratio = 2.0 * np.pi * np.asarray(frequency), np.asarray(damping)
    return np.exp(sample_time * size * (-ratio + 1j * np.sqrt(1.0 - ratio**2)))


def _draw(axes: Axes, view: SetView, point: OperatingPointModes, everything: bool) -> None:
    for mode in point.reference:
        axes.plot(mode.pole.real, mode.pole.imag, "o", mfc="none", mec=INK, ms=8, mew=1.0, zorder=3)
    for marker, model in zip(_MARKERS, compared(view), strict=False):
        found: list[Mode | None] = list(point.models[model.title])
        if everything:
            found += point.others[model.title]
        for own in found:
            if own is not None:
                axes.plot(own.pole.real, own.pole.imag, marker, color=model.colour, ms=6, mew=1.5, zorder=4)


def _zoom(axes: Axes, view: SetView, points: Sequence[OperatingPointModes], index: int, name: str) -> None:
    for point in points:
        _draw(axes, view, point, everything=False)
    poles = np.array([point.reference[index].pole for point in points])
    axes.plot(poles.real, poles.imag, color=INK, linewidth=0.6, zorder=1)
    centre = 0.5 * (poles.real.max() + poles.real.min()) + 0.5j * (poles.imag.max() + poles.imag.min())
    half_width = max(1.1 * np.ptp(poles.real), _LEAST_SPAN)
    half_height = max(0.8 * np.ptp(poles.imag), _LEAST_SPAN)
    axes.set_xlim(centre.real - half_width, centre.real + half_width)
    axes.set_ylim(centre.imag - half_height, centre.imag + half_height)
    for point in (points[0], points[-1]):
        pole = point.reference[index].pole
        left = pole.real <= centre.real
        axes.annotate(
            operating_point_name(point.height),
            (pole.real, pole.imag),
            xytext=(-9 if left else 9, 0),
            textcoords="offset points",
            ha="right" if left else "left",
            va="center",
            fontsize=7.5,
            color=MUTED,
        )
    axes.set_title(f"mode {name}")
    axes.set_xlabel("Re z [1]")
    axes.locator_params(axis="x", nbins=3)
    axes.locator_params(axis="y", nbins=5)
    axes.ticklabel_format(useOffset=False)
    if index == 0:
        axes.set_ylabel("Im z [1]")
