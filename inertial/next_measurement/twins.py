"""Effects that no measurement of a station separates: one is equivalent to the other under every possible step."""

import numpy as np

from inertial.next_measurement.menus import TableReach, courses, pose_grid, present, reach_of, temperatures
from inertial.next_measurement.separation import Rivals, apart
from inertial.planning.sequences import SequenceStep, StationPace
from inertial.state import State

NOTHING = 1e-6
"""Part of a truth, in chi-square, that an equivalent effect may leave under every step: rounding."""

_EVERY, _FURTHER = 4, 12


def everything(state: State, reach: TableReach, pace: StationPace) -> list[SequenceStep]:
    """Steps of every kind that a station can take: directions, temperatures, waits, approaches, ramps, power."""
    here = present(state, pace)
    poses = pose_grid(reach, here)
    steps = poses[::_EVERY]
    for temperature in temperatures(here, reach):
        steps += pose_grid(reach, temperature)[::_FURTHER]
    kinds: set[str] = set()
    for course in courses(state, reach, poses[:4], here):
        if course.kind not in kinds:
            kinds.add(course.kind)
            steps += course.steps
    return steps


def never_apart(rivals: Rivals, reach: TableReach | None, pace: StationPace) -> np.ndarray:
    """Whether (r, r) the rival of a column explains the prediction of the rival of a row, under every step of the station."""
    state = rivals.lot.state
    steps = everything(state, reach or reach_of(state), pace)
    if not steps:
        return ~np.eye(len(rivals.terms), dtype=bool)
    separation = apart(rivals, steps, pace)
    same = separation.left < NOTHING * np.maximum(separation.whole, 1e-300)[:, None]
    np.fill_diagonal(same, val=False)
    return same


def twins_of(rivals: Rivals, never: np.ndarray) -> tuple[str, ...]:
    """The best rival and those that no measurement separates from it; empty if there are none."""
    alike = [name for name, same in zip(rivals.ids, never[0], strict=True) if same]
    return (rivals.ids[0], *alike) if alike else ()
