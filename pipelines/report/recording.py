"""The content of a recording as a picture and as a page: its axes, static intervals, and faults of samples."""

import numpy as np

from inertial.arrays import Array
from pipelines.drawing import Chart, Plot, PlotAxis, Trace, still, svg_text
from pipelines.drawing.chart import Role, between
from pipelines.importers.inspection import Inspection
from pipelines.report.templates import template
from schemas.units import AXES

_PIXELS = 1500
ROOM = 0.05  # of the range, above and below
STILL: tuple[str, Role] = ("static interval", "accent")
SEVERAL: tuple[str, Role] = ("several positions in one interval", "y")
STUCK: tuple[str, Role] = ("the axis is constant", "limit")


def chart_of(inspection: Inspection) -> Chart | None:
    """Output against time by axis, static intervals shaded; None where no axes were recognised."""
    if inspection.output is None or not len(inspection.output):
        return None
    document = inspection.document
    count = np.arange(len(inspection.output), dtype=np.float64)
    time = count if inspection.time is None else inspection.time - inspection.time[0]
    along = "time / s" if inspection.time is not None else "sample"
    unit = document["output_unit"] or "unit not known"
    plots: list[Plot] = []
    for k, axis in enumerate(AXES):
        x, y = _envelope(time, inspection.output[:, k])
        low, high = float(np.nanmin(y)), float(np.nanmax(y))
        room = ROOM * (high - low) or 1.0
        low, high = low - room, high + room
        shades = [
            (time[fault["first_row"] - 1], time[min(fault["first_row"] - 1 + fault["samples"], len(time) - 1)], STUCK)
            for fault in document["faults"]
            if fault["axis"] == axis and fault["fault"] == "stuck_output"
        ] + [
            (interval["start_s"], interval["end_s"], SEVERAL if interval["positions"] > 1 else STILL)
            for interval in document["intervals"]
        ]
        shaded = [between(np.array([start, end]), low, high, *look) for start, end, look in shades]
        traces = (*shaded, Trace("", x, y, "line", axis, width=0.8, legend=False))
        plots.append(Plot("", PlotAxis(along), PlotAxis(f"{axis} / {unit}", low=low, high=high), traces))
    return Chart("Output of the axes over time", tuple(plots), height=210)


def _envelope(time: Array, x: Array) -> tuple[Array, Array]:
    """A line through the lowest and the highest sample of as many pieces as there are pixels: the envelope of all samples."""
    count = len(x)
    if count <= 2 * _PIXELS:
        return time, x
    edges = np.linspace(0, count, _PIXELS + 1).astype(np.int64)[:-1]
    ends = np.stack([np.minimum.reduceat(x, edges), np.maximum.reduceat(x, edges)], axis=1)
    return np.repeat(time[edges], 2), ends.ravel()


def page(inspection: Inspection) -> str:
    """The content of a recording as one HTML text that needs no other file."""
    chart = chart_of(inspection)
    return template("recording.html").render(
        one=inspection.document, picture="" if chart is None else still(svg_text(chart))
    )
