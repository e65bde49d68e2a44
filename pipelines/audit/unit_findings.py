"""Findings about units: exchanged serials, out of tolerance, leaving their limits, drift outliers."""

from collections.abc import Collection, Iterator, Sequence
from typing import Any

import numpy as np

from inertial.arrays import Flags
from inertial.population.comparison import outlier_limit
from pipelines.audit.audit import Audit
from pipelines.audit.calibrations import IMPORTED, Calibrations, date_of
from pipelines.audit.drifts import OF_UNIT
from pipelines.audit.finding import AuditFinding, date_or_never
from pipelines.audit.pairs import YEAR_D, changes_of, last_of_each, pairs_of
from pipelines.audit.parameters import FAMILY_OF, parameter_text, unit_text
from pipelines.audit.rules import Rules
from pipelines.audit.unit_drifts import UnitDrift


def of_units(audit: Audit) -> Iterator[AuditFinding]:
    """All findings about units, the most serious kind first."""
    yield from _two_units(audit)
    yield from _exchanged(audit)
    yield from _out_of_tolerance(audit)
    scope, all_ = audit.scope, audit.all
    judged = audit.good & audit.product & (all_.device == (scope.device.upper() or all_.device))
    judged &= all_.station == (scope.station or all_.station)
    yield from of_small_kinds(all_, judged, audit.rules, {kind.device for kind in audit.kinds}, scope.since)
    yield from _leaving(audit)
    yield from _unlike_their_kind(audit)


def _two_units(audit: Audit) -> Iterator[AuditFinding]:
    for serial, rows in twice(audit.all).items():
        if audit.all.day[rows[1]] < audit.scope.since:
            continue
        first, second = (_where(audit.all, row) for row in rows)
        message = (
            f"{serial}: measured as {first} and as {second}, which is impossible for one unit: two units have one serial; "
            "identify both, give one a new serial, and revoke the certificates of the wrong one"
        )
        evidence = {"runs": [str(audit.all.run[row]) for row in rows]}
        yield AuditFinding("quality", "two_units", serial, message, (serial,), evidence)


def _where(calibrations: Calibrations, row: int) -> str:
    day = date_of(float(calibrations.day[row]))
    return f"{calibrations.device[row]} on {calibrations.station[row]}, {day} (run {calibrations.run[row]})"


def _exchanged(audit: Audit) -> Iterator[AuditFinding]:
    for stranger in audit.strangers:
        unit, run, day = (str(getattr(audit.all, n)[stranger.row]) for n in ("unit", "run", "day"))
        evidence = {
            "run": run,
            "date": date_of(float(day)),
            "distance": stranger.distance,
            "looks_like": stranger.looks_like,
        }
        if stranger.looks_like:
            how = "and vice versa" if stranger.exchanged else "whose own calibration of that day differs"
            message = (
                f"{unit} of {date_of(float(day))} (run {run}) does not fit its history, it fits that of "
                f"{stranger.looks_like}, {how}: serials were exchanged; read both labels, revoke the certificates "
                "and certify again"
            )
            yield AuditFinding("quality", "exchanged", unit, message, (unit, stranger.looks_like), evidence)
        else:
            message = (
                f"{unit} of {date_of(float(day))} (run {run}) fits neither its own history nor that of any other unit: it was "
                "damaged, or its serial is wrong; measure it again"
            )
            yield AuditFinding("quality", "foreign", unit, message, (unit,), evidence)


def _out_of_tolerance(audit: Audit) -> Iterator[AuditFinding]:
    """Units out of tolerance at their re-calibration by more than the uncertainty: their measurements are doubtful."""
    for drifts in audit.units.values():
        outside = [d for d in drifts if d.day >= audit.scope.since and abs(d.change) - _expanded(d) > d.tolerance]
        if not outside:
            continue
        drift = max(outside, key=lambda d: (abs(d.change) - _expanded(d)) / d.tolerance)
        text = unit_text(drift.parameter)
        message = (
            f"{drift.unit}: {parameter_text(drift.parameter)} changed by {drift.change:+.4g} {text} in {_after(drift.years)}, "
            f"tolerance {drift.tolerance:g} {text}, U {_expanded(drift):.3g}, E_n {drift.e_n:+.1f}{_besides(outside)}; its "
            f"measurements since {date_of(drift.day - YEAR_D * drift.years)} are doubtful: inform its users"
        )
        evidence = {**_numbers(drift), "parameters": [d.parameter for d in outside]}
        yield AuditFinding("quality", "found_outside", drift.unit, message, (drift.unit,), evidence)


def of_small_kinds(
    calibrations: Calibrations, good: Flags, rules: Rules, large: Collection[str], since: float
) -> Iterator[AuditFinding]:
    """Units out of tolerance of kinds with too few calibrations for a drift, by U (k = 2) of both calibrations alone.

    large : the kinds with enough of them, whose units :func:`of_units` judges with what their pairs tell of the mounting
    """
    pairs = pairs_of(calibrations, good)
    last = pairs.chosen(last_of_each(calibrations.histories[pairs.later]))
    changes = {name: changes_of(calibrations, last, name) for name in OF_UNIT}
    for k, row in enumerate(map(int, last.later)):
        serial, device, day = str(calibrations.unit[row]), str(calibrations.device[row]), float(calibrations.day[row])
        if device in large or day < since:
            continue
        excess = {
            name: (abs(change[k]) - 2.0 * np.sqrt(variance[k])) / rules.tolerance_of(device, FAMILY_OF[name])
            for name, (change, variance) in changes.items()
        }
        outside = [name for name, over in excess.items() if over > 1.0]
        if not outside:
            continue
        worst = max(outside, key=lambda name: excess[name])
        change, u = float(changes[worst][0][k]), 2.0 * float(np.sqrt(changes[worst][1][k]))
        tolerance, text, years = rules.tolerance_of(device, FAMILY_OF[worst]), unit_text(worst), float(last.years[k])
        message = (
            f"{serial}: {parameter_text(worst)} changed by {change:+.4g} {text} in {_after(years)}, tolerance {tolerance:g} "
            f"{text}, U {u:.3g} without the mounting{_besides(outside)}; its measurements since "
            f"{date_of(day - YEAR_D * years)} are doubtful: inform its users"
        )
        evidence = {
            "parameter": worst, "run": str(calibrations.run[row]), "date": date_of(day), "change": change,
            "months": 12 * years, "expanded": u, "tolerance": tolerance, "parameters": outside,
        }  # fmt: skip
        yield AuditFinding("quality", "found_outside", serial, message, (serial,), evidence)


def _leaving(audit: Audit) -> Iterator[AuditFinding]:
    """Units that are expected to leave their tolerance or limit before they are due: each by the first of them."""
    due_day = {
        f"{audit.all.device[row]} {audit.all.unit[row]}": float(day)
        for row, day in zip(audit.due.row, audit.due.day, strict=True)
    }
    for unit, drifts in audit.units.items():
        due = due_day.get(unit, np.inf)
        leavings = [leaving for drift in drifts for leaving in _leavings(drift) if drift.day < leaving[0][0] < due]
        if not leavings:
            continue
        days, what, bound, drift = min(leavings, key=lambda leaving: leaving[0][0])
        text, others = unit_text(drift.parameter), list(dict.fromkeys(leaving[3].parameter for leaving in leavings))
        moves = f"drifts {_signed(drift.slope)} {text} a year" if np.isfinite(drift.slope) else "drifts like its kind"
        message = (
            f"{drift.unit}: {parameter_text(drift.parameter)} {moves} and leaves its {what} of {bound:g} {text} "
            f"about {date_or_never(days[0])} ({date_or_never(days[1])} to {date_or_never(days[2])})"
            f"{_besides(others)}, before it is due on {date_of(due)}; recall it"
        )
        evidence = {**_numbers(drift), "parameters": others}
        yield AuditFinding("quality", "leaves", drift.unit, message, (drift.unit,), evidence)


def _leavings(drift: UnitDrift) -> list[tuple[tuple[float, float, float], str, float, UnitDrift]]:
    """Days (expected, soonest, latest) when a parameter leaves its tolerance, and the product's limit."""
    tolerance = (drift.leaves, drift.soonest, drift.latest)
    return [(tolerance, "tolerance", drift.tolerance, drift), (drift.limit_day, "limit", drift.limit, drift)]


def _when(drift: UnitDrift) -> str:
    """When a parameter leaves its tolerance, as the end of a sentence."""
    if not np.isfinite(drift.tolerance):
        return "has no tolerance"
    bound = f"its tolerance of {drift.tolerance:g} {unit_text(drift.parameter)}"
    if np.isfinite(drift.leaves):
        days = f"({date_or_never(drift.soonest)} to {date_or_never(drift.latest)})"
        return f"leaves {bound} about {date_of(drift.leaves)} {days}"
    if np.isfinite(drift.soonest):
        return f"may leave {bound} from {date_of(drift.soonest)} on"
    return f"stays in {bound} for the next ten years"


def _expanded(drift: UnitDrift) -> float:
    return abs(drift.change / drift.e_n) if drift.e_n else np.inf


def _besides(leavings: Sequence[object]) -> str:
    more = len(leavings) - 1
    return f", and {more} more parameter{'s' if more > 1 else ''}" if more else ""


def _unlike_their_kind(audit: Audit) -> Iterator[AuditFinding]:
    """Units whose slope is an outlier of their kind: each by its most significant parameter."""
    count = sum(len(drifts) for drifts in audit.units.values())
    for drifts in audit.units.values():
        # calibrations within a few days have no stated drift
        stated = [drift for drift in drifts if np.isfinite(drift.odd)]
        worst = max(stated, key=lambda drift: abs(drift.odd), default=None)
        if worst is not None and abs(worst.odd) > outlier_limit(count) and worst.day >= audit.scope.since:
            text = unit_text(worst.parameter)
            when = f"{_when(worst)}: give it a shorter interval, or take it out of use"
            message = (
                f"{worst.unit}: {parameter_text(worst.parameter)} drifts {_signed(worst.slope)} {text} a year over "
                f"{worst.calibrations} calibrations, {abs(worst.odd):.1f} σ from its kind, and {when}"
            )
            yield AuditFinding("quality", "drifts", worst.unit, message, (worst.unit,), _numbers(worst))


def _numbers(drift: UnitDrift) -> dict[str, Any]:
    return {
        "parameter": drift.parameter, "run": drift.run, "date": date_of(drift.day), "change": drift.change,
        "months": 12 * drift.years, "e_n": drift.e_n,
        "slope_per_year": drift.slope if np.isfinite(drift.slope) else None, "tolerance": drift.tolerance,
        "leaves": date_or_never(drift.leaves), "soonest": date_or_never(drift.soonest), "latest": date_or_never(drift.latest),
    }  # fmt: skip


def _after(years: float) -> str:
    """Time between two calibrations, in a unit in which it is not zero."""
    months, days = 12.0 * years, YEAR_D * years
    if months >= 1.5:
        return f"{months:.0f} months"
    return f"{days:.0f} days" if days >= 1.5 else f"{24.0 * days:.2g} hours"


def _signed(value: float) -> str:
    """A number with its sign and three significant digits, large ones without an exponent."""
    text = f"{value:+.3g}"
    return f"{float(text):+.0f}" if "e+" in text else text


AT_ONCE_D = 1.0 / 96.0  # a quarter of an hour: moving and soaking a unit takes longer


def twice(calibrations: Calibrations) -> dict[str, tuple[int, int]]:
    """Serials of two units, in order, with the rows of two calibrations that cannot be of one unit."""
    order = np.lexsort((calibrations.day, calibrations.unit.astype(str)))
    unit, device, station = (column[order] for column in (calibrations.unit, calibrations.device, calibrations.station))
    same_unit = unit[1:] == unit[:-1]
    close = (np.diff(calibrations.day[order]) < AT_ONCE_D) & (station[1:] != station[:-1])
    by_serial: dict[str, tuple[int, int]] = {}
    stated = (device[1:] != IMPORTED) & (device[:-1] != IMPORTED)  # an import states no device
    for k in np.flatnonzero(same_unit & ((device[1:] != device[:-1]) & stated | close)):
        by_serial.setdefault(str(unit[k]), (int(order[k]), int(order[k + 1])))
    return by_serial
