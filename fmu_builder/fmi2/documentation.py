"""The page an importer shows when somebody asks what an FMU is, for models that bring none of their own."""

from __future__ import annotations

from html import escape
from pathlib import Path

from fmu_builder.fmi2.interface import Interface


def _row(cells: list[str], tag: str = "td") -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def licence_page() -> dict[str, bytes]:
    """Return the licence of the C sources, to go into documentation/: it demands to go with every copy."""
    return {"licenses/license.txt": (Path(__file__).parent / "license.txt").read_bytes()}


def index_page(interface: Interface) -> str:
    """Return documentation/index.html: what the model is and a table of its variables."""
    head = ["name", "causality", "unit", "start", "minimum", "maximum", "description"]
    rows = [
        _row(
            [
                interface.shown_name(variable),
                variable.causality,
                variable.unit,
                *("" if x is None else str(x) for x in (variable.start, variable.minimum, variable.maximum)),
                variable.description,
            ]
        )
        for variable in interface.variables
    ]
    name = escape(interface.model_name)
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en">',
            f'<head><meta charset="utf-8"><title>{name}</title></head>',
            f"<body>\n<h1>{name}</h1>",
            f"<p>{escape(interface.description)}</p>",
            f"<p>Version {escape(interface.version)}, licence {escape(interface.licence or '-')}.</p>",
            "<table>",
            _row(head, "th"),
            *rows,
            "</table>\n</body>\n</html>\n",
        ]
    )
