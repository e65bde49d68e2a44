"""The last change of each parameter of every unit, and when the unit leaves tolerance and limit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.arrays import Array, Flags, Index
from inertial.population.drift import LatestState, forecast, in_tolerance, last_reliable, leaves, standing
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
    final = pairs.chosen(last_of_each(calibrations.histories[pairs.later]))
    out: dict[str, list[UnitDrift]] = {}
    for device in dict.fromkeys(kind.device for kind in kinds):
        of_device = [kind for kind in kinds if kind.device == device]
        rows = final.chosen(np.flatnonzero(calibrations.device[final.later] == device))
        # of all parameters together, assumed independent
        probability = np.ones((rows.later.size, AHEAD.size), dtype=np.float32)
        courses = [_course(calibrations, good, rows, kind, limits, probability) for kind in of_device]
        bounded = any(np.isfinite(kind.tolerance) for kind in of_device) and all(kind.known for kind in of_device)
        years = last_reliable(probability, rules.reliability_target, AHEAD) if bounded else np.inf
        until = calibrations.day[rows.later] + YEAR_D * years
        for kind, course in zip(of_device, courses, strict=True):
            for drift in _unit_drifts(calibrations, rows, kind, course, until):
                out.setdefault(f"{drift.device} {drift.unit}", []).append(drift)
    return out


class _Course(NamedTuple):
    """Present state of the units of a kind in one parameter, (units,), and the days when they leave tolerance and limit."""

    now: LatestState
    counts: Index
    times: Array
    limit: float
    beyond: Array


def _course(
    calibrations: Calibrations,
    good: Flags,
    rows: Pairs,
    kind: KindDrift,
    limits: Mapping[tuple[str, str], float],
    probability: NDArray[np.float32],
) -> _Course:
    """The course after the last calibrations; ``probability`` (units, times) is multiplied by that of being in tolerance."""
    padded = _padded(calibrations, good, rows, kind.parameter)
    now, counts = standing(*padded, kind.ahead), np.isfinite(padded[0]).sum(axis=1)
    mean, deviation = forecast(now, kind.ahead, AHEAD, origin=now.last)
    day, limit = calibrations.day[rows.later], limits.get((kind.device, FAMILY_OF[kind.parameter]), np.inf)
    if np.isfinite(kind.tolerance):
        known = np.isfinite(now.last)
        probability[known] *= in_tolerance(mean[known], deviation[known], kind.tolerance).astype(np.float32)
    tolerance, most = (kind.tolerance, limit) if kind.known else (np.inf, np.inf)
    beyond = _leaving(mean + now.last[:, None], deviation, most, day)
    return _Course(now, counts, _leaving(mean, deviation, tolerance, day), limit, beyond)


def _unit_drifts(
    calibrations: Calibrations, rows: Pairs, kind: KindDrift, course: _Course, until: Array
) -> Iterator[UnitDrift]:
    change, _ = changes_of(calibrations, rows, kind.parameter)
    numbers = e_n_of(calibrations, rows, kind.parameter, kind.seating)
    for k in np.flatnonzero(np.isfinite(change)):
        row, odd = rows.later[k], float(course.now.odd[k])
        expected, soonest, latest = course.times[:, k].tolist()
        limit_expected, limit_soonest, limit_latest = course.beyond[:, k].tolist()
        yield UnitDrift(
            unit=str(calibrations.unit[row]),
            device=kind.device,
            parameter=kind.parameter,
            day=float(calibrations.day[row]),
            run=str(calibrations.run[row]),
            change=float(change[k]),
            years=float(rows.years[k]),
            e_n=float(numbers[k]),
            slope=float(course.now.slope[k]) if np.isfinite(odd) else float("nan"),
            tolerance=kind.tolerance,
            leaves=expected,
            soonest=soonest,
            latest=latest,
            limit=course.limit,
            limit_day=(limit_expected, limit_soonest, limit_latest),
            reliable_day=float(until[k]),
            odd=odd,
            calibrations=int(course.counts[k]),
        )


def _leaving(mean: Array, deviation: Array, bound: float, day: Array) -> Array:
    """Days when values leave ± ``bound``: expected, soonest, latest, (3, units)."""
    if not np.isfinite(bound):
        return np.full((3, day.size), np.inf)
    return day + YEAR_D * np.stack(leaves(mean, deviation, bound, AHEAD))


def _padded(calibrations: Calibrations, good: Flags, rows: Pairs, name: str) -> tuple[Array, Array, Array]:
    """Values, errors and years of the units of these last calibrations, (units, most), filled with NaN."""
    units = calibrations.histories[rows.later]
    index = np.full(int(calibrations.histories.max()) + 1, -1)
    index[units] = np.arange(units.size)
    value, error = calibrations.column(name), calibrations.error(name)
    use = np.flatnonzero(good & (index[calibrations.histories] >= 0) & np.isfinite(value + error))
    unit = index[calibrations.histories[use]]
    starts = first_of_each(unit)
    order = np.arange(use.size) - np.repeat(starts, np.diff(np.append(starts, use.size)))
    shape = (units.size, int(order.max()) + 1 if use.size else 1)
    filled = np.full((3, *shape), np.nan)
    filled[:, unit, order] = np.stack([value, error, calibrations.day / YEAR_D])[:, use]
    return filled[0], filled[1], filled[2]
