"""The content of a recording as a picture and as a page: its axes, static intervals, and faults of samples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from pipelines.report.plots import COLOURS, STYLE, WIDTH_IN, svg
from pipelines.report.templates import template

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pipelines.importers.documents import InspectDocument
    from pipelines.importers.inspection import Inspection

_PIXELS = 1500
_STILL, _FAULT, _SEVERAL = "#dfe9f5", "#f6c9c9", "#f5e3b3"
_AXES = "xyz"


def figure_of(inspection: Inspection) -> Figure | None:
    """Output against time by axis, static intervals shaded; None where no axes were recognised."""
    if inspection.output is None or not len(inspection.output):
        return None
    document = inspection.document
    time = (
        np.arange(len(inspection.output), dtype=np.float64)
        if inspection.time is None
        else inspection.time - inspection.time[0]
    )
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 6.2))
        rows = figure.subplots(3, 1, sharex=True)
        figure.subplots_adjust(left=0.085, right=0.99, bottom=0.085, top=0.925, hspace=0.12)
        unit = document["output_unit"] or "unit not known"
        for k, place in enumerate(rows):
            for one in document["intervals"]:
                colour = _SEVERAL if one["positions"] > 1 else _STILL
                place.axvspan(one["start_s"], one["end_s"], color=colour, linewidth=0.0)
            for one in document["faults"]:
                if one["axis"] == _AXES[k] and one["fault"] == "stuck_output":
                    end = time[min(one["first_row"] - 1 + one["samples"], len(time) - 1)]
                    place.axvspan(time[one["first_row"] - 1], end, color=_FAULT, linewidth=0.0)
            x, low, high = _envelope(time, inspection.output[:, k])
            place.fill_between(x, low, high, color=COLOURS[_AXES[k]], linewidth=0.6, edgecolor=COLOURS[_AXES[k]])
            place.set_ylabel(f"{_AXES[k]} / {unit}")
            place.yaxis.set_major_locator(MaxNLocator(5))
        rows[-1].set_xlabel("time / s" if inspection.time is not None else "sample")
        rows[0].set_title(_title(document), loc="left", fontsize=10.5)
        return figure


def _title(document: InspectDocument) -> str:
    still = f"{len(document['intervals'])} static intervals shaded"
    parts = [still if document["intervals"] else "no static interval"]
    if any(one["positions"] > 1 for one in document["intervals"]):
        parts.append("yellow: several positions in one")
    if any(one["fault"] == "stuck_output" for one in document["faults"]):
        parts.append("red: the axis is constant")
    return "; ".join(parts)


def _envelope(
    time: NDArray[np.float64], x: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest of as many pieces as there are pixels: the envelope of a line through all samples."""
    count = len(x)
    if count <= 2 * _PIXELS:
        return time, x, x
    edges = np.linspace(0, count, _PIXELS + 1).astype(np.int64)[:-1]
    return time[edges], np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)


def save_picture(inspection: Inspection, path: Path) -> bool:
    """Write the picture in the format of the file's ending (.svg, .png, .pdf); False if there is nothing to draw."""
    figure = figure_of(inspection)
    if figure is None:
        return False
    with mpl.rc_context(STYLE):
        figure.savefig(path, dpi=110)
    return True


def page(inspection: Inspection) -> str:
    """The content of a recording as one HTML text that needs no other file."""
    figure = figure_of(inspection)
    return template("recording.html").render(one=inspection.document, picture="" if figure is None else svg(figure))
