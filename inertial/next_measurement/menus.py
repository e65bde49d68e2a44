"""Possible next steps of a station: sequences of every kind that can separate effects.

These are poses in new directions, at the temperatures of the run; waits of different length after a move; approaches from both
sides; temperature excursions up and down, soaked or during the ramp; the same poses later; and power cycles of the devices.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Literal

import numpy as np

from inertial import frames, poses
from inertial.arrays import Array
from inertial.planning.drivers import first_unit
from inertial.planning.features import levels
from inertial.planning.sequences import SequenceStep, StationPace, n_of, standing
from inertial.state import T_REFERENCE, State

Kind = Literal["poses", "soaks", "waits", "approach", "excursion", "ramp", "later", "power"]

_DETOUR = np.radians(20.0)
_EXCURSION_K = 25.0
_MINOR_K = 8.0
_VARIED_K = 5.0
_NEARLY_K = 1.0
_STOPS = 8


@dataclass(frozen=True)
class TableReach:
    """Capabilities and limits of a station.

    outer, inner : rad, bounds of the table angles
    temperature : °C, bounds for further soaks; None if the temperature must not be changed
    settle : s, usual wait after a move
    power : whether it can switch the devices off and on
    """

    outer: tuple[float, float] = (-np.pi, np.pi)
    inner: tuple[float, float] = (-2.0 * np.pi, 2.0 * np.pi)
    temperature: tuple[float, float] | None = None
    settle: float = 2.0
    power: bool = False

    def allows(self, step: SequenceStep) -> bool:
        """Whether a step lies within the bounds."""
        inside = self.outer[0] <= step.outer <= self.outer[1] and self.inner[0] <= step.inner <= self.inner[1]
        if self.temperature is None:
            return inside
        low, high = self.temperature
        return inside and low - _NEARLY_K <= step.temperature <= high + _NEARLY_K


@dataclass(frozen=True)
class StepSequence:
    """A sequence of steps that is proposed as a whole."""

    kind: Kind
    steps: tuple[SequenceStep, ...]

    def times(self, repeats: int) -> "StepSequence":
        """The sequence repeated ``repeats`` times."""
        return StepSequence(self.kind, self.steps * repeats)


def reach_of(state: State) -> TableReach:
    """The capabilities of a station that a run implies: any angle, its usual wait, and its temperature range if it varied."""
    settle = 2.0 if state.since_move is None else float(np.clip(np.median(state.since_move), 0.0, 60.0))
    if state.temperature is None or float(np.ptp(state.temperature)) < _VARIED_K:
        return TableReach(settle=settle)
    return TableReach(
        settle=settle, temperature=(round(float(np.min(state.temperature))), round(float(np.max(state.temperature))))
    )


def pose_grid(reach: TableReach, temperature: float) -> list[SequenceStep]:
    """Steps in directions that show any curve of the force: a lattice, edges and corners, rings near 0.1 to 0.75 g.

    Each direction is reached by two table attitudes; both are included, because the table errors differ.
    """
    rings = [_ring(axis, level) for axis in range(3) for level in (0.1, 0.24, 0.5, 0.75)]
    named = [poses.plan(name) for name in ("twenty_six", "orthogonal24")]
    angles = np.radians(np.concatenate([poses.fibonacci(48), *named, *rings]))
    other = np.stack([-angles[:, 0], np.where(angles[:, 1] > 0.0, angles[:, 1] - np.pi, angles[:, 1] + np.pi)], axis=1)
    steps = [SequenceStep(float(o), float(i), temperature, reach.settle) for o, i in np.concatenate([angles, other])]
    return [s for s in steps if reach.allows(s)]


def _ring(axis: int, level: float) -> Array:
    """Outer and inner angle, (8, 2), degrees, of directions with ± ``level`` g on an axis."""
    turn = 2.0 * np.pi * (np.arange(4) + 0.5 * (axis == 1)) / 4.0 + 0.3
    across = np.sqrt(1.0 - level**2)
    both = [
        np.roll(np.array([sign * level, across * np.cos(t), across * np.sin(t)]), axis)
        for sign in (1.0, -1.0)
        for t in turn
    ]
    outer, inner = frames.angles_from_force(np.array(both))
    return np.degrees(np.stack([outer, inner], axis=1))


def temperatures(here: float, reach: TableReach) -> list[float]:
    """Temperatures of further soaks: the ends and the middle of the range, without the present temperature."""
    if reach.temperature is None:
        return []
    low, high = reach.temperature
    return [t for t in (high, low, 0.5 * (low + high)) if abs(t - here) > 2.0]


def present(state: State, pace: StationPace) -> float:
    """Present temperature of the chamber, °C."""
    there = pace.start or standing(state)
    if there is not None:
        return there.temperature
    return T_REFERENCE if state.temperature is None else round(float(np.mean(state.temperature[..., -1])), 1)


def courses(state: State, reach: TableReach, best: Sequence[SequenceStep], here: float) -> list[StepSequence]:
    """Sequences that are not a selection of single poses.

    Parameters
    ----------
    best : poses whose directions separate the rivals; the first two are used beside two faces
    here : °C, present temperature of the chamber
    """
    faces = [SequenceStep(0.0, 0.0, here, reach.settle), SequenceStep(np.pi, 0.0, here, reach.settle)]
    chosen = [*faces, *(replace(s, temperature=here) for s in best[:2])]
    sequences = [
        *_waits(here),
        *_approaches(state, reach, here, chosen),
        *_laters(chosen),
        *(_power_cycles(chosen) if reach.power and state.since_power is not None else ()),
    ]
    if reach.temperature is not None:
        sequences += [
            *_excursions(*reach.temperature, here, chosen),
            *_between(state, here, chosen),
            *_ramps(*reach.temperature, here, chosen),
        ]
    return [c for c in sequences if c.steps and all(reach.allows(s) for s in c.steps)]


def _waits(here: float) -> list[StepSequence]:
    """Opposite poses in turn, with increasing waits after the move, or repeated dwells in each pose."""
    pairs = (
        ((0.0, 0.0), (np.pi, 0.0)),
        ((0.5 * np.pi, 0.0), (-0.5 * np.pi, 0.0)),
        ((0.5 * np.pi, 0.5 * np.pi), (0.5 * np.pi, -0.5 * np.pi)),
    )
    sequences: list[StepSequence] = []
    for waits in ((0.0, 20.0, 60.0), (0.0, 10.0, 30.0, 100.0, 300.0), (0.0, 0.0, 0.0, 120.0), (0.0, 600.0)):
        for some in (pairs, pairs[:1]):
            steps = [SequenceStep(o, i, here, w) for w in waits for pair in some for o, i in pair]
            sequences.append(StepSequence("waits", tuple(steps)))
    # repeated dwells in each pose record the complete settling
    stay = [SequenceStep(o, i, here, 0.0) for pair in pairs for o, i in pair for _ in range(8)]
    return [*sequences, StepSequence("waits", tuple(stay))]


def _approaches(state: State, reach: TableReach, here: float, chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Poses approached from both sides of each axis; the poses of the run in reverse order."""
    sequences: list[StepSequence] = []
    for count in (2, 4):
        steps: list[SequenceStep] = []
        for pose in chosen[:count]:
            for outer, inner in ((_DETOUR, 0.0), (-_DETOUR, 0.0), (0.0, _DETOUR), (0.0, -_DETOUR)):
                steps += [replace(pose, outer=pose.outer + outer, inner=pose.inner + inner), pose]
        sequences.append(StepSequence("approach", tuple(steps)))
    if state.outer is not None and state.inner is not None:
        last = range(n_of(state) - 2, max(n_of(state) - 26, -1), -1)
        outer, inner = np.atleast_2d(state.outer)[0], np.atleast_2d(state.inner)[0]
        back = [SequenceStep(float(outer[k]), float(inner[k]), here, reach.settle) for k in last]
        sequences += [StepSequence("approach", tuple(back[:12])), StepSequence("approach", tuple(back))]
    return sequences


def _laters(chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Chosen steps repeated once or several times, each time after a wait."""
    sequences: list[StepSequence] = []
    for wait, times in ((120.0, 3), (600.0, 1), (600.0, 3), (1800.0, 1), (1800.0, 2)):
        group = [replace(chosen[0], wait=wait), *chosen[1:], chosen[0]]
        sequences.append(StepSequence("later", tuple(group * times)))
    return sequences


def _power_cycles(chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Two opposite poses before and after the devices are off for a while, and again while they warm up."""
    first, second = chosen[0], chosen[1]
    sequences: list[StepSequence] = []
    for off, later in product((300.0, 600.0, 1800.0), ((), (60.0,), (60.0, 300.0), (60.0, 300.0, 900.0))):
        before = [first, second, first, second]
        after = [replace(first, off=off), second, first, second]
        again = [step for wait in later for step in (replace(first, wait=wait), second, first, second)]
        sequences.append(StepSequence("power", (*before, *after, *again)))
    return sequences


def _excursions(low: float, high: float, here: float, chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Soaks at other temperatures and back at the present one, upwards and downwards, over large and small steps."""
    up, down = min(high, here + _EXCURSION_K), max(low, here - _EXCURSION_K)
    near_up, near_down = min(high, here + _MINOR_K), max(low, here - _MINOR_K)
    middle = 0.5 * (low + high)
    ways = (
        (up, here), (down, here), (up, down, here), (near_up, here), (near_down, here), (near_up, near_down, here),
        (high, middle), (low, middle), (high, middle, low), (low, middle, high), (high, low), (low, high),
    )  # fmt: skip
    sequences: list[StepSequence] = []
    for way, count in product(dict.fromkeys(ways), (2, 4)):
        stops = [t for k, t in enumerate(way) if abs(t - (way[k - 1] if k else here)) > 1.0]
        steps = [replace(pose, temperature=t) for t in stops for pose in chosen[:count]]
        sequences.append(StepSequence("excursion", tuple(steps)))
    return sequences


def _between(state: State, here: float, chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Soaks between those of the run, from the nearer end on: only they show a curvature between two soaks."""
    soaks = np.array(sorted(levels(first_unit(state))))
    apart = np.flatnonzero(np.diff(soaks) > _VARIED_K)
    if apart.size < 1:
        return []
    halves = np.round(0.5 * (soaks[apart] + soaks[apart + 1]), 1)
    low, wide = soaks[apart], np.diff(soaks)[apart]
    quarters = np.round(np.concatenate([low + 0.25 * wide, low + 0.75 * wide]), 1)
    sequences: list[StepSequence] = []
    for stops in (halves, np.sort(quarters), np.sort(np.concatenate([halves, quarters]))):
        way = stops[:_STOPS] if abs(stops[0] - here) <= abs(stops[-1] - here) else stops[::-1][:_STOPS]
        for count in (2, 4):
            steps = [replace(pose, temperature=float(t)) for t in way for pose in chosen[:count]]
            sequences.append(StepSequence("excursion", tuple(steps)))
    return sequences


def _ramps(low: float, high: float, here: float, chosen: Sequence[SequenceStep]) -> list[StepSequence]:
    """Dwells during a temperature ramp, while the devices follow the air, one way or also back."""
    sequences: list[StepSequence] = []
    for away, times in product((min(high, here + _EXCURSION_K), max(low, here - _EXCURSION_K)), (8, 20)):
        if abs(away - here) < 5.0:
            continue
        out = [replace(chosen[k % 2], temperature=away, soaked=False, wait=15.0) for k in range(times)]
        back = [replace(s, temperature=here) for s in out]
        sequences += [StepSequence("ramp", tuple(out)), StepSequence("ramp", (*out, *back))]
    return sequences
