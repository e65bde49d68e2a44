"""A chart as SVG text: stands in a page before a script draws it, in print, and without a script.

Written directly: a report has dozens of plots, and a drawing library takes a hundred times as long for them.
"""

from dataclasses import dataclass, replace
from html import escape
from itertools import pairwise

import numpy as np

from inertial.arrays import Array
from pipelines.drawing.chart import ROLES, Chart, ColourScale, Plot, PlotAxis, Trace
from pipelines.drawing.marks import DRAW, PlotArea, marks, shade
from pipelines.drawing.ticks import Ticks, date_ticks, linear_ticks, log_ticks

WIDTH = 1150.0
"""Of the picture, in its own pixels; a page shows it as wide as it is itself."""
LETTER = 6.9  # mean width of a letter of 12.5 px
HEAD = 40.0  # above the plots, for the legend: as Plotly has it
GAP, TOP, BOTTOM, LINE = 14.0, 24.0, 46.0, 20.0
ROOM = 0.05  # of a range, on both sides of the values
BAR = 84.0
SPHERE_TOP = 26.0
MOST_NAMES = 26
LONGEST_TURNED = 14
SINE = 0.62  # of the 38° by which they are turned
LEGEND_MARK = 7.0  # as large for all, as Plotly has it
GRID, FRAME, TEXT, QUIET = "#e4e4e4", "#8a8f98", "#1d1f23", "#55585f"


@dataclass(frozen=True)
class _Scaled:
    """An axis with its range (in decades on a logarithmic one) and its ticks."""

    axis: PlotAxis
    low: float
    high: float
    ticks: Ticks

    def at(self, values: Array) -> Array:
        """Values as shares of the axis, from its low end."""
        with np.errstate(divide="ignore", invalid="ignore"):  # nothing at or below zero has a place
            inner = np.log10(values) if self.axis.log else values
        return (inner - self.low) / (self.high - self.low)


def svg_text(chart: Chart) -> str:
    """The chart as SVG text that stands inside a page."""
    names = _legend_names(chart)
    lines = _legend_lines(names)
    head = max(HEAD, LINE * len(lines) + 6.0)
    wide = WIDTH - (BAR if chart.scale is not None else 0.0)
    plot_width = (wide - GAP * (chart.columns - 1)) / chart.columns
    scaled = [_scaled(plot, plot_width, float(chart.height)) for plot in chart.plots]
    left = [
        max((_left(chart, k, scaled[k][1]) for k in range(column, len(chart.plots), chart.columns)), default=0.0)
        for column in range(chart.columns)
    ]
    feet = [
        0.0 if plot.sphere else _foot(scaled[k][0].ticks, plot_width - left[k % chart.columns] - 6.0)
        for k, plot in enumerate(chart.plots)
    ]
    tall = chart.height + max(feet, default=0.0)
    parts = [
        f'<g transform="translate({x:.1f} {LINE * row + 10.0:.1f})">{mark}{text_at(14.0, 4.0, name)}</g>'
        for row, line in enumerate(lines)
        for x, name, mark in line
    ]
    for number, plot in enumerate(chart.plots):
        row, column = divmod(number, chart.columns)
        x, y = column * (plot_width + GAP), head + row * tall
        if plot.sphere:
            area = _sphere_area(plot, x, y, plot_width, tall)
        else:
            wide_each, tall_each = plot_width - left[column] - 6.0, tall - TOP - BOTTOM - feet[number]
            area = PlotArea(x + left[column], y + TOP, wide_each, tall_each, *(axis.at for axis in scaled[number]))
            parts.append(_axes(plot, area, scaled[number], feet[number], labelled=_labelled(chart, number)))
        parts += [DRAW[trace.style](trace, area, chart.scale) for trace in plot.traces]
        parts.append(text_at(area.left, y + TOP - 9.0, plot.title, 'font-weight="600"') if plot.title else "")
    height = head + tall * chart.rows
    if chart.note:
        height += LINE
        parts.append(text_at(0.0, height - 6.0, chart.note, f'fill="{QUIET}"'))
    if chart.scale is not None:
        parts.append(_bar(chart.scale, wide + 16.0, head + 0.12 * (height - head), 0.76 * (height - head)))
    return part(chart.title, height, "".join(parts))


def still(picture: str) -> str:
    """A picture for a page, which is moved under a narrow window in place of letters that nobody can read."""
    return f'<div class="still">{picture}</div>'


def part(title: str, height: float, content: str) -> str:
    """A picture of a page as SVG text, ``WIDTH`` wide."""
    box = f'viewBox="0 0 {WIDTH:g} {height:g}" font-size="12.5" fill="{TEXT}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(title)}" {box}>{content}</svg>'


def alone(picture: str) -> str:
    """The SVG text of a picture as that of a file, which takes no font from a page."""
    return picture.replace("<svg ", '<svg font-family="sans-serif" ', 1)


def _scaled(plot: Plot, wide: float, tall: float) -> tuple[_Scaled, _Scaled]:
    edges: list[Array] = []
    for trace in plot.traces:
        edges += [trace.y] if trace.high is None else [trace.y, trace.high]
        edges += [] if trace.error is None else [trace.y - trace.error, trace.y + trace.error]
    return _axis(plot.x, [t.x for t in plot.traces], int(wide // 75)), _axis(plot.y, edges, int(tall // 48))


def _axis(axis: PlotAxis, arrays: list[Array], most: int) -> _Scaled:
    values = np.concatenate(arrays) if arrays else np.zeros(0)
    values = values[np.isfinite(values)]
    if axis.log:
        values = np.log10(values[values > 0.0])
    low, high = (float(values.min()), float(values.max())) if values.size else (0.0, 1.0)
    room = ROOM * (high - low) or max(0.05 * abs(high), 0.5 if not values.size or not high else 0.0)
    low, high = low - room, high + room
    if axis.low is not None and axis.high is not None:
        low, high = (float(np.log10(axis.low)), float(np.log10(axis.high))) if axis.log else (axis.low, axis.high)
    if axis.names:
        step = 1 + len(axis.names) // max(MOST_NAMES, 3 * most)
        ticks = [(float(k), axis.names[k]) for k in range(0, len(axis.names), step) if low <= k <= high]
    elif axis.log:
        ticks = log_ticks(10.0**low, 10.0**high)
    elif axis.dates:
        ticks = date_ticks(low, high, most)
    else:
        ticks = linear_ticks(low, high, most, axis.step)
    return _Scaled(axis, low, high, ticks)


def _labelled(chart: Chart, number: int) -> bool:
    """Whether the label of a plot's vertical axis is not that of its neighbour at the left."""
    return number % chart.columns == 0 or chart.plots[number - 1].y.label != chart.plots[number].y.label


def _left(chart: Chart, number: int, scaled: _Scaled) -> float:
    if chart.plots[number].sphere:
        return 0.0
    longest = max((len(label) for _, label in scaled.ticks), default=0)
    return LETTER * longest + 12.0 + (23.0 if _labelled(chart, number) and scaled.axis.label else 0.0)


def _foot(ticks: Ticks, wide: float) -> float:
    """Room that names need below level ones where they are turned because they would not stand side by side; else 0."""
    lengths = [len(text) for _, text in ticks]
    # one long name is as wide as its neighbours leave it room
    widest = max((0.5 * (first + second) for first, second in pairwise(lengths)), default=0.0)
    if (widest + 2.0) * len(lengths) * LETTER <= wide:
        return 0.0
    return SINE * LETTER * min(max(lengths), LONGEST_TURNED) - 4.0


def _axes(plot: Plot, area: PlotArea, scaled: tuple[_Scaled, _Scaled], foot: float, *, labelled: bool) -> str:
    across, along = scaled
    base = area.top + area.height
    x_ticks = [(float(area.x(np.array([value]))[0]), text) for value, text in across.ticks]
    y_ticks = [(float(area.y(np.array([value]))[0]), text) for value, text in along.ticks]
    grid = "".join(f"M{x:.1f} {area.top:.1f}v{area.height:.1f}" for x, _ in x_ticks)
    grid += "".join(f"M{area.left:.1f} {y:.1f}h{area.width:.1f}" for y, _ in y_ticks)
    frame = f"M{area.left:.1f} {area.top:.1f}v{area.height:.1f}h{area.width:.1f}"
    parts = [f'<path d="{grid}" stroke="{GRID}" fill="none"/><path d="{frame}" stroke="{FRAME}" fill="none"/>']
    turned = foot > 0.0
    for x, text in x_ticks:
        turn = (
            f'text-anchor="end" transform="rotate(-38 {x:.1f} {base + 13:.1f})"' if turned else 'text-anchor="middle"'
        )
        at = x if turned else min(x, WIDTH - 0.5 * LETTER * len(text))  # the last one ends inside
        parts.append(text_at(at, base + 15.0, _cut(text) if turned else text, f'{turn} fill="{QUIET}"'))
    parts += [text_at(area.left - 6.0, y + 4.0, text, f'text-anchor="end" fill="{QUIET}"') for y, text in y_ticks]
    middle, below = area.left + 0.5 * area.width, base + 34.0 + foot
    parts.append(text_at(middle, below, plot.x.label, 'text-anchor="middle"'))
    if labelled and plot.y.label:
        x = area.left - LETTER * max((len(text) for _, text in y_ticks), default=0) - 19.0
        y = area.top + 0.5 * area.height
        parts.append(text_at(x, y, plot.y.label, f'text-anchor="middle" transform="rotate(-90 {x:.1f} {y:.1f})"'))
    return "".join(parts)


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST_TURNED else f"{text[: LONGEST_TURNED - 1]}…"


def _sphere_area(plot: Plot, x: float, y: float, wide: float, tall: float) -> PlotArea:
    """The place of a map, with the same scale in both directions."""
    low, high = plot.x.low or -2.12, plot.x.high or 2.12
    bottom, top = plot.y.low or -1.16, plot.y.high or 1.16
    scale = min(wide / (high - low), (tall - SPHERE_TOP) / (top - bottom))
    width, height = scale * (high - low), scale * (top - bottom)
    return PlotArea(
        x + 0.5 * (wide - width), y + SPHERE_TOP, width, height,
        lambda values: (values - low) / (high - low), lambda values: (values - bottom) / (top - bottom),
    )  # fmt: skip


def _legend_names(chart: Chart) -> list[tuple[str, str]]:
    """Names of the traces with their mark, each once."""
    by_name: dict[str, str] = {}
    for plot in chart.plots:
        for trace in plot.traces:
            if trace.legend and trace.name and trace.style not in {"density", "labels"}:
                by_name.setdefault(trace.name, _mark(trace))
    return list(by_name.items())


def _mark(trace: Trace) -> str:
    """The symbol of a trace for the legend, about the origin, as SVG."""
    colour = ROLES[trace.role]
    if trace.style == "line":
        dash = ' stroke-dasharray="5 3"' if trace.dashed else ""
        return f'<path d="M-9 0h18" stroke="{colour}" stroke-width="2"{dash}/>'
    if trace.style == "band":
        return f'<path d="M-9-5h18v10h-18z" fill="{colour}" fill-opacity=".25"/>'
    if trace.style == "bars":
        return f'<path d="M-5-5h10v10h-10z" fill="{colour}"/>'
    return marks(np.zeros(1), np.zeros(1), replace(trace, size=LEGEND_MARK), colour)


def _legend_lines(names: list[tuple[str, str]]) -> list[list[tuple[float, str, str]]]:
    """The entries of each line of the legend, with their places."""
    lines: list[list[tuple[float, str, str]]] = []
    at = WIDTH
    for name, mark in names:
        long = LETTER * len(name) + 42.0
        if at + long > WIDTH:
            lines.append([])
            at = 12.0
        lines[-1].append((at, name, mark))
        at += long
    return lines


def _bar(scale: ColourScale, x: float, y: float, height: float) -> str:
    steps = 48
    share = (np.arange(steps) + 0.5) / steps
    colours = shade(scale.low + share * (scale.high - scale.low), scale)
    step_height = height / steps
    cells = "".join(
        f'<path d="M{x:.1f} {y + height - step_height * (k + 1):.2f}h12v{step_height + 0.4:.2f}h-12z" fill="{colour}"/>'
        for k, colour in enumerate(colours)
    )
    labels = "".join(
        text_at(x + 17.0, y + height * (scale.high - value) / (scale.high - scale.low) + 4.0, text, f'fill="{QUIET}"')
        for value, text in linear_ticks(scale.low, scale.high, max(2, int(height // 60)))
        if scale.low <= value <= scale.high
    )
    middle = y + 0.5 * height
    turn = f'text-anchor="middle" transform="rotate(-90 {x + 62.0:.1f} {middle:.1f})"'
    return cells + labels + text_at(x + 62.0, middle, scale.label, turn)


def text_at(x: float, y: float, text: str, more: str = "") -> str:
    """A text at its place; ``more`` are further attributes."""
    return f'<text x="{x:.1f}" y="{y:.1f}"{" " + more if more else ""}>{escape(text, quote=False)}</text>'
