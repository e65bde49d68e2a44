"""Charts of the audit: yield, calibrations due, control charts, quantities of stations and drifts of units over time."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.audit.parameters import unit_text
from pipelines.report.charts import Chart, Plot, PlotAxis, Trace

if TYPE_CHECKING:
    from pipelines.audit.audit import Audit
    from pipelines.audit.stations_over_time import ControlChart, StationSeries
    from pipelines.audit.unit_drifts import UnitDrift

MONTHS = 24
YEAR_D = 365.25


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
    return Chart(
        "Yield by month", (Plot("", PlotAxis("month", dates=True), PlotAxis("yield / %"), traces),), height=260
    )


def due_chart(audit: Audit) -> Chart:
    """Units due, by month over the next two years."""
    months = (audit.due.day - audit.scope.until) / (YEAR_D / 12.0)
    ahead = np.bincount(np.floor(months[(months >= 0.0) & (months < MONTHS)]).astype(int), minlength=MONTHS)
    late = int(np.count_nonzero(months < 0.0))
    bars = Trace("units due", np.arange(MONTHS, dtype=np.float64) + 0.5, ahead.astype(float), "bars")
    axis = PlotAxis(f"months ahead ({late} units are overdue and are not among them)")
    return Chart("Re-calibrations due", (Plot("", axis, PlotAxis("units"), (bars,)),), height=260)


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
    title = (
        f"{one.station}: {one.standard}, {one.parameter}: {one.alarms} alarms, {one.expected:.1f} expected by chance"
    )
    plot = Plot(title, PlotAxis("date", dates=True), PlotAxis(f"{one.parameter} / {one.unit_text}"), tuple(traces))
    return Chart(f"Control chart of {one.standard} on {one.station}", (plot,), height=280)


def series_chart(one: StationSeries) -> Chart:
    """A quantity of a station over time, its level between changes, and the days of these."""
    edges = [0, *(change.first for change in one.changes), one.day.size]
    traces = [Trace("runs", one.day, one.value, role="muted", texts=tuple(str(run) for run in one.run))]
    for k, (start, stop) in enumerate(pairwise(edges)):
        level = np.full(2, one.value[start:stop].mean())
        traces.append(
            Trace("level", np.array([one.day[start], one.day[stop - 1]]), level, "line", "accent", legend=k == 0)
        )
    low, high = float(one.value.min()), float(one.value.max())
    for k, change in enumerate(one.changes):
        day = np.full(2, one.day[change.first])
        traces.append(Trace("change", day, np.array([low, high]), "line", "limit", dashed=True, legend=k == 0))
    plot = Plot(
        "",
        PlotAxis("date", dates=True),
        PlotAxis(f"{one.parameter} / {one.unit_text}" if one.unit_text else one.parameter),
        tuple(traces),
    )
    return Chart(f"{one.station}: {one.where}, {one.parameter}", (plot,), height=260)


def drift_chart(audit: Audit, one: UnitDrift) -> Chart:
    """The history of a unit's parameter, with the tolerance about the last calibration and the extrapolated drift."""
    rows = np.flatnonzero(audit.good & (audit.all.unit == one.unit) & (audit.all.device == one.device))
    day, value, error = audit.all.day[rows], audit.all.column(one.parameter)[rows], audit.all.error(one.parameter)[rows]
    end = day[-1] + YEAR_D * 2.0
    ahead = np.array([day[-1], end])
    traces = [
        Trace(
            "calibrations, k = 2", day, value, error=2.0 * error, texts=tuple(str(run) for run in audit.all.run[rows])
        )
    ]
    if np.isfinite(one.slope):
        traces.append(Trace("drift", ahead, value[-1] + one.slope * (ahead - day[-1]) / YEAR_D, "line", "before"))
    if np.isfinite(one.tolerance):
        for k, edge in enumerate((-one.tolerance, one.tolerance)):
            traces.append(
                Trace("tolerance", ahead, np.full(2, value[-1] + edge), "line", "limit", dashed=True, legend=k == 0)
            )
    plot = Plot(
        "",
        PlotAxis("date", dates=True),
        PlotAxis(f"{one.parameter} / {unit_text(one.parameter)}"),
        tuple(traces),
    )
    return Chart(f"Drift of {one.unit}: {one.parameter}, E_n {one.e_n:.2f}", (plot,), height=260)
