"""Poses moved in a plan: by hand, by a drag on the map, written as a recipe that reads as the same one."""

from pathlib import Path

import numpy as np
import pytest
from capture_double import recipe_file

from inertial.frames import force_from_angles
from pipelines.drawing.mollweide import project
from pipelines.jobs.moved_poses import moves_of, with_moved_poses
from pipelines.jobs.recipes import load_recipe
from pipelines.workbench.routes.plan import dragged_to, save_recipe, turned_to
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import PlanPage
from schemas.errors import RecipeInvalid, WrongUse


@pytest.fixture
def settings(tmp_path: Path) -> WorkbenchSettings:
    folder = tmp_path / "bench"
    folder.mkdir()
    return WorkbenchSettings(archive=str(tmp_path / "archive"), folder=folder, token="t")


@pytest.fixture
def page(settings: WorkbenchSettings) -> PlanPage:
    return PlanPage(recipe=recipe_file(settings.folder))


def test_a_moved_pose_is_the_only_difference_in_all_its_repetitions_and_moves_that_cannot_be_are_refused() -> None:
    recipe = load_recipe("production")
    moved = with_moved_poses(recipe, moves_of(["p05=45,-90", "v1=20,0.5", "p05=46,-90"], "plan"), "plan")
    changed = [(a, b) for a, b in zip(recipe.poses, moved.poses, strict=True) if a != b]
    assert [(b.name, b.outer_deg, b.inner_deg) for _, b in changed] == [("p05", 46.0, -90.0)]
    assert [p.inner_deg for p in moved.verification if p.name == "v1"] == [0.5] * 3
    kept = {"poses", "verification"}
    assert moved.model_dump(exclude=kept) == recipe.model_dump(exclude=kept)
    for text in ("p05", "p05=45", "p05=45,x", "p05=45,90,1", "p05=400,0", "p05=nan,0"):
        with pytest.raises(WrongUse, match="pose"):
            moves_of([text], "plan")
    with pytest.raises(WrongUse, match="no pose 'p99'"):
        with_moved_poses(recipe, {"p99": (0.0, 0.0)}, "plan")
    fit = recipe.poses[3]
    with pytest.raises(RecipeInvalid, match="of the fit"):
        with_moved_poses(recipe, {"v1": (fit.outer_deg, fit.inner_deg)}, "plan")
    flat = {pose.name: (90.0, float(k)) for k, pose in enumerate(recipe.poses)}
    with pytest.raises(RecipeInvalid, match="span"):
        with_moved_poses(recipe, flat, "plan")


def test_a_drag_turns_the_table_the_nearer_way(settings: WorkbenchSettings, page: PlanPage) -> None:
    for outer, inner in ((45.0, 100.0), (-45.0, 100.0)):
        near = turned_to(settings, page, "p3", outer + 4.0, inner + 4.0)
        x, y = project(force_from_angles(*np.radians([[outer], [inner]])))
        dragged = dragged_to(settings, near, "p3", float(x[0]), float(y[0]))
        assert dragged.pose == (f"p3={outer:g},{inner:g}",)
    with pytest.raises(WrongUse, match="outside"):
        dragged_to(settings, page, "p3", 3.0, 0.0)


def test_the_written_recipe_reads_as_the_moved_one_and_replaces_nothing(
    settings: WorkbenchSettings, page: PlanPage
) -> None:
    moved = turned_to(settings, page, "p3", 33.5, 71.25)
    place = save_recipe(settings, moved, "mine")
    read = load_recipe(str(place))
    wanted = with_moved_poses(load_recipe(page.recipe), {"p3": (33.5, 71.25)}, "plan")
    assert read.model_dump(exclude={"name"}) == wanted.model_dump(exclude={"name"})
    before = place.read_bytes()
    for name in ("mine", "production", "../there", "Big", ""):
        with pytest.raises(WrongUse):
            save_recipe(settings, moved, name)
    assert place.read_bytes() == before
