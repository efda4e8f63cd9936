"""HTML files that open by double click: the demo's report and its picture, the page on an identification."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fmu_builder.files import write_text

if TYPE_CHECKING:
    from cosimulation.demo import DemoResult
    from cosimulation.identify import Identified

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


def write_identification(path: Path, result: Identified) -> None:
    """Write the page on an identification: the same bytes for the same result.

    Args:
        path: The HTML file.
        result: What was identified, and how.

    Raises:
        OutputError: The file cannot be written.
    """
    from cosimulation.report.identification import identification_page

    write_text(path, identification_page(result))
