"""The last change of each parameter of every unit, and when the unit leaves tolerance and limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.arrays import Array, Flags, Index
from inertial.population.drift import (
    LatestState,
    forecast,
    in_tolerance,
    last_reliable,
    leaves,
    standing,
)
from pipelines.audit.calibrations import Calibrations
from pipelines.audit.drifts import AHEAD, KindDrift
from pipelines.audit.pairs import YEAR_D, Pairs, changes_of, e_n_of, first_of_each, last_of_each, pairs_of
from pipelines.audit.parameters import FAMILY_OF
from pipelines.audit.rules import Rules


@dataclass(frozen=True)
class UnitDrift:
    """History and forecast of one parameter of one unit; days since 1970, changes in the parameter's unit.

    leaves, soonest, latest : expected day of leaving the tolerance and its 95 % interval; infinite for never
    limit, limit_day : the product's limit of the value, and day (expected, soonest, latest) of leaving it
    reliable_day : last day on which all parameters of the unit together stay in tolerance with the target's probability
    odd : distance of its slope from its kind's, in σ; calibrations : number of them
    slope, odd : NaN for a unit whose calibrations lie within 30 days, for which no drift is stated
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


def unit_drifts(
    calibrations: Calibrations,
    good: Flags,
    kinds: list[KindDrift],
    rules: Rules,
    limits: Mapping[tuple[str, str], float],
) -> dict[str, list[UnitDrift]]:
    """Every parameter of every unit with two calibrations or more: its last change, and its forecast; by device and unit.

    Parameters
    ----------
    limits : of the product, by device and family, in the parameter's unit
    """
    pairs = pairs_of(calibrations, good)
    last = last_of_each(calibrations.histories[pairs.later])
    final = Pairs(pairs.later[last], pairs.earlier[last], pairs.years[last])
    out: dict[str, list[UnitDrift]] = {}
    for device in dict.fromkeys(drift_of_kind.device for drift_of_kind in kinds):
        own = np.flatnonzero(calibrations.device[final.later] == device)
        rows = Pairs(final.later[own], final.earlier[own], final.years[own])
        # of all parameters together, assumed independent
        probability = np.ones((own.size, AHEAD.size), dtype=np.float32)
        courses = [
            _course(
                calibrations,
                good,
                rows,
                drift_of_kind,
                limits.get((device, FAMILY_OF[drift_of_kind.parameter]), np.inf),
                probability,
            )
            for drift_of_kind in kinds
            if drift_of_kind.device == device
        ]
        bounded = any(np.isfinite(course.drift_of_kind.tolerance) for course in courses) and all(
            c.drift_of_kind.known for c in courses
        )
        years = last_reliable(probability, rules.reliability_target, AHEAD) if bounded else np.inf
        until = calibrations.day[rows.later] + YEAR_D * years
        for course in courses:
            for drift in _unit_drifts(calibrations, rows, course, until):
                out.setdefault(f"{drift.device} {drift.unit}", []).append(drift)
    return out


class _Course(NamedTuple):
    """Present state of the units of a kind in one parameter, (units,), and the days when they leave tolerance and limit."""

    drift_of_kind: KindDrift
    now: LatestState
    counts: Index
    times: tuple[Array, Array, Array]
    limit: float
    beyond: tuple[Array, Array, Array]


def _course(
    calibrations: Calibrations,
    good: Flags,
    rows: Pairs,
    drift_of_kind: KindDrift,
    limit: float,
    probability: NDArray[np.float32],
) -> _Course:
    """The course after the last calibrations; ``probability`` (units, times) is multiplied by that of being in tolerance."""
    padded = _padded(calibrations, good, rows, drift_of_kind.parameter)
    now, counts = standing(*padded, drift_of_kind.ahead), np.isfinite(padded[0]).sum(axis=1)
    mean, deviation = forecast(now, drift_of_kind.ahead, AHEAD, origin=now.last)
    day = calibrations.day[rows.later]
    if np.isfinite(drift_of_kind.tolerance):
        known = np.isfinite(now.last)
        probability[known] *= in_tolerance(mean[known], deviation[known], drift_of_kind.tolerance).astype(np.float32)
    bounds = (drift_of_kind.tolerance, limit) if drift_of_kind.known else (np.inf, np.inf)
    times = _leaving(mean, deviation, bounds[0], day)
    return _Course(
        drift_of_kind, now, counts, times, limit, _leaving(mean + now.last[:, None], deviation, bounds[1], day)
    )


def _unit_drifts(calibrations: Calibrations, rows: Pairs, course: _Course, until: Array) -> list[UnitDrift]:
    drift_of_kind, now, times, beyond = course.drift_of_kind, course.now, course.times, course.beyond
    change, _ = changes_of(calibrations, rows, drift_of_kind.parameter)
    numbers = e_n_of(calibrations, rows, drift_of_kind.parameter, drift_of_kind.seating)
    return [
        UnitDrift(
            unit=str(calibrations.unit[row]),
            device=drift_of_kind.device,
            parameter=drift_of_kind.parameter,
            day=float(calibrations.day[row]),
            run=str(calibrations.run[row]),
            change=float(change[k]),
            years=float(rows.years[k]),
            e_n=float(numbers[k]),
            slope=float(now.slope[k]) if np.isfinite(now.odd[k]) else float("nan"),
            tolerance=drift_of_kind.tolerance,
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


def _padded(calibrations: Calibrations, good: Flags, rows: Pairs, name: str) -> tuple[Array, Array, Array]:
    """Values, errors and years of the units of these last calibrations, (units, most), filled with NaN."""
    units = calibrations.histories[rows.later]
    place = np.full(int(calibrations.histories.max()) + 1, -1)
    place[units] = np.arange(units.size)
    value, error = calibrations.column(name), calibrations.error(name)
    use = np.flatnonzero(good & (place[calibrations.histories] >= 0) & np.isfinite(value + error))
    unit = place[calibrations.histories[use]]
    starts = first_of_each(unit)
    order = np.arange(use.size) - np.repeat(starts, np.diff(np.append(starts, use.size)))
    shape = (units.size, int(order.max()) + 1 if use.size else 1)
    filled: list[Array] = []
    for content in (value, error, calibrations.day / YEAR_D):
        target = np.full(shape, np.nan)
        target[unit, order] = content[use]
        filled.append(target)
    return filled[0], filled[1], filled[2]
