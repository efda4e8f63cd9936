"""Spectra of velocities and forces on the test data (thesis Figures 4.16 to 4.18 in purpose)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from scipy.signal import welch

from cosimulation.report.figures.drawing import INK, MUTED, SYMBOLS, drawing_style, inline_svg, new_figure
from cosimulation.report.modes import mode_bands, mode_name
from cosimulation.report.views import SetView
from identification.arrays import Array

SIGNALS_SHOWN = (("xi_dot", "m/s"), ("zeta_dot", "m/s"), ("F_H", "N"), ("F_p", "N"))
HIGHEST = 30.0
"""Highest frequency shown [Hz]."""
SEGMENT_SECONDS = 8.192


def amplitude_density(values: Array, sample_time: float) -> tuple[Array, Array]:
    """Return frequencies up to `HIGHEST` [Hz] and the amplitude density [unit/sqrt(Hz)], Welch's method.

    Hann windows of `SEGMENT_SECONDS`, half overlapping, mean removed.

    Args:
        values: The signal, (rows,).
        sample_time: s.
    """
    segment = min(len(values), round(SEGMENT_SECONDS / sample_time))
    frequency, power = welch(values, 1.0 / sample_time, "hann", segment, detrend="constant")
    shown = (frequency > 0.0) & (frequency <= HIGHEST)
    return frequency[shown], np.sqrt(power[shown])


def spectra_figure(view: SetView) -> str:
    """Return the spectra of four signals, reference against models, with the reference's modes marked."""
    with drawing_style():
        figure = new_figure(6.4)
        grid = figure.subplots(2, 2, sharex=True)
        for axes, (signal, unit) in zip(grid.flat, SIGNALS_SHOWN, strict=True):
            _spectrum(axes, view, signal, unit)
        for axes in grid[-1]:
            axes.set_xlabel("frequency [Hz]")
        grid[0, 0].set_xlim(0.0, HIGHEST)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2)
        names = ", ".join(signal for signal, _ in SIGNALS_SHOWN)
        alternative = f"Amplitude spectra of {names} from 0 to 30 Hz, set {view.name}: reference and models."
        return inline_svg(figure, f"spectra-{view.name}", alternative)


def _spectrum(axes: Axes, view: SetView, signal: str, unit: str) -> None:
    bands = mode_bands(view)
    for index, (low, high) in enumerate(bands):
        axes.axvspan(low, high, color="#f1e7c9", linewidth=1.5, zorder=0)
        axes.annotate(
            f"$f_{{{mode_name(index, len(bands))}}}$",
            (0.5 * (low + high), 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, -3),
            textcoords="offset points",
            ha="center",
            va="top",
            color=MUTED,
        )
    frequency, density = amplitude_density(view.reference(signal)[view.scored], view.sample_time)
    lowest, highest = density.min(), density.max()
    axes.semilogy(frequency, density, color=INK, linewidth=2.2, label="reference", alpha=0.85)
    for model in view.models:
        with np.errstate(over="ignore"):
            frequency, density = amplitude_density(model.output(signal)[view.scored], view.sample_time)
        if np.isfinite(density).all():
            axes.semilogy(
                frequency, density, color=model.colour, linestyle=model.dashes, lw=1.0, label=model.title
            )
    axes.set_ylim(lowest / 2.5, highest * 6.0)
    axes.set_ylabel(f"{SYMBOLS[signal]} [{unit} / " + r"$\sqrt{\mathrm{Hz}}$]")
