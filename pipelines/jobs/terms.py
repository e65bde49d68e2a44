"""What a job states of its uncertainty, and what is refused before anything moves, such as poses out of the station's range."""

from pathlib import Path
from typing import Any

import numpy as np

from inertial.planning.visibility import visibilities
from pipelines.jobs.model_files import refuse_unknown_effects
from pipelines.jobs.recipes import load_limits, lot_of, units_of
from pipelines.procedures import refuse_unusable
from pipelines.schedule.planned_state import planned_dwells, planned_state
from pipelines.stages.grade import refuse_limits_without_figures
from pipelines.stages.uncertainty.budget_terms import BudgetTerms, terms_of
from pipelines.stages.uncertainty.contributions import merged
from pipelines.stages.uncertainty.measurands import EFFECTS
from pipelines.stages.uncertainty.reachable import PlannedDwells, reachable, unreachable
from schemas.errors import RecipeInvalid, TumblelineError
from schemas.limits import VALIDITY_MONTHS, Limits
from schemas.recipe import Recipe
from schemas.reference import Reference
from schemas.station import Pace, StationConfig, refuse_untraced
from schemas.uncertainty import Uncertainty

GRAVITY_SIGMAS = 3.0


def budget_terms(recipe: Recipe, station: Any, limits: Limits | None) -> BudgetTerms:
    """The terms of a job's budget; the station of an archived job may be its document, as it was written."""
    stated, pace, given = (getattr(station, name, None) for name in ("uncertainty", "pace", "reference"))
    stated = None if stated is None else Uncertainty.model_validate(stated)
    references = [Reference.model_validate(reference) for reference in given or []]
    room = Pace.model_validate(pace or {}).room_C
    months = VALIDITY_MONTHS if limits is None else limits.longest_validity_months
    return terms_of(recipe, stated, references, room, months)


def planned_terms(recipe: Recipe, station: StationConfig, limits: Limits | None) -> BudgetTerms:
    """The terms of a recipe that is planned on a station."""
    return budget_terms(with_stability(recipe, station), station, limits)


def refuse_unreachable(recipe: Recipe, station: StationConfig, limits: Limits) -> None:
    """Refuse limits that the stated references and the stability of the device cannot meet, before anything moves.

    The noise of the device is left out: what is refused here would fail with a device of no noise.
    """
    terms = planned_terms(recipe, station, limits)
    if terms.stated is None or not recipe.tumbles:
        return  # without the multi-position test no figure rests on the budget
    planned = without_noise(recipe, station)
    wrong = unreachable(reachable(planned, terms, recipe.effects), limits, terms.certificate.validity_months)
    if wrong:
        raise RecipeInvalid(
            f"recipe {recipe.name} on station {station.name}: no unit can meet its limits, noise of the device left out: "
            f"{'; '.join(wrong)}; nothing was moved; raise the limits in {recipe.limits}, or lower the uncertainty of the "
            f"largest contribution in [uncertainty]{_supply_not_measured(terms)} (see 'tumbleline plan')",
            key="limits",
        )


def asked_of_noise(recipe: Recipe, station: StationConfig, limits: Limits) -> dict[str, float]:
    """Standard errors by noise that ``[stop]`` of a recipe leaves beside the stated references, by effect, µg per unit.

    Raises RecipeInvalid: the references alone exceed an uncertainty that is asked for, so that the lot would never end early.
    """
    asked = {} if recipe.stop is None else recipe.stop.asked
    terms = planned_terms(recipe, station, limits)
    references = dict.fromkeys(asked, 0.0)
    if asked and terms.stated is not None:
        for reach in reachable(without_noise(recipe, station), terms, recipe.effects):
            if reach.quantity in references:
                references[reach.quantity] = max(references[reach.quantity], reach.u)
    allowed = {
        effect: (value / limits.coverage_factor) ** 2 - references[effect] ** 2 for effect, value in asked.items()
    }
    for effect in (effect for effect, square in allowed.items() if square <= 0.0):
        unit, least = EFFECTS[effect], limits.coverage_factor * references[effect]
        raise RecipeInvalid(
            f"recipe {recipe.name} on station {station.name}: [stop] asks for U = {asked[effect]:g} {unit} of {effect}, the "
            f"references alone have U = {least:.3g} {unit}; write a "
            "larger U in [stop], or lower the uncertainty of the references (see 'tumbleline plan')",
            key="stop",
        )
    return {effect: float(np.sqrt(square)) for effect, square in allowed.items()}


def refuse_unusable_stop(recipe: Recipe, station: StationConfig, limits: Limits) -> None:
    """Refuse a ``[stop]`` that could never end the lot, or of which a key could never do what it says.

    Raises RecipeInvalid: it has no poses, asks for effects that the dwells can never show, for less than the references allow,
    or for dwells no longer than planned.
    """
    terms = recipe.stop
    if terms is None:
        return
    if not recipe.tumbles:
        raise RecipeInvalid(
            f"recipe {recipe.name}: [stop] ends the multi-position test, its procedures have none; remove it",
            key="stop",
        )
    refuse_unknown_effects(terms.visible, "stop.visible")
    if fitted := [effect for effect in terms.visible if effect in recipe.effects]:
        raise RecipeInvalid(
            f"recipe {recipe.name}: key 'stop.visible': {', '.join(fitted)} in the model, effects beside it are needed; ask for "
            "an uncertainty in [stop], or leave it out",
            key="stop.visible",
        )
    if terms.visible:
        rows = visibilities(planned_state(recipe, station, history=True), recipe.effects, 1.0, terms.visible)
        if unseen := [row.effect for row in rows if not row.seen]:
            raise RecipeInvalid(
                f"recipe {recipe.name}: key 'stop.visible': the whole plan does not show {', '.join(unseen)}, the lot "
                "would never end early; leave it out, or change poses or soaks (see 'tumbleline plan')",
                key="stop.visible",
            )
    if terms.longest_dwell_s is not None and terms.longest_dwell_s < recipe.dwell_s:
        raise RecipeInvalid(
            f"recipe {recipe.name}: key 'stop.longest_dwell_s': {terms.longest_dwell_s:g} s, dwell_s is {recipe.dwell_s:g} s; "
            "at least that is needed",
            key="stop.longest_dwell_s",
        )
    asked_of_noise(recipe, station, limits)


def without_noise(recipe: Recipe, station: StationConfig) -> PlannedDwells:
    """The dwells that a recipe plans, of a device of no noise: their weights are alike, and nothing is added to them."""
    dwells = planned_dwells(recipe, station)
    weights = 1e-24 * np.eye(dwells.fit.time.size)
    return PlannedDwells(*dwells, covariance=weights, run_ug=0.0, instability_ug=0.0)


def _supply_not_measured(terms: BudgetTerms) -> str:
    """Advice for a device whose output follows a supply that is not measured; empty for other devices."""
    supply = None if terms.stated is None else terms.stated.supply
    if supply is None or terms.stability is None or terms.stability.ratiometric == 0.0 or supply.ratio_measured:
        return ""
    return "; the output follows the supply: measure that of each slot, supply = { u_ppm = …, ratio_measured = true }"


def with_stability(recipe: Recipe, station: StationConfig) -> Recipe:
    """The recipe with the stability of its device's preset, on a simulated station with a budget; else as it is."""
    stated = merged(station.uncertainty, recipe.uncertainty)
    if recipe.stability is not None or station.simulation is None or stated is None:
        return recipe
    from stations.plant.preset import load_preset  # a station of hardware has no plant

    preset = load_preset(recipe.device, station.simulation.preset_overrides)
    stability = preset.stability
    if stability is not None and preset.zero_level > 0.0:
        electrical = {"supply_V": preset.supply_V, "zero_level_g": preset.zero_level / preset.scale}
        stability = stability.model_copy(update=electrical)
    return recipe.model_copy(update={"stability": stability})


def refuse_contradictions(recipe: Recipe, station: StationConfig) -> None:
    """Refuse a recipe whose entries are not traced, whose local gravity is not the station's, or that lacks its nominal supply.

    Raises RecipeInvalid: with the key.
    """
    if recipe.uncertainty is not None:
        try:
            refuse_untraced(recipe.uncertainty, station.reference, simulated=station.kind == "simulated")
        except ValueError as problem:
            raise RecipeInvalid(f"recipe {recipe.name}: {problem}", key="uncertainty") from None
    stated, stability = merged(station.uncertainty, recipe.uncertainty), recipe.stability
    measured = stated is not None and stated.supply is not None and stated.supply.ratio_measured
    if stability is not None and stability.ratiometric > 0.0 and stability.supply_V is None and measured:
        raise RecipeInvalid(
            f"recipe {recipe.name}: key 'stability.supply_V': missing, station {station.name} measures the supply that the "
            "output follows, and the nominal one is needed; add supply_V = … in V to [stability]",
            key="stability.supply_V",
        )
    if stated is None or stated.gravity is None:
        return
    value, u = stated.gravity.value, stated.gravity.relative().u
    apart = recipe.local_gravity_m_s2 / value - 1.0
    if abs(apart) > GRAVITY_SIGMAS * u and not stated.gravity.exact:
        raise RecipeInvalid(
            f"recipe {recipe.name}: key 'local_gravity_m_s2': {recipe.local_gravity_m_s2:g} m/s², station {station.name} states "
            f"{value:.8g} m/s² ± {2e6 * u:.2g} ppm (k = 2), they differ by {1e6 * apart:.0f} ppm; use the station's value",
            key="local_gravity_m_s2",
        )


def refuse_other_outputs(recipe: Recipe, station: StationConfig) -> None:
    """Refuse, on a simulated station, an unknown device, and a number of axes that it cannot have; slots tell it on hardware."""
    if station.simulation is not None:
        from stations.plant.preset import load_preset  # a station of hardware has no plant

        load_preset(recipe.device, station.simulation.preset_overrides).with_axes(recipe.sensor_axes)


def refuse_missing_full(recipe: Recipe, folder: Path) -> None:
    """Refuse a full plan of ``[prior]`` that is not there; ``folder``: where it is looked for first."""
    if recipe.prior is not None and (name := recipe.prior.full):
        try:
            units_of(str(folder / name) if (folder / name).is_file() else name)
        except RecipeInvalid as problem:
            raise RecipeInvalid(f"recipe {recipe.name}: key 'prior.full': {problem}", key="prior.full") from None


def refuse_beyond_station(recipe: Recipe, station: StationConfig) -> None:
    """Refuse temperatures, °C, angles, degrees, and rates, Hz, outside of the limits of the station.

    Raises RecipeInvalid: names the key, the first value outside, and the range
    """
    limits = station.limits
    static = [recipe.static_temperature_C] if recipe.static_record_s > 0.0 else []
    chosen = [*recipe.poses, *recipe.verification, recipe.static_pose]
    for key, values, (low, high), unit, owner in (
        ("temperatures_C", recipe.temperatures_C, limits.temperature_C, "°C", "chamber"),
        ("static_temperature_C", static, limits.temperature_C, "°C", "chamber"),
        ("poses (outer)", [p.outer_deg for p in chosen], limits.outer_deg[:2], "°", "table"),
        ("poses (inner)", [p.inner_deg for p in chosen], limits.inner_deg[:2], "°", "table"),
        ("rate_hz", [recipe.rate_hz], (0.0, limits.rate_hz), "Hz", "reader"),
    ):
        outside = [value for value in values if not low <= value <= high]
        if outside:
            raise RecipeInvalid(
                f"recipe: key '{key}': {outside[0]:g} {unit}, the {owner} of station {station.name} reaches {low:g} to "
                f"{high:g} {unit}; change the recipe, or measure on another station",
                key=key.split(" ", 1)[0],
            )


def refused_by_run(recipe: Recipe, station: StationConfig, folder: Path) -> list[str]:
    """What 'tumbleline run' refuses in a recipe that can be planned: limits, serials, ranges of the station, ``[stop]``.

    folder : where a limits file that the recipe names is looked for
    """
    messages: list[str] = []
    for check in (
        lambda: load_limits(recipe, folder),
        # without units in the recipe they are given to the run
        lambda: lot_of(recipe, ()) if recipe.units else None,
        lambda: refuse_limits_without_figures(load_limits(recipe, folder), with_stability(recipe, station)),
        lambda: refuse_contradictions(recipe, station),
        lambda: refuse_other_outputs(recipe, station),
        lambda: refuse_beyond_station(recipe, station),
        lambda: refuse_unusable(recipe, station),
        lambda: refuse_unusable_stop(recipe, station, load_limits(recipe, folder)),
    ):
        try:
            check()
        except TumblelineError as problem:
            if str(problem) not in messages:  # limits that are missing are missed by each check that reads them
                messages.append(str(problem))
    return messages
