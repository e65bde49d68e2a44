"""A chart as a file: SVG as it stands in a page; PNG and PDF are typeset from it by a library that is optional."""

from __future__ import annotations

from pathlib import Path

from pipelines.drawing.chart import Chart
from pipelines.drawing.vector import WIDTH, alone, svg_text
from schemas.errors import WrongUse
from schemas.library import library

ENDINGS = (".svg", ".png", ".pdf")
EXTRA = "pdf"
POINTS = 0.72  # of a pixel of the picture
DOTS_PER_INCH = 130.0
PAGE = """\
#set page(width: auto, height: auto, margin: 8pt)
#image(bytes(sys.inputs.chart), format: "svg", width: {:g}pt)
"""


def refuse_ending(path: Path, option: str) -> None:
    """Refuse a file that is no picture by its ending."""
    if path.suffix.lower() not in ENDINGS:
        raise WrongUse(f"{option} {path}: '{path.suffix}' cannot be drawn; name a .png, .svg or .pdf file")


def picture(chart: Chart, ending: str) -> bytes:
    """The content of a file with one of :data:`ENDINGS`; the same bytes for the same chart.

    Raises
    ------
    WrongUse
        The library that makes PNG and PDF is not installed.
    """
    svg = alone(svg_text(chart))
    if ending == ".svg":
        return svg.encode()
    typst = library(
        "typst", EXTRA, f"picture: a {ending.removeprefix('.').upper()} file (an .svg file needs no library)"
    )
    compiler = typst.Compiler(
        PAGE.format(POINTS * WIDTH).encode(),
        font_paths=typst.Fonts(include_system_fonts=False, include_embedded_fonts=True),
        sys_inputs={"chart": svg},
    )
    return compiler.compile(format=ending.removeprefix("."), ppi=DOTS_PER_INCH)
