"""Figures of the study: lost contact over time, what it does to the FIT, and the loop of friction."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cosimulation.pantograph import TORQUE
from cosimulation.report.figures.drawing import INK, MUTED, PALETTE, drawing_style, inline_svg, new_figure
from cosimulation.study.contact.results import Results
from cosimulation.study.contact.task import TWIN
from cosimulation.study.page import Drawing
from cosimulation.study.side_by_side import SAMPLE_TIME, WHITE_BOX, Record, model_of

WORST_FIT = -100.0
"""What is worse is drawn here [%]."""
_DASHED = (0, (4, 2))
_DOTTED = (0, (1, 1.5))
_STYLES = ("solid", _DASHED, _DOTTED)


def over_friction(results: Results) -> Drawing:
    """Return the FIT of F_p over Coulomb's torque in the base joint."""
    axis = {case.name for case in results.settings.frictions if case.axis}

    def draw(axes: Axes, wbm: str) -> None:
        for colour, network in zip(PALETTE, results.networks(wbm), strict=False):
            for amplitude, dashes in zip(results.settings.friction_amplitudes, _STYLES, strict=False):
                points = {
                    one.coulomb: results.fit(wbm, network, one, "bilateral")
                    for one in results.frictions(amplitude)
                    if one.friction in axis
                }
                _curve(axes, points, colour, dashes, f"{model_of(network)}, amplitude {amplitude:g}", 0.0)
        axes.set_xlabel("$T_c$ in the base joint [N.m]")
        axes.set_ylim(0.0, 101.0)

    caption = (
        "FIT of the contact force over Coulomb friction in the base joint of the white-box model, median "
        "over the seeds. The networks know of no friction; n4sid hides the surrogate where they agree; what "
        "is below zero is drawn at zero."
    )
    return _panels("friction", results.sets, draw, "FIT of $F_p$ [%]", caption, 3.2)


def over_amplitude(results: Results) -> Drawing:
    """Return FIT of F_p and time without contact over the amplitude of the excitation."""
    with drawing_style():
        figure = new_figure(5.6)
        grid = figure.subplots(2, len(results.sets), sharey="row", sharex=True, squeeze=False)
        for column, wbm in enumerate(results.sets):
            _fit_over_amplitude(grid[0][column], results, wbm)
            _loss_over_amplitude(grid[1][column], results, wbm)
            grid[0][column].set_title(f"white-box set {wbm}")
            grid[1][column].set_xlabel("amplitude of the excitation (1: acceptance recipe)")
        grid[0][0].set_ylabel("FIT of $F_p$ [%]")
        grid[1][0].set_ylabel("time without contact [%]")
        _legend(figure, grid[0][0])
        caption = (
            f"Lift-off at {TORQUE:g} N.m: FIT of the contact force (above; what is worse is drawn at "
            f"{_minus(WORST_FIT)} %) and time without contact (below) over the amplitude, median over the "
            "seeds. The twin is the white-box model itself on a wire that is a hair higher: beyond the "
            "amplitude where it fails, nobody predicts the single bounce."
        )
        svg = inline_svg(figure, "amplitude", caption)
    return Drawing(Markup(svg), caption)


def _fit_over_amplitude(axes: Axes, results: Results, wbm: str) -> None:
    cases = [
        (network, contact, colour, dashes, f"{model_of(network)}, unilateral {word}")
        for colour, network in zip(PALETTE, results.networks(wbm), strict=False)
        for contact, dashes, word in (("unilateral", "solid", "on"), ("bilateral", _DASHED, "off"))
    ]
    for network, contact, colour, dashes, label in [*cases, (TWIN, "unilateral", INK, _DOTTED, "twin")]:
        points = {one.amplitude: results.fit(wbm, network, one, contact) for one in results.lift_offs()}
        _curve(axes, points, colour, dashes, label, WORST_FIT)
    axes.set_xscale("log")
    axes.set_ylim(WORST_FIT, 103.0)


def _loss_over_amplitude(axes: Axes, results: Results, wbm: str) -> None:
    def points(network: str, contact: str, field: str = "value") -> dict[float, float]:
        return {
            one.amplitude: results.value("time without contact", wbm, network, one, contact, field)
            for one in results.lift_offs()
        }

    for colour, network in zip(PALETTE, results.networks(wbm), strict=False):
        _curve(axes, points(network, "unilateral"), colour, "solid", "")
        _curve(axes, points(network, "bilateral"), colour, _DASHED, "")
    reference = points(results.networks(wbm)[0], "unilateral", "reference")
    _curve(axes, reference, INK, _DOTTED, "white-box model")
    axes.legend(loc="upper left")
    axes.set_xticks(sorted(reference), [f"{one:g}" for one in sorted(reference)])
    axes.minorticks_off()


def close_up(results: Results) -> Drawing:
    """Return the contact force around a lost contact: white-box model, networks, networks that pull."""

    def draw(axes: Axes, wbm: str) -> None:
        curves = results.drawings("close-up", wbm)
        _time_curves(axes, curves)
        axes.set_xlabel("time [s]")

    caption = (
        "Contact force around the longest lost contact in the first half of the record at the amplitude "
        f"{results.settings.shown_amplitude:g}: the white-box model, the networks with unilateral on, and "
        "(dashed) with it off."
    )
    return _panels("close-up", results.sets, draw, "$F_p$ [N]", caption, 3.4)


def jumps(results: Results, title: str, name: str) -> Drawing:
    """Return the contact force after the wire has jumped."""

    def draw(axes: Axes, wbm: str) -> None:
        chosen = [item for item in results.drawings("jump", wbm) if item["title"] == title]
        _time_curves(axes, [item for item in chosen if item["contact"] == "unilateral"])
        axes.set_xlim(-0.05, 0.4)
        axes.set_xlabel("time after the jump [s]")

    caption = f"Contact force, {title} at once: white-box model and networks, unilateral on."
    return _panels(name, results.sets, draw, "$F_p$ [N]", caption, 3.0)


def loops(results: Results) -> Drawing:
    """Return the contact force over the height on a slow ramp up and down."""

    def draw(axes: Axes, wbm: str) -> None:
        curves = results.drawings("loop", wbm)
        dry = [item for item in curves if item["network"] == WHITE_BOX]
        shades = np.linspace(0.75, 0.0, len(dry)) if len(dry) > 1 else [0.0]
        for shade, item in zip(shades, dry, strict=True):
            axes.plot(item["height"], item["force"], color=str(shade), linewidth=1.0, label=item["friction"])
        for colour, item in zip(PALETTE, [one for one in curves if one not in dry], strict=False):
            axes.plot(
                item["height"],
                item["force"],
                color=colour,
                linestyle=_DASHED,
                label=model_of(item["network"]),
            )
        low, high = results.settings.ramp_counted
        axes.set_xlim(low, high)
        axes.set_ylim(*_span(curves, low, high))
        axes.set_xlabel("height of the wire [m]")

    caption = (
        "Contact force over the height of the wire on a slow ramp up and down: white-box model with "
        "friction (grey to black), below on the rising and above on the falling wire; the networks (dashed) "
        "run on one line."
    )
    return _panels("loops", results.sets, draw, "$F_p$ [N]", caption, 3.8, True)


def _span(curves: Sequence[Record], low: float, high: float) -> tuple[float, float]:
    """Return the least and the largest force between two heights, with some air [N]."""
    forces = [
        np.asarray(item["force"])[(np.asarray(item["height"]) > low) & (np.asarray(item["height"]) < high)]
        for item in curves
    ]
    found = np.concatenate(forces)
    return float(found.min()) - 3.0, float(found.max()) + 3.0


def _time_curves(axes: Axes, curves: Sequence[Record]) -> None:
    names = [name for name in dict.fromkeys(item["network"] for item in curves) if name != WHITE_BOX]
    for item in curves:
        time = item["begin"] + SAMPLE_TIME * np.arange(len(item["force"]))
        if item["network"] == WHITE_BOX:
            axes.plot(time, item["force"], color=INK, linewidth=2.2, alpha=0.45, label="white-box model")
            continue
        off = item["contact"] == "bilateral"
        label = model_of(item["network"]) + (", unilateral off" if off else "")
        colour = PALETTE[names.index(item["network"])]
        axes.plot(time, item["force"], color=colour, linestyle=_DOTTED if off else "solid", label=label)
    axes.axhline(0.0, color=MUTED, linewidth=0.6)


def _curve(
    axes: Axes, points: dict[float, float], colour: str, dashes: object, label: str, least: float = -np.inf
) -> None:
    amplitudes = sorted(points)
    values = np.maximum([points[one] for one in amplitudes], least)
    axes.plot(amplitudes, values, color=colour, linestyle=dashes, marker="o", ms=3, label=label or None)


def _panels(
    name: str,
    sets: Sequence[str],
    draw: Callable[[Axes, str], None],
    quantity: str,
    caption: str,
    height: float,
    own_scale: bool = False,
) -> Drawing:
    with drawing_style():
        figure = new_figure(height)
        grid = figure.subplots(1, len(sets), sharey=not own_scale, squeeze=False)[0]
        for axes, wbm in zip(grid, sets, strict=True):
            draw(axes, wbm)
            axes.set_title(f"white-box set {wbm}")
        grid[0].set_ylabel(quantity)
        _legend(figure, grid[0])
        svg = inline_svg(figure, name, caption)
    return Drawing(Markup(svg), caption)


def _legend(figure: Figure, axes: Axes) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4)


def _minus(value: float) -> str:
    return f"{value:g}".replace("-", "\N{MINUS SIGN}")
