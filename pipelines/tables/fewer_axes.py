"""What the poses of a device with one axis or two do not determine: coefficients that are held at zero, and said to be."""

from __future__ import annotations

import pandas as pd

from inertial.effects.base import others
from inertial.frames import unseen_directions
from inertial.state import State
from pipelines.tables.dwell_table import DwellTable, output_axes, state_of_table
from schemas.units import AXES


def undetermined(state: State) -> list[str]:
    """Names of the responses across an axis that no pose shows, as Kxy; none for a device with three axes."""
    if len(state.axes) == len(AXES):
        return []
    unseen = unseen_directions(state.force)
    return [f"K{AXES[axis]}{AXES[k]}" for axis in state.axes for k in others(axis) if k in unseen]


def shows_misalignment(dwells: pd.DataFrame) -> bool:
    """Whether a pose shows the response across an axis; those of a device with three axes are asked to."""
    if len(output_axes(dwells.columns)) == len(AXES):
        return True
    state = state_of_table(DwellTable(dwells))[1]
    return len(undetermined(state)) < 2 * len(state.axes)


def sentences(state: State) -> list[str]:
    """What cannot be determined from the poses, and what to measure for it."""
    names = undetermined(state)
    if not names:
        return []
    text = f"cannot be determined from these poses: {', '.join(names)} (held at zero: the force across does not change in that "
    return [f"{text}direction); turn the device about its own axis by 90° and tilt it again"]
