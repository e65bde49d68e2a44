"""Features of a plan that hide effects: what it has one value of, one direction of, one order of."""

import numpy as np
from numpy.typing import NDArray

from inertial.planning.sequences import n_of
from inertial.state import State

Array = NDArray[np.float64]

_STEP_TOLERANCE = np.radians(0.05)
_FLAT_K = 2.0


def in_steps(angle: Array | None, step_deg: float) -> bool:
    """Whether all angles, rad, are multiples of a step, degrees."""
    if angle is None:
        return False
    step = np.radians(step_deg)
    return bool(np.all(np.abs(angle - step * np.round(angle / step)) < _STEP_TOLERANCE))


def levels(state: State) -> list[float]:
    """Temperatures of the soaks in order of time, °C: levels that stay within two kelvin."""
    if state.temperature is None:
        return []
    found: list[float] = []
    for value in np.ravel(state.temperature):
        if not found or abs(float(value) - found[-1]) > _FLAT_K:
            found.append(float(value))
    return found


def distinct(state: State) -> int:
    """How many temperatures a plan has that differ by more than two kelvin."""
    ordered = np.sort(levels(state))
    return 0 if ordered.size == 0 else 1 + int(np.count_nonzero(np.diff(ordered) > _FLAT_K))


def one_way(state: State) -> bool:
    """Whether the temperature goes from soak to soak in one direction."""
    steps = np.diff(levels(state))
    return steps.size > 0 and (bool(np.all(steps > 0)) or bool(np.all(steps < 0)))


def soaked_only(state: State) -> bool:
    """Whether no dwell was taken while the temperature moved."""
    if state.temperature is None:
        return False
    rate = state.temperature_rate
    if state.history is not None and rate is not None:
        return bool(np.percentile(np.abs(rate), 95) < 0.5)
    return True


def powered_once(state: State) -> bool:
    """Whether the devices are switched on once, at the beginning."""
    return state.since_power is not None and bool(np.all(np.diff(state.since_power) >= 0.0))


def constant(values: Array | None, share: float) -> bool:
    """Whether values span no more than a share of the largest."""
    return values is not None and float(np.ptp(values)) <= share * max(float(np.max(np.abs(values))), 1e-12)


def approached_alike(state: State) -> bool:
    """Whether every pose that comes again comes from the same side; poses that come once come from one side."""
    if state.outer is None or state.inner is None:
        return False
    sides: dict[tuple[float, float], set[tuple[float, ...]]] = {}
    steps = np.sign(np.round(np.stack([np.diff(state.outer), np.diff(state.inner)]), 4))
    for k in range(1, n_of(state)):
        pose = (round(float(state.outer[k]), 3), round(float(state.inner[k]), 3))
        sides.setdefault(pose, set()).add(tuple(steps[:, k - 1].tolist()))
    return all(len(s) < 2 for s in sides.values())


def one_wait(state: State) -> bool:
    """Whether the waits after a move differ by less than half."""
    since = state.since_move
    return since is None or float(np.ptp(since)) < 0.5 * float(np.median(since))


def never_again(state: State) -> bool:
    """Whether no pose comes twice within a soak."""
    place = np.round(state.force, 3)
    if state.temperature is not None:
        place = np.concatenate([place, np.round(state.temperature[:, None] / _FLAT_K)], axis=1)
    return len(np.unique(place, axis=0)) == n_of(state)


def far_from_zero(state: State) -> bool:
    """Whether some axis has no pose within a tenth of a g of zero on one of the sides."""
    near = (np.abs(state.force) < 0.1) & (np.abs(state.force) > 1e-6)
    return not bool(np.all(np.any(near & (state.force > 0), axis=0) & np.any(near & (state.force < 0), axis=0)))


def few_levels_of_force(state: State) -> str:
    """What |f| an axis sees, where it sees a handful of values only."""
    seen = np.unique(np.round(np.abs(state.force), 2))
    return f"|f| of {', '.join(f'{v:g}' for v in seen)} g only" if seen.size <= 5 else ""
