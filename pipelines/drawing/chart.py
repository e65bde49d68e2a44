"""The description of a chart: arrays, labels with units, and the role of every trace; no drawing library.

A page, a file of a report and a CSV file are drawn from the same description, so that they hold the same numbers.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from inertial.arrays import Array

Role = Literal["x", "y", "z", "fourth", "norm", "accent", "before", "after", "muted", "limit", "good", "ink"]
Style = Literal["points", "line", "band", "bars", "density", "labels"]
Anchor = Literal["center", "top left", "top right", "top center", "bottom center"]
Symbol = Literal["circle", "triangle-up", "triangle-down", "square", "diamond"]

ROLES: dict[Role, str] = {
    "x": "#0072b2",
    "y": "#d55e00",
    "z": "#009e73",
    "fourth": "#b0508a",
    "norm": "#0072b2",
    "accent": "#0072b2",
    "before": "#8a6400",
    "after": "#7a3fb0",
    "muted": "#868f99",
    "limit": "#b3261e",
    "good": "#1b7f3b",
    "ink": "#3a3f47",
}
"""Colours on a white page for any colour vision (Okabe and Ito); a page replaces them by those of its theme."""

SEVERAL: tuple[Role, ...] = ("x", "y", "z", "fourth", "ink", "muted")
"""Roles of series that are no axes, in order."""

DIVERGING = ((0.0, "#2f7bc4"), (0.25, "#74a9d8"), (0.5, "#b9bfc6"), (0.75, "#e58a6f"), (1.0, "#d0382f"))
SEQUENTIAL = ((0.0, "#4a63b8"), (0.25, "#667ba8"), (0.5, "#8b8f86"), (0.75, "#b3a052"), (1.0, "#cfa91a"))
"""Colours of values, none of which is near that of a white or of a dark page."""


@dataclass(frozen=True)
class PlotAxis:
    """An axis: its label with the unit.

    dates : whether values are days since 1970, UTC · names : of the places 0, 1, … of a categorical axis
    low, high : limits; None for those of the values · step : distance of the ticks; None for a round one
    """

    label: str
    log: bool = False
    dates: bool = False
    names: tuple[str, ...] = ()
    low: float | None = None
    high: float | None = None
    step: float | None = None


@dataclass(frozen=True)
class ColourScale:
    """The meaning of colours: a label with its unit, and the values at both ends."""

    label: str
    low: float
    high: float
    diverging: bool = True


@dataclass(frozen=True, eq=False)
class Trace:
    """Values with the same drawing style.

    x, y : (n,) · high : (n,), upper edge of a band · error : (n,), half length of an error bar
    colour : (n,), values on the chart's colour scale; the role's colour where None
    counts : (rows, columns), of a density; x and y are then the middles of columns and rows
    width : of a line, in pixels; 0 for the usual one
    texts : (n,), shown beside a label or at the pointer
    anchors : (n,), on which side of its point a label stands; on the point where empty
    picks : (n,), selection by a click on a point; empty for none
    """

    name: str
    x: Array
    y: Array
    style: Style = "points"
    role: Role = "accent"
    symbol: Symbol = "circle"
    size: float = 6.0
    dashed: bool = False
    width: float = 0.0
    high: Array | None = None
    error: Array | None = None
    colour: Array | None = None
    counts: Array | None = None
    texts: tuple[str, ...] = ()
    anchors: tuple[Anchor, ...] = ()
    picks: tuple[str, ...] = ()
    legend: bool = True


@dataclass(frozen=True)
class Plot:
    """One pair of axes with its traces; a ``sphere`` has no axes and keeps its proportions."""

    title: str
    x: PlotAxis
    y: PlotAxis
    traces: tuple[Trace, ...]
    sphere: bool = False


@dataclass(frozen=True)
class Chart:
    """Plots side by side in ``columns`` columns, one colour scale for all.

    title : description for screen readers · height : of one row, in pixels of a page · note : a line below the plots
    """

    title: str
    plots: tuple[Plot, ...]
    columns: int = 1
    scale: ColourScale | None = None
    height: int = 320
    note: str = ""

    @property
    def rows(self) -> int:
        """Number of rows of plots."""
        return -(-len(self.plots) // self.columns)


def level(x: Array, value: float, role: Role = "muted", name: str = "", *, dashed: bool = True) -> Trace:
    """A horizontal line over the range of values."""
    return Trace(name, _ends(x), np.full(2, value), "line", role, dashed=dashed, legend=bool(name))


def between(x: Array, low: float, high: float, name: str, role: Role = "muted", *, legend: bool = True) -> Trace:
    """A horizontal band over the range of values."""
    return Trace(name, _ends(x), np.full(2, low), "band", role, high=np.full(2, high), legend=legend)


def _ends(x: Array) -> Array:
    finite = x[np.isfinite(x)]
    return np.array([finite.min(), finite.max()], dtype=np.float64) if finite.size else np.zeros(2)


def measured_curve(
    names: tuple[str, str, str], role: Role, x: Array, y: Array, interval: tuple[Array, Array], fitted: Array | None
) -> list[Trace]:
    """Points with their interval and with a fitted line, where these are known; ``names`` are those of the three."""
    low, high = interval
    bounded = np.isfinite(low) & np.isfinite(high)
    traces = [Trace(names[1], x, y, role=role, size=5.0)]
    if bounded.any():
        band = Trace(names[0], x[bounded], low[bounded], "band", role, high=high[bounded], legend=False)
        traces.insert(0, band)
    if fitted is not None and np.isfinite(fitted).any():
        traces.append(Trace(names[2], x, fitted, "line", role, legend=False))
    return traces


def shortened(name: str, most: int = 28) -> str:
    """A long name without its middle: a long serial number would take half of a figure."""
    return name if len(name) <= most else f"{name[: most - 9]}…{name[-8:]}"


def symmetric(values: Array, label: str) -> ColourScale:
    """A diverging scale about zero that holds all finite values."""
    finite = values[np.isfinite(values)]
    largest = float(np.max(np.abs(finite))) if finite.size else 1.0
    return ColourScale(label, -(largest or 1.0), largest or 1.0)


def density(x: Array, y: Array) -> Trace:
    """Counts of many points in cells of a grid: for points that would cover each other."""
    finite = np.isfinite(x) & np.isfinite(y)
    counts, *edges = np.histogram2d(x[finite], y[finite], bins=(80, 60))
    columns, rows = (0.5 * (edge[1:] + edge[:-1]) for edge in edges)
    return Trace("all units", columns, rows, "density", "muted", counts=counts.T)
