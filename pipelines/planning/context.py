"""A recipe on a station before it is measured: activities, dwells and procedures, and what poses of verification show besides."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.noise.dwells import DwellNoise, dwell_covariance
from inertial.noise.flicker import FLICKER_FLOOR
from inertial.planning.visibility import visibilities
from inertial.state import State
from pipelines.procedures import PROCEDURES, parts_of
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import Activity, schedule, spent
from schemas.errors import RecipeInvalid
from schemas.limits import Limits
from schemas.recipe import Recipe
from schemas.station import StationConfig
from stations.plant.preset import load_preset

OF_VERIFICATION = "only the verification poses show it, which a diagnosis uses and a fit leaves out"
REMEDY = "move poses from 'verification' to 'poses', and verify in others"

UG = 1e-6  # of g


@dataclass(frozen=True)
class PlanContext:
    """A recipe on a station.

    activities : what the station does and when
    state : the planned dwells of the fit, (n,)
    covariance : (n, n), of the dwell means, g²
    prior : (axes, p, p), precision of a prior of the model's coefficients, 1/g²; None without a prior
    """

    recipe: Recipe
    station: StationConfig
    noise: DwellNoise
    activities: list[Activity]
    state: State
    covariance: NDArray[np.float64]
    prior: NDArray[np.float64] | None = None

    @property
    def minutes(self) -> float:
        """Station time without the static record, min."""
        times = spent(self.activities)
        return times.total - times.static_record

    @property
    def heat(self) -> NDArray[np.float64]:
        """The device's temperature at the dwells of the fit (n,), °C."""
        return np.zeros(0) if self.state.temperature is None else self.state.temperature


def plan_context(
    recipe: Recipe,
    station: StationConfig,
    noise: DwellNoise,
    *,
    slowest: float = 0.0,
    prior: NDArray[np.float64] | None = None,
) -> PlanContext:
    """A recipe on a station with devices of this noise; ``slowest`` as in :func:`inertial.noise.dwells.dwell_covariance`.

    Raises RecipeInvalid: the recipe has no multi-position test, of whose dwells a plan is made.
    """
    if not recipe.tumbles:
        raise RecipeInvalid(
            f"recipe {recipe.name}: its procedures have no multi_position, of whose dwells visibility, pictures and a quicker "
            "recipe are made; list it, or see station time and figures of the procedures with 'tumbleline plan'",
            key="procedures",
        )
    activities = schedule(steps(recipe), station, recipe)
    state = state_of(activities, station, recipe, history=True)
    covariance = dwell_covariance(state.time, recipe.dwell_s, noise, slowest=slowest)
    return PlanContext(recipe, station, noise, activities, state, covariance, prior)


def shown_by_verification(
    activities: Sequence[Activity], station: StationConfig, recipe: Recipe, effects: Sequence[str]
) -> set[str]:
    """The effects that are visible with the poses of verification, of those that are not visible without them.

    activities : what the station does in the recipe
    effects : those that are not visible in the dwells of the fit; the recipe's others are the model
    """
    if not effects or not recipe.verification:
        return set()
    every = state_of(activities, station, recipe, history=True, kinds=("dwell", "verification"))
    return {
        s.effect
        for effect in effects
        for s in visibilities(every, [other for other in recipe.effects if other != effect], 1.0, [effect])
        if s.seen
    }


def with_verification_hint(text: str, activities: Sequence[Activity], station: StationConfig, recipe: Recipe) -> str:
    """A sentence on effects that "cannot be identified", completed where the poses of verification show them."""
    named = [effect for effect in recipe.effects if f"{effect} cannot be identified" in text]
    checked = sorted(shown_by_verification(activities, station, recipe, named))
    return f"{text}; {', '.join(checked)}: {OF_VERIFICATION}; {REMEDY}" if checked else text


def noise_of(recipe: Recipe, device: str, density: float | None, wander: float | None) -> DwellNoise:
    """Noise of a preset, with given values instead of the preset's.

    device : preset; the recipe's device where it is empty
    density : white noise, µg/√Hz · wander : flicker floor of the Allan deviation, µg
    """
    if density is not None and wander is not None:
        return DwellNoise(density * UG, wander * UG / FLICKER_FLOOR)
    preset = load_preset(device or recipe.device)
    white = preset.sampled_density_ug(recipe.rate_hz) if density is None else density
    if wander is not None:
        return DwellNoise(white * UG, wander * UG / FLICKER_FLOOR)
    return DwellNoise(white * UG, preset.bias_instability_ug * UG, preset.rate_random_walk_ug * UG)


def plan_of_procedures(recipe: Recipe, station: StationConfig, limits: Limits | None) -> dict[str, Any]:
    """Document of a recipe without the multi-position test: its time and procedures; no effect of a sensor's model is fitted."""
    return {
        "recipe": recipe.name,
        "device": recipe.device,
        "station": station.name,
        "minutes": spent(schedule(steps(recipe), station, recipe)).document(),
        "procedures": procedure_rows(recipe, station, limits),
        "effects": [],
    }


def procedure_rows(recipe: Recipe, station: StationConfig, limits: Limits | None) -> list[dict[str, Any]]:
    """A row for each procedure of the recipe's list, in order: records, station time, equipment, figures with their limits."""
    activities = schedule(steps(recipe), station, recipe)
    asked = {} if limits is None else limits.figures
    rows: list[dict[str, Any]] = []
    for number, part in enumerate(parts_of(recipe)):
        procedure = PROCEDURES[part.kind]
        of_procedure = [activity for activity in activities if activity.step.procedure == number]
        figures = [
            {
                "figure": s.name,
                "unit": s.unit,
                "meaning": s.meaning,
                "limit": asked[s.name].text if s.name in asked else None,
            }
            for s in procedure.figures
        ]
        row = {
            "procedure": part.kind,
            "states": procedure.states,
            "records": len({activity.step.record for activity in of_procedure}),
            "minutes": round(spent(of_procedure).total, 2),
            "temperatures_C": list(dict.fromkeys(activity.step.temperature for activity in of_procedure)),
            "equipment": list(procedure.roles_for(part)),
            "figures": figures,
        }
        rows.append(row)
    return rows
