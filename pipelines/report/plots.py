"""The look of pictures that matplotlib draws, and their SVG as it stands inside a page."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLOURS = {"x": "#0072b2", "y": "#d55e00", "z": "#009e73"}  # for any colour vision (Okabe and Ito)
WIDTH_IN = 11.5
STYLE: dict[Any, Any] = {
    "font.size": 10.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "axes.axisbelow": True,
    "svg.fonttype": "none",
    "svg.hashsalt": "tumbleline",
    "font.family": "sans-serif",
    "text.parse_math": False,  # names of columns and units are shown literally, with dollar signs
    "axes.titley": 1.0,  # a fixed place: looking for a free one costs as much as drawing the points
}


def svg(figure: Figure) -> str:
    """A figure as SVG text that stands inside a page."""
    sink = io.StringIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # the browser has fonts of its own
        figure.savefig(sink, format="svg", metadata={"Date": None, "Creator": None})
    text = sink.getvalue()
    return text[text.index("<svg") :]
