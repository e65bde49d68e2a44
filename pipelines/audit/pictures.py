"""Charts of the audit: yield, calibrations due, control charts, quantities of stations and units over time."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from inertial.counts import number_of
from pipelines.audit.audit import Audit
from pipelines.audit.drifts import OF_UNIT
from pipelines.audit.finding import AuditFinding
from pipelines.audit.pairs import YEAR_D
from pipelines.audit.parameters import NAMES, parameter_text, unit_text
from pipelines.audit.stations_over_time import ControlChart, StationSeries
from pipelines.audit.unit_drifts import UnitDrift
from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role, Symbol, between, level

MONTHS = 24
MOST_POINTS = 1500
MOST_FORECAST_Y = 6.0
UNIT_ROLES: tuple[Role, Role] = ("x", "y")
SIGNALS: tuple[tuple[str, Role, Symbol, float], ...] = (
    ("check standard", "ink", "circle", 6.0),
    ("signal", "limit", "diamond", 9.0),
)


def yield_chart(months: list[Any]) -> Chart:
    """Yield month by month with its exact 95 % interval."""
    day = np.array([np.datetime64(f"{month.name}-15", "D").astype(float) for month in months])
    low, value, high = (
        100.0 * np.array([getattr(m.interval, side) for m in months]) for side in ("low", "value", "high")
    )
    texts = tuple(f"{m.name}: {v:.1f} % of {m.total}" for m, v in zip(months, value, strict=True))
    traces = (
        Trace("95 % interval", day, low, "band", "accent", high=high),
        Trace("yield", day, value, size=7.0, texts=texts),
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
    note = f"{number_of(late, 'overdue unit')} not shown" if late else ""
    most = max(1.05 * float(ahead.max()), 1.0)
    axes = (
        PlotAxis("months ahead", step=3.0),
        PlotAxis("units due", low=0.0, high=most, step=1.0 if most < 8.0 else None),
    )
    return Chart("Re-calibrations due", (Plot("", *axes, (bars,)),), height=260, note=note)


def control_chart(chart: ControlChart) -> Chart:
    """A control chart: values within 1, 2 and 3 σ, the moving average, and the signals."""
    centre, sigma = chart.chart.centre, chart.chart.sigma
    traces = [
        between(chart.day, centre - width * sigma, centre + width * sigma, f"± {width} σ", legend=False)
        for width in (3, 2, 1)
    ]
    traces.append(Trace("moving average", chart.day, chart.average, "line", "before"))
    texts = np.array([f"{run}: {value:.5g}" for run, value in zip(chart.run, chart.value, strict=True)], dtype=object)
    for rows, (name, role, symbol, size) in zip((~chart.hit, chart.hit), SIGNALS, strict=True):
        labels = tuple(texts[rows])
        traces.append(Trace(name, chart.day[rows], chart.value[rows], "points", role, symbol, size, texts=labels))
    alarms = f"{number_of(chart.alarms, 'alarm')}, {chart.expected:.1f} expected by chance"
    name = parameter_text(chart.parameter)
    title = f"{chart.station}: {chart.standard}, {name}: {alarms}"
    plot = Plot(title, PlotAxis("date", dates=True), PlotAxis(f"{name} / {chart.unit_text}"), tuple(traces))
    return Chart(f"Control chart of {chart.standard} on {chart.station}", (plot,), height=280)


def series_chart(series: StationSeries) -> Chart:
    """A quantity of a station over time, its level between changes, and the days of these with their intervals."""
    low, high = np.percentile(series.value, (0.5, 99.5))  # a single outlier leaves room for the rest
    room = 0.25 * (high - low) + 1e-9
    low, high = float(low - room), float(high + room)
    edges = [0, *(change.first for change in series.changes), series.day.size]
    thin = slice(None, None, 1 + series.day.size // MOST_POINTS)
    runs = tuple(str(run) for run in series.run[thin])
    traces = [Trace("runs", series.day[thin], series.value[thin], role="muted", size=4.0, texts=runs)]
    for start, stop in pairwise(edges):
        between_changes = series.day[[start, stop - 1]]
        traces.append(level(between_changes, series.value[start:stop].mean(), "accent", "level", dashed=False))
    for change in series.changes:
        when = series.day[[max(change.low - 1, 0), min(change.high, series.day.size - 1)]]
        traces.append(between(when, low, high, "interval of the change", "limit"))
        day = np.full(2, series.day[change.first])
        traces.append(Trace("change", day, np.array([low, high]), "line", "limit", dashed=True))
    name = parameter_text(series.parameter)
    title = f"{series.station}: {series.where}, {name}"
    label = f"{name} / {series.unit_text}" if series.unit_text else name
    plot = Plot(title, PlotAxis("date", dates=True), PlotAxis(label, low=low, high=high), tuple(traces))
    return Chart(title, (plot,), height=260)


def drift_chart(audit: Audit, drift: UnitDrift) -> Chart:
    """The history of a unit's parameter, the tolerance about the last calibration, and the drift until it leaves that."""
    rows = np.flatnonzero(audit.good & (audit.all.unit == drift.unit) & (audit.all.device == drift.device))
    day, value, error = (
        audit.all.day[rows],
        audit.all.column(drift.parameter)[rows],
        audit.all.error(drift.parameter)[rows],
    )
    end = day[-1] + YEAR_D * min(MOST_FORECAST_Y, 1.1 * _years_to(drift))
    ahead = np.array([day[-1], end])
    texts = tuple(str(run) for run in audit.all.run[rows])
    traces = [Trace("calibrations, k = 2", day, value, error=2.0 * error, texts=texts)]
    last = float(value[-1])
    if np.isfinite(drift.slope):
        traces.append(Trace("drift", ahead, last + drift.slope * (ahead - day[-1]) / YEAR_D, "line", "before"))
    if np.isfinite(drift.tolerance):
        low, high = last - drift.tolerance, last + drift.tolerance
        traces += [level(ahead, edge, "limit", "tolerance") for edge in (low, high)]
        if np.isfinite(drift.leaves):
            window = np.array([max(drift.soonest, day[-1]), min(drift.latest, end)])
            traces.append(between(window, low, high, "leaves its tolerance", "fourth"))
    label = f"{parameter_text(drift.parameter)} / {unit_text(drift.parameter)}"
    plot = Plot("", PlotAxis("date", dates=True), PlotAxis(label), tuple(traces))
    return Chart(f"Drift of {drift.unit}: {parameter_text(drift.parameter)}, E_n {drift.e_n:.2f}", (plot,), height=260)


def _years_to(drift: UnitDrift) -> float:
    end = drift.latest if np.isfinite(drift.latest) else drift.leaves
    return max(1.0, (end - drift.day) / YEAR_D) if np.isfinite(end) else MOST_FORECAST_Y


def evidence_chart(audit: Audit, finding: AuditFinding) -> Chart | None:
    """The values that a finding is drawn from; None where it has no series of values."""
    numbers = finding.evidence
    parameter = str(numbers.get("parameter", ""))
    if finding.who == "station" and "where" in numbers:
        key = (str(numbers["station"]), str(numbers["where"]), parameter)
        series = (s for s in (*audit.stations, *audit.slots) if (s.station, s.where, s.parameter) == key)
        return next((series_chart(s) for s in series), None)
    if "standard" in numbers:
        key = (str(numbers["station"]), str(numbers["standard"]), parameter)
        charts = (chart for chart in audit.charts if (chart.station, chart.standard, chart.parameter) == key)
        return next((control_chart(chart) for chart in charts), None)
    if not finding.units or len(finding.units) > len(UNIT_ROLES) or "run" not in numbers:
        return None
    drifts = [
        d for unit in audit.units.values() for d in unit if (d.unit, d.parameter) == (finding.units[0], parameter)
    ]
    if drifts:
        return drift_chart(audit, drifts[0])
    return _histories(audit, finding.units, parameter or _furthest(audit, finding.units), str(numbers["run"]))


def _furthest(audit: Audit, units: Sequence[str]) -> str:
    """The parameter in which a unit's calibrations are most scattered relative to their errors."""
    rows = audit.all.unit == units[0]
    columns = [NAMES.index(name) for name in OF_UNIT]
    values, errors = audit.all.values[rows][:, columns], audit.all.errors[rows][:, columns]
    spread = np.nan_to_num(np.ptp(values, axis=0) / np.nanmax(errors, axis=0))
    return OF_UNIT[int(np.argmax(spread))]


def _histories(audit: Audit, units: Sequence[str], parameter: str, run: str) -> Chart:
    """Calibrations of one or two units before all others of their kind, with those of the run of the finding marked."""
    calibrations = audit.all
    value, error, text = calibrations.column(parameter), 2.0 * calibrations.error(parameter), unit_text(parameter)
    kind = calibrations.device == calibrations.device[calibrations.unit == units[0]][0]
    shown_units = np.isin(calibrations.unit, units)
    others, marked = kind & ~shown_units, shown_units & (calibrations.run == run)
    traces = [Trace("other units of the kind", calibrations.day[others], value[others], role="muted", size=3.5)]
    for name, role in zip(units, UNIT_ROLES, strict=False):
        rows = np.flatnonzero((calibrations.unit == name) & kind)
        day, shown = calibrations.day[rows], value[rows]
        texts = tuple(f"{name}, run {calibrations.run[row]}: {value[row]:.5g} {text}" for row in rows)
        traces.append(Trace(f"{name} line", day, shown, "line", role, legend=False))
        traces.append(Trace(name, day, shown, role=role, size=7.0, error=error[rows], texts=texts))
    traces.append(
        Trace(f"run {run}", calibrations.day[marked], value[marked], role="limit", symbol="diamond", size=11.0)
    )
    plot = Plot("", PlotAxis("date of measurement", dates=True), PlotAxis(f"{parameter} / {text}"), tuple(traces))
    return Chart(f"{parameter} of {' and '.join(units)}, k = 2", (plot,), height=280)
