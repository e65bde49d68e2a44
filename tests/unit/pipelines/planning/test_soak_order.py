"""The order of soaks and poses with which a recipe is known first: the same dwells, and no later than as given."""

from collections import Counter

import numpy as np
import pytest
from long_suites import mostly_slow

from inertial import design
from inertial.poses import plan
from pipelines.jobs.recipes import load_recipe
from pipelines.planning.context import PlanContext, noise_of, plan_context
from pipelines.planning.plan import identified
from pipelines.planning.requirement import numbered
from pipelines.planning.soak_order import known_after, look_counts, ordered
from schemas.errors import RecipeInvalid
from schemas.poses import SoakPart
from schemas.recipe import Recipe
from schemas.station import load_station

UP_AND_DOWN = [-10.0, 25.0, 60.0, 25.0, -10.0]


def planned(heat: list[float], **changes: object) -> PlanContext:
    update = {
        "effects": ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"],
        "poses": numbered("p", plan("twelve")),
        "temperatures_C": heat,
        "static_record_s": 0.0,
        "verification": [],
        **changes,
    }
    recipe = load_recipe().model_copy(update=update)
    return plan_context(recipe, load_station(), noise_of(recipe, recipe.device, None, None))


def dwells(recipe: Recipe) -> Counter[tuple[float, str]]:
    return Counter((t, pose.name) for k, t in enumerate(recipe.temperatures_C) for pose in recipe.poses_at(k))


@pytest.fixture(scope="module")
def context() -> PlanContext:
    return planned(UP_AND_DOWN)


@pytest.mark.parametrize("factor", mostly_slow([1.3, 2.5], 2.5))
def test_the_same_dwells_are_known_no_later(context: PlanContext, factor: float) -> None:
    required = factor * identified(context).errors
    found = ordered(context, required)
    assert dwells(found.recipe) == dwells(context.recipe)
    assert found.before == known_after(context, required)
    assert found.until <= found.before
    again = plan_context(found.recipe, context.station, context.noise)
    assert found.until == known_after(again, required)


def test_little_that_is_asked_needs_both_ends_alone_and_what_the_whole_plan_reaches_its_end(
    context: PlanContext,
) -> None:
    """By hand: nothing is asked but a model that is determined; the way over both ends is shortest from one to the other."""
    found = ordered(context, np.full_like(identified(context).errors, np.inf))
    assert set(found.recipe.temperatures_C[:2]) == {-10.0, 60.0}
    assert found.until < 0.6 * context.minutes
    errors = identified(context).errors
    assert known_after(context, 1.001 * errors) == context.minutes
    assert known_after(context, 0.999 * errors) is None


def test_no_look_comes_before_both_ends_of_the_range_or_rests_on_a_single_dwell(context: PlanContext) -> None:
    counts = look_counts(context.activities, context.station, context.recipe)
    assert 24 < counts[0] <= 30  # the third soak of twelve has begun
    assert counts[-1] < 60
    columns = design.local_columns(
        design.split(context.recipe.effects)[0], context.state, design.starting_values([], context.state)
    )
    first = look_counts(context.activities, context.station, context.recipe)[0]
    hat = [h @ np.linalg.pinv(h) for h in columns[:, :first]]
    assert max(np.max(np.diagonal(one)) for one in hat) <= 0.5
    before = [h @ np.linalg.pinv(h) for h in columns[:, : first - 1]]
    assert max(np.max(np.diagonal(one)) for one in before) > 0.5


def test_poses_with_waits_keep_their_order_and_ramps_are_refused() -> None:
    waits = [float(k) for k in range(12)]
    soaks = [SoakPart(temperature_C=t, poses=list(range(1, 13)), waits_s=waits) for t in (-10.0, 60.0)]
    context = planned([-10.0, 60.0], soaks=soaks)
    found = ordered(context, np.full_like(identified(context).errors, np.inf))
    assert all(part.poses == list(range(1, 13)) for part in found.recipe.soaks)
    soaks = [SoakPart(temperature_C=t, poses=list(range(1, 13)), settled=False) for t in (60.0, -10.0)]
    context = planned([60.0, -10.0], soaks=soaks)
    with pytest.raises(RecipeInvalid, match="measures on ramps"):
        ordered(context, identified(context).errors)
