"""A thermometer that repeats itself."""

from collections.abc import Iterator

import numpy as np

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.readings import Array, Readings


def stale(readings: Readings) -> Iterator[Fault]:
    """A thermometer that repeats a value to the last digit although the temperature changes, or although it had noise before."""
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
            yield Fault("stale_temperature", unit, tuple(range(start, start + length)), evidence)


def _noisy_steps(steps: Array) -> bool:
    """Whether readings go up and down at random: steps of noise reverse two times in three, those of a drift rarely."""
    if steps.size < 6 or np.mean(steps == 0.0) > 0.1:
        return False
    return bool(np.mean(np.sign(steps[1:]) != np.sign(steps[:-1])) > 0.45)


def _moved_elsewhere(readings: Readings, unit: int, stretch: slice) -> float:
    """Change of the temperature of the chamber, or of the other units, during the stretch, K."""
    moves = [0.0]
    if readings.chamber is not None:
        moves.append(float(np.ptp(readings.chamber[unit, stretch])))
    if readings.temperature is not None and len(readings.temperature) > 2:
        others = np.delete(readings.temperature, unit, axis=0)[:, stretch]
        moves.append(float(np.nanmedian(np.ptp(others, axis=1))))
    return max(moves)


def _longest_repeat(row: Array) -> tuple[int, int]:
    """First dwell and length of the longest run of equal values."""
    best, start = (0, 0), 0
    for dwell in range(1, row.size + 1):
        if dwell == row.size or row[dwell] != row[start]:
            if dwell - start > best[1]:
                best = (start, dwell - start)
            start = dwell
    return best


LOOK = Look(stale, ("stale_temperature",), order=130, order_in_one_pose=40)
