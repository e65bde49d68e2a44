"""Plans with dwells added: poses in further directions, the opposite order, waits, soaks, power cycles, raised quantities."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np

from inertial import poses
from inertial.arrays import Array
from inertial.planning.features import levels
from inertial.planning.sequences import SequenceStep, StationPace, extended, n_of
from inertial.state import State

_STEPS_K = 20.0

TURNED = [(90.0, b) for b in (45.0, 135.0, -45.0, -135.0)]
TILTED = [(a, b) for a, b in product((45.0, 135.0), (0.0, 90.0, 180.0, -90.0))]
GENERAL = [(float(o), float(i)) for o, i in poses.fibonacci(24)]
_CORNERS = [(a, b) for a, b in product((54.736, 125.264), (45.0, 135.0, -45.0, -135.0))]


def last_level(state: State) -> float:
    """The last temperature of the plan, at which poses are added, °C."""
    return 25.0 if state.temperature is None else float(state.temperature[..., -1])


def with_poses(state: State, angles: list[tuple[float, float]]) -> State:
    """The plan, then poses at these angles in degrees."""
    temperature = last_level(state)
    return extended(state, [SequenceStep(float(np.radians(o)), float(np.radians(i)), temperature) for o, i in angles])


def near_zero(state: State) -> State:
    """The plan, then poses with 2 mg to 50 mg on each axis, of both signs."""
    small = (0.1, 0.3, 1.0, 3.0)
    both = [(90.0 + s * d, b) for d in small for s in (1.0, -1.0) for b in (0.0, 90.0)]
    both += [(90.0, s * d) for d in small for s in (1.0, -1.0)] + [(90.0, 90.0 + s * d) for d in small for s in (1, -1)]
    return with_poses(state, both)


def backwards(state: State) -> State:
    """The plan, then its poses in the opposite order, so that each is approached from the other side."""
    if state.outer is None or state.inner is None:
        return state
    order = range(n_of(state) - 2, -1, -1)
    steps = [SequenceStep(float(state.outer[k]), float(state.inner[k]), last_level(state)) for k in order]
    return extended(state, steps)


def waits(state: State) -> State:
    """The plan, then some poses after waits of different lengths."""
    if state.outer is None or state.inner is None:
        return state
    half = max(n_of(state) // 2, 1)
    pairs = [(0, 0.5), (half, 5.0), (0, 20.0), (half, 60.0), (0, 200.0), (half, 600.0)]
    return extended(
        state, [SequenceStep(float(state.outer[k]), float(state.inner[k]), last_level(state), w) for k, w in pairs]
    )


def later(state: State) -> State:
    """The plan, then every pose again an hour later."""
    if state.outer is None or state.inner is None:
        return state
    steps = [SequenceStep(float(o), float(i), last_level(state)) for o, i in zip(state.outer, state.inner, strict=True)]
    return extended(state, steps, StationPace(rest=max(3600.0, float(np.ptp(state.time)))))


def with_soaks(state: State, temperatures: list[float], *, soaked: bool = True) -> State:
    """The plan, then faces and corners at further temperatures, °C."""
    angles = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, -90.0), *_CORNERS[:3]]
    steps = [
        SequenceStep(float(np.radians(o)), float(np.radians(i)), t, soaked=soaked)
        for t in temperatures
        for o, i in angles
    ]
    return extended(state, steps, StationPace(soak_s=900.0))


def soaks_back(state: State) -> State:
    """The plan, then soaks at its own temperatures in the opposite order."""
    return with_soaks(state, levels(state)[-2::-1])


def ramps(state: State) -> State:
    """The plan, then dwells during temperature ramps in both directions."""
    last = last_level(state)
    return with_soaks(state, [last + _STEPS_K, last - _STEPS_K, last], soaked=False)


def cycled(state: State) -> State:
    """The plan, then an hour without power at the same temperature, then one pose during warm-up."""
    if state.outer is None or state.inner is None:
        return state
    last = last_level(state)
    first = SequenceStep(float(state.outer[0]), float(state.inner[0]), last, 10.0, off=3600.0)
    waits = (30.0, 100.0, 300.0, 900.0, 2000.0)
    return extended(state, [first, *(replace(first, wait=w, off=0.0) for w in waits)])


def raised(state: State, attribute: str, factor: float) -> State:
    """The plan, then every pose again, every second one with a quantity raised by a factor."""
    repeated = later(state)
    values: Array | None = getattr(repeated, attribute)
    if values is None:
        return state
    values = values.copy()
    values[n_of(state) :: 2] *= factor
    changed: dict[str, Any] = {attribute: values}
    return replace(repeated, **changed, memory={})


def up_down(state: State) -> list[float]:
    """Soak temperatures above and below the middle of the plan's range, and back, °C."""
    present = levels(state)
    middle = 0.5 * (min(present) + max(present)) if present else 25.0
    return [middle + _STEPS_K, middle, middle - _STEPS_K, middle]


def more_levels(state: State) -> list[float]:
    """Soak temperatures inside the plan's range, from high to low, °C; around its middle where the range is 10 K or less."""
    present = levels(state)
    low, high = min(present), max(present)
    return [low + part * (high - low) for part in (0.8, 0.6, 0.4, 0.2)] if high - low > 10.0 else up_down(state)
