"""Plans with what they lacked added: poses in other directions, other orders, waits, soaks, powers and supplies."""

from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from inertial import poses
from inertial.planning.features import levels
from inertial.planning.sequences import SequenceStep, StationPace, extended, n_of
from inertial.state import State

Array = NDArray[np.float64]

_STEPS_K = 20.0

TURNED = [(90.0, b) for b in (45.0, 135.0, -45.0, -135.0)]
TILTED = [(a, b) for a, b in product((45.0, 135.0), (0.0, 90.0, 180.0, -90.0))]
GENERAL = [(float(o), float(i)) for o, i in poses.fibonacci(24)]
_CORNERS = [(a, b) for a, b in product((54.736, 125.264), (45.0, 135.0, -45.0, -135.0))]


def last_level(state: State) -> float:
    """Temperature to add poses at: the last of the plan, °C."""
    return 25.0 if state.temperature is None else float(state.temperature[..., -1])


def with_poses(state: State, angles: list[tuple[float, float]]) -> State:
    """The plan with poses at these angles in degrees after it."""
    temperature = last_level(state)
    return extended(state, [SequenceStep(float(np.radians(o)), float(np.radians(i)), temperature) for o, i in angles])


def near_zero(state: State) -> State:
    """The plan with poses in which each axis stands a few thousandths to a few hundredths of a g from zero, on both sides."""
    small = (0.1, 0.3, 1.0, 3.0)
    both = [(90.0 + s * d, b) for d in small for s in (1.0, -1.0) for b in (0.0, 90.0)]
    both += [(90.0, s * d) for d in small for s in (1.0, -1.0)] + [(90.0, 90.0 + s * d) for d in small for s in (1, -1)]
    return with_poses(state, both)


def backwards(state: State) -> State:
    """The plan with its poses once more in the opposite order, so that each is approached from the other side."""
    if state.outer is None or state.inner is None:
        return state
    order = range(n_of(state) - 2, -1, -1)
    steps = [SequenceStep(float(state.outer[k]), float(state.inner[k]), last_level(state)) for k in order]
    return extended(state, steps)


def waits(state: State) -> State:
    """The plan with some poses after waits of different length."""
    if state.outer is None or state.inner is None:
        return state
    half = max(n_of(state) // 2, 1)
    pairs = [(0, 0.5), (half, 5.0), (0, 20.0), (half, 60.0), (0, 200.0), (half, 600.0)]
    return extended(
        state, [SequenceStep(float(state.outer[k]), float(state.inner[k]), last_level(state), w) for k, w in pairs]
    )


def later(state: State) -> State:
    """The plan with every pose again, an hour later."""
    if state.outer is None or state.inner is None:
        return state
    steps = [SequenceStep(float(o), float(i), last_level(state)) for o, i in zip(state.outer, state.inner, strict=True)]
    return extended(state, steps, StationPace(rest=max(3600.0, float(np.ptp(state.time)))))


def with_soaks(state: State, temperatures: list[float], *, soaked: bool = True) -> State:
    """The plan with faces and corners at further temperatures, °C."""
    chosen = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, -90.0), *_CORNERS[:3]]
    steps = [
        SequenceStep(float(np.radians(o)), float(np.radians(i)), t, soaked=soaked)
        for t in temperatures
        for o, i in chosen
    ]
    return extended(state, steps, StationPace(soak_s=900.0))


def soaks_back(state: State) -> State:
    """The plan with soaks on the way back, at its own temperatures."""
    return with_soaks(state, levels(state)[-2::-1])


def ramps(state: State) -> State:
    """The plan with dwells taken while the devices still follow the chamber, up and down again."""
    here = last_level(state)
    return with_soaks(state, [here + _STEPS_K, here - _STEPS_K, here], soaked=False)


def cycled(state: State) -> State:
    """The plan with the power off for an hour at the same temperature, then poses as the devices warm up."""
    if state.outer is None or state.inner is None:
        return state
    here = last_level(state)
    first = SequenceStep(float(state.outer[0]), float(state.inner[0]), here, 10.0, off=3600.0)
    waits = (30.0, 100.0, 300.0, 900.0, 2000.0)
    return extended(state, [first, *(replace(first, wait=w, off=0.0) for w in waits)])


def supply_steps(state: State) -> State:
    """The plan with every pose again, every other one at 2 % more supply."""
    more = later(state)
    return state if more.supply is None else replace(more, supply=_raised(state, more.supply, 1.02), memory={})


def shaken(state: State) -> State:
    """The plan with every pose again, every other one at ten times the vibration."""
    more = later(state)
    return state if more.vibration is None else replace(more, vibration=_raised(state, more.vibration, 10.0), memory={})


def _raised(state: State, values: Array, factor: float) -> Array:
    """What was recorded over a plan and its repetition, every other dwell of the repetition times a factor."""
    found = values.copy()
    found[n_of(state) :: 2] *= factor
    return found


def up_down(state: State) -> list[float]:
    """Temperatures of soaks above and below the middle of the plan's, and back, °C."""
    here = levels(state)
    middle = 0.5 * (min(here) + max(here)) if here else 25.0
    return [middle + _STEPS_K, middle, middle - _STEPS_K, middle]


def more_levels(state: State) -> list[float]:
    """Temperatures between the plan's, on the way back, °C; above and below it where it spans ten kelvin or less."""
    here = levels(state)
    low, high = min(here), max(here)
    return [low + part * (high - low) for part in (0.8, 0.6, 0.4, 0.2)] if high - low > 10.0 else up_down(state)
