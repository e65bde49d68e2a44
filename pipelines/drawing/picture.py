"""A chart as a file: SVG as in a page, PNG and PDF typeset from it by a library that is optional, CSV of its numbers."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from pipelines.drawing.chart import Chart, Plot, Trace
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


COLUMNS = ("plot", "series", "x_label", "x", "y_label", "y", "high", "error", "colour", "text", "pick")
_LEADS = ("=", "+", "-", "@", "\t", "\r")


def csv_text(chart: Chart) -> str:
    """The numbers of a chart; guide lines are omitted."""
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(COLUMNS)
    for plot in chart.plots:
        for trace in plot.traces:
            if trace.name:
                writer.writerows(_rows(plot, trace))
    return sink.getvalue()


def _rows(plot: Plot, trace: Trace) -> Iterator[list[str]]:
    head = [safe_cell(plot.title), safe_cell(trace.name)]
    if trace.counts is not None:
        for row, y in enumerate(trace.y):
            for column, x in enumerate(trace.x):
                if trace.counts[row, column]:
                    count = repr(float(trace.counts[row, column]))
                    yield [*head, plot.x.label, repr(float(x)), plot.y.label, repr(float(y)), "", "", count, "", ""]
        return
    for k in range(trace.x.size):
        values = [_number(array, k) for array in (trace.high, trace.error, trace.colour)]
        texts = [safe_cell(texts[k]) if texts else "" for texts in (trace.texts, trace.picks)]
        x, y = repr(float(trace.x[k])), _number(trace.y, k)
        yield [*head, plot.x.label, x, plot.y.label, y, *values, *texts]


def _number(values: np.ndarray | None, k: int) -> str:
    return "" if values is None or not np.isfinite(values[k]) else repr(float(values[k]))


def safe_cell(value: Any) -> Any:
    """A value that spreadsheets do not evaluate as a formula."""
    return f"'{value}" if isinstance(value, str) and value.startswith(_LEADS) else value
