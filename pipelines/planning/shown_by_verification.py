"""Effects that only the poses of verification show: a diagnosis uses every dwell and can name them, a fit cannot have them."""

from __future__ import annotations

from collections.abc import Sequence

from inertial.planning.visibility import SEEN, visibilities
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.timing import Activity
from schemas.recipe import Recipe
from schemas.station import StationConfig

OF_VERIFICATION = "only the verification poses show it, which a diagnosis uses and a fit leaves out"
REMEDY = "move poses from 'verification' to 'poses', and verify in others"


def shown_by_verification(
    activities: Sequence[Activity], station: StationConfig, recipe: Recipe, effects: Sequence[str]
) -> set[str]:
    """The effects that are visible with the poses of verification, of those that are not visible without them.

    Parameters
    ----------
    activities : what the station does in the recipe
    effects : those that are not visible in the dwells of the fit; the recipe's others are the model
    """
    if not effects or not recipe.verification:
        return set()
    every = state_of(activities, station, recipe, history=True, kinds=("dwell", "verification"))
    shown: set[str] = set()
    for effect in effects:
        rest = [other for other in recipe.effects if other != effect]
        shown |= {s.effect for s in visibilities(every, rest, 1.0, [effect]) if s.remaining_fraction > SEEN}
    return shown
