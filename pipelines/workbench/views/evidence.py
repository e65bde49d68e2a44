"""The evidence of a finding of the audit as a chart: the values that it is drawn from."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pipelines.audit import charts as audit_charts
from pipelines.audit.drifts import OWN
from pipelines.audit.finding import AuditFinding
from pipelines.audit.parameters import NAMES, unit_text
from pipelines.drawing import Chart, Plot, PlotAxis, Trace
from pipelines.drawing.chart import Role

if TYPE_CHECKING:
    from pipelines.audit.audit import Audit

MOST = 80  # findings with a chart of their own
COLOURS: tuple[Role, Role] = ("x", "y")


def evidence(audit: Audit, listed: Sequence[AuditFinding]) -> dict[str, Chart]:
    """Charts by the address of their finding; a finding without one has its numbers only."""
    charts = {address_of(one): chart_of(audit, one) for one in listed[:MOST]}
    return {name: chart for name, chart in charts.items() if chart is not None}


def address_of(finding: AuditFinding) -> str:
    """A name of a finding that stays the same as long as the finding does."""
    words = (finding.kind, finding.subject, str(finding.evidence.get("parameter", finding.evidence.get("figure", ""))))
    return ".".join(word for word in words if word)[:180]


def chart_of(audit: Audit, finding: AuditFinding) -> Chart | None:
    """The chart of a finding; None where it has no series of values."""
    numbers = finding.evidence
    parameter = str(numbers.get("parameter", ""))
    if finding.who == "station" and "where" in numbers:
        same = (str(numbers["station"]), str(numbers["where"]), parameter)
        series = (one for one in (*audit.stations, *audit.slots) if (one.station, one.where, one.parameter) == same)
        return next((audit_charts.series_chart(one) for one in series), None)
    if "standard" in numbers:
        same = (str(numbers["station"]), str(numbers["standard"]), parameter)
        charts = (one for one in audit.charts if (one.station, one.standard, one.parameter) == same)
        return next((audit_charts.control_chart(one) for one in charts), None)
    if not finding.units or len(finding.units) > len(COLOURS) or "run" not in numbers:
        return None
    drifts = [d for own in audit.units.values() for d in own if d.unit == finding.units[0] and d.parameter == parameter]
    if drifts:
        return audit_charts.drift_chart(audit, drifts[0])
    return _histories(audit, finding.units, parameter or _furthest(audit, finding.units), str(numbers["run"]))


def _furthest(audit: Audit, units: Sequence[str]) -> str:
    """The parameter in which a unit's calibrations are most scattered relative to their errors."""
    rows = audit.all.unit == units[0]
    own = [NAMES.index(name) for name in OWN]
    values, errors = audit.all.values[rows][:, own], audit.all.errors[rows][:, own]
    spread = np.nan_to_num(np.ptp(values, axis=0) / np.nanmax(errors, axis=0))
    return OWN[int(np.argmax(spread))]


def _histories(audit: Audit, units: Sequence[str], parameter: str, run: str) -> Chart:
    """Calibrations of one or two units before all others of their kind, with those of the run of the finding marked."""
    own = audit.all
    value, text = own.column(parameter), unit_text(parameter)
    kind = own.device == own.device[own.unit == units[0]][0]
    traces = [
        Trace(
            "other units of the kind",
            *_places(own.day, value, kind & ~np.isin(own.unit, units)),
            role="muted",
            size=3.5,
        )
    ]
    for name, role in zip(units, COLOURS, strict=False):
        rows = np.flatnonzero((own.unit == name) & kind)
        texts = tuple(f"{name}, run {own.run[row]}: {value[row]:.5g} {text}" for row in rows)
        traces.append(Trace(f"{name} line", own.day[rows], value[rows], "line", role, legend=False))
        traces.append(
            Trace(
                name, own.day[rows], value[rows], role=role, size=7, error=2.0 * own.error(parameter)[rows], texts=texts
            )
        )
    marked = np.isin(own.unit, units) & (own.run == run)
    label = f"run {run}"
    traces.append(Trace(label, *_places(own.day, value, marked), role="limit", symbol="diamond", size=11))
    plot = Plot("", PlotAxis("date of measurement", dates=True), PlotAxis(f"{parameter} / {text}"), tuple(traces))
    return Chart(f"{parameter} of {' and '.join(units)}, k = 2", (plot,), height=280)


def _places(
    day: NDArray[np.float64], value: NDArray[np.float64], rows: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return day[rows], value[rows]
