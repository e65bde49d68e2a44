"""Features of a plan that hide effects, each with the smallest change that removes it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inertial import poses
from inertial.sequences import Pace, Step, extended, n_of
from inertial.state import State

Array = NDArray[np.float64]
Driver = Literal["force", "order", "since_move", "temperature", "time", "rate", "since_power", "supply", "vibration"]

_STEP_TOLERANCE = np.radians(0.05)
_FLAT_K = 2.0
_STEPS_K = 20.0


@dataclass(frozen=True)
class Change:
    """A feature of plans and its cure.

    driver : what the cure varies; effects that do not answer to it are not helped by it
    found : the feature in words where a plan has it, else empty
    made : the plan with the cure added
    cure : the cure in words
    """

    driver: Driver
    found: Callable[[State], str]
    made: Callable[[State], State]
    cure: Callable[[State], str]


def _in_steps(angle: Array | None, step_deg: float) -> bool:
    if angle is None:
        return False
    step = np.radians(step_deg)
    return bool(np.all(np.abs(angle - step * np.round(angle / step)) < _STEP_TOLERANCE))


def _level(state: State) -> float:
    """Temperature to add poses at: the last of the plan, °C."""
    return 25.0 if state.temperature is None else float(state.temperature[..., -1])


def _with(state: State, angles: list[tuple[float, float]]) -> State:
    """The plan with poses at these angles in degrees after it."""
    temperature = _level(state)
    return extended(state, [Step(float(np.radians(o)), float(np.radians(i)), temperature) for o, i in angles])


_TURNED = [(90.0, b) for b in (45.0, 135.0, -45.0, -135.0)]
_TILTED = [(a, b) for a, b in product((45.0, 135.0), (0.0, 90.0, 180.0, -90.0))]
_CORNERS = [(a, b) for a, b in product((54.736, 125.264), (45.0, 135.0, -45.0, -135.0))]
_GENERAL = [(float(o), float(i)) for o, i in poses.fibonacci(24)]


def _near_zero(state: State) -> State:
    """Poses in which each axis stands a hundredth of a g from zero on both sides."""
    small = (0.1, 0.3, 1.0, 3.0)
    both = [(90.0 + s * d, b) for d in small for s in (1.0, -1.0) for b in (0.0, 90.0)]
    both += [(90.0, s * d) for d in small for s in (1.0, -1.0)] + [(90.0, 90.0 + s * d) for d in small for s in (1, -1)]
    return _with(state, both)


def _backwards(state: State) -> State:
    """The poses once more in the opposite order, so that each is approached from the other side."""
    if state.outer is None or state.inner is None:
        return state
    order = range(n_of(state) - 2, -1, -1)
    steps = [Step(float(state.outer[k]), float(state.inner[k]), _level(state)) for k in order]
    return extended(state, steps)


def _waits(state: State) -> State:
    """Some poses with waits of different length."""
    if state.outer is None or state.inner is None:
        return state
    half = max(n_of(state) // 2, 1)
    pairs = [(0, 0.5), (half, 5.0), (0, 20.0), (half, 60.0), (0, 200.0), (half, 600.0)]
    return extended(state, [Step(float(state.outer[k]), float(state.inner[k]), _level(state), w) for k, w in pairs])


def _later(state: State) -> State:
    """Every pose again, an hour later."""
    if state.outer is None or state.inner is None:
        return state
    steps = [Step(float(o), float(i), _level(state)) for o, i in zip(state.outer, state.inner, strict=True)]
    return extended(state, steps, Pace(rest=max(3600.0, float(np.ptp(state.time)))))


def _soaks(state: State, temperatures: list[float], *, soaked: bool = True) -> State:
    """Two opposed sets of poses at further temperatures."""
    chosen = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, -90.0), *_CORNERS[:3]]
    steps = [
        Step(float(np.radians(o)), float(np.radians(i)), t, soaked=soaked) for t in temperatures for o, i in chosen
    ]
    return extended(state, steps, Pace(soak_s=900.0))


def levels(state: State) -> list[float]:
    """Temperatures of the soaks in order of time, °C: levels that stay within two kelvin."""
    if state.temperature is None:
        return []
    found: list[float] = []
    for value in np.ravel(state.temperature):
        if not found or abs(float(value) - found[-1]) > _FLAT_K:
            found.append(float(value))
    return found


def _distinct(state: State) -> int:
    ordered = np.sort(levels(state))
    return 0 if ordered.size == 0 else 1 + int(np.count_nonzero(np.diff(ordered) > _FLAT_K))


def _one_way(state: State) -> bool:
    steps = np.diff(levels(state))
    return steps.size > 0 and (bool(np.all(steps > 0)) or bool(np.all(steps < 0)))


def _back(state: State) -> State:
    """Soaks on the way back, at the plan's own temperatures."""
    return _soaks(state, levels(state)[-2::-1])


def _ramps(state: State) -> State:
    """Dwells taken while the devices still follow the chamber, up and down again."""
    here = _level(state)
    return _soaks(state, [here + _STEPS_K, here - _STEPS_K, here], soaked=False)


def _soaked_only(state: State) -> bool:
    """Whether no dwell was taken while the temperature moved."""
    if state.temperature is None:
        return False
    rate = state.temperature_rate
    if state.history is not None and rate is not None:
        return bool(np.percentile(np.abs(rate), 95) < 0.5)
    return True


def _cycled(state: State) -> State:
    """The power off for an hour at the same temperature, then poses as the devices warm up."""
    if state.outer is None or state.inner is None:
        return state
    here = _level(state)
    first = Step(float(state.outer[0]), float(state.inner[0]), here, 10.0, off=3600.0)
    waits = (30.0, 100.0, 300.0, 900.0, 2000.0)
    return extended(state, [first, *(replace(first, wait=w, off=0.0) for w in waits)])


def _powered_once(state: State) -> bool:
    return state.since_power is not None and bool(np.all(np.diff(state.since_power) >= 0.0))


def _constant(values: Array | None, share: float) -> bool:
    return values is not None and float(np.ptp(values)) <= share * max(float(np.max(np.abs(values))), 1e-12)


def _supply_steps(state: State) -> State:
    if state.supply is None:
        return state
    more = _later(state)
    if more.supply is None:
        return state
    stepped = more.supply.copy()
    stepped[n_of(state) :: 2] *= 1.02
    return replace(more, supply=stepped, memory={})


def _shaken(state: State) -> State:
    more = _later(state)
    if more.vibration is None:
        return state
    stronger = more.vibration.copy()
    stronger[n_of(state) :: 2] *= 10.0
    return replace(more, vibration=stronger, memory={})


def _said(words: str, when: Callable[[State], bool]) -> Callable[[State], str]:
    return lambda state: words if when(state) else ""


def _always(words: str) -> Callable[[State], str]:
    return lambda _state: words


def _approached_alike(state: State) -> bool:
    """Whether every pose that comes again comes from the same side; poses that come once come from one side."""
    if state.outer is None or state.inner is None:
        return False
    sides: dict[tuple[float, float], set[tuple[float, ...]]] = {}
    steps = np.sign(np.round(np.stack([np.diff(state.outer), np.diff(state.inner)]), 4))
    for k in range(1, n_of(state)):
        pose = (round(float(state.outer[k]), 3), round(float(state.inner[k]), 3))
        sides.setdefault(pose, set()).add(tuple(steps[:, k - 1].tolist()))
    return all(len(s) < 2 for s in sides.values())


def _one_wait(state: State) -> bool:
    """Whether the waits after a move differ by less than half."""
    since = state.since_move
    return since is None or float(np.ptp(since)) < 0.5 * float(np.median(since))


def _never_again(state: State) -> bool:
    """Whether no pose comes twice within a soak."""
    place = np.round(state.force, 3)
    if state.temperature is not None:
        place = np.concatenate([place, np.round(state.temperature[:, None] / _FLAT_K)], axis=1)
    return len(np.unique(place, axis=0)) == n_of(state)


def _far_from_zero(state: State) -> bool:
    """Whether some axis has no pose within a tenth of a g of zero on one of the sides."""
    near = (np.abs(state.force) < 0.1) & (np.abs(state.force) > 1e-6)
    return not bool(np.all(np.any(near & (state.force > 0), axis=0) & np.any(near & (state.force < 0), axis=0)))


def _few_levels_of_force(state: State) -> str:
    """What |f| an axis sees, where it sees a handful of values only."""
    seen = np.unique(np.round(np.abs(state.force), 2))
    return f"|f| of {', '.join(f'{v:g}' for v in seen)} g only" if seen.size <= 5 else ""


def _up_down(state: State) -> list[float]:
    here = levels(state)
    middle = 0.5 * (min(here) + max(here)) if here else 25.0
    return [middle + _STEPS_K, middle, middle - _STEPS_K, middle]


def _more_levels(state: State) -> list[float]:
    here = levels(state)
    low, high = min(here), max(here)
    return [low + part * (high - low) for part in (0.8, 0.6, 0.4, 0.2)] if high - low > 10.0 else _up_down(state)


def _degrees(values: list[float]) -> str:
    return ", ".join(f"{v:.0f}" for v in values)


CHANGES: tuple[Change, ...] = (
    Change(
        "force",
        _said("β in 90° steps", lambda s: _in_steps(s.inner, 90.0)),
        lambda s: _with(s, _TURNED),
        _always("add poses at β = 45°"),
    ),
    Change(
        "force",
        _said("α in 90° steps", lambda s: _in_steps(s.outer, 90.0)),
        lambda s: _with(s, _TILTED),
        _always("add poses at α = 45°"),
    ),
    Change(
        "force",
        _few_levels_of_force,
        lambda s: _with(s, _GENERAL),
        _always("add poses in general directions, as the plan fibonacci24 has them"),
    ),
    Change(
        "force",
        _said("having no pose within 0.1 g of zero on either side", _far_from_zero),
        _near_zero,
        _always("add poses that tilt each axis through 0 g by a few tenths of a degree"),
    ),
    Change(
        "order",
        _said("coming to every pose from one side only", _approached_alike),
        _backwards,
        _always("go through the poses again in the opposite order"),
    ),
    Change(
        "since_move",
        _said("one wait after every move", _one_wait),
        _waits,
        _always("wait 5, 20, 60 and 200 s after some moves"),
    ),
    Change(
        "temperature",
        _said("one temperature only", lambda s: _distinct(s) == 1),
        lambda s: _soaks(s, _up_down(s)),
        lambda s: f"add soaks at {_degrees(_up_down(s)[:3:2])} °C, and come back",
    ),
    Change(
        "temperature",
        _said("soaks in one direction only", _one_way),
        _back,
        lambda s: f"add soaks on the way back, at {_degrees(levels(s)[-2::-1])} °C",
    ),
    Change(
        "temperature",
        lambda s: f"having {_distinct(s)} temperatures only" if 2 <= _distinct(s) <= 4 else "",
        lambda s: _soaks(s, _more_levels(s)),
        lambda s: f"add soaks at {_degrees(_more_levels(s))} °C",
    ),
    Change(
        "time",
        _said("measuring no pose again later", _never_again),
        _later,
        _always("measure the poses again an hour later"),
    ),
    Change(
        "rate",
        _said("reading only when the temperature has settled", _soaked_only),
        _ramps,
        _always("read while the temperature moves, up and down"),
    ),
    Change(
        "since_power",
        _said("one power-on at the beginning", _powered_once),
        _cycled,
        _always("switch the power off and on at constant temperature"),
    ),
    Change(
        "supply",
        _said("a constant supply", lambda s: _constant(s.supply, 0.005)),
        _supply_steps,
        _always("step the supply at constant temperature"),
    ),
    Change(
        "vibration",
        _said("steady vibration", lambda s: _constant(s.vibration, 0.9)),
        _shaken,
        _always("measure with the compressor on and off"),
    ),
)
"""In the order in which a test engineer would rather make them: the cheapest first."""
