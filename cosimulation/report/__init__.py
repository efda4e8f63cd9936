"""The report: one HTML file that opens by double click, and a picture of the result."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmu_builder.files import write_text

if TYPE_CHECKING:
    from cosimulation.demo import DemoResult

PICTURE = "picture.svg"
"""Name of the picture beside the report."""


def write_report(path: Path, result: DemoResult) -> None:
    """Write the report of a demo: the same bytes for the same result.

    Args:
        path: The HTML file.
        result: What the demo found out.

    Raises:
        OutputError: The file cannot be written.
    """
    from cosimulation.report.page import render

    write_text(path, render(result))


def write_picture(path: Path, result: DemoResult) -> None:
    """Write a small SVG of the contact force on unseen data, to introduce the project with.

    Args:
        path: The SVG file.
        result: What the demo found out.

    Raises:
        OutputError: The file cannot be written.
    """
    from cosimulation.report.figures.picture import picture
    from cosimulation.report.views import views

    write_text(path, picture(views(result)))
