"""`diagnose --next`: the proposed measurement as a recipe that `plan` accepts."""

import json
from pathlib import Path

import pytest
from in_process import given
from typer.testing import CliRunner

from benchmarks.truth import Spec, make_run
from pipelines.cli import app
from pipelines.diagnosis.next_recipe import next_recipe
from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe
from schemas.errors import RecipeInvalid

PLAIN = "bias,scale,misalignment"
LINE_SIX = Path(__file__).resolve().parents[2] / "deploy" / "recipes" / "line-six.toml"
STEP = {"outer_deg": 45.0, "inner_deg": 30.0, "chamber_C": 25.1, "why": "a | b", "wait_s": 2.0, "soaked": True}


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dwells on six faces with a square term, which no face separates from a fourth order."""
    folder = tmp_path_factory.mktemp("six")
    spec = Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=4)
    make_run(spec, 5).dwells.to_parquet(folder / "dwells.parquet")
    return folder


def test_the_proposed_steps_are_a_recipe_that_plan_and_run_accept_and_that_separates_the_class(
    six: Path, tmp_path: Path
) -> None:
    target = tmp_path / "next.toml"
    words = ["diagnose", str(six / "dwells.parquet"), "--effects", PLAIN, "--json"]
    result = CliRunner().invoke(app, [*words, "--next", str(target), "--recipe", str(LINE_SIX)])
    assert result.exit_code == 1, result.output
    steps = [row for row in json.loads(result.stdout)["next_measurements"] if row.get("measurable", True)]
    assert steps

    recipe = load_recipe(str(target))
    assert len(recipe.poses_at(0)) == 6 + sum(row.get("repeats", 1) for row in steps)
    assert recipe.effects == PLAIN.split(",")
    begun = (
        Request(recipe=str(target)).job().recipe
    )  # what 'run' begins with; the station adds what it states of the device
    assert begun.model_copy(update={"stability": recipe.stability}) == recipe

    before, after = (planned(path) for path in (LINE_SIX, target))
    assert "fourth_order" in exact_aliases(before)  # on faces fi² and fi⁴ are one column
    assert "fourth_order" not in exact_aliases(after)
    assert after["minutes"]["total"] > before["minutes"]["total"]


def exact_aliases(plan: dict) -> list[str]:
    """Effects that no data of the plan separate from the square term."""
    return next(entry["alias_exact"] for entry in plan["effects"] if entry["effect"] == "second_order")


def planned(recipe: Path) -> dict:
    result = CliRunner().invoke(app, ["plan", str(recipe), "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_dwells_of_a_file_need_their_recipe(six: Path, tmp_path: Path) -> None:
    status, _, err = given("diagnose", six / "dwells.parquet", "--next", tmp_path / "next.toml")
    assert status == 2
    assert "add --recipe FILE" in err
    assert list(tmp_path.iterdir()) == []


def test_steps_at_the_same_temperature_join_the_soak_and_others_begin_one(six: Path) -> None:
    base = load_recipe(str(LINE_SIX))
    rows = [
        {**STEP, "repeats": 2},
        {**STEP, "chamber_C": 60.0, "wait_s": 30.0, "off_s": 120.0},
        {**STEP, "measurable": False, "outer_deg": 1.0},
        {**STEP, "chamber_C": 0.0, "soaked": False, "outer_deg": base.poses[0].outer_deg,
         "inner_deg": base.poses[0].inner_deg},
    ]  # fmt: skip
    recipe = next_recipe(base, rows, "Next one")
    assert recipe.name == "next-one"
    assert recipe.temperatures_C == [25.0, 60.0, 0.0]
    assert [len(recipe.poses_at(k)) for k in range(3)] == [8, 1, 1]
    assert recipe.poses_at(2)[0] == base.poses[0]
    assert (recipe.waits_at(1), recipe.off_at(1)) == ([30.0], [120.0])
    assert [recipe.settles_at(k) for k in range(3)] == [True, True, False]
    assert [len(recipe.verification_at(k)) for k in range(3)] == [2, 0, 0]
    assert len(recipe.poses) == 7


def test_a_step_that_no_recipe_can_have_is_refused(six: Path) -> None:
    with pytest.raises(RecipeInvalid):
        next_recipe(load_recipe(str(LINE_SIX)), [{**STEP, "chamber_C": 1e6}], "next")
