"""Parts of the search for a cheaper recipe: how many dwells, how far the poses reach, and what the textbook plan is worth."""

from dataclasses import replace

import numpy as np
import pytest
from root_process import ROOT

from inertial.frames import force_from_angles
from inertial.noise.dwells import DwellNoise, dwell_covariance
from pipelines.jobs.model_files import STARTING_MODEL
from pipelines.jobs.recipes import load_recipe
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.lower_bound import lower_bound
from pipelines.planning.optimise import RecipeSearch
from pipelines.planning.plan import identified
from pipelines.planning.requirement import Requirement, candidates
from pipelines.planning.textbook import reference_errors, textbook
from pipelines.planning.timed_design import FEWEST, PlanDesign, TimedDesign, fewest_dwells, smallest_passing, spanned
from schemas.recipe import Recipe
from schemas.station import load_station

STATION = load_station()
NOISE = DwellNoise(25e-6, 300e-6, 4e-6)
ANALOGUE = ROOT / "deploy" / "recipes" / "analogue.toml"


BASE = load_recipe().model_copy(update={"effects": list(STARTING_MODEL), "static_record_s": 0.0})
DESIGN = PlanDesign((25.0, -10.0, 60.0, 25.0), (6,) * 4, 2.0)


def against(recipe: Recipe) -> PlanContext:
    """The textbook plan of a recipe."""
    return plan_context(textbook(recipe, (-10.0, 60.0)), STATION, NOISE)


@pytest.fixture(scope="module")
def timed():
    context = against(BASE)
    requirement = Requirement(reference_errors(context, BASE), (), (-10.0, 60.0), candidates(STATION))
    return TimedDesign(BASE, STATION, NOISE, requirement, slowest=float(context.state.time[-1]))


@pytest.mark.parametrize("axes", [1, 2])
def test_only_axes_with_an_output_are_designed_for(timed: TimedDesign, axes: int) -> None:
    """In every part of the search, the axes of a device with fewer have the numbers of these axes of a triad."""
    recipe = timed.recipe.model_copy(update={"sensor_axes": axes})
    requirement = replace(timed.requirement, errors=timed.requirement.errors[:axes])
    fewer = TimedDesign(recipe, STATION, NOISE, requirement, slowest=timed.slowest)
    assert np.allclose(fewer.ratio_and_seconds(DESIGN)[0], timed.ratio_and_seconds(DESIGN)[0][:axes])
    assert np.array_equal(fewer.pose_independent(), timed.pose_independent()[:axes])
    (slots, choice), (of_three, _) = fewer.slots(DESIGN), timed.slots(DESIGN)
    assert np.allclose(slots.matrix(choice), of_three.matrix(choice)[:axes])
    search = RecipeSearch(recipe, against(recipe), requirement)
    assert search.reached(search.designed(DESIGN)).shape == requirement.errors.shape
    assert lower_bound(recipe, against(recipe), requirement) is not None


def test_a_prior_counts_as_information_in_every_part_of_the_search(timed: TimedDesign) -> None:
    """One as precise as the required errors halves the variance that is needed; one of no precision changes nothing."""
    errors = timed.requirement.errors
    whole = np.stack([np.diag(1.0 / row**2) for row in errors])
    bounds, found = [], []
    for prior in (None, 0.0 * whole, whole):
        requirement = replace(timed.requirement, prior=prior)
        search = RecipeSearch(BASE, against(BASE), requirement)
        slots, choice = search.timed.slots(DESIGN)
        context = plan_context(BASE, STATION, NOISE, prior=prior)
        bounds.append(lower_bound(BASE, against(BASE), requirement).share)
        value = requirement.objective(slots.matrix(choice))
        found.append((search.timed.ratio_and_seconds(DESIGN)[0], identified(context).errors, float(value)))
    for one, other in zip(found[0], found[1], strict=True):
        assert np.allclose(one, other)
    assert np.all(found[2][0] < 1.0)
    assert np.all(found[2][1] < np.minimum(errors, found[0][1]))
    assert found[2][2] < found[0][2]
    assert bounds[2] < bounds[1] == bounds[0]


def test_no_soak_has_a_dwell_too_many(timed: TimedDesign) -> None:
    made, allowed = replace(DESIGN, counts=()), np.full((3, 6), 1.4)
    design = fewest_dwells(timed, made, allowed)
    assert np.all(timed.ratio_and_seconds(design)[0] <= allowed)
    assert len(set(design.counts)) > 1
    assert fewest_dwells(timed, made, np.full((3, 6), 0.05)) is None  # none is enough
    assert [smallest_passing(lambda n: n >= 7, 1, most) for most in (20, 6)] == [7, None]
    for soak, count in enumerate(design.counts):
        fewer = list(design.counts)
        fewer[soak] -= 1
        assert count == FEWEST or np.any(timed.ratio_and_seconds(replace(design, counts=tuple(fewer)))[0] > allowed)


def test_the_table_of_flicker_gives_the_covariance_of_dwells(timed: TimedDesign) -> None:
    time = np.sort(np.random.default_rng(3).uniform(900.0, 8000.0, 40)).round(1) + 20.0 * np.arange(40)
    exact = dwell_covariance(time, 2.0, NOISE, slowest=timed.slowest)
    assert timed.covariance(time, 2.0) == pytest.approx(exact, rel=1e-4)


def test_a_plan_that_reaches_too_little_is_widened_by_few_poses():
    force = force_from_angles(*np.radians(candidates(STATION)).T)
    flat = np.flatnonzero(np.abs(force[:, 2]) < 0.4)[:8].astype(np.intp)
    fixed = np.zeros(8, dtype=bool)
    fixed[[0, 7]] = True
    choice = spanned(force, flat, fixed, 1.4, 3)
    assert np.ptp(force[flat], axis=0).min() < 1.4 <= np.ptp(force[choice], axis=0).min()
    assert np.array_equal(choice[fixed], flat[fixed])
    assert np.array_equal(spanned(force, flat, fixed, 1.4, 2), flat)  # z has no output


def test_what_the_textbook_plan_cannot_identify_is_wanted_as_the_recipe_knows_it():
    recipe = load_recipe(str(ANALOGUE))
    noise = DwellNoise(280e-6)
    errors = reference_errors(plan_context(textbook(recipe, recipe.temperatures_C), STATION, noise), recipe)
    own = identified(plan_context(recipe, STATION, noise)).errors
    assert errors[:, -1] == pytest.approx(own[:, -1])
    assert np.all(errors[:, :-1] < own[:, :-1])
