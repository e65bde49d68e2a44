"""The planned dwells of the fit and of the verification, as the uncertainty budget of a plan needs them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.state import State
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import Activity, schedule
from schemas.recipe import Recipe
from schemas.station import StationConfig

Array = NDArray[np.float64]


class Planned(NamedTuple):
    """States of the dwells of the fit and of the verification; soak and temperature of each dwell of the fit."""

    fit: State
    verification: State | None
    soak: NDArray[np.int64]
    target_C: Array


def planned_dwells(recipe: Recipe, station: StationConfig, activities: list[Activity] | None = None) -> Planned:
    """The dwells that a recipe plans on a station."""
    whole = schedule(steps(recipe), station, recipe) if activities is None else activities
    own = [one for one in whole if one.kind == "dwell"]
    checks = [one for one in whole if one.kind == "verification"]
    return Planned(
        fit=state_of(whole, station, recipe),
        verification=state_of(whole, station, recipe, kinds=("verification",)) if checks else None,
        soak=np.array([one.step.soak for one in own]),
        target_C=np.array([one.step.temperature for one in own]),
    )
