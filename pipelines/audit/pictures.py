"""Plots of an audit, as SVG inside the page."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import matplotlib as mpl
import numpy as np
from matplotlib.dates import AutoDateLocator, ConciseDateFormatter
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from inertial.counts import number_of
from pipelines.audit.pairs import YEAR_D
from pipelines.audit.parameters import unit_text
from pipelines.report.plots import STYLE, WIDTH_IN, svg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from pipelines.audit.audit import Audit
    from pipelines.audit.population import Share
    from pipelines.audit.stations_over_time import ControlChart, StationSeries
    from pipelines.audit.unit_drifts import UnitDrift

BLUE, RED, GREY, ORANGE, GREEN = "#0072b2", "#c62828", "#b4b4b4", "#d55e00", "#009e73"
ROW_IN = 2.5
TICKS = 5
MOST_POINTS = 1500
MOST_FORECAST_Y = 6.0


def series_plot(series: Sequence[StationSeries]) -> str:
    """Quantities of stations over time: single runs in grey, the level between changes, the days of the changes."""
    figure, places = _rows(len(series))
    with mpl.rc_context(STYLE):
        for place, one in zip(places, series, strict=True):
            thin = slice(None, None, 1 + one.day.size // MOST_POINTS)
            place.scatter(one.day[thin], one.value[thin], s=7, c=GREY, linewidths=0)
            edges = [0, *(c.first for c in one.changes), one.day.size]
            for start, stop in pairwise(edges):
                place.hlines(one.value[start:stop].mean(), one.day[start], one.day[stop - 1], color=BLUE, linewidth=2.0)
            for change in one.changes:
                low, high = one.day[max(change.low - 1, 0)], one.day[min(change.high, one.day.size - 1)]
                place.axvspan(low, high, color=RED, alpha=0.25, linewidth=0)
                place.axvline(one.day[change.first], color=RED, linewidth=1.0)
            place.set(title=f"{one.station}: {one.where}, {one.parameter}", ylabel=one.unit_text)
            _calm(place, one.value)
        _dated(places)
        return svg(figure)


def chart_plot(charts: Sequence[ControlChart]) -> str:
    """Control charts: every value with the limits of 1, 2 and 3 σ, the moving average with its own limits, signals in red."""
    figure, places = _rows(len(charts))
    with mpl.rc_context(STYLE):
        for place, one in zip(places, charts, strict=True):
            for width, shade in ((3.0, "#f1f3f6"), (2.0, "#e7ebf0"), (1.0, "#dce2ea")):
                low, high = one.chart.centre - width * one.chart.sigma, one.chart.centre + width * one.chart.sigma
                place.axhspan(low, high, color=shade, linewidth=0)
            hit = one.rules.any(axis=0)
            place.plot(one.day, one.average, color=ORANGE, linewidth=1.4, label="moving average")
            place.scatter(one.day[~hit], one.value[~hit], s=9, c="#55585f", linewidths=0, label="check standard")
            place.scatter(one.day[hit], one.value[hit], s=16, c=RED, linewidths=0, label="signal of a rule")
            outside = one.outside
            place.scatter(one.day[outside], one.average[outside], s=12, c=ORANGE, marker="s", linewidths=0)
            title = f"{one.station}: {one.standard}, {one.parameter}: "
            f"{number_of(one.alarms, 'alarm')}, {one.expected:.1f} expected by chance"
            place.set(title=title, ylabel=one.unit_text)
            place.grid(visible=False)
            place.yaxis.set_major_locator(MaxNLocator(TICKS))
        low, high = places[0].get_ylim()
        places[0].set_ylim(low, high + 0.2 * (high - low))
        places[0].legend(loc="upper left", ncols=3, frameon=False, fontsize=9)
        _dated(places)
        return svg(figure)


def yield_plot(months: Sequence[Share]) -> str:
    """Yield month by month with its exact 95 % interval."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 2.4))
        place = figure.subplots()
        figure.subplots_adjust(left=0.06, right=0.99, bottom=0.16, top=0.95)
        day = np.array([np.datetime64(f"{m.name}-15", "D").astype(float) for m in months])
        low, high = (np.array([100.0 * getattr(m.interval, side) for m in months]) for side in ("low", "high"))
        value = np.array([100.0 * m.interval.value for m in months])
        place.fill_between(day, low, high, color=BLUE, alpha=0.18, linewidth=0)
        place.plot(day, value, "o-", color=BLUE, markersize=3.5, linewidth=1.2)
        place.set(ylabel="yield / %", ylim=(max(0.0, np.floor(np.percentile(low, 10)) - 1.0), 100.4))
        _dated([place])
        return svg(figure)


def due_plot(audit: Audit) -> str:
    """Units that come due, month by month over the next two years."""
    months = (audit.due.day - audit.scope.until) / (YEAR_D / 12.0)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, 2.2))
        place = figure.subplots()
        figure.subplots_adjust(left=0.06, right=0.99, bottom=0.2, top=0.95)
        ahead = np.bincount(np.floor(months[(months >= 0.0) & (months < 24.0)]).astype(int), minlength=24)
        place.bar(np.arange(24) + 0.5, ahead, width=0.8, color=BLUE)
        place.set_xticks(range(0, 25, 3))
        place.set_ylim(0.0, max(1.05 * float(ahead.max()), 1.0))
        late = int(np.count_nonzero(months < 0.0))
        more = f" ({number_of(late, 'overdue unit')} not shown)" if late else ""
        place.set(xlabel=f"months ahead{more}", ylabel="units due")
        place.yaxis.set_major_locator(MaxNLocator(TICKS, integer=True))
        place.grid(visible=False, axis="x")
        return svg(figure)


def drift_plot(audit: Audit, drifts: Sequence[UnitDrift]) -> str:
    """Histories of units: every calibration, the tolerance about the last one, and the forecast of the drift."""
    figure, places = _rows(len(drifts))
    with mpl.rc_context(STYLE):
        for place, one in zip(places, drifts, strict=True):
            rows = np.flatnonzero(audit.good & (audit.all.unit == one.unit) & (audit.all.device == one.device))
            day, value, error = (
                audit.all.day[rows],
                audit.all.column(one.parameter)[rows],
                audit.all.error(one.parameter)[rows],
            )
            place.errorbar(day, value, 2.0 * error, fmt="o", color=BLUE, markersize=4, linewidth=0.8)
            end = day[-1] + YEAR_D * min(MOST_FORECAST_Y, _years_to(one) * 1.1)
            if np.isfinite(one.tolerance):
                for edge in (-one.tolerance, one.tolerance):
                    place.hlines(value[-1] + edge, day[-1], end, color=RED, linestyle="--", linewidth=1.0)
            ahead = np.array([day[-1], end])
            place.plot(ahead, value[-1] + one.slope * (ahead - day[-1]) / YEAR_D, color=ORANGE, linewidth=1.4)
            if np.isfinite(one.leaves):
                late = min(one.latest, end)
                place.axvspan(max(one.soonest, day[-1]), late, color=ORANGE, alpha=0.15, linewidth=0)
            place.set(title=f"{one.unit}: {one.parameter}", ylabel=unit_text(one.parameter))
            place.yaxis.set_major_locator(MaxNLocator(TICKS))
        _dated(places)
        return svg(figure)


def _years_to(drift: UnitDrift) -> float:
    end = drift.latest if np.isfinite(drift.latest) else drift.leaves
    return max(1.0, (end - drift.day) / YEAR_D) if np.isfinite(end) else MOST_FORECAST_Y


def _rows(count: int) -> tuple[Figure, list[Axes]]:
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH_IN, ROW_IN * count))
        places = list(figure.subplots(count, 1, squeeze=False)[:, 0])
        edge = 0.3 / (ROW_IN * count)
        figure.subplots_adjust(left=0.075, right=0.99, bottom=1.1 * edge, top=1.0 - edge, hspace=0.42)
        return figure, places


def _calm(place: Axes, values: NDArray[np.float64]) -> None:
    """Limits of an axis that ignore single outliers."""
    low, high = np.percentile(values, (0.5, 99.5))
    room = 0.25 * (high - low) + 1e-9
    place.set_ylim(low - room, high + room)
    place.yaxis.set_major_locator(MaxNLocator(TICKS))


def _dated(places: Sequence[Axes]) -> None:
    for place in places:
        locator = AutoDateLocator(minticks=4, maxticks=9)
        place.xaxis.set_major_locator(locator)
        place.xaxis.set_major_formatter(ConciseDateFormatter(locator))
