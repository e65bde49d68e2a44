"""Features of a plan that make effects invisible: a single value, direction or order of a quantity."""

import numpy as np

from inertial.arrays import Array
from inertial.planning.sequences import n_of
from inertial.state import State

_STEP_TOLERANCE = np.radians(0.05)
_FLAT_K = 2.0


def in_steps(angle: Array | None, step_deg: float) -> bool:
    """Whether all angles, rad, are multiples of a step, degrees."""
    if angle is None:
        return False
    step = np.radians(step_deg)
    return bool(np.all(np.abs(angle - step * np.round(angle / step)) < _STEP_TOLERANCE))


def levels(state: State) -> list[float]:
    """Soak temperatures in order of time, °C; dwells within 2 K of one another belong to one soak."""
    if state.temperature is None:
        return []
    soaks: list[float] = []
    for value in np.ravel(state.temperature):
        if not soaks or abs(float(value) - soaks[-1]) > _FLAT_K:
            soaks.append(float(value))
    return soaks


def distinct(state: State) -> int:
    """Number of temperatures of a plan that differ by more than 2 K."""
    ordered = np.sort(levels(state))
    return 0 if ordered.size == 0 else 1 + int(np.count_nonzero(np.diff(ordered) > _FLAT_K))


def one_way(state: State) -> bool:
    """Whether the soak temperatures only rise or only fall."""
    steps = np.diff(levels(state))
    return steps.size > 0 and (bool(np.all(steps > 0)) or bool(np.all(steps < 0)))


def soaked_only(state: State) -> bool:
    """Whether every dwell was measured at a settled temperature."""
    if state.temperature is None:
        return False
    rate = state.temperature_rate
    if state.history is not None and rate is not None:
        return bool(np.percentile(np.abs(rate), 95) < 0.5)
    return True


def powered_once(state: State) -> bool:
    """Whether the devices are powered on only once, at the start."""
    return state.since_power is not None and bool(np.all(np.diff(state.since_power) >= 0.0))


def constant(values: Array | None, share: float) -> bool:
    """Whether the range of values is at most a share of the largest."""
    return values is not None and float(np.ptp(values)) <= share * max(float(np.max(np.abs(values))), 1e-12)


def approached_alike(state: State) -> bool:
    """Whether every pose is always approached from the same side."""
    if state.outer is None or state.inner is None:
        return False
    sides: dict[tuple[float, float], set[tuple[float, ...]]] = {}
    steps = np.sign(np.round(np.stack([np.diff(state.outer), np.diff(state.inner)]), 4))
    for k in range(1, n_of(state)):
        pose = (round(float(state.outer[k]), 3), round(float(state.inner[k]), 3))
        sides.setdefault(pose, set()).add(tuple(steps[:, k - 1].tolist()))
    return all(len(s) < 2 for s in sides.values())


def one_wait(state: State) -> bool:
    """Whether the range of waits after a move is less than half their median."""
    since = state.since_move
    return since is None or float(np.ptp(since)) < 0.5 * float(np.median(since))


def never_again(state: State) -> bool:
    """Whether no pose is repeated at the same temperature."""
    conditions = np.round(state.force, 3)
    if state.temperature is not None:
        conditions = np.concatenate([conditions, np.round(state.temperature[:, None] / _FLAT_K)], axis=1)
    return len(np.unique(conditions, axis=0)) == n_of(state)


def far_from_zero(state: State) -> bool:
    """Whether an axis has no pose within 0.1 g of zero on the positive or the negative side."""
    near = (np.abs(state.force) < 0.1) & (np.abs(state.force) > 1e-6)
    return not bool(np.all(np.any(near & (state.force > 0), axis=0) & np.any(near & (state.force < 0), axis=0)))


def few_levels_of_force(state: State) -> str:
    """The values of |f| on the axes where there are five or fewer, else empty."""
    values = np.unique(np.round(np.abs(state.force), 2))
    return f"|f| of {', '.join(f'{v:g}' for v in values)} g only" if values.size <= 5 else ""
