"""Visibility of effects, expected errors and station time of a recipe, before it is measured."""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.effects import SensorEffect
from inertial.errors import NotIdentified
from inertial.noise.dwells import dwell_covariance
from inertial.noise.flicker import RATIO, constants_of_means
from inertial.noise.measurands import DAY_S, against_mean, between_means, flicker_mean, walk_mean
from inertial.planning.expected import Expected, expected_errors, expected_gain
from inertial.planning.reasons import reason
from inertial.planning.visibility import SEEN, Visibility, visibilities
from inertial.state import State
from inertial.uncertainty.period import Windows, flicker_within
from pipelines.planning.context import OF_VERIFICATION, PlanContext, shown_by_verification, with_verification_hint
from pipelines.schedule.planned_state import planned_dwells
from pipelines.schedule.timing import spent
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.stages.uncertainty.reachable import PlannedDwells, at_risk, reachable, unreachable
from pipelines.stages.uncertainty.tables import LABELS
from pipelines.tables.calibration import unit_texts
from schemas.limits import Limits
from schemas.units import AXES, MICRO

NO_SWITCH_ON = "no repeatability of switching on is stated for this device"


def plan(context: PlanContext, terms: BudgetTerms | None = None, limits: Limits | None = None) -> dict[str, Any]:
    """Document of a recipe: visibility of every effect of the catalogue, expected errors, station time; keys for other programs.

    terms : what station and device state of their uncertainty; without them the document has no ``uncertainty``
    limits : that the uncertainty must allow
    Raises NotIdentified: the recipe cannot identify its own model; the message says what is missing.
    """
    recipe, noise = context.recipe, context.noise
    of_record = _of_record(context)
    expected = identified(replace(context, covariance=of_record))
    visibility = visibilities(context.state, recipe.effects, noise.error(recipe.dwell_s), covariance=context.covariance)
    fast = visibilities(
        context.state, recipe.effects, noise.white(recipe.dwell_s), [s.effect for s in visibility if s.seen]
    )
    alone = {s.effect: MICRO * s.size for s in fast if np.isfinite(s.size)}
    hidden = [s.effect for s in visibility if not s.seen]
    checked = shown_by_verification(context.activities, context.station, recipe, hidden)
    white, wander, together = (MICRO * f(recipe.dwell_s) for f in (noise.white, noise.wander, noise.error))
    return {
        "recipe": recipe.name,
        "device": recipe.device,
        "station": context.station.name,
        "model": list(recipe.effects),
        "poses": len(recipe.poses),
        "dwells": int(context.state.time.size),
        "temperatures_C": list(recipe.temperatures_C),
        "dwell_error_ug": {"white": white, "wander": wander, "together": together},
        "dwell_s": {"planned": recipe.dwell_s, "white_as_large_as_wander": noise.balanced()},
        "minutes": spent(context.activities).document(),
        "coefficients": _coefficient_rows(expected),
        "bias": _bias(context, expected, of_record, terms),
        "effects": [_row(s, context, checked) | {"floor_white_ug": alone.get(s.effect)} for s in visibility],
        **({} if terms is None else {"uncertainty": reach(context, of_record, terms, limits)}),
    }


def _of_record(context: PlanContext, verification: Array | None = None) -> Array:
    """Covariance of the dwells as a fit sees it: what changes more slowly than the record is, for the record, the bias itself.

    The walk is counted from its mean over the record, as in a fit.

    verification : (m,), s, times of dwells that follow those of the fit in the covariance
    """
    fit, length = context.state.time, context.recipe.dwell_s
    time = fit if verification is None else np.concatenate([fit, verification])
    since = float(time.min()) - 0.5 * length
    along, variance = walk_mean(time, since, float(fit.min()), float(np.ptp(fit)))
    covariance = dwell_covariance(time, length, context.noise, since=since)
    return covariance + context.noise.walk**2 * (variance - along[:, None] - along)


def _against_means(context: PlanContext, square: Array, gain: Array) -> tuple[Array, Array]:
    """Variances (k,), g², of biases as the mean of the record and, as far as the walk goes, of the day after it.

    square : (k,), variances of the coefficients; gain : (k, n), what every dwell adds to them
    """
    time, noise, length = context.state.time, context.noise, context.recipe.dwell_s
    span, first = float(np.ptp(time)), float(time.min())
    since = first - 0.5 * length
    if not span > 0.0:
        return square, square
    constants = constants_of_means(length, span + 0.5 * length)
    flicker = np.full(len(square), noise.instability**2 * constants.size * np.log(RATIO) / np.pi)
    square = square + against_mean(flicker, gain, flicker_mean(time, constants, first, span))
    walk = np.full(len(square), noise.walk**2)
    goes_on = against_mean(walk, gain, walk_mean(time, since, first + span, DAY_S))
    goes_on = goes_on - against_mean(walk, gain, walk_mean(time, since, first, span))
    return np.maximum(square, 0.0), np.maximum(square + goes_on, 0.0)


def _bias(
    context: PlanContext, expected: Expected, of_record: Array, terms: BudgetTerms | None
) -> dict[str, float | str | None] | None:
    """Standard uncertainty of the bias by measurand, of the worst axis, as the fit will state it; None without a bias.

    See :func:`pipelines.stages.uncertainty.bias_measurands.bias_measurands`.
    """
    axes, columns = np.nonzero(np.array([[effect == "bias" for effect, _ in names] for names in expected.names]))
    if not axes.size:
        return None
    gain = expected_gain(context.recipe.effects, context.state, of_record)[axes, columns]
    record, later = _against_means(context, expected.errors[axes, columns] ** 2, gain)
    span = float(np.ptp(context.state.time))
    apart = context.noise.instability * np.sqrt(between_means(span, DAY_S)) if span > 0.0 else 0.0
    long = MICRO * float(np.max(np.hypot(np.sqrt(later), apart)))
    again = None if terms is None or terms.stability is None else terms.stability.switch_on_ug
    return {
        "record_u_ug": MICRO * float(np.max(np.sqrt(record))),
        "long_u_ug": long,
        "long_s": DAY_S,
        "switch_on_u_ug": None if again is None else float(np.hypot(long, again)),
        **({"switch_on_why": NO_SWITCH_ON} if again is None else {}),
    }


def identified(context: PlanContext) -> Expected:
    """The expected standard errors of a recipe's model.

    Raises NotIdentified: the recipe cannot identify it; the message names the feature of the plan and what to add.
    """
    recipe = context.recipe
    try:
        return expected_errors(
            recipe.effects, context.state, context.covariance, units=max(1, len(recipe.units)), prior=context.prior
        )
    except NotIdentified as problem:
        text = missing(context.state, recipe.effects) or str(problem)
        text = with_verification_hint(text, context.activities, context.station, recipe)
        raise NotIdentified(f"plan {recipe.name}: {text}") from None


def missing(state: State, effects: Sequence[str]) -> str:
    """The effects of a model that its plan cannot identify beside the others, and what to add; empty where it identifies all."""
    reasons: dict[str, str] = {}
    for effect in effects:
        rest = [e for e in effects if e != effect]
        visibility = visibilities(state, rest, 1.0, [effect])
        if visibility and visibility[0].remaining_fraction <= SEEN:
            reasons[effect] = reason(state, effect, rest)
    # of mutually confounded effects only the last is reported: without it the others are identified
    mutual = len(reasons) > 1 and any(visibilities(state, ("bias",), 1.0, [e])[0].seen for e in reasons)
    chosen = list(reasons)[-1:] if mutual else list(reasons)
    return "; ".join(f"{effect} cannot be identified: {reasons[effect]}" for effect in chosen)


def _coefficient_rows(expected: Expected) -> list[dict[str, Any]]:
    """One row per coefficient and axis; parameters of the station have axis ``*``."""
    rows: list[dict[str, Any]] = []
    for letter, names, errors in zip(AXES, expected.names, expected.errors.tolist(), strict=False):
        count = Counter[str]()
        for (effect, name), error in zip(names, errors, strict=True):
            rows.append(_coefficient(effect, name, letter, error, count[effect]))
            count[effect] += 1
    shared = zip(expected.shared_names, expected.shared_errors.tolist(), strict=True)
    return [*rows, *(_coefficient(effect, name, "*", error, 0) for (effect, name), error in shared)]


def _coefficient(effect: str, name: str, axis: str, error: float, number: int) -> dict[str, Any]:
    return {
        "effect": effect,
        "name": name,
        "axis": axis,
        "uncertainty_ug": MICRO * error,
        "unit": _unit(effect, number),
    }


def _unit(effect: str, number: int) -> str:
    known = catalogue.get(effect)
    return unit_texts(known, "µg")[number] if isinstance(known, SensorEffect) else "µrad"


def _why(visibility: Visibility, context: PlanContext, checked: Collection[str]) -> str:
    """Why an effect is not visible; empty where it is."""
    if visibility.seen:
        return ""
    text = reason(context.state, visibility.effect, context.recipe.effects)
    return f"{text or visibility.breaker}; {OF_VERIFICATION}" if visibility.effect in checked else text


def _row(visibility: Visibility, context: PlanContext, checked: Collection[str]) -> dict[str, Any]:
    finite = bool(np.isfinite(visibility.floor))
    return {
        "effect": visibility.effect,
        "seen": visibility.seen,
        "left": visibility.remaining_fraction,
        "left_by_axis": list(visibility.by_axis),
        "variance_inflation": visibility.variance_inflation if visibility.remaining_fraction > 0.0 else None,
        "floor_ug": MICRO * visibility.floor if finite else None,
        "floor_unit": _unit(visibility.effect, visibility.column) if finite else None,
        "floor_size_ug": MICRO * visibility.size if finite else None,
        "typical_ug": list(catalogue.get(visibility.effect).typical_ug),
        "faint": finite and MICRO * visibility.size > catalogue.get(visibility.effect).typical_ug[1],
        "alias": list(visibility.alias),
        "alias_exact": list(visibility.exact),
        "breaker": visibility.breaker,
        "unseen_ranges": [
            {"parameter": r.parameter, "unit": r.unit, "from": r.low, "to": r.high, "text": str(r)}
            for r in visibility.unseen_ranges
        ],
        "why": _why(visibility, context, checked),
    }


def reach(context: PlanContext, covariance: Array, terms: BudgetTerms, limits: Limits | None) -> dict[str, Any] | None:
    """The uncertainties that a recipe can reach on its station; None where no uncertainty is stated.

    covariance : (n, n), of the dwells of the fit as the fit sees them, g²
    """
    if terms.stated is None:
        return None
    dwells = planned_dwells(context.recipe, context.station, context.activities)
    noise, length = context.noise, context.recipe.dwell_s
    span = float(np.ptp(dwells.fit.time)) + length
    slowest = None if terms.stability is None else terms.stability.flicker_slowest_s
    within = noise.instability * flicker_within(Windows(span, length, 0.0), slowest)
    run = MICRO * float(np.hypot(noise.white(length), within))
    joint = None if dwells.verification is None else _of_record(context, dwells.verification.time)
    planned = PlannedDwells(*dwells, covariance, run, MICRO * noise.instability, joint)
    reaches = reachable(planned, terms, context.recipe.effects)
    months = terms.certificate.validity_months
    return {
        "k": 2.0,
        "frame": terms.certificate.frame,
        "validity_months": months,
        "grade_source": terms.stated.grade_source,
        "not_stated": terms.stated.not_stated,
        "quantities": [
            {
                "quantity": quantity.quantity,
                "axis": quantity.axis,
                "unit": quantity.unit,
                "u": quantity.u,
                "expanded": 2.0 * quantity.u,
                "shares": {LABELS[name]: share for name, share in quantity.shares.items() if share >= 5e-4},
            }
            for quantity in reaches
        ],
        "unreachable": [] if limits is None else unreachable(reaches, limits, months),
        "at_risk": [] if limits is None else at_risk(reaches, limits),
        "remarks": remarks(context, terms),
    }


def remarks(context: PlanContext, terms: BudgetTerms) -> list[str]:
    """Remarks on the statement of uncertainty: soaks that are too short, temperatures of the chamber, gravity by formula."""
    stated, out = terms.stated, list[str]()
    if stated is None:
        return out
    temperatures = [terms.room_C, *context.recipe.temperatures_C]
    if stated.settling is not None and (stated.thermometer is None or stated.thermometer.measures != "device"):
        tau = max(stated.settling.tau_s)
        step = max(abs(b - a) for a, b in pairwise(temperatures))
        needed, left = tau * float(np.log(max(step / 0.1, 1.0))), step * float(np.exp(-terms.soak_min_s / tau))
        if terms.soak_min_s < needed:
            out.append(
                f"soak_min_s {terms.soak_min_s:.0f}: {needed:.0f} s needed for 0.1 K; the remainder of a step of {step:.0f} K is "
                f"{left:.2g} K"
            )
    if stated.thermometer is not None and stated.thermometer.measures == "chamber":
        out.append('thermometer measures = "chamber": its offset and the gradient to the element count in full')
    if stated.gravity is not None and stated.gravity.source == "formula":
        out.append(
            f"local gravity by the formula of 1980, u = {1e6 * stated.gravity.relative().u:.0f} ppm; a survey replaces it"
        )
    return out
