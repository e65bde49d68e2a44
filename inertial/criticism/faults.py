"""Data faults: what must be mended before physics is diagnosed. The first look that finds one stands for a unit."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from inertial.criticism.readings import Array, Readings, exchanged, find_split, robust_fit


@dataclass(frozen=True)
class Fault:
    """A data fault of one unit: its name, the places of the dwells in it, and what shows it."""

    name: str
    unit: int
    dwells: tuple[int, ...]
    evidence: str


Look = Callable[[Readings], Iterator[Fault]]


def find_faults(readings: Readings) -> list[Fault]:
    """Data faults of a lot, at most one kind per unit; a unit without one is fit for diagnosis."""
    found: dict[int, Fault] = {}
    for look in LOOKS if readings.turned else STILL_LOOKS:
        for fault in look(readings):
            found.setdefault(fault.unit, fault)
    return [found[u] for u in sorted(found)]


def truncated(readings: Readings) -> Iterator[Fault]:
    """Dwells that the rest of the lot has and a unit lacks: all at the end, or here and there."""
    there = readings.there
    for unit, row in enumerate(there):
        missing = np.flatnonzero(~row)
        if not missing.size:
            continue
        last = np.flatnonzero(row)[-1] if row.any() else -1
        at_end = missing[missing > last]
        name = "truncated_file" if at_end.size >= 0.5 * missing.size else "dropped_samples"
        yield Fault(name, unit, _places(missing), f"{missing.size} of {row.size} dwells of the lot are missing")
    if there.all() and _cut_off(readings):
        for unit in range(len(there)):
            yield Fault(
                "truncated_file",
                unit,
                (),
                "the record of temperature goes on, and the last round of poses is not complete",
            )


def _cut_off(readings: Readings) -> bool:
    """Whether the temperature's history runs on far behind the last dwell, which ends in the middle of a round of poses."""
    time = readings.time[0]
    if readings.history_end is None or readings.history_end - time[-1] < 0.15 * float(np.ptp(time)):
        return False
    _, counts = np.unique(np.round(readings.force[0], 3), axis=0, return_counts=True)
    return bool(counts.max() == counts.min() + 1 and counts.min() >= 2)


def clock(readings: Readings) -> Iterator[Fault]:
    """Time that runs backwards from one dwell to the next."""
    for unit, time in enumerate(readings.time):
        row = readings.there[unit]
        back = np.flatnonzero(np.diff(time[row]) < 0.0)
        if back.size:
            places = np.flatnonzero(row)[back + 1]
            step = float(np.diff(time[row])[back[0]])
            yield Fault("clock_jitter", unit, _places(places), f"time steps back by {-step:.1f} s at dwell {places[0]}")


def temperature_units(readings: Readings) -> Iterator[Fault]:
    """Temperatures that cannot be °C."""
    for unit, row in enumerate(readings.temperature if readings.temperature is not None else ()):
        typical = float(np.nanmedian(row))
        if typical > 200.0 or typical < -100.0:
            yield Fault("wrong_units", unit, (), f"temperature about {typical:.0f}, not °C")


def dead(readings: Readings) -> Iterator[Fault]:
    """An axis that answers to no direction of gravity."""
    for unit, fit in enumerate(readings.fits):
        size = np.linalg.norm(fit[:, 1:], axis=1)
        weak = np.flatnonzero(size < 0.2 * np.median(size)) if np.median(size) > 0.0 else np.arange(3)
        for axis in weak[:1]:
            share = size[axis] / max(float(np.median(size)), 1e-300)
            evidence = f"axis {'xyz'[axis]} answers to gravity with {share:.1%} of the other axes' scale"
            yield Fault("dead_channel", unit, (), evidence)


def stuck(readings: Readings) -> Iterator[Fault]:
    """The same output, to the last digit, in dwells of different poses."""
    for unit, out in enumerate(readings.output):
        moved = np.linalg.norm(np.diff(readings.force[unit], axis=0), axis=-1) > 0.05
        same = (np.diff(out, axis=0) == 0.0).any(axis=-1) & moved
        if np.count_nonzero(same) >= 2:
            places = np.flatnonzero(same) + 1
            yield Fault(
                "stuck_output", unit, _places(places), f"output repeats exactly in {places.size} dwells of new poses"
            )


def stale(readings: Readings) -> Iterator[Fault]:
    """A thermometer that repeats itself to the last digit while the temperature moves, or while it had noise before."""
    if readings.temperature is None:
        return
    for unit, row in enumerate(readings.temperature):
        start, length = _longest_repeat(row)
        if length < 6:
            continue
        moved = _moved_elsewhere(readings, unit, slice(start, start + length))
        outside: Array = np.delete(row, np.arange(start, start + length)).astype(np.float64)
        steps = np.diff(outside)
        fine = np.abs(steps[steps != 0.0])
        resolution = float(np.min(fine)) if fine.size else np.inf
        if moved > max(1.0, 3.0 * min(resolution, 1e9)) or (length > 0.15 * row.size and _noisy_steps(steps)):
            evidence = f"temperature stays at {row[start]:.3f} °C for {length} dwells"
            yield Fault("stale_temperature", unit, _places(np.arange(start, start + length)), evidence)


def _noisy_steps(steps: Array) -> bool:
    """Whether readings go up and down at random: steps of noise turn round two times in three, those of a drift seldom."""
    if steps.size < 6 or np.mean(steps == 0.0) > 0.1:
        return False
    return bool(np.mean(np.sign(steps[1:]) != np.sign(steps[:-1])) > 0.45)


def _moved_elsewhere(readings: Readings, unit: int, stretch: slice) -> float:
    """How far the chamber, or the other units, moved meanwhile, K."""
    moves = [0.0]
    if readings.chamber is not None:
        moves.append(float(np.ptp(readings.chamber[unit, stretch])))
    if readings.temperature is not None and len(readings.temperature) > 2:
        others = np.delete(readings.temperature, unit, axis=0)[:, stretch]
        moves.append(float(np.nanmedian(np.ptp(others, axis=1))))
    return max(moves)


def _longest_repeat(row: Array) -> tuple[int, int]:
    best, start = (0, 0), 0
    for place in range(1, row.size + 1):
        if place == row.size or row[place] != row[start]:
            if place - start > best[1]:
                best = (start, place - start)
            start = place
    return best


def changed_units(readings: Readings) -> Iterator[Fault]:
    """A calibration that changes during the run: to that of another unit (cables exchanged), or to another range."""
    splits = {
        u: s for u in range(len(readings.force)) if (s := find_split(readings.force[u], readings.output[u])) is not None
    }
    for unit, split in splits.items():
        places = tuple(range(split.place, _length(readings, unit)))
        partner = next((v for v, other in splits.items() if v != unit and exchanged(split, other)), None)
        if partner is not None:
            yield Fault(
                "units_swapped",
                unit,
                places,
                f"from dwell {split.place} on it carries the calibration of unit {partner}",
            )
        elif not 0.75 < split.ratio < 1.33:
            yield Fault(
                "wrong_range", unit, places, f"scale changes by a factor {split.ratio:.3g} at dwell {split.place}"
            )


def _length(readings: Readings, unit: int) -> int:
    """Number of dwells up to the last one a unit has."""
    return int(np.flatnonzero(readings.there[unit])[-1]) + 1


def scale_units(readings: Readings) -> Iterator[Fault]:
    """A unit whose scale is far from its lot's."""
    scale = readings.scale
    for unit in range(scale.size):
        alone = 1.0 if readings.unit_name == "g" else float(scale[unit])
        others = float(np.median(np.delete(scale, unit))) if scale.size > 2 else alone
        ratio = float(scale[unit]) / others
        if not 0.75 < ratio < 1.33:
            yield Fault(_kind(ratio), unit, (), f"scale is {ratio:.4g} times that of the lot")


def _kind(ratio: float) -> str:
    octaves = np.log2(ratio)
    return "wrong_range" if abs(octaves - round(octaves)) < 0.06 and abs(round(octaves)) <= 4 else "wrong_units"


def flipped(readings: Readings) -> Iterator[Fault]:
    """Axes in another order or with another sign: the best signed permutation of the response is not the identity."""
    for unit, fit in enumerate(readings.fits):
        k = fit[:, 1:] / max(float(readings.scale[unit]), 1e-300)
        rows, columns = linear_sum_assignment(-np.abs(k))
        signs = np.sign(k[rows, columns])
        if np.min(np.abs(k[rows, columns])) < 0.6 or (np.array_equal(rows, columns) and np.all(signs > 0)):
            continue
        told = ", ".join(
            f"{'xyz'[i]} reads {'+' if s > 0 else '−'}{'xyz'[j]}" for i, j, s in zip(rows, columns, signs, strict=True)
        )
        yield Fault("axis_flip", unit, (), told)


def swapped_units(readings: Readings) -> Iterator[Fault]:
    """Dwells that two units' fingerprints say were exchanged between them."""
    units, n = readings.there.shape
    if units < 2:
        return
    exchanged: dict[tuple[int, int], list[int]] = {}
    for place in range(n):
        for pair in _exchanges(readings, place):
            exchanged.setdefault(pair, []).append(place)
    for (one, other), places in exchanged.items():
        if len(places) >= max(3, n // 20):
            for unit, partner in ((one, other), (other, one)):
                evidence = f"{len(places)} dwells carry the bias and scale of unit {partner}"
                yield Fault("units_swapped", unit, tuple(places), evidence)


def _exchanges(readings: Readings, place: int) -> Iterator[tuple[int, int]]:
    """Pairs of units whose outputs at one dwell fit each other's calibration far better than their own."""
    there = np.flatnonzero(readings.there[:, place])
    design = np.concatenate([np.ones((there.size, 1)), readings.force[there, place]], axis=-1)
    predicted = np.einsum("vip,up->uvi", readings.fits[there], design)
    scale = readings.scale[there]
    distance = np.linalg.norm((readings.output[there, place][:, None] - predicted) / scale[:, None, None], axis=-1)
    own = np.diag(distance)
    best = np.argmin(distance, axis=1)
    for i, j in enumerate(best):
        mutual = j > i and best[j] == i
        if mutual and distance[i, j] < 0.2 * own[i] and distance[j, i] < 0.2 * own[j] and own[i] > 0.005:
            yield int(there[i]), int(there[j])


def wrong_poses(readings: Readings) -> Iterator[Fault]:
    """Dwells whose output belongs to another direction of gravity than the one commanded."""
    size = np.linalg.norm(readings.misfit, axis=-1)
    typical = np.nanmedian(size, axis=1, keepdims=True)
    out = size > np.maximum(0.02, 15.0 * typical)
    if len(out) > 2:
        out &= (
            np.nanmean(out, axis=0, keepdims=True) < 0.5
        )  # what most units show is the plan's or the table's, not one unit's
    for unit, row in enumerate(out):
        places = np.flatnonzero(row)
        if not places.size or places.size > 0.4 * row.size:
            continue
        felt = _felt(readings, unit, places)
        turned = np.abs(np.linalg.norm(felt, axis=-1) - 1.0) < 0.02
        if not turned.any():
            continue
        name, told = _which_pose(readings.force[unit], places[turned], felt[turned])
        yield Fault(name, unit, _places(places[turned]), told)


def _felt(readings: Readings, unit: int, places: NDArray[np.intp]) -> Array:
    """Specific force that the outputs at some dwells stand for, (k, 3), g."""
    fit = readings.fits[unit]
    return np.linalg.solve(fit[:, 1:], (readings.output[unit, places] - fit[:, 0]).T).T


def _which_pose(force: Array, places: NDArray[np.intp], felt: Array) -> tuple[str, str]:
    for i, a in enumerate(places):
        for j in range(i + 1, len(places)):
            b = places[j]
            if np.linalg.norm(felt[i] - force[b]) < 0.05 and np.linalg.norm(felt[j] - force[a]) < 0.05:
                return "swapped_dwells", f"dwells {a} and {b} carry each other's pose"
    angle = np.degrees(np.arccos(np.clip(np.sum(felt[0] * force[places[0]]), -1.0, 1.0)))
    return "wrong_pose", f"dwell {places[0]} was taken {angle:.1f}° from the commanded pose"


def noisy(readings: Readings) -> Iterator[Fault]:
    """Dwells whose scatter is far above the unit's own and the lot's: spikes on an axis, torn words on all."""
    if readings.spread is None:
        return
    typical = np.nanmedian(readings.spread, axis=1, keepdims=True)
    ratio = readings.spread / np.where(typical > 0.0, typical, np.inf)
    common = np.nanmedian(ratio, axis=0, keepdims=True) if len(ratio) > 2 else np.ones((1, *ratio.shape[1:]))
    loud: NDArray[np.bool_] = np.logical_and(ratio > 5.0, ratio > 3.0 * common)
    few = np.count_nonzero(loud.any(axis=-1), axis=1) < 3
    loud &= ~(few[:, None, None] & (ratio < 10.0))  # one restless dwell is a transient, not a fault of the reading
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
            name, unit, _places(places), f"scatter up to {worst:.0f} times the unit's own in {places.size} dwells"
        )


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
            yield Fault("spikes", unit, _places(places), f"{places.size} dwells far off the others")


def quantised(readings: Readings) -> Iterator[Fault]:
    """Outputs on a lattice whose step, over √12, exceeds the noise of a mean."""
    for unit, out in enumerate(readings.output):
        there = readings.there[unit]
        for axis in range(3):
            step = lattice_step(out[there, axis])
            noise = _white(readings, unit, axis)
            if step is not None and noise is not None and step / np.sqrt(12.0) > 1.5 * noise:
                ratio = step / np.sqrt(12.0) / noise
                evidence = f"axis {'xyz'[axis]} moves in steps of {step:.3g}: LSB/√12 is {ratio:.1f} times the noise"
                yield Fault("quantised", unit, (), evidence)
                break


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


def dropped(readings: Readings) -> Iterator[Fault]:
    """Dwells with fewer samples than the lot has there, or than their duration holds."""
    if readings.count is None:
        return
    if len(readings.count) > 2:
        expected = np.nanmedian(readings.count, axis=0, keepdims=True)
    elif readings.duration is not None:
        rate = np.nanmedian(readings.count / np.maximum(readings.duration, 1e-9), axis=1, keepdims=True)
        expected = rate * readings.duration
    else:
        expected = np.nanmedian(readings.count, axis=1, keepdims=True)
        if np.nanmean(np.abs(readings.count / expected - 1.0) > 0.1) > 0.4:
            return  # dwells of planned different length
    for unit, row in enumerate(readings.count / np.maximum(expected, 1e-9)):
        places = np.flatnonzero(row < 0.85)
        if places.size:
            worst = float(np.nanmin(row))
            yield Fault(
                "dropped_samples",
                unit,
                _places(places),
                f"{places.size} dwells hold as little as {worst:.0%} of the samples",
            )


def _places(values: NDArray[np.intp]) -> tuple[int, ...]:
    return tuple(int(v) for v in values)


LOOKS: tuple[Look, ...] = (
    truncated,
    clock,
    temperature_units,
    stuck,
    changed_units,
    dead,
    scale_units,
    flipped,
    swapped_units,
    wrong_poses,
    noisy,
    outliers,
    stale,
    quantised,
    dropped,
)

STILL_LOOKS: tuple[Look, ...] = (truncated, clock, temperature_units, stale, noisy, quantised, dropped)
"""Looks for a record in one pose: nothing is known of its response, and an output may well repeat."""

__all__ = ["Fault", "Look", "find_faults", "lattice_step", "robust_fit"]
