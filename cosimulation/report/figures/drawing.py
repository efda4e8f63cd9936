"""How every figure looks, and how it becomes an inline SVG that is the same for the same numbers."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from identification.arrays import Array

INK = "#1c1c1c"
MUTED = "#5c6470"
GRID = "#d9dde3"
REFERENCE_BAND = "#b9bfc8"
PALETTE = ("#0061a8", "#d98200", "#009e73", "#b0568f", "#d55e00", "#4aa5dd")
"""Colours of curves that are told apart by them."""
WIDTH = 8.2
"""Width of a figure [inch]; text of 9 pt is then as large as the text around it on a wide screen."""

SYMBOLS = {
    "xi": r"$\xi$",
    "xi_dot": r"$\dot{\xi}$",
    "zeta": r"$\zeta$",
    "zeta_dot": r"$\dot{\zeta}$",
    "F_H": r"$F_H$",
    "F_p": r"$F_p$",
    "eta": r"$\eta$",
}

_STYLE: dict[str, Any] = {
    "svg.hashsalt": "llmn",
    "svg.fonttype": "path",
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "lines.linewidth": 1.2,
    "path.simplify": True,
    "path.simplify_threshold": 0.3,
    "mathtext.fontset": "dejavusans",
}


Rows = npt.NDArray[np.int64]

_DIGITS = re.compile(r"-?\d+\.\d{3,}")


@contextmanager
def drawing_style() -> Iterator[None]:
    """Draw with the report's style, whatever the user's own settings are."""
    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(_STYLE)
        yield


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """Return an empty figure of `height` [inch]."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasSVG(figure)
    return figure


def svg_document(figure: Figure) -> str:
    """Return a figure as an SVG file, without the time of day; paths are exact to 1/100 point."""
    buffer = io.StringIO()
    figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None})
    return re.sub(r' d="[^"]*"', lambda path: _DIGITS.sub(_rounded, path[0]), buffer.getvalue())


def _rounded(number: re.Match[str]) -> str:
    text = f"{float(number[0]):.2f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def inline_svg(figure: Figure, name: str, alternative: str) -> str:
    """Return a figure as an `<svg>` element to stand inside a page.

    Args:
        figure: The figure.
        name: Unique in the page; every id in the element starts with it.
        alternative: What the figure shows, for a reader who cannot see it.
    """
    text = svg_document(figure)
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = text.replace("xlink:href=", "href=")
    text = re.sub(r'\bid="([^"]+)"', rf'id="{name}-\1"', text)
    text = re.sub(r'href="#([^"]+)"', rf'href="#{name}-\1"', text)
    text = re.sub(r"url\(#([^)]+)\)", rf"url(#{name}-\1)", text)
    box = re.search(r'viewBox="([^"]+)"', text)
    if box is None:
        raise ValueError("matplotlib wrote an SVG without a viewBox")
    head = f'<svg viewBox="{box[1]}" role="img" aria-label="{escape(alternative, quote=True)}">'
    body = text[text.index(">") + 1 :]
    return head + re.sub(r">\s+<", "><", body).strip()


def buckets(count: int, columns: int) -> Rows:
    """Return the first row of each of at most `columns` equal stretches of `count` rows."""
    return np.unique(np.linspace(0, count, min(columns, count), endpoint=False).astype(np.int64))


def envelope(values: Array, columns: int) -> tuple[Rows, Array, Array]:
    """Return first row, minimum and maximum of at most `columns` stretches: dense curves as a band."""
    first = buckets(len(values), columns)
    return first, np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)


def mark_unscored(axes: Axes, begin: float, label: bool = False) -> None:
    """Shade the time before `begin` [s], which does not count for FIT."""
    axes.axvspan(0.0, begin, color="#eef0f3", linewidth=0, zorder=0)
    if label:
        axes.annotate(
            "not scored",
            (0.0, 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(4, 4),
            textcoords="offset points",
            va="bottom",
            color=MUTED,
            fontsize=8,
        )


def fit_text(fit: float) -> str:
    """Return FIT [%] as text."""
    return f"{fit:.1f} %".replace("-", "\N{MINUS SIGN}") if np.isfinite(fit) else "not finite"
