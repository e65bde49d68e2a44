"""Charts of the audit: yield, calibrations due, control charts, quantities of stations and drifts of units over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from inertial.counts import number_of
from pipelines.audit.pairs import YEAR_D
from pipelines.audit.parameters import unit_text
from pipelines.drawing import Chart, Plot, PlotAxis, Trace

if TYPE_CHECKING:
    from pipelines.audit.audit import Audit
    from pipelines.audit.stations_over_time import ControlChart, StationSeries
    from pipelines.audit.unit_drifts import UnitDrift

MONTHS = 24
MOST_POINTS = 1500
MOST_FORECAST_Y = 6.0


def yield_chart(months: list[Any]) -> Chart:
    """Yield month by month with its exact 95 % interval."""
    day = np.array([np.datetime64(f"{month.name}-15", "D").astype(float) for month in months])
    low, value, high = (
        100.0 * np.array([getattr(m.interval, side) for m in months]) for side in ("low", "value", "high")
    )
    traces = (
        Trace("95 % interval", day, low, "band", "accent", high=high),
        Trace(
            "yield",
            day,
            value,
            size=7,
            texts=tuple(f"{m.name}: {v:.1f} % of {m.total}" for m, v in zip(months, value, strict=True)),
        ),
    )
    least = max(0.0, float(np.floor(np.percentile(low, 10))) - 1.0)
    plot = Plot("", PlotAxis("month", dates=True), PlotAxis("yield / %", low=least, high=100.4), traces)
    return Chart("Yield by month", (plot,), height=260)


def due_chart(audit: Audit) -> Chart:
    """Units due, by month over the next two years."""
    months = (audit.due.day - audit.scope.until) / (YEAR_D / 12.0)
    ahead = np.bincount(np.floor(months[(months >= 0.0) & (months < MONTHS)]).astype(int), minlength=MONTHS)
    late = int(np.count_nonzero(months < 0.0))
    bars = Trace("units due", np.arange(MONTHS, dtype=np.float64) + 0.5, ahead.astype(float), "bars")
    more = f" ({number_of(late, 'overdue unit')} not shown)" if late else ""
    most = max(1.05 * float(ahead.max()), 1.0)
    axes = (
        PlotAxis(f"months ahead{more}", step=3.0),
        PlotAxis("units due", low=0.0, high=most, step=1.0 if most < 8.0 else None),
    )
    return Chart("Re-calibrations due", (Plot("", *axes, (bars,)),), height=260)


def control_chart(one: ControlChart) -> Chart:
    """A control chart: values within 1, 2 and 3 σ, the moving average, and the signals."""
    hit = one.rules.any(axis=0) | one.outside
    ends = np.array([one.day.min(), one.day.max()])
    centre, sigma = one.chart.centre, one.chart.sigma
    traces = [
        Trace(
            f"± {width} σ",
            ends,
            np.full(2, centre - width * sigma),
            "band",
            "muted",
            high=np.full(2, centre + width * sigma),
            legend=False,
        )
        for width in (3, 2, 1)
    ]
    texts = tuple(f"{run}: {value:.5g}" for run, value in zip(one.run, one.value, strict=True))
    traces += [
        Trace("moving average", one.day, one.average, "line", "before"),
        Trace(
            "check standard",
            one.day[~hit],
            one.value[~hit],
            role="ink",
            texts=tuple(np.array(texts, dtype=object)[~hit]),
        ),
        Trace(
            "signal",
            one.day[hit],
            one.value[hit],
            role="limit",
            symbol="diamond",
            size=9,
            texts=tuple(np.array(texts, dtype=object)[hit]),
        ),
    ]
    alarms = f"{number_of(one.alarms, 'alarm')}, {one.expected:.1f} expected by chance"
    title = f"{one.station}: {one.standard}, {one.parameter}: {alarms}"
    plot = Plot(title, PlotAxis("date", dates=True), PlotAxis(f"{one.parameter} / {one.unit_text}"), tuple(traces))
    return Chart(f"Control chart of {one.standard} on {one.station}", (plot,), height=280)


def series_chart(one: StationSeries) -> Chart:
    """A quantity of a station over time, its level between changes, and the days of these with their intervals."""
    low, high = np.percentile(one.value, (0.5, 99.5))  # a single outlier leaves room for the rest
    room = 0.25 * (high - low) + 1e-9
    low, high = float(low - room), float(high + room)
    edges = [0, *(change.first for change in one.changes), one.day.size]
    thin = slice(None, None, 1 + one.day.size // MOST_POINTS)
    traces = [
        Trace(
            "runs",
            one.day[thin],
            one.value[thin],
            role="muted",
            size=4.0,
            texts=tuple(str(run) for run in one.run[thin]),
        )
    ]
    for k, (start, stop) in enumerate(pairwise(edges)):
        level = np.full(2, one.value[start:stop].mean())
        traces.append(
            Trace("level", np.array([one.day[start], one.day[stop - 1]]), level, "line", "accent", legend=k == 0)
        )
    for k, change in enumerate(one.changes):
        when = one.day[[max(change.low - 1, 0), min(change.high, one.day.size - 1)]]
        traces.append(
            Trace(
                "interval of the change", when, np.full(2, low), "band", "limit", high=np.full(2, high), legend=k == 0
            )
        )
        day = np.full(2, one.day[change.first])
        traces.append(Trace("change", day, np.array([low, high]), "line", "limit", dashed=True, legend=k == 0))
    title = f"{one.station}: {one.where}, {one.parameter}"
    label = f"{one.parameter} / {one.unit_text}" if one.unit_text else one.parameter
    plot = Plot(title, PlotAxis("date", dates=True), PlotAxis(label, low=low, high=high), tuple(traces))
    return Chart(title, (plot,), height=260)


def drift_chart(audit: Audit, one: UnitDrift) -> Chart:
    """The history of a unit's parameter, the tolerance about the last calibration, and the drift until it leaves that."""
    rows = np.flatnonzero(audit.good & (audit.all.unit == one.unit) & (audit.all.device == one.device))
    day, value, error = audit.all.day[rows], audit.all.column(one.parameter)[rows], audit.all.error(one.parameter)[rows]
    end = day[-1] + YEAR_D * min(MOST_FORECAST_Y, 1.1 * _years_to(one))
    ahead = np.array([day[-1], end])
    traces = [
        Trace(
            "calibrations, k = 2", day, value, error=2.0 * error, texts=tuple(str(run) for run in audit.all.run[rows])
        )
    ]
    last = float(value[-1])
    if np.isfinite(one.slope):
        traces.append(Trace("drift", ahead, last + one.slope * (ahead - day[-1]) / YEAR_D, "line", "before"))
    if np.isfinite(one.tolerance):
        low, high = last - one.tolerance, last + one.tolerance
        for k, edge in enumerate((low, high)):
            traces.append(Trace("tolerance", ahead, np.full(2, edge), "line", "limit", dashed=True, legend=k == 0))
        if np.isfinite(one.leaves):
            window = np.array([max(one.soonest, day[-1]), min(one.latest, end)])
            name = "leaves its tolerance"
            traces.append(Trace(name, window, np.full(2, low), "band", "before", high=np.full(2, high)))
    label = f"{one.parameter} / {unit_text(one.parameter)}"
    plot = Plot(f"{one.unit}: {one.parameter}", PlotAxis("date", dates=True), PlotAxis(label), tuple(traces))
    return Chart(f"Drift of {one.unit}: {one.parameter}, E_n {one.e_n:.2f}", (plot,), height=260)


def _years_to(drift: UnitDrift) -> float:
    end = drift.latest if np.isfinite(drift.latest) else drift.leaves
    return max(1.0, (end - drift.day) / YEAR_D) if np.isfinite(end) else MOST_FORECAST_Y
