"""Features of a plan that make effects invisible, each with the smallest change of the plan that removes it.

Dwells are added: poses in further directions, the opposite order, waits, soaks, power cycles, raised quantities.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np

from inertial import poses
from inertial.arrays import Array
from inertial.planning import features
from inertial.planning.features import levels
from inertial.planning.sequences import SequenceStep, StationPace, extended, n_of
from inertial.quantities import LEFT_ALONE, Quantity, Varied
from inertial.state import State

Driver = str  # an attribute of the state, or "force", "order" of the poses, "rate" of the temperature

_WAIT_S = 2.0  # after a move
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


def _again(state: State, poses_again: Iterable[tuple[int, float, float]], pace: StationPace | None = None) -> State:
    """The plan, then some of its poses by number, each after a wait and a time without power, s; as it is without angles."""
    if state.outer is None or state.inner is None:
        return state
    outer, inner, last = state.outer, state.inner, last_level(state)
    steps = [SequenceStep(float(outer[k]), float(inner[k]), last, wait, off=off) for k, wait, off in poses_again]
    return extended(state, steps, pace)


def backwards(state: State) -> State:
    """The plan, then its poses in the opposite order, so that each is approached from the other side."""
    return _again(state, [(k, _WAIT_S, 0.0) for k in range(n_of(state) - 2, -1, -1)])


def waits(state: State) -> State:
    """The plan, then some poses after waits of different lengths."""
    half = max(n_of(state) // 2, 1)
    pairs = [(0, 0.5), (half, 5.0), (0, 20.0), (half, 60.0), (0, 200.0), (half, 600.0)]
    return _again(state, [(k, wait, 0.0) for k, wait in pairs])


def later(state: State) -> State:
    """The plan, then every pose again an hour later."""
    pace = StationPace(rest=max(3600.0, float(np.ptp(state.time))))
    return _again(state, [(k, _WAIT_S, 0.0) for k in range(n_of(state))], pace)


def with_soaks(state: State, temperatures: list[float], *, soaked: bool = True) -> State:
    """The plan, then faces and corners at further temperatures, °C."""
    angles = [(0.0, 0.0), (180.0, 0.0), (90.0, 0.0), (90.0, 90.0), (90.0, 180.0), (90.0, -90.0), *_CORNERS[:3]]
    steps = [
        SequenceStep(float(np.radians(o)), float(np.radians(i)), t, soaked=soaked)
        for t in temperatures
        for o, i in angles
    ]
    return extended(state, steps, StationPace(soak_s=900.0))


def ramps(state: State) -> State:
    """The plan, then dwells during temperature ramps in both directions."""
    last = last_level(state)
    return with_soaks(state, [last + _STEPS_K, last - _STEPS_K, last], soaked=False)


def cycled(state: State) -> State:
    """The plan, then an hour without power at the same temperature, then one pose during warm-up."""
    return _again(state, [(0, 10.0, 3600.0), *((0, wait, 0.0) for wait in (30.0, 100.0, 300.0, 900.0, 2000.0))])


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


@dataclass(frozen=True)
class Remedy:
    """A feature of plans that makes effects invisible, and the change that removes it.

    driver : the quantity that the change varies; it only helps effects that depend on this quantity
    feature : description of the feature where a plan has it, else empty
    apply : returns the plan with the change
    cure : the change as an instruction
    """

    driver: Driver
    feature: Callable[[State], str]
    apply: Callable[[State], State]
    cure: Callable[[State], str]


def _where(description: str, condition: Callable[[State], bool]) -> Callable[[State], str]:
    """The description of plans that fulfil a condition, empty for others."""
    return lambda state: description if condition(state) else ""


def _always(instruction: str) -> Callable[[State], str]:
    return lambda _state: instruction


def _degrees(values: list[float]) -> str:
    return ", ".join(f"{v:.0f}" for v in values)


def _of(row: Quantity, varied: Varied) -> Remedy:
    """The remedy of a plan that leaves a quantity alone."""
    return Remedy(
        row.attribute,
        _where(varied.feature, lambda s: features.constant(getattr(s, row.attribute), varied.steady)),
        lambda s: raised(s, row.attribute, varied.factor),
        _always(varied.cure),
    )


REMEDIES: tuple[Remedy, ...] = (
    Remedy(
        "force",
        _where("β in 90° steps", lambda s: features.in_steps(s.inner, 90.0)),
        lambda s: with_poses(s, TURNED),
        _always("add poses at β = 45°"),
    ),
    Remedy(
        "force",
        _where("α in 90° steps", lambda s: features.in_steps(s.outer, 90.0)),
        lambda s: with_poses(s, TILTED),
        _always("add poses at α = 45°"),
    ),
    Remedy(
        "force",
        features.few_levels_of_force,
        lambda s: with_poses(s, GENERAL),
        _always("add poses in general directions, for example the plan fibonacci24"),
    ),
    Remedy(
        "force",
        _where("the absence of poses within ± 0.1 g of zero on every axis", features.far_from_zero),
        near_zero,
        _always("add poses that tilt each axis through 0 g by a few tenths of a degree"),
    ),
    Remedy(
        "order",
        _where("approach of every pose from one side only", features.approached_alike),
        backwards,
        _always("repeat the poses in the opposite order"),
    ),
    Remedy(
        "since_move",
        _where("the same wait after every move", features.one_wait),
        waits,
        _always("wait 5, 20, 60 and 200 s after some moves"),
    ),
    Remedy(
        "temperature",
        _where("a single temperature", lambda s: features.distinct(s) == 1),
        lambda s: with_soaks(s, up_down(s)),
        lambda s: f"add soaks at {_degrees(up_down(s)[:3:2])} °C, and return",
    ),
    Remedy(
        "temperature",
        _where("soaks in one direction only", features.one_way),
        lambda s: with_soaks(s, levels(s)[-2::-1]),
        lambda s: f"add soaks on the way back, at {_degrees(features.levels(s)[-2::-1])} °C",
    ),
    Remedy(
        "temperature",
        lambda s: f"measurement at {features.distinct(s)} temperatures only" if 2 <= features.distinct(s) <= 4 else "",
        lambda s: with_soaks(s, more_levels(s)),
        lambda s: f"add soaks at {_degrees(more_levels(s))} °C",
    ),
    Remedy(
        "time",
        _where("the absence of repeated poses", features.never_again),
        later,
        _always("measure the poses again an hour later"),
    ),
    Remedy(
        "rate",
        _where("measurement at settled temperatures only", features.soaked_only),
        ramps,
        _always("measure while the temperature rises and falls"),
    ),
    Remedy(
        "since_power",
        _where("a single power-on at the start", features.powered_once),
        cycled,
        _always("switch the power off and on at constant temperature"),
    ),
    *(_of(row, row.varied) for row in LEFT_ALONE if row.varied),
)
"""In order of effort for a test engineer, the least first."""
