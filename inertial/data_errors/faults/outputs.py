"""Faults of the outputs of single dwells: repeats, spikes, torn words, coarse steps."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inertial import decisions
from inertial.data_errors.faults.fault import Fault, look, places_of
from inertial.data_errors.readings import Array, Readings


@look(40)
def stuck(readings: Readings) -> Iterator[Fault]:
    """The same output, to the last digit, in dwells of different poses; or samples of a dwell that are all the same."""
    for unit, out in enumerate(readings.output):
        still = _still(readings, unit)
        if still.size:
            evidence = f"an axis is constant in {still.size} dwells: it has no scatter, unlike in the others"
            yield Fault("stuck_output", unit, places_of(still), evidence)
            continue
        moved = np.linalg.norm(np.diff(readings.force[unit], axis=0), axis=-1) > 0.05
        same = (np.diff(out, axis=0) == 0.0).any(axis=-1) & moved
        if np.count_nonzero(same) >= 2:
            places = np.flatnonzero(same) + 1
            yield Fault(
                "stuck_output", unit, places_of(places), f"output repeats exactly in {places.size} dwells of new poses"
            )


def _still(readings: Readings, unit: int) -> NDArray[np.intp]:
    """Dwells in which an axis has no scatter although it has in most: the means of equal samples differ by rounding."""
    if readings.spread is None or readings.count is None:
        return np.zeros(0, dtype=np.intp)
    spread = np.where((readings.count[unit] > 2.0)[:, None], readings.spread[unit], np.nan)
    usual = np.nan_to_num(np.nanmedian(spread, axis=0)) if np.isfinite(spread).any(axis=0).all() else np.zeros(3)
    return np.flatnonzero(np.any((spread < 1e-6 * usual) & (usual > 0.0), axis=-1))


@look(110, in_one_pose=True)
def noisy(readings: Readings) -> Iterator[Fault]:
    """Dwells whose scatter is far above the unit's own and the lot's: spikes on an axis, torn words on all."""
    if readings.spread is None:
        return
    typical = np.nanmedian(readings.spread, axis=1, keepdims=True)
    ratio = readings.spread / np.where(typical > 0.0, typical, np.inf)
    common = np.nanmedian(ratio, axis=0, keepdims=True) if len(ratio) > 2 else np.ones((1, *ratio.shape[1:]))
    loud: NDArray[np.bool_] = np.logical_and(ratio > 5.0, ratio > 3.0 * common)
    few = np.count_nonzero(loud.any(axis=-1), axis=1) < 3
    loud &= ~(few[:, None, None] & (ratio < 10.0))  # one noisy dwell is a transient, not a fault of the reading
    if readings.vibration is not None:
        level = np.nanmedian(readings.vibration, axis=1, keepdims=True)
        loud &= ~(readings.vibration > 2.0 * np.maximum(level, 1e-12))[..., None]
    for unit, row in enumerate(np.asarray(loud)):
        places = np.flatnonzero(row.any(axis=-1))
        if not places.size:
            continue
        together = float(np.mean(row[places].sum(axis=-1)))
        name = "torn_words" if together > 2.0 and places.size >= 3 else "spikes"
        worst = float(np.nanmax(np.where(row, ratio[unit], 0.0)))
        yield Fault(
            name, unit, places_of(places), f"scatter up to {worst:.0f} times the unit's own in {places.size} dwells"
        )


@look(120)
def outliers(readings: Readings) -> Iterator[Fault]:
    """Single dwells far off on one axis alone, where no scatter was recorded to show spikes."""
    if readings.spread is not None:
        return
    size = np.abs(readings.misfit)
    typical = np.nanmedian(size, axis=1, keepdims=True)
    out = np.any(size > np.maximum(0.005, 40.0 * typical), axis=-1)
    for unit, row in enumerate(np.asarray(out)):
        places = np.flatnonzero(row)
        if 0 < places.size <= 0.1 * row.size:
            yield Fault("spikes", unit, places_of(places), f"{places.size} dwells far from the others")


@look(140, in_one_pose=True)
def quantised(readings: Readings) -> Iterator[Fault]:
    """Outputs on a lattice whose step, over √12, exceeds the noise of a mean; or samples that jump between its steps."""
    for unit, out in enumerate(readings.output):
        there = readings.there[unit]
        for axis in range(3):
            noise = _white(readings, unit, axis)
            step = lattice_step(out[there, axis])
            if step is not None and noise is not None and step / np.sqrt(12.0) > noise:
                ratio = step / np.sqrt(12.0) / noise
                evidence = f"axis {'xyz'[axis]} moves in steps of {step:.3g}: LSB/√12 is {ratio:.1f} times the noise"
                yield Fault("quantised", unit, (), evidence)
                break
            coarse = _coarse_step(readings, unit, axis)
            if coarse is not None:
                evidence = (
                    f"the scatter of axis {'xyz'[axis]} follows where its mean lies between steps of {coarse:.4g}"
                )
                yield Fault("quantised", unit, (), f"{evidence}: the samples jump between two of them")
                break


def _coarse_step(readings: Readings, unit: int, axis: int) -> float | None:
    """Step of a converter that is coarser than the noise of a sample; None where there is none.

    With steps q well above the noise, samples take the two next values: their variance is q²·p·(1 − p), p the place of the mean
    between the two, and it comes again with every step. Noise that grows with temperature, or in time, is no such scatter:
    the means follow the temperature too, and some step fits both. What follows either is left out.
    """
    if readings.spread is None or readings.count is None:
        return None
    there = readings.there[unit]
    mean, spread, count = (
        a[there] for a in (readings.output[unit, :, axis], readings.spread[unit, :, axis], readings.count[unit])
    )
    typical = float(np.median(spread))
    if mean.size < 16 or typical <= 0.0:
        return None
    square = _without_drivers(readings, unit, there, spread**2)
    if np.std(square) / (2.0 * typical**2) < decisions.STEPS_UNEVEN / np.sqrt(2.0 * float(np.median(count))):
        return None
    whole, reach = float(np.sum(square**2)), float(np.ptp(mean))
    # p(1 − p) is at most a quarter: the largest scatter is half a step
    low, high = 1.6 * float(spread.max()), 2.6 * float(spread.max())
    if reach <= 0.0 or reach / low > _MOST_STEPS:
        return None
    rates = np.arange(1.0 / high, 1.0 / low, 1.0 / (6.0 * reach))
    best, step = 0.0, 0.0
    for part in np.array_split(rates, max(1, rates.size // 2000)):
        phase = 2.0 * np.pi * np.outer(part, mean - mean[0])
        waves = np.stack([np.cos(phase), np.sin(phase)], axis=-1)
        waves = waves - waves.mean(axis=1, keepdims=True)
        gram = np.swapaxes(waves, -1, -2) @ waves + 1e-9 * np.eye(2)
        inside = np.einsum("rnk,n->rk", waves, square)
        explained = np.einsum("rk,rk->r", inside, np.linalg.solve(gram, inside[..., None])[..., 0]) / whole
        place = int(np.argmax(explained))
        if explained[place] > best:
            best, step = float(explained[place]), 1.0 / float(part[place])
    return step if best > decisions.STEPS_FOLLOW else None


def _without_drivers(readings: Readings, unit: int, there: NDArray[np.bool_], values: Array) -> Array:
    """Values of the dwells that are there, less their mean and what follows the temperature or the time."""
    warm = readings.temperature if readings.temperature is not None else readings.chamber
    drivers = [readings.time[unit], *([] if warm is None else [warm[unit]])]
    unit_ranges: list[Array] = []
    for driver in reversed(drivers):
        own = driver[there]
        if np.isfinite(own).all() and np.ptp(own) > 0.0:
            unit_ranges.append(2.0 * (own - own.min()) / np.ptp(own) - 1.0)
    powers = [own**k for k in range(1, _DEGREE + 1) for own in unit_ranges]
    # few dwells: many columns would take up the steps of a converter, too
    x = np.stack([np.ones(values.size), *powers[: values.size // _DWELLS_EACH]], axis=1)
    left: Array = values - x @ np.linalg.lstsq(x, values, rcond=1e-9)[0]
    return left


_DEGREE = 4
"""Degree of the polynomial of a driver that the scatter of dwells may follow."""

_DWELLS_EACH = 8
"""Dwells for each column of these."""

_MOST_STEPS = 20_000
"""Steps over the range of the means beyond which the step cannot be estimated from these dwells."""


def _white(readings: Readings, unit: int, axis: int) -> float | None:
    """Standard error of a dwell mean from its scatter, output unit; None where it was not recorded."""
    if readings.spread is None or readings.count is None:
        return None
    error = readings.spread[unit, :, axis] / np.sqrt(readings.count[unit])
    return max(float(np.nanmedian(error)), 1e-300)


def lattice_step(values: Array) -> float | None:
    """Step of the lattice that all values lie on, by Euclid's algorithm with a tolerance; None where they lie on none."""
    distinct = np.unique(values)
    if distinct.size < 3:
        return None
    gaps = np.diff(distinct)
    tolerance = 1e-6 * float(np.ptp(distinct)) + 1e-12 * float(np.max(np.abs(distinct)))
    step = float(gaps[0])
    for gap in gaps[1:]:
        a, b = max(step, float(gap)), min(step, float(gap))
        while b > tolerance:
            rest = a % b
            a, b = b, min(rest, b - rest)
        step = a
        if step < 30.0 * tolerance:
            return None
    return step
