"""Drift since the last calibration: per kind of device and parameter, per unit, and when a unit leaves its tolerance."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from inertial.population.agreement import e_n
from inertial.population.drift import (
    DeviceDrift,
    LatestState,
    drifts_known,
    forecast,
    in_tolerance,
    kind_of,
    last_reliable,
    leaves,
    prudent,
    standing,
)
from pipelines.audit.parameters import FAMILIES, FAMILY_OF, NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from pipelines.audit.calibrations import Calibrations
    from pipelines.audit.rules import Rules

    Array = NDArray[np.float64]
    Flags = NDArray[np.bool_]
    Index = NDArray[np.int64]

YEAR_D = 365.25
MONTH_D = YEAR_D / 12.0
OWN = tuple(name for name in NAMES if FAMILIES[FAMILY_OF[name]].own)
FEWEST_PAIRS = 8
PAIRS_A_DOF = 6.0
"""Pairs for each degree of freedom of the mounting's variance: three variances are taken apart from the same pairs. By
simulation of units that stand still, 20 units of three calibrations whose stated uncertainty is a fifth of their scatter: |E_n|
> 1 in 4.4 % (8.3 % with a coverage factor of 2)."""
AHEAD = np.arange(0.0, 10.0 + 1e-9, 1.0 / 24.0)  # years, in steps of half a month


@dataclass(frozen=True)
class Pairs:
    """Neighbouring calibrations of the same unit: rows of the later and of the earlier one, and the years between."""

    later: Index
    earlier: Index
    years: Array


@dataclass(frozen=True)
class KindDrift:
    """How one parameter of one kind of device drifts, and how the last changes compare with the uncertainty of both.

    ahead : what forecasts take for it, see :func:`~inertial.population.drift.prudent`
    beyond : share of the pairs with |E_n| > 1; out : share that moved further than the tolerance; median : of |change|
    reliable_months : for how long a unit of the kind stays in all its tolerances with the target's probability; NaN without one
    known : whether any pair lies far enough apart to tell a drift; where none does, nothing is forecast
    """

    device: str
    parameter: str
    kind: DeviceDrift
    ahead: DeviceDrift
    beyond: float
    out: float
    median: float
    tolerance: float
    reliable_months: float
    known: bool = True


@dataclass(frozen=True)
class UnitDrift:
    """One parameter of one unit, where it came from and where it goes; days since 1970, changes in the parameter's unit.

    leaves, soonest, latest : day when it is expected to leave its tolerance and the 95 % interval of it; infinite for never
    limit, limit_day : the product's limit of the value itself, and day (expected, soonest, latest) when it leaves that
    reliable_day : until when the unit stays in tolerance with the target's probability, in all its parameters together
    odd : distance of its slope from its kind's, in σ; calibrations : that this rests on
    slope, odd : NaN for a unit whose calibrations lie within 30 days: no drift is stated of it
    """

    unit: str
    device: str
    parameter: str
    day: float
    run: str
    change: float
    years: float
    e_n: float
    slope: float
    tolerance: float
    leaves: float
    soonest: float
    latest: float
    limit: float
    limit_day: tuple[float, float, float]
    reliable_day: float
    odd: float
    calibrations: int


def pairs_of(all_: Calibrations, good: Flags) -> Pairs:
    """Every good calibration with the good one before it of the same unit."""
    rows = np.flatnonzero(good)
    same = all_.histories[rows[1:]] == all_.histories[rows[:-1]]
    later, earlier = rows[1:][same], rows[:-1][same]
    return Pairs(later, earlier, (all_.day[later] - all_.day[earlier]) / YEAR_D)


def kind_drifts(all_: Calibrations, good: Flags, rules: Rules, since: float) -> list[KindDrift]:
    """How every parameter of every kind drifts, from all pairs; the shares are of those that end in the period."""
    pairs, out = pairs_of(all_, good), list[KindDrift]()
    spans = _spans(all_, pairs)
    for device in np.unique(all_.device.astype(str)):
        of_kind = all_.device[pairs.later] == device
        if of_kind.sum() < FEWEST_PAIRS:
            continue
        own: list[KindDrift] = []
        for name in OWN:
            change, known = _changes(all_, pairs, name)
            longer, longer_known = _changes(all_, spans, name)
            kept = of_kind & np.isfinite(change + known)
            whole = (all_.device[spans.later] == device) & np.isfinite(longer + longer_known)
            if kept.sum() < FEWEST_PAIRS:
                continue
            both = (
                (change[kept], longer[whole]),
                (pairs.years[kept], spans.years[whole]),
                (known[kept], longer_known[whole]),
            )
            together = tuple(np.concatenate(parts) for parts in both)
            kind = kind_of(*together)
            recent = kept & (all_.day[pairs.later] >= since)
            found = _kind_drift(all_, pairs, recent, device, name, (kind, prudent(kind, *together)), rules)
            own.append(replace(found, known=drifts_known(together[1])))
        forecast_known = all(one.known for one in own)
        months = float("nan") if not forecast_known else _reliable_months(all_, pairs, own, rules.reliability_target)
        out += [replace(one, reliable_months=months if np.isfinite(one.tolerance) else float("nan")) for one in own]
    return out


def _reliable_months(all_: Calibrations, pairs: Pairs, kinds: list[KindDrift], target: float) -> float:
    """For how long a new unit stays in all tolerances of its kind with the target's probability, months."""
    probability = np.ones((1, AHEAD.size))
    for one in kinds:
        if np.isfinite(one.tolerance):
            of_kind = all_.device[pairs.later] == one.device
            sigma = float(np.nanmedian(all_.error(one.parameter)[pairs.later[of_kind]]))
            start, fresh = np.array([0.0]), np.array([sigma**2 + one.ahead.mount_sd**2])
            slope, spread = np.array([one.ahead.mean_slope]), np.array([one.ahead.slope_sd**2])
            new = LatestState(start, slope, fresh, start, spread, start, start)
            probability *= in_tolerance(*forecast(new, one.ahead, AHEAD, origin=0.0), one.tolerance)
    return 12.0 * float(last_reliable(probability, target, AHEAD)[0])


def _kind_drift(
    all_: Calibrations,
    pairs: Pairs,
    recent: Flags,
    device: str,
    name: str,
    kinds: tuple[DeviceDrift, DeviceDrift],
    rules: Rules,
) -> KindDrift:
    tolerance = rules.tolerance_of(device, FAMILY_OF[name])
    kind, ahead = kinds
    change, _ = _changes(all_, pairs, name)
    numbers, moved = _e_n(all_, pairs, name, kind)[recent], np.abs(change[recent])
    numbers, moved = numbers[np.isfinite(numbers)], moved[np.isfinite(moved)]
    return KindDrift(
        device=device,
        parameter=name,
        kind=kind,
        ahead=ahead,
        beyond=float(np.mean(np.abs(numbers) > 1.0)) if numbers.size else 0.0,
        out=float(np.mean(moved > tolerance)) if moved.size else 0.0,
        median=float(np.median(moved)) if moved.size else 0.0,
        tolerance=tolerance,
        reliable_months=float("nan"),
    )


def unit_drifts(
    all_: Calibrations, good: Flags, kinds: list[KindDrift], rules: Rules, limits: Mapping[tuple[str, str], float]
) -> dict[str, list[UnitDrift]]:
    """Every parameter of every unit with two calibrations or more: its last change, and its forecast; by device and unit.

    Parameters
    ----------
    limits : of the product, by device and family, in the parameter's unit
    """
    pairs = pairs_of(all_, good)
    last = _last_of_each(all_.histories[pairs.later])
    final = Pairs(pairs.later[last], pairs.earlier[last], pairs.years[last])
    out: dict[str, list[UnitDrift]] = {}
    for device in dict.fromkeys(found.device for found in kinds):
        own = np.flatnonzero(all_.device[final.later] == device)
        rows = Pairs(final.later[own], final.earlier[own], final.years[own])
        # of all parameters together, as if each moved by itself
        probability = np.ones((own.size, AHEAD.size), dtype=np.float32)
        courses = [
            _course(all_, good, rows, found, limits.get((device, FAMILY_OF[found.parameter]), np.inf), probability)
            for found in kinds
            if found.device == device
        ]
        bounded = any(np.isfinite(course.found.tolerance) for course in courses) and all(c.found.known for c in courses)
        years = last_reliable(probability, rules.reliability_target, AHEAD) if bounded else np.inf
        until = all_.day[rows.later] + YEAR_D * years
        for course in courses:
            for drift in _unit_drifts(all_, rows, course, until):
                out.setdefault(f"{drift.device} {drift.unit}", []).append(drift)
    return out


class _Course(NamedTuple):
    """Where the units of a kind stand in one parameter, (units,), and when they leave its tolerance and its limit."""

    found: KindDrift
    now: LatestState
    counts: Index
    times: tuple[Array, Array, Array]
    limit: float
    beyond: tuple[Array, Array, Array]


def _course(
    all_: Calibrations,
    good: Flags,
    rows: Pairs,
    found: KindDrift,
    limit: float,
    probability: NDArray[np.float32],
) -> _Course:
    """The course of the last calibrations given; ``probability`` (units, times) is multiplied by that of being in tolerance."""
    padded = _padded(all_, good, rows, found.parameter)
    now, counts = standing(*padded, found.ahead), np.isfinite(padded[0]).sum(axis=1)
    mean, deviation = forecast(now, found.ahead, AHEAD, origin=now.last)
    day = all_.day[rows.later]
    if np.isfinite(found.tolerance):
        known = np.isfinite(now.last)
        probability[known] *= in_tolerance(mean[known], deviation[known], found.tolerance).astype(np.float32)
    bounds = (found.tolerance, limit) if found.known else (np.inf, np.inf)
    times = _leaving(mean, deviation, bounds[0], day)
    return _Course(found, now, counts, times, limit, _leaving(mean + now.last[:, None], deviation, bounds[1], day))


def _unit_drifts(all_: Calibrations, rows: Pairs, course: _Course, until: Array) -> list[UnitDrift]:
    found, now, times, beyond = course.found, course.now, course.times, course.beyond
    change, _ = _changes(all_, rows, found.parameter)
    numbers = _e_n(all_, rows, found.parameter, found.kind)
    return [
        UnitDrift(
            unit=str(all_.unit[row]),
            device=found.device,
            parameter=found.parameter,
            day=float(all_.day[row]),
            run=str(all_.run[row]),
            change=float(change[k]),
            years=float(rows.years[k]),
            e_n=float(numbers[k]),
            slope=float(now.slope[k]) if np.isfinite(now.odd[k]) else float("nan"),
            tolerance=found.tolerance,
            leaves=float(times[0][k]),
            soonest=float(times[1][k]),
            latest=float(times[2][k]),
            limit=course.limit,
            limit_day=(float(beyond[0][k]), float(beyond[1][k]), float(beyond[2][k])),
            reliable_day=float(until[k]),
            odd=float(now.odd[k]),
            calibrations=int(course.counts[k]),
        )
        for k, row in enumerate(rows.later)
        if np.isfinite(change[k])
    ]


def _leaving(mean: Array, deviation: Array, bound: float, day: Array) -> tuple[Array, Array, Array]:
    """Days when values leave ± ``bound``: expected, soonest, latest."""
    if not np.isfinite(bound):
        never = np.full(day.size, np.inf)
        return never, never, never
    expected, soonest, latest = leaves(mean, deviation, bound, AHEAD)
    return day + YEAR_D * expected, day + YEAR_D * soonest, day + YEAR_D * latest


def _changes(all_: Calibrations, pairs: Pairs, name: str) -> tuple[Array, Array]:
    """Change of a parameter over every pair, and the sum of both variances."""
    value, error = all_.column(name), all_.error(name)
    return value[pairs.later] - value[pairs.earlier], error[pairs.later] ** 2 + error[pairs.earlier] ** 2


def _e_n(all_: Calibrations, pairs: Pairs, name: str, kind: DeviceDrift) -> Array:
    """E_n of every pair; what mounting adds belongs to the uncertainty of both, and is known from the kind's pairs alone."""
    value = all_.column(name)
    error = np.hypot(all_.error(name), kind.mount_sd)
    total = error[pairs.later] ** 2 + error[pairs.earlier] ** 2
    share = np.maximum(2.0 * kind.mount_sd**2 / total, 1e-6)
    dof = max(kind.pairs / PAIRS_A_DOF, 1.0) / share**2  # Welch and Satterthwaite (JCGM 100, G.4.1)
    return e_n(value[pairs.later], value[pairs.earlier], error[pairs.later], error[pairs.earlier], dof)


def _spans(all_: Calibrations, pairs: Pairs) -> Pairs:
    """The last calibration of every unit with its first, where others lie between: the long times tell slope from walk."""
    unit = all_.histories[pairs.later]
    last = _last_of_each(unit)
    first = np.concatenate([[0], last[:-1] + 1]) if last.size else last
    longer = last > first
    later, earlier = pairs.later[last[longer]], pairs.earlier[first[longer]]
    return Pairs(later, earlier, (all_.day[later] - all_.day[earlier]) / YEAR_D)


def _last_of_each(numbers: Index) -> Index:
    """Places where a run of equal numbers ends."""
    if not numbers.size:
        return np.zeros(0, dtype=np.int64)
    return np.flatnonzero(np.concatenate([numbers[1:] != numbers[:-1], [True]]))


def _padded(all_: Calibrations, good: Flags, rows: Pairs, name: str) -> tuple[Array, Array, Array]:
    """Values, errors and years of the units whose last calibrations are given, (units, most), filled up with NaN."""
    units = all_.histories[rows.later]
    place = np.full(int(all_.histories.max()) + 1, -1)
    place[units] = np.arange(units.size)
    value, error = all_.column(name), all_.error(name)
    use = np.flatnonzero(good & (place[all_.histories] >= 0) & np.isfinite(value + error))
    unit = place[all_.histories[use]]
    starts = (
        np.flatnonzero(np.concatenate([[True], unit[1:] != unit[:-1]])) if use.size else np.zeros(0, dtype=np.int64)
    )
    order = np.arange(use.size) - np.repeat(starts, np.diff(np.append(starts, use.size)))
    shape = (units.size, int(order.max()) + 1 if use.size else 1)
    filled: list[Array] = []
    for content in (value, error, all_.day / YEAR_D):
        target = np.full(shape, np.nan)
        target[unit, order] = content[use]
        filled.append(target)
    return filled[0], filled[1], filled[2]
