"""Theta of a surrogate as tables show it: both thetas with standard errors beside Table 4.3, and in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosimulation.report import thesis
from cosimulation.report.figures.drawing import PALETTE
from cosimulation.report.figures.theta import ThetaPanel, ThetaSeries, theta_figure
from cosimulation.report.tables import Cell, Row, number, significant
from cosimulation.report.views import SetView
from identification.surrogate import SurrogateResult, Which

THETAS: tuple[tuple[Which, str], ...] = (("physical", "frequency response"), ("tuned", "after output error"))
"""Both thetas with their names for a person."""
_MARKERS = ("o", "s")
_CURVE_POINTS = 81


@dataclass(frozen=True)
class SurrogateTable:
    """Theta of a surrogate.

    Attributes:
        title: The model.
        description: Its structure.
        recommended: Which theta the FMU is made of, in words.
        reason: Why.
        head: The collector head, in words.
        columns: Names of the local models.
        rows: Three rows per parameter.
        fit_errors: How well the frequency responses were met, in words.
        sure: Whether there are standard errors.
        correlated: Pairs of parameters that data hardly tell apart, in words.
        remarks: What cannot be told, in words.
        figure: SVG of theta over the height.
    """

    title: str
    description: str
    recommended: str
    reason: str
    head: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    fit_errors: str
    sure: bool
    correlated: tuple[str, ...]
    remarks: tuple[str, ...]
    figure: str


def surrogate_tables(view: SetView) -> tuple[SurrogateTable, ...]:
    """Return the table of every surrogate of a white-box set."""
    return tuple(
        surrogate_table(model.title, model.candidate.surrogate, f"{view.name}-{model.candidate.name}")
        for model in view.surrogates
        if model.candidate.surrogate is not None
    )


def surrogate_table(title: str, result: SurrogateResult, name: str) -> SurrogateTable:
    """Return theta per local model, physical and tuned, with standard errors beside Table 4.3.

    Args:
        title: The model, for a person.
        result: The surrogate.
        name: Unique in the page.
    """
    rows: list[Row] = []
    for index, parameter in enumerate(result.structure.parameters):
        rows.append(Row(f"{parameter.name} [{parameter.unit}]", (Cell(parameter.description),), "group"))
        for which, label in THETAS:
            cells = _cells(result, which, index)
            rows.append(Row(label, cells, "mark" if which == result.recommended else "ours"))
        published = thesis.SURROGATE_PARAMETERS.get(parameter.name, ())
        if len(published) == len(result.physical):
            values = tuple(Cell(number(value), repr(value)) for value in published)
            rows.append(Row("thesis, Table 4.3", values, "thesis"))
    errors = ", ".join(f"{100.0 * fit.relative_error:.1f} %" for fit in result.responses)
    starts = ", ".join(
        f"{fit.start}, {fit.agreed} of {fit.starts} agree" if fit.fallback else fit.start
        for fit in result.responses
    )
    description = result.structure.description
    head = result.parameters().head.items()
    return SurrogateTable(
        title=title,
        description=description[:1].upper() + description[1:],
        recommended=dict(THETAS)[result.recommended],
        reason=result.reason,
        head=", ".join(f"{name} = {quantity.value:g} {quantity.unit}" for name, quantity in head),
        columns=tuple(f"LLM {index + 1}, {centre:g} m" for index, centre in enumerate(result.frame.centres)),
        rows=tuple(rows),
        fit_errors=f"Relative error of the frequency-response fits: {errors}; "
        f"what they started from: {starts}.",
        sure=any(np.isfinite(result.standard_errors(which)).any() for which, _ in THETAS),
        correlated=result.correlated(),
        remarks=() if result.certainty is None else result.certainty.remarks,
        figure=_figure(result, name),
    )


def _cells(result: SurrogateResult, which: Which, index: int) -> tuple[Cell, ...]:
    """Return one parameter of every local model with standard error and bound."""
    name, found = result.structure.names[index], []
    table = zip(result.theta(which), result.standard_errors(which), result.at_bound(which), strict=True)
    for theta, errors, held in table:
        value, error = float(theta[index]), float(errors[index])
        small = f"\N{PLUS-MINUS SIGN} {significant(error, 3)}" if np.isfinite(error) else ""
        found.append(Cell(significant(value), repr(value), small=small, note=held.get(name, "")))
    return tuple(found)


def _figure(result: SurrogateResult, name: str) -> str:
    """Return theta over the height: local models with standard errors, and the blend between them."""
    blend, panels = result.frame.theta_blend, []
    centres = np.array(result.frame.centres)
    known = result.local.settings
    heights = np.linspace(known.low, known.high, _CURVE_POINTS)
    curves = {}
    for which, _ in THETAS:
        if blend is not None:
            shares = blend.shares(result.parameters_of(which).warp)
            blended = result.structure.blended(result.theta(which), shares)
            curves[which] = [np.interp(heights, blend.positions, column) for column in blended.T]
    for index, parameter in enumerate(result.structure.parameters):
        series = [
            ThetaSeries(
                label,
                PALETTE[place],
                _MARKERS[place],
                centres,
                result.theta(which)[:, index],
                result.standard_errors(which)[:, index],
                line=(heights, curves[which][index]) if which in curves else None,
            )
            for place, (which, label) in enumerate(THETAS)
        ]
        panels.append(ThetaPanel(parameter.name, parameter.unit, series))
    return theta_figure(name, panels)
