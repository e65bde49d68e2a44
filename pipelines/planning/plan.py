"""What a recipe can see, how well, and what it costs, before any chamber time is spent."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from inertial import effects as catalogue
from inertial.effects import SensorEffect
from inertial.errors import NotIdentified
from inertial.noise.dwells import dwell_covariance
from inertial.noise.measurands import DAY_S, between_means
from inertial.planning.expected import expected_errors
from inertial.planning.reasons import reason
from inertial.planning.visibility import SEEN, sights
from pipelines.schedule.planned_state import state_of
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import schedule, spent
from pipelines.tables.calibration import unit_texts
from schemas.units import AXES, MICRO

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from inertial.noise.dwells import DwellNoise
    from inertial.planning.expected import Expected
    from inertial.planning.visibility import Visibility
    from inertial.state import State
    from pipelines.schedule.timing import Activity
    from schemas.recipe import Recipe
    from schemas.station import StationConfig


@dataclass(frozen=True)
class PlanContext:
    """A recipe as a station will go through it: what is done when, the dwells of the fit, the covariance of their means in g²."""

    recipe: Recipe
    station: StationConfig
    noise: DwellNoise
    stretches: list[Activity]
    state: State
    covariance: NDArray[np.float64]


def plan_context(recipe: Recipe, station: StationConfig, noise: DwellNoise, *, slowest: float = 0.0) -> PlanContext:
    """A recipe on a station, with devices of this noise; ``slowest`` as in :func:`inertial.noise.dwells.dwell_covariance`."""
    whole = schedule(steps(recipe), station, recipe)
    state = state_of(whole, station, recipe, history=True)
    covariance = dwell_covariance(state.time, recipe.dwell_s, noise, slowest=slowest)
    return PlanContext(recipe, station, noise, whole, state, covariance)


def plan(plan: PlanContext) -> dict[str, Any]:
    """How a recipe sees every effect of the catalogue, as a document with the keys that other programs read.

    Raises
    ------
    NotIdentified
        The recipe cannot identify its own model; the message says what is missing.
    """
    recipe, noise = plan.recipe, plan.noise
    expected = identified(replace(plan, covariance=_of_record(plan)))
    found = sights(plan.state, recipe.effects, noise.error(recipe.dwell_s), covariance=plan.covariance)
    white, wander, together = (MICRO * f(recipe.dwell_s) for f in (noise.white, noise.wander, noise.error))
    return {
        "recipe": recipe.name,
        "device": recipe.device,
        "station": plan.station.name,
        "model": list(recipe.effects),
        "poses": len(recipe.poses),
        "dwells": int(plan.state.time.size),
        "temperatures_C": list(recipe.temperatures_C),
        "dwell_error_ug": {"white": white, "wander": wander, "together": together},
        "dwell_s": {"planned": recipe.dwell_s, "white_as_large_as_wander": noise.balanced()},
        "minutes": spent(plan.stretches).document(),
        "coefficients": _coefficient_rows(expected),
        "bias": _bias(plan, expected),
        "effects": [_row(s, plan.state, recipe.effects) for s in found],
    }


def _of_record(plan: PlanContext) -> NDArray[np.float64]:
    """Covariance of the dwells as a fit sees it: what changes more slowly than the record is, for the record, the bias itself."""
    time, length = plan.state.time, plan.recipe.dwell_s
    return dwell_covariance(time, length, plan.noise, since=float(time.min()) - 0.5 * length)


def _bias(plan: PlanContext, expected: Expected) -> dict[str, float | None] | None:
    """Standard uncertainty of the bias by measurand, of the worst axis, as the fit will state it; None for a model without one.

    See :func:`pipelines.stages.bias_measurands.bias_measurands`.
    """
    own = [
        float(expected.errors[axis, k])
        for axis, names in enumerate(expected.names)
        for k, (effect, _) in enumerate(names)
        if effect == "bias"
    ]
    if not own:
        return None
    span = float(np.ptp(plan.state.time))
    apart = plan.noise.instability * np.sqrt(between_means(span, DAY_S)) if span > 0.0 else 0.0
    return {
        "record_u_ug": MICRO * max(own),
        "long_u_ug": MICRO * float(np.hypot(max(own), apart)),
        "long_s": DAY_S,
        "switch_on_u_ug": None,
    }


def identified(plan: PlanContext) -> Expected:
    """The errors expected of a recipe's model; refused, in the user's words, where the recipe cannot identify it."""
    units = max(1, len(plan.recipe.units))
    try:
        return expected_errors(plan.recipe.effects, plan.state, plan.covariance, units=units)
    except NotIdentified as problem:
        raise NotIdentified(f"plan {plan.recipe.name}: {missing(plan.state, plan.recipe.effects) or problem}") from None


def missing(state: State, effects: Sequence[str]) -> str:
    """Which effects of a model its plan cannot identify beside the others, and what is to be added; empty where it can all."""
    poor: dict[str, str] = {}
    for effect in effects:
        rest = [e for e in effects if e != effect]
        sight = sights(state, rest, 1.0, [effect])
        if sight and sight[0].left <= SEEN:
            poor[effect] = reason(state, effect, rest)
    # of effects that hide behind one another the last is the one too many
    chosen = list(poor)[-1:] if len(poor) > 1 and not _alone(state, poor) else list(poor)
    return "; ".join(f"{effect} cannot be identified: {poor[effect]}" for effect in chosen)


def _alone(state: State, poor: dict[str, str]) -> bool:
    """Whether every one of the effects is invisible by itself, not only beside the others."""
    return all(not sights(state, ("bias",), 1.0, [effect])[0].seen for effect in poor)


def _coefficient_rows(expected: Expected) -> list[dict[str, Any]]:
    """One row per coefficient and axis; what all units share has axis ``*``."""
    rows: list[dict[str, Any]] = []
    for axis, letter in enumerate(AXES):
        place: dict[str, int] = {}
        for column, (effect, name) in enumerate(expected.names[axis]):
            k = place.setdefault(effect, 0)
            place[effect] += 1
            rows.append(_coefficient(effect, name, letter, float(expected.errors[axis, column]), k))
    shared = zip(expected.shared_names, expected.shared_errors.tolist(), strict=True)
    return [*rows, *(_coefficient(effect, name, "*", error, 0) for (effect, name), error in shared)]


def _coefficient(effect: str, name: str, axis: str, error: float, place: int) -> dict[str, Any]:
    return {
        "effect": effect,
        "name": name,
        "axis": axis,
        "uncertainty_ug": MICRO * error,
        "unit": _unit(effect, place),
    }


def _unit(effect: str, place: int) -> str:
    """Unit of an effect's coefficient."""
    known = catalogue.get(effect)
    return unit_texts(known, "µg")[place] if isinstance(known, SensorEffect) else "µrad"


def _row(sight: Visibility, state: State, model: Sequence[str]) -> dict[str, Any]:
    finite = bool(np.isfinite(sight.floor))
    return {
        "effect": sight.effect,
        "seen": sight.seen,
        "left": sight.left,
        "left_by_axis": list(sight.by_axis),
        "variance_inflation": sight.variance_inflation if sight.left > 0.0 else None,
        "floor_ug": MICRO * sight.floor if finite else None,
        "floor_unit": _unit(sight.effect, sight.column) if finite else None,
        "floor_size_ug": MICRO * sight.size if finite else None,
        "typical_ug": list(catalogue.get(sight.effect).typical_ug),
        "faint": finite and MICRO * sight.size > catalogue.get(sight.effect).typical_ug[1],
        "alias": list(sight.alias),
        "alias_exact": list(sight.exact),
        "breaker": sight.breaker,
        "why": "" if sight.seen else reason(state, sight.effect, model),
    }
