"""Figures that need the data themselves, drawn beside them: poles and spectra of one seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from cosimulation.candidates import Candidate, head_forces
from cosimulation.demo import SetResult
from cosimulation.linearise import Linearisation
from cosimulation.pantograph import INPUTS, SIGNALS, operating_point_name
from cosimulation.report.figures.drawing import (
    INK,
    MUTED,
    PALETTE,
    SYMBOLS,
    drawing_style,
    inline_svg,
    new_figure,
)
from cosimulation.report.figures.poles import poles_figure
from cosimulation.report.figures.spectra import HIGHEST, amplitude_density
from cosimulation.report.modes import modes, reference_poles
from cosimulation.report.views import ModelView, SetView
from cosimulation.scoring import ScoredRun
from cosimulation.study.local_models import LocalModelSource
from cosimulation.study.order import with_forces
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import ParameterSet
from identification import n4sid
from identification.arrays import Array
from identification.n4sid import LocalModels
from identification.network import NetworkSettings
from identification.scores import scored_rows
from identification.surrogate import SurrogateResult, network

_SHOWN = (("xi_dot", "m/s"), ("zeta_dot", "m/s"), ("F_p", "N"))
"""Signals of Figures 4.16, 4.17 and 4.18."""
_DECADES = 1e-4
"""Of the largest density: what is smaller is not shown."""
_NAMES = ("surrogate", "n4sid")
_LINEARISED = "linearised white-box model"
_DASHES: dict[str, Any] = {"n4sid": (0, (4, 2)), _LINEARISED: (0, (1, 1.5))}


def drawings(
    source: LocalModelSource, result: SurrogateResult, local: LocalModels, truth: Sequence[Linearisation]
) -> list[dict[str, Any]]:
    """Return a record with an SVG per figure.

    Args:
        source: The data of a seed.
        result: The surrogate.
        local: The black-box models it was made from.
        truth: The reference linearised at their heights.
    """
    plain = NetworkSettings(validity="cubic", blending="parameter")
    sets = {
        "surrogate": network("surrogate", result, head_forces(source.wbm)),
        "n4sid": n4sid.network("n4sid", local, plain, head_forces(source.wbm)),
    }
    poles = (
        f"Set {source.wbm}, seed {source.seed}: poles of the local models in the z plane, upper half near 1, "
        "and one zoom per mode; black lines join the linearised white-box model's poles from the lowest to "
        "the highest operating point (thesis Figure 4.33)."
    )
    found = [{"drawing": "poles", "svg": poles_figure(_view(source, sets, truth)), "caption": poles}]
    if source.data.select("operating_point", "test"):
        spectra = (
            f"Set {source.wbm}, seed {source.seed}: amplitude density at the operating points on fresh data, "
            "over the largest of the white-box model, and below it that of the models' errors (thin); "
            "shaded: its modes there (thesis Figures 4.16 to 4.18)."
        )
        svg = _spectra(source, sets, truth)
        found.append({"drawing": "spectra", "svg": svg, "caption": spectra})
    return found


def _view(
    source: LocalModelSource, sets: Mapping[str, ParameterSet], truth: Sequence[Linearisation]
) -> SetView:
    """Return the models as the report's figures take them."""
    (test,) = source.data.select("whole_range", "test")
    models = []
    for index, (name, parameter_set) in enumerate(sets.items()):
        run = ScoredRun(test, _outputs(parameter_set, test.data.matrix(INPUTS)), (), 0.0)
        candidate = Candidate(name, parameter_set, {})
        models.append(ModelView(candidate, {"test": run}, {}, None, PALETTE[1 - index], "solid"))
    return SetView(SetResult(source.wbm, source.data, linearisations=tuple(truth)), tuple(models))


def _outputs(parameter_set: ParameterSet, inputs: Array) -> Array:
    """Return the columns of `SIGNALS`."""
    order = [parameter_set.output_names.index(name) for name in SIGNALS]
    return simulate(parameter_set, inputs)[:, order]


def _spectra(
    source: LocalModelSource, sets: Mapping[str, ParameterSet], truth: Sequence[Linearisation]
) -> str:
    """Return a row per signal, a column per operating point."""
    points = source.data.select("operating_point", "test")
    heights = [point.height or 0.0 for point in points]
    exact = source.linearised(heights)
    with drawing_style():
        figure = new_figure(7.0)
        grid = figure.subplots(len(_SHOWN), len(points), sharex=True, sharey=True, squeeze=False)
        for column, (point, model, linearisation) in enumerate(zip(points, exact, truth, strict=True)):
            inputs = point.data.matrix(INPUTS)
            curves = {
                "white-box model": (point.data.matrix(SIGNALS), INK),
                _LINEARISED: (
                    with_forces(source.wbm, model.simulate(inputs), point.data.column("eta")),
                    PALETTE[2],
                ),
            }
            for index, name in enumerate(_NAMES):
                curves[name] = (_outputs(sets[name], inputs), PALETTE[1 - index])
            found = modes(reference_poles(linearisation, model.sample_time), model.sample_time)
            resonances = [mode.frequency for mode in found if mode.oscillates]
            for axes, (signal, _) in zip(grid[:, column], _SHOWN, strict=True):
                _one(axes, signal, curves, model.sample_time, resonances)
            grid[0, column].set_title(operating_point_name(heights[column]))
            grid[-1, column].set_xlabel("frequency [Hz]")
        for axes, (signal, _) in zip(grid[:, 0], _SHOWN, strict=True):
            axes.set_ylabel(f"{SYMBOLS[signal]}, relative [1]")
        grid[0, 0].set_xlim(0.0, HIGHEST)
        grid[0, 0].set_ylim(_DECADES, 2.0)
        handles, labels = grid[0, 0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=4)
        names = ", ".join(signal for signal, _ in _SHOWN)
        what = f"Amplitude spectra of {names} at the operating points, set {source.wbm}."
        return inline_svg(figure, f"op-spectra-{source.wbm}", what)


def _one(
    axes: Axes,
    signal: str,
    curves: Mapping[str, tuple[Array, str]],
    sample_time: float,
    resonances: Sequence[float],
) -> None:
    for resonance in resonances:
        axes.axvline(resonance, color="#f1e7c9", linewidth=3.0, zorder=0)
    column, largest = SIGNALS.index(signal), 0.0
    reference: Array = np.zeros(0)
    for name, (outputs, colour) in curves.items():
        values = outputs[scored_rows(len(outputs)), column]
        with np.errstate(over="ignore", invalid="ignore"):
            frequency, density = amplitude_density(values, sample_time)
        largest = largest or float(density.max())
        first = name == "white-box model"
        axes.semilogy(
            frequency, density / largest, color=colour, linewidth=2.4 if first else 1.0,
            linestyle=_DASHES.get(name, "solid"), alpha=0.4 if first else 1.0, label=name,
        )  # fmt: skip
        if not first:
            error = values - reference
            frequency, density = amplitude_density(error, sample_time)
            axes.semilogy(frequency, density / largest, color=colour, linewidth=0.7, alpha=0.8)
        else:
            reference = values
    axes.tick_params(labelcolor=MUTED)
