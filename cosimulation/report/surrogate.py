"""Theta of a surrogate as tables show it: both thetas with standard errors beside Table 4.3, and in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cosimulation.report import thesis
from cosimulation.report.figures.drawing import PALETTE
from cosimulation.report.figures.theta import ThetaPanel, ThetaSeries, theta_figure
from cosimulation.report.tables import Cell, Row, number, significant
from cosimulation.report.views import SetView
from identification.surrogate import LARGEST_CONDITION, STATE_NAMES, SurrogateResult, Which

THETAS: tuple[tuple[Which, str], ...] = (("physical", "frequency response"), ("tuned", "after output error"))
"""Both thetas with their names for a person."""
_MARKERS = ("o", "s")
_CURVE_POINTS = 81


INFORMATION = {
    "partial": "Without coupling over time, as in the thesis (eq. 5.1-5.2): the state counts as given. Where "
    "the thesis has a dash, a parameter acts only through the hold of one sample: many decades less.",
    "coupled": "With the coupling over time (eq. 5.3): through the whole simulation.",
}
"""What the two kinds of Fisher information are."""


@dataclass(frozen=True)
class InformationTable:
    """Exponents of ten of Fisher information, a row per state and a column per parameter.

    Attributes:
        caption: Which kind.
        columns: Names of the parameters.
        rows: One per state.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]


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
        diagram: The chain of masses in one line.
        fit_errors: How well the frequency responses were met, and from which starts, in words.
        sure: Whether there are standard errors.
        correlated: Pairs of parameters that data hardly tell apart, in words.
        remarks: Per theta its name and what cannot be told, in words.
        condition: Of the Fisher matrix scaled to unit diagonal, in words.
        information: Fisher information without and with the coupling over time.
        figure: SVG of theta over the height.
    """

    title: str
    description: str
    recommended: str
    reason: str
    head: str
    columns: tuple[str, ...]
    rows: tuple[Row, ...]
    diagram: str
    fit_errors: str
    sure: bool
    correlated: tuple[str, ...]
    remarks: tuple[tuple[str, tuple[str, ...]], ...]
    condition: str
    information: tuple[InformationTable, ...]
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
        rows += published_rows(parameter.name, len(result.physical))
    errors = ", ".join(f"{100.0 * fit.relative_error:.1f} %" for fit in result.responses)
    starts = list(dict.fromkeys(fit.account for fit in result.responses))
    if len(starts) > 1:
        starts = [f"LLM {index + 1}: {fit.account}" for index, fit in enumerate(result.responses)]
    tuned = f" Output error started from the {result.tuned_from}." if result.tuned_from else ""
    description = result.structure.description
    head = result.parameters().head.items()
    return SurrogateTable(
        title=title,
        description=description[:1].upper() + description[1:],
        recommended=dict(THETAS)[result.recommended],
        reason=result.reason[:1].upper() + result.reason[1:],
        head=", ".join(f"{name} = {quantity.value:g} {quantity.unit}" for name, quantity in head),
        columns=tuple(f"LLM {index + 1}, {centre:g} m" for index, centre in enumerate(result.frame.centres)),
        rows=tuple(rows),
        diagram=result.structure.diagram,
        fit_errors=f"Relative error of the frequency-response fits: {errors}; "
        f"what they started from: {'; '.join(starts)}.{tuned}",
        sure=any(np.isfinite(result.standard_errors(which)).any() for which, _ in THETAS),
        correlated=result.correlated(),
        remarks=tuple((label, told) for which, label in THETAS if (told := result.remarks(which))),
        condition="" if result.certainty is None else _condition(result.certainty.condition),
        information=_information(result),
        figure=_figure(result, name),
    )


def published_rows(name: str, count: int) -> list[Row]:
    """Return the row of Table 4.3 of a parameter, if the thesis has it for so many local models."""
    published, unit = thesis.SURROGATE_PARAMETERS.get(name, ()), ""
    if name == "b_M":
        published = tuple(1.0 / value for value in thesis.SURROGATE_PARAMETERS["r_M"])
        unit = ", 1/r_M"
    if len(published) != count:
        return []
    return [
        Row(f"thesis, Table 4.3{unit}", tuple(Cell(number(one), repr(one)) for one in published), "thesis")
    ]


def exponent(value: float) -> Cell:
    """Return the exponent of ten of Fisher information, as in Table 5.2; a dash where there is none."""
    if not value > 0.0:
        return Cell("\N{EN DASH}", repr(value))
    return Cell(f"{int(np.floor(np.log10(value)))}".replace("-", "\N{MINUS SIGN}"), repr(value))


def _condition(value: float) -> str:
    """Return what the condition of the scaled Fisher matrix says."""
    if value <= LARGEST_CONDITION:
        return f"Condition of the Fisher matrix scaled to unit diagonal: {value:.2g}."
    size = f"is {value:.2g}, above {LARGEST_CONDITION:.0e}" if np.isfinite(value) else "is beyond all bounds"
    return (
        f"The condition of the Fisher matrix scaled to unit diagonal {size}: there are no standard errors of "
        "the theta after output error."
    )


def _information(result: SurrogateResult) -> tuple[InformationTable, ...]:
    """Return Table 5.2 in shape, summed over the local models, without and with the coupling over time."""
    told = result.certainty
    if told is None:
        return ()
    found = []
    for kind, table in (("partial", told.partial), ("coupled", told.coupled)):
        rows = tuple(
            Row(state, tuple(exponent(float(value)) for value in values))
            for state, values in zip(STATE_NAMES, table.sum(axis=1), strict=True)
        )
        found.append(InformationTable(INFORMATION[kind], result.structure.names, rows))
    return tuple(found)


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
