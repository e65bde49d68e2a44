"""Outputs in steps that are coarser than the noise."""

from collections.abc import Iterator

import numpy as np

from inertial import decisions
from inertial.arrays import Flags
from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Array, Readings

_DEGREE = 4
"""Degree of the polynomials of temperature and time that are fitted to the scatter of the dwells."""

_DWELLS_EACH = 8
"""Smallest number of dwells per column of these."""

_MOST_STEPS = 20_000
"""Steps over the range of the means beyond which the step cannot be estimated from these dwells."""


def quantised(readings: Readings) -> Iterator[Fault]:
    """Outputs on a lattice whose step, over √12, exceeds the noise of a mean; or samples that jump between its steps."""
    for unit, out in enumerate(readings.output):
        there = readings.there[unit]
        for axis, sensed in enumerate(readings.axes):
            noise = _white(readings, unit, axis)
            step = lattice_step(out[there, axis])
            if step is not None and noise is not None and step / np.sqrt(12.0) > noise:
                ratio = step / np.sqrt(12.0) / noise
                evidence = f"axis {'xyz'[sensed]} moves in steps of {step:.3g}: LSB/√12 is {ratio:.1f} times the noise"
                yield Fault("quantised", unit, (), evidence)
                break
            coarse = _coarse_step(readings, unit, axis)
            if coarse is not None:
                evidence = f"the scatter of axis {'xyz'[sensed]} depends on its mean with a period of {coarse:.4g}"
                yield Fault("quantised", unit, (), f"{evidence}: the samples jump between two steps of a converter")
                break


def _coarse_step(readings: Readings, unit: int, axis: int) -> float | None:
    """Step of a converter that is coarser than the noise of a sample; None where there is none.

    With steps q well above the noise, the samples take the two nearest values: their variance is q²·p·(1 − p), where p is the
    position of the mean between the two, and is periodic in the mean with period q. Noise that grows with temperature or time
    could be mistaken for it, because the means depend on temperature, too; its dependence on either is removed first.
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
    total, reach = float(np.sum(square**2)), float(np.ptp(mean))
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
        explained = np.einsum("rk,rk->r", inside, np.linalg.solve(gram, inside[..., None])[..., 0]) / total
        peak = int(np.argmax(explained))
        if explained[peak] > best:
            best, step = float(explained[peak]), 1.0 / float(part[peak])
    return step if best > decisions.STEPS_FOLLOW else None


def _without_drivers(readings: Readings, unit: int, there: Flags, values: Array) -> Array:
    """Residuals of values of the present dwells after a fit of polynomials in temperature and time."""
    unit_ranges: list[Array] = []
    for driver in (readings.warm, readings.time):
        if driver is None:
            continue
        measured = driver[unit, there]
        if np.isfinite(measured).all() and np.ptp(measured) > 0.0:
            unit_ranges.append(2.0 * (measured - measured.min()) / np.ptp(measured) - 1.0)
    powers = [unit_range**k for k in range(1, _DEGREE + 1) for unit_range in unit_ranges]
    # for few dwells, many columns would also absorb the pattern of the converter's steps
    x = np.stack([np.ones(values.size), *powers[: values.size // _DWELLS_EACH]], axis=1)
    left: Array = values - x @ np.linalg.lstsq(x, values, rcond=1e-9)[0]
    return left


def _white(readings: Readings, unit: int, axis: int) -> float | None:
    """Standard error of a dwell mean from its scatter, output unit; None where it was not recorded."""
    if readings.spread is None or readings.count is None:
        return None
    error = readings.spread[unit, :, axis] / np.sqrt(readings.count[unit])
    return max(float(np.nanmedian(error)), 1e-300)


def lattice_step(values: Array) -> float | None:
    """Step of the lattice that contains all values, by Euclid's algorithm with a tolerance; None if there is no such lattice."""
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


LOOK = Look(quantised, ("quantised",), order=140, order_in_one_pose=60)
