"""The time line of a run: soaks, moves, dwells and power, second by second as a station would do them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .poses import PLANS, SOAKS
from .spec import Spec

Floats = NDArray[np.float64]

GRID_S = 5.0
TABLE_SPEED = 20.0  # degrees per second
RAMP_K_PER_S = 2.5 / 60.0
RAMP_CYCLES = 7
CYCLES = 4  # times that power comes on in a run at one temperature
OFF_S = (1800.0, 5400.0)
LEGS_C = (25.0, 72.0, -8.0, 45.0)  # turning points of the run that measures while it ramps


@dataclass(frozen=True)
class Timeline:
    """When each dwell starts, where the table is told to go, and what the chamber is told. Angles in degrees, times in s."""

    commanded: Floats  # (n, 2)
    start: Floats  # (n,)
    wait: Floats  # (n,) from the end of the move to the start of the dwell
    dwell: float
    stay: Floats  # (n,) from the end of the dwell to the end of the next move
    power_on: Floats  # (m,) instants of switching on
    power_gap: Floats  # (m,) how long it had been off
    profile: Floats  # (p, 2) time and set point
    end: float


def _orders(spec: Spec, rng: np.random.Generator, visits: int) -> list[Floats]:
    poses = PLANS[spec.plan]
    order = np.arange(len(poses))
    rounds = []
    for visit in range(visits):
        if spec.shuffled_poses:
            order = rng.permutation(len(poses))
        rounds.append(poses[order] if spec.shuffled_poses or visit % 2 == 0 else poses[order[::-1]])
    return rounds


def build(spec: Spec, rng: np.random.Generator) -> Timeline:
    """The time line of one run of `spec`."""
    ramping = spec.soaks == "ramps"
    soaks = (LEGS_C[0],) if ramping else SOAKS[spec.soaks]
    visits = spec.repeats * (RAMP_CYCLES if ramping else 1)
    dwell = float(rng.choice([10.0, 15.0, 20.0]))
    settle = float(rng.choice([5.0, 10.0, 20.0]))
    hold = float(rng.choice([1200.0, 1800.0, 2700.0]))
    now, at = 0.0, np.zeros(2)
    power_on, power_gap = [0.0], [86400.0]
    profile = [(0.0, 23.0)]
    commanded, start, wait = [], [], []
    for index, target in enumerate(soaks):
        if spec.power_cycles and index > 0:
            gap = float(rng.uniform(*OFF_S))
            now += gap
            power_on.append(now)
            power_gap.append(gap)
        ramp = abs(target - profile[-1][1]) / RAMP_K_PER_S
        profile += [(now, profile[-1][1]), (now + ramp, target)]
        now += 30.0 if spec.power_cycles and len(soaks) == 1 else ramp + hold
        for round_index, poses in enumerate(_orders(spec, rng, visits)):
            if spec.power_cycles and len(soaks) == 1 and round_index > 0 and round_index % -(-visits // CYCLES) == 0:
                gap = float(rng.uniform(*OFF_S))
                now += gap
                power_on.append(now)
                power_gap.append(gap)
            for pose in poses:
                pause = settle * (float(rng.uniform(0.4, 4.0)) if spec.varied_waits else 1.0)
                now += float(np.abs(pose - at).max()) / TABLE_SPEED + 1.0 + pause
                commanded.append(pose)
                start.append(now)
                wait.append(pause)
                now += dwell
                at = pose
        profile.append((now, target))
    if ramping:
        profile += _legs(profile[-1][0] - (now - start[0]), now)
        profile = sorted(set(profile[:3] + profile[4:]))
    begin = np.array(start)
    stay = np.append(begin[1:] - np.array(wait)[1:] - begin[:-1] - dwell, 0.0)
    return Timeline(
        np.array(commanded),
        begin,
        np.array(wait),
        dwell,
        stay,
        np.array(power_on),
        np.array(power_gap),
        np.array(profile),
        now,
    )


def _legs(begin: float, end: float) -> list[tuple[float, float]]:
    """Set points of up and down ramps at unlike rates that fill the time from `begin` to `end`."""
    share = np.array([0.0, 0.28, 0.72, 1.0])
    return [(begin + s * (end - begin), level) for s, level in zip(share, LEGS_C, strict=True)]
