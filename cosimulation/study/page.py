"""The page of a study: limits first, then coloured tables and figures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from cosimulation.report.tables import Row as TextRow
from cosimulation.report.template import TEMPLATES as REPORT_TEMPLATES
from cosimulation.study.limits import Limit, Verdict

TEMPLATES = Path(__file__).parent / "templates"
RED, YELLOW, GREEN = (246, 165, 158), (252, 236, 165), (159, 212, 158)
Cell = tuple[float, float | None]
"""A figure and a smaller one below it."""


@dataclass(frozen=True)
class Row:
    """One row of a table.

    Attributes:
        name: Heading.
        cells: One per column.
        yardstick: Whether it is there to measure the others by, not to choose.
    """

    name: str
    cells: Sequence[Cell]
    yardstick: bool = False


@dataclass(frozen=True)
class Table:
    """A coloured table of FIT values.

    Attributes:
        caption: What is shown.
        corner: Heading of the first column.
        columns: Headings of the others.
        rows: One cell per column each.
    """

    caption: str
    corner: str
    columns: Sequence[str]
    rows: Sequence[Row]


@dataclass(frozen=True)
class TextTable:
    """A table of anything else, with the report's cells.

    Attributes:
        caption: What is shown.
        corner: Heading of the first column.
        columns: Headings of the others.
        rows: One cell per column each.
        prose: Whether the cells hold sentences rather than numbers.
    """

    caption: str
    corner: str
    columns: Sequence[str]
    rows: Sequence[TextRow]
    prose: bool = False


@dataclass(frozen=True)
class Drawing:
    """An inline SVG with its caption."""

    svg: Markup
    caption: str


@dataclass(frozen=True)
class Section:
    """One section of the page."""

    title: str
    text: str
    tables: Sequence[Table] = field(default_factory=tuple)
    figures: Sequence[Drawing] = field(default_factory=tuple)
    text_tables: Sequence[TextTable] = field(default_factory=tuple)


def colour(fit: float) -> str:
    """Return the colour of a FIT: red 0, yellow 50, green 100 % (thesis Figure 4.20)."""
    if not math.isfinite(fit):
        return "#e4e7eb"
    share = min(max(fit, 0.0), 100.0) / 50.0
    low, high = (RED, YELLOW) if share < 1.0 else (YELLOW, GREEN)
    part = share if share < 1.0 else share - 1.0
    mixed = (round(a + (b - a) * part) for a, b in zip(low, high, strict=True))
    return "#" + "".join(f"{value:02x}" for value in mixed)


def number(fit: float) -> str:
    """Return a FIT as text."""
    if math.isnan(fit):
        return "none"
    if math.isinf(fit):
        return "ran away"
    if fit <= -1000.0:
        return "< \N{MINUS SIGN}1000"
    return f"{fit:.2f}".replace("-", "\N{MINUS SIGN}")


def exact(fit: float) -> str:
    """Return a FIT or a difference of two with the digits that decide a limit."""
    return "none" if math.isnan(fit) else f"{fit:.3f}".replace("-", "\N{MINUS SIGN}")


def asked(limit: Limit) -> str:
    """Return what a limit asks for as text."""
    sign = "\N{LESS-THAN OR EQUAL TO}" if limit.measure else "\N{GREATER-THAN OR EQUAL TO}"
    parts = [
        f"{name} {sign} {value:g}"
        for name, value in (*limit.asked, ("stretch", limit.stretch))
        if value is not None
    ]
    return ", ".join(parts)


def render(
    title: str, lead: str, verdicts: Sequence[Verdict], sections: Sequence[Section], settings: str
) -> str:
    """Return the whole page: the same text for the same results."""
    environment = Environment(
        loader=FileSystemLoader([TEMPLATES, REPORT_TEMPLATES]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    environment.globals.update(colour=colour, number=number, exact=exact, asked=asked)
    style = (REPORT_TEMPLATES / "style.css").read_text(encoding="utf-8")
    return environment.get_template("study.html.jinja").render(
        title=title,
        lead=lead,
        verdicts=[verdict for verdict in verdicts if verdict.limit.measure is None],
        measured=[verdict for verdict in verdicts if verdict.limit.measure is not None],
        yardsticks=any(verdict.yardstick is not None for verdict in verdicts),
        sections=sections,
        settings=settings,
        style=Markup(style),
    )
