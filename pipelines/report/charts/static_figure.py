"""A chart drawn without a browser as PNG, to be sent."""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.figure import Figure

from pipelines.report.charts.chart import DIVERGING, ROLES, SEQUENTIAL
from pipelines.report.plots import STYLE, WIDTH_IN

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from pipelines.report.charts.chart import Chart, ColourScale, Plot, PlotAxis, Trace

PIXELS_PER_IN = 100.0
MOST_NAMES = 30
SYMBOLS = {"circle": "o", "triangle-up": "^", "triangle-down": "v", "square": "s", "diamond": "D"}


def png_bytes(chart: Chart, *, dots_per_inch: int = 130) -> bytes:
    """The chart as a PNG file on white."""
    sink = io.BytesIO()
    with mpl.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing")
        _drawn(chart).savefig(sink, format="png", dpi=dots_per_inch, metadata={"Software": None})
    return sink.getvalue()


def _drawn(chart: Chart) -> Figure:
    size = (WIDTH_IN, chart.height * chart.rows / PIXELS_PER_IN + 0.5)
    figure = Figure(figsize=size, layout="constrained")
    places = figure.subplots(chart.rows, chart.columns, squeeze=False)
    for number, place in enumerate(places.ravel()):
        if number < len(chart.plots):
            _plot(place, chart.plots[number], chart.scale)
        else:
            place.set_axis_off()
    if chart.scale is not None:
        shade = ScalarMappable(Normalize(chart.scale.low, chart.scale.high), _colours(chart.scale))
        bar = figure.colorbar(shade, ax=places, shrink=0.75, aspect=26, pad=0.015)
        bar.set_label(chart.scale.label)
    return figure


def _plot(place: Axes, plot: Plot, scale: ColourScale | None) -> None:
    for trace in plot.traces:
        _DRAW[trace.style](place, trace, scale)
    place.set_title(plot.title, loc="left", fontweight="bold", fontsize=10.0)
    if plot.sphere:
        place.set_axis_off()
        place.set_aspect("equal")
        place.grid(visible=False)
    for axis, which in ((plot.x, "x"), (plot.y, "y")):
        _axis(place, axis, which)
    handles, labels = place.get_legend_handles_labels()
    if handles:
        place.legend(handles, labels, frameon=False, fontsize=8.5, ncols=min(4, len(handles)), loc="best")


def _axis(place: Axes, axis: PlotAxis, which: str) -> None:
    put: dict[str, Any] = {f"{which}label": axis.label}
    if axis.log:
        put[f"{which}scale"] = "log"
    if axis.low is not None and axis.high is not None:
        put[f"{which}lim"] = (axis.low, axis.high)
    place.set(**put)
    own = place.xaxis if which == "x" else place.yaxis
    if axis.names:
        every = 1 + len(axis.names) // MOST_NAMES
        own.set_ticks(range(0, len(axis.names), every), axis.names[::every], rotation=40 if which == "x" else 0)
    if axis.dates:
        from matplotlib.dates import AutoDateLocator, ConciseDateFormatter

        locator = AutoDateLocator()
        own.set_major_locator(locator)
        own.set_major_formatter(ConciseDateFormatter(locator))


def _label(trace: Trace) -> str:
    return trace.name if trace.legend and trace.name else f"_{trace.name}"


def _colours(scale: ColourScale) -> LinearSegmentedColormap:
    return LinearSegmentedColormap.from_list("scale", list(DIVERGING if scale.diverging else SEQUENTIAL))


def _points(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    look: dict[str, Any] = {
        "s": trace.size**2 * 0.7,
        "marker": SYMBOLS[trace.symbol],
        "label": _label(trace),
        "zorder": 3,
    }
    if trace.colour is not None and scale is not None:
        look |= {"c": trace.colour, "cmap": _colours(scale), "vmin": scale.low, "vmax": scale.high}
        place.scatter(trace.x, trace.y, edgecolors="#555555", linewidths=0.4, **look)
    else:
        place.scatter(trace.x, trace.y, c=ROLES[trace.role], linewidths=0, **look)
    if trace.error is not None:
        place.errorbar(trace.x, trace.y, trace.error, fmt="none", ecolor=ROLES[trace.role], elinewidth=0.8)


def _line(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    del scale
    style = "--" if trace.dashed else "-"
    width = trace.width or (1.4 if trace.name else 0.7)
    place.plot(trace.x, trace.y, style, color=ROLES[trace.role], linewidth=width, label=_label(trace), zorder=2)


def _band(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    del scale
    place.fill_between(
        trace.x, trace.y, np.asarray(trace.high), color=ROLES[trace.role], alpha=0.18, linewidth=0, label=_label(trace)
    )


def _bars(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    del scale
    place.bar(trace.x, trace.y, width=0.7, color=ROLES[trace.role], label=_label(trace))


def _density(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    del scale
    counts = np.asarray(trace.counts, dtype=float)
    shown = np.ma.masked_less(counts, 1.0)
    place.pcolormesh(trace.x, trace.y, np.log10(shown), cmap="Greys", vmin=-1.0, rasterized=True, zorder=1)


def _labels(place: Axes, trace: Trace, scale: ColourScale | None) -> None:
    del scale
    anchors = trace.anchors or ("center",) * len(trace.texts)
    for x, y, text, anchor in zip(trace.x, trace.y, trace.texts, anchors, strict=True):
        up, side = anchor.split() if " " in anchor else ("", "center")
        away = (2.0 * (side == "right") - 2.0 * (side == "left"), 2.0 * (up == "top") - 2.0 * (up == "bottom"))
        place.annotate(
            text, (x, y), away, textcoords="offset points", fontsize=8.5, color=ROLES[trace.role],
            ha={"right": "left", "left": "right"}.get(side, "center"),
            va={"top": "bottom", "bottom": "top"}.get(up, "center"),
        )  # fmt: skip


_DRAW = {
    "points": _points,
    "line": _line,
    "band": _band,
    "bars": _bars,
    "density": _density,
    "labels": _labels,
}
