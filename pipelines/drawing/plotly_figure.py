"""A chart as a figure of Plotly: data and layout as JSON, without the Python package of that name.

Colours are names of roles (``role:before``) that the page replaces by those of its theme. Arrays travel as 32-bit binary.
"""

import base64
from dataclasses import replace
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipelines.drawing.chart import DIVERGING, SEQUENTIAL, Chart, ColourScale, Plot, PlotAxis, Trace, shortened
from pipelines.drawing.ticks import log_ticks

MANY = 4000
"""Points from which WebGL draws faster than SVG."""
DAY_MS = 86_400_000.0
GAP_X, GAP_PX = 0.078, 92.0
SPHERE_GAP_X, SPHERE_GAP_PX = 0.012, 26.0
DECADES = 100.0  # a logarithmic axis that spans more has a label at each decade
ENTRY_PX = 22  # room for an entry of the legend
NOTE_PX = 22  # room for a line below
LABEL_PX = 18  # room for a further line of a label
NARROW_LETTERS = 36  # of such a line on a narrow screen
NARROW_SPHERE_PX = 220  # twice as wide as high, as its outline is
MOST_NAMES, NARROW_NAMES = 40, 14  # names along the width of a figure
NARROW_D = 20.0  # closer dates get a margin
CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "showSendToCloud": False,
    "plotlyServerURL": "",
    "topojsonURL": "/none",
    "modeBarButtonsToRemove": ["sendChartToCloud", "select2d", "lasso2d", "autoScale2d"],
}
"""Options that keep the figure on the page: by default Plotly's toolbar offers to send it to a server."""


def plotly_figure(chart: Chart, *, webgl: bool = True) -> dict[str, Any]:
    """Data, layout and configuration of a figure, and its layout with one plot below the other; colours by role.

    webgl : whether many points are drawn by WebGL, which the small bundle of reports cannot do
    """
    data: list[dict[str, Any]] = []
    shown: set[str] = set()
    for number, plot in enumerate(chart.plots):
        for trace in plot.traces:
            data.append(_trace(trace, _axis_names(number), shown, dates=plot.x.dates))
            if not webgl and data[-1]["type"] == "scattergl":
                data[-1]["type"] = "scatter"
            shown.add(trace.name)
    figure = {"data": data, "layout": _layout(chart), "config": CONFIG}
    spheres = all(plot.sphere for plot in chart.plots)
    longest = max(len(text) for text in (chart.note, *(plot.x.label for plot in chart.plots)))
    if chart.columns == 1 and not spheres and longest <= NARROW_LETTERS:
        return figure
    height = min(chart.height, NARROW_SPHERE_PX) if spheres else chart.height
    plots = tuple(replace(plot, x=replace(plot.x, label=fill(plot.x.label, NARROW_LETTERS))) for plot in chart.plots)
    note = fill(chart.note, NARROW_LETTERS)
    narrow = _layout(replace(chart, plots=plots, columns=1, height=height, note=note), NARROW_NAMES)
    narrow["height"] += ENTRY_PX * sum(trace["showlegend"] for trace in data)  # the legend has one entry a line there
    return figure | {"narrow": narrow}


def _layout(chart: Chart, most_names: int = MOST_NAMES) -> dict[str, Any]:
    above = 1.0 + 30.0 / (chart.height * chart.rows)
    layout: dict[str, Any] = {
        "height": chart.height * chart.rows + 40,
        "margin": {"l": 62, "r": 16, "t": 44, "b": 52},
        "showlegend": any(t.legend and t.name for p in chart.plots for t in p.traces),
        "legend": {"orientation": "h", "itemsizing": "constant", "x": 0, "y": above, "yanchor": "bottom"},
        "hovermode": "closest",
        "annotations": [],
        "barmode": "group",
        "meta": {"title": _safe(chart.title)},
    }
    for number, plot in enumerate(chart.plots):
        _lay_out(layout, plot, number, chart, most_names)
    if chart.scale is not None:
        layout["coloraxis"] = _colour_axis(chart.scale)
        layout["margin"]["r"] = 78
    if all(plot.sphere for plot in chart.plots):
        layout["margin"] |= {"l": 8, "b": 8, "t": 34}
        layout["height"] = chart.height * chart.rows + 20
    if chart.note:
        lines, below = chart.note.count("\n") + 1, layout["margin"]["b"]
        layout["margin"]["b"] += NOTE_PX * lines
        layout["height"] += NOTE_PX * lines
        layout["annotations"].append({
            "text": _safe(chart.note), "align": "left", "x": 0, "y": 0, "xref": "paper",
            "yref": "paper", "xanchor": "left", "yanchor": "top", "showarrow": False, "yshift": -below,
        })  # fmt: skip
    return layout


def _axis_names(number: int) -> tuple[str, str]:
    end = "" if number == 0 else str(number + 1)
    return f"x{end}", f"y{end}"


def _lay_out(layout: dict[str, Any], plot: Plot, number: int, chart: Chart, most_names: int) -> None:
    """The axes of a plot at its place in the grid, with its title above."""
    row, column = divmod(number, chart.columns)
    beside, below = (SPHERE_GAP_X, SPHERE_GAP_PX) if plot.sphere else (GAP_X, GAP_PX)
    below += LABEL_PX * max(drawn.x.label.count("\n") for drawn in chart.plots)
    width = (1.0 - beside * (chart.columns - 1)) / chart.columns
    gap = below / (chart.height * chart.rows)
    height = (1.0 - gap * (chart.rows - 1)) / chart.rows
    left, top = column * (width + beside), 1.0 - row * (height + gap)
    across, along = _axis_names(number)
    for axis, name, domain, other in (
        (plot.x, across, (left, left + width), along),
        (plot.y, along, (top - height, top), across),
    ):
        layout[name.replace("x", "xaxis").replace("y", "yaxis")] = {
            **_axis(axis, plot, name[0], most_names // chart.columns),
            "domain": [max(domain[0], 0.0), min(domain[1], 1.0)],
            "anchor": other,
        }
    if plot.sphere:
        layout[along.replace("y", "yaxis")] |= {"scaleanchor": across, "scaleratio": 1.0}
    elif column and chart.plots[number - 1].y.label == plot.y.label:
        del layout[along.replace("y", "yaxis")]["title"]  # labelled at the left already
    if plot.title:
        layout["annotations"].append({
            "text": f"<b>{_safe(plot.title)}</b>", "x": left, "y": top, "xref": "paper", "yref": "paper",
            "xanchor": "left", "yanchor": "bottom", "showarrow": False, "yshift": 4,
        })  # fmt: skip


def _axis(axis: PlotAxis, plot: Plot, side: str, most_names: int) -> dict[str, Any]:
    title = {"text": _safe(axis.label), "standoff": 8, "font": {"size": 13}}
    out: dict[str, Any] = {"title": title, "automargin": True, "zeroline": False}
    if plot.sphere:
        return {"visible": False, "range": [axis.low, axis.high], "fixedrange": True}
    if axis.log:
        out |= {"type": "log", "exponentformat": "power"}
        values = np.concatenate([getattr(t, side) for t in plot.traces]) if plot.traces else np.zeros(0)
        positive = values[values > 0.0]
        if positive.size and positive.max() > DECADES * positive.min():
            out["dtick"] = 1  # labels at the decades; between them the digits alone are no numbers
        elif len(ticks := log_ticks(float(positive.min()), float(positive.max())) if positive.size else []) > 1:
            out |= {"tickvals": [value for value, _ in ticks], "ticktext": [text for _, text in ticks]}
    if axis.dates:
        out["type"] = "date"
        days = np.concatenate([trace.x for trace in plot.traces]) if plot.traces else np.zeros(0)
        if days.size and np.ptp(days) < NARROW_D:
            out["range"] = [DAY_MS * (float(days.min()) - NARROW_D), DAY_MS * (float(days.max()) + NARROW_D)]
    if axis.names:
        step = -(-len(axis.names) // most_names) if side == "x" else 1
        places = list(range(0, len(axis.names), step))
        out |= {"tickvals": places, "ticktext": [_safe(shortened(axis.names[k])) for k in places]}
    if axis.step is not None:
        out["dtick"] = axis.step
    if axis.low is not None and axis.high is not None:
        out["range"] = [axis.low, axis.high]
    return out


def _trace(trace: Trace, names: tuple[str, str], shown: set[str], *, dates: bool) -> dict[str, Any]:
    x = trace.x * DAY_MS if dates else trace.x
    out: dict[str, Any] = {
        "xaxis": names[0],
        "yaxis": names[1],
        "name": _safe(shortened(trace.name)),
        "legendgroup": _safe(trace.name),
        "showlegend": bool(trace.legend and trace.name and trace.name not in shown and trace.style != "density"),
    }
    colour = f"role:{trace.role}"
    if trace.style == "density":
        counts = np.asarray(trace.counts, dtype=float)
        return out | {
            "type": "heatmap", "x": packed(x), "y": packed(trace.y), "showscale": False, "hoverinfo": "skip",
            "z": [[float(np.log10(n)) + 0.3 if n > 0.0 else None for n in row] for row in counts],
            "colorscale": [[0, "role:faint"], [1, "role:muted"]], "zmin": 0,
        }  # fmt: skip
    if trace.style == "band":
        # one closed line: up along the low edge, back along the high one
        upper = np.asarray(trace.high)[::-1]
        return out | {
            "type": "scatter", "mode": "lines", "fill": "toself", "fillcolor": f"{colour}:0.2", "line": {"width": 0},
            "x": packed(np.concatenate([x, x[::-1]])), "y": packed(np.concatenate([trace.y, upper])), "hoverinfo": "skip",
        }  # fmt: skip
    out |= {"x": packed(x, dates=dates), "y": packed(trace.y)}
    if trace.style == "bars":
        return out | {"type": "bar", "marker": {"color": colour}, "hovertext": [_safe(text) for text in trace.texts]}
    if trace.style == "labels":
        return out | {
            "type": "scatter", "mode": "text", "text": [_safe(t) for t in trace.texts], "textfont": {"color": colour},
            "hoverinfo": "skip", "cliponaxis": False,
            **({"textposition": [a if a != "center" else "middle center" for a in trace.anchors]} if trace.anchors else {}),
        }  # fmt: skip
    if trace.style == "line":
        line = {"color": colour, "width": trace.width or (1.8 if trace.name else 1.0)}
        line |= {"dash": "dash"} if trace.dashed else {}
        return out | {"type": "scatter", "mode": "lines", "line": line, **({} if trace.name else {"hoverinfo": "skip"})}
    return out | _points(trace, colour)


def _points(trace: Trace, colour: str) -> dict[str, Any]:
    marker: dict[str, Any] = {"size": trace.size, "symbol": trace.symbol, "color": colour}
    if trace.colour is not None:
        marker |= {"color": packed(trace.colour), "coloraxis": "coloraxis", "line": {"width": 0.7, "color": "role:ink"}}
    kind = "scattergl" if trace.x.size > MANY else "scatter"
    out: dict[str, Any] = {"type": kind, "mode": "markers", "marker": marker}
    out |= {"cliponaxis": False} if kind == "scatter" else {}  # a point at the edge is whole
    if trace.error is not None:
        out["error_y"] = {"type": "data", "array": packed(trace.error), "color": colour, "thickness": 1, "width": 0}
    if trace.texts:
        out |= {"text": [_safe(text) for text in trace.texts], "hovertemplate": "%{text}<extra></extra>"}
    if trace.picks:
        out["customdata"] = list(trace.picks)
    return out


def _colour_axis(scale: ColourScale) -> dict[str, Any]:
    colours = [list(anchor) for anchor in (DIVERGING if scale.diverging else SEQUENTIAL)]
    title = {"text": _safe(scale.label), "side": "right", "font": {"size": 13}}
    return {
        "cmin": scale.low, "cmax": scale.high, "colorscale": colours,
        "colorbar": {"title": title, "thickness": 12, "outlinewidth": 0},
    }  # fmt: skip


def packed(values: NDArray[np.float64], *, dates: bool = False) -> dict[str, str]:
    """Numbers as Plotly reads them in binary: 32 bits, 64 where they are dates."""
    kind = np.dtype("<f8") if dates else np.dtype("<f4")
    data = np.ascontiguousarray(values, dtype=kind).tobytes()
    return {"dtype": "f8" if dates else "f4", "bdata": base64.b64encode(data).decode()}


def _safe(text: str) -> str:
    """A text for Plotly, without markup but for the ends of its lines."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;").replace("\n", "<br>")
