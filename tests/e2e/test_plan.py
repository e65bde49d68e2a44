"""`tumbleline plan` from the command line: what other programs read, and what it refuses."""

import json
import re
from datetime import UTC, datetime
from pathlib import Path

import pytest
from typer.testing import CliRunner

from inertial.errors import NotIdentified
from pipelines.archive import Archive
from pipelines.cli import app
from pipelines.jobs.model_change import change_from_options
from pipelines.jobs.releases import release
from schemas.errors import RecipeInvalid, WrongUse

RECIPE = """
name = "faces"
device = "adxl355"
local_gravity_m_s2 = 9.80665
poses = "six"
temperatures_C = [25.0]
effects = ["bias", "scale", "misalignment"]
"""
KEYS = {"effect", "seen", "left", "variance_inflation", "floor_ug", "alias", "breaker"}


def planned(*words: object) -> dict:
    """The document of a plan."""
    done = CliRunner().invoke(app, ["plan", *map(str, words), "--json"])
    assert done.exit_code == 0, done.exception
    return json.loads(done.stdout)


@pytest.fixture(scope="module")
def seen(tmp_path_factory) -> dict:
    """What the plan of six faces says of every effect."""
    path = tmp_path_factory.mktemp("seen") / "faces.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return {row["effect"]: row for row in planned(path)["effects"]}


@pytest.fixture
def faces(tmp_path):
    path = tmp_path / "faces.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def test_plan_says_for_every_effect_whether_six_faces_see_it_and_what_hides_it(seen):
    assert all(set(row) >= KEYS for row in seen.values())
    square, cross = seen["second_order"], seen["cross_coupling"]
    assert square["seen"]
    assert square["left"] == pytest.approx(0.82, abs=0.01)
    assert {"scale_asymmetry", "fourth_order"} <= set(square["alias"])
    assert square["why"] == ""
    assert not cross["seen"]
    assert cross["floor_ug"] is None
    assert "45" in cross["breaker"] or "90" in cross["breaker"]
    assert "β in 90° steps" in cross["why"]
    assert "add poses at β = 45°" in cross["why"]


def test_a_floor_comes_with_its_unit_and_with_what_an_effect_of_that_size_adds(seen):
    square, shaken = seen["second_order"], seen["vibration_rectification"]
    assert square["floor_unit"] == "µg/g²"
    # K2·fx² is 1 in two of six faces and 0 in the others
    assert square["floor_size_ug"] == pytest.approx(square["floor_ug"] / 3**0.5, rel=1e-3)
    assert shaken["floor_unit"] == "µg/g²"
    assert shaken["floor_size_ug"] < 1e-3 * shaken["floor_ug"]


def test_plan_marks_what_would_have_to_be_larger_than_it_ever_is():
    rows = planned("production")["effects"]
    faint = {row["effect"] for row in rows if row["seen"] and row["floor_size_ug"] > row["typical_ug"][1]}
    told = " ".join(CliRunner().invoke(app, ["plan", "production"]).stdout.split())
    assert "scale_aging" in faint
    assert f"floor above the typical size: {', '.join(sorted(faint))}" in told


def test_plan_of_the_built_in_recipe_adds_up_its_minutes():
    minutes = planned()["minutes"]
    parts = [minutes[k] for k in ("soaks", "moves", "dwells", "static_record")]
    assert minutes["total"] == pytest.approx(sum(parts), abs=0.05)


def test_plan_refuses_a_model_that_the_recipe_cannot_determine(faces):
    faces.write_text(RECIPE.replace('"misalignment"]', '"misalignment", "third_order"]'), encoding="utf-8")
    done = CliRunner().invoke(app, ["plan", str(faces)])
    assert isinstance(done.exception, NotIdentified)
    assert "third_order" in str(done.exception)


def test_plan_refuses_an_invisible_model_with_what_is_missing(faces):
    faces.write_text(RECIPE.replace('"misalignment"]', '"misalignment", "cross_coupling"]'), encoding="utf-8")
    done = CliRunner().invoke(app, ["plan", str(faces)])
    assert isinstance(done.exception, NotIdentified)
    assert "cross_coupling cannot be identified: β in 90° steps makes" in str(done.exception)
    assert "add poses at β = 45°" in str(done.exception)


def test_plan_tells_the_error_to_be_expected_of_every_coefficient(faces):
    document = planned(faces, "--noise", "25", "--wander", "0")
    rows = {(r["effect"], r["axis"]): r for r in document["coefficients"] if r["effect"] != "misalignment"}
    white = document["dwell_error_ug"]["white"]
    assert white == pytest.approx(25.0 / 20.0**0.5)
    # six faces: the bias from six dwells, the scale from the two along the axis
    assert rows["bias", "x"]["uncertainty_ug"] == pytest.approx(white / 6.0**0.5, rel=1e-6)
    assert rows["scale", "z"]["uncertainty_ug"] == pytest.approx(white / 2.0**0.5, rel=1e-6)
    assert rows["scale", "z"]["unit"] == "µg/g"


def test_wander_of_the_device_counts_beside_its_white_noise(faces):
    quiet, restless = (planned(faces, "--device", name) for name in ("qa700", "adxl355"))
    assert restless["dwell_error_ug"]["wander"] == pytest.approx(0.664 * 300.0, rel=0.01)
    assert restless["dwell_error_ug"]["together"] > 5.0 * quiet["dwell_error_ug"]["together"]
    floors = [{r["effect"]: r["floor_ug"] for r in d["effects"]}["second_order"] for d in (quiet, restless)]
    assert floors[1] > 5.0 * floors[0]


def test_a_slow_station_needs_more_minutes(faces, tmp_path):
    text = (Path(__file__).parents[2] / "deploy/stations/simulated.toml").read_text(encoding="utf-8")
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("speed_deg_s = 30.0", "speed_deg_s = 3.0"), encoding="utf-8")
    usual, slower = (planned(faces, *more)["minutes"] for more in ((), ("--station", slow)))
    assert slower["moves"] > 3.0 * usual["moves"]
    assert slower["soaks"] == usual["soaks"]


def test_the_page_of_a_plan_opens_without_a_network(faces, tmp_path):
    page = tmp_path / "plan.html"
    done = CliRunner().invoke(app, ["plan", str(faces), "--page", str(page)])
    assert done.exit_code == 0
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 5
    assert not re.search(r"(src|href)=.http", text)
    assert "β in 90° steps" in text


def test_a_page_in_a_folder_that_is_not_there_is_one_message(faces, tmp_path):
    done = CliRunner().invoke(app, ["plan", str(faces), "--page", str(tmp_path / "none" / "plan.html")])
    assert isinstance(done.exception, WrongUse)
    assert "cannot be written" in str(done.exception)


def test_plan_of_a_recipe_with_the_lines_model_asks_the_archive_for_it(faces, tmp_path):
    faces.write_text(RECIPE.replace('effects = ["bias", "scale", "misalignment"]', 'model = "line"'), encoding="utf-8")
    asked = ["plan", str(faces), "--archive", str(tmp_path / "archive")]
    none = CliRunner().invoke(app, asked)
    assert isinstance(none.exception, RecipeInvalid)
    assert "for adxl355 on simulated no model is released" in str(none.exception)
    own = Archive(tmp_path / "archive")
    own.prepare()
    model = tmp_path / "m.toml"
    model.write_text(
        '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment", "own_square"]\n\n'
        '[[formula]]\nid = "own_square"\ncolumns = ["f**2"]\nwhy = "a trial"\n'
    )
    release(own, change_from_options("", model), datetime(2026, 1, 1, tzinfo=UTC), reason="test", force=True)
    assert planned(*asked[1:])["model"] == ["bias", "scale", "misalignment", "own_square"]
    assert planned(faces, "--effects", "bias,scale,misalignment")["model"] == ["bias", "scale", "misalignment"]


def test_effects_that_slow_noise_hides_are_listed_with_what_shows_them():
    done = CliRunner().invoke(app, ["plan", "--noise", "2", "--wander", "40"])
    assert done.exit_code == 0
    listed = done.stdout.split("raised by slow noise", 1)[1].split("effect visible in part", 1)[0]
    assert re.search(r"step_change|warm_up|bias_temperature_quadratic|creep_after_move", listed)
    done = CliRunner().invoke(app, ["plan", "--noise", "2", "--wander", "0"])
    assert "raised by slow noise" not in done.stdout


def test_an_effect_that_only_the_verification_poses_show_is_refused_with_the_reason(tmp_path):
    """The diagnosis of such a run names it, as it uses every dwell; the plan says why a fit cannot have it."""
    from capture_double import CaptureDouble

    from pipelines.archive import Archive
    from pipelines.chain.runner import Runner
    from pipelines.cli.next_commands import fit_refusal
    from pipelines.jobs.job import Request

    source = Path(__file__).resolve().parents[2] / "deploy" / "recipes"
    text = (source / "line-twelve.toml").read_text(encoding="utf-8")
    (tmp_path / "line-temperature.limits.toml").write_bytes((source / "line-temperature.limits.toml").read_bytes())
    recipe = tmp_path / "twelve.toml"
    recipe.write_text(text, encoding="utf-8")
    runner = Runner(Request(str(recipe)).job(), Archive(tmp_path / "archive"), measure=CaptureDouble())
    runner.stage("capture")
    model = [*runner.job.recipe.effects, "third_order"]
    assert fit_refusal(runner.run, runner.job.recipe.effects) == ""
    told = fit_refusal(runner.run, model)
    done = CliRunner().invoke(app, ["plan", str(recipe), "--effects", ",".join(model)])
    assert done.exit_code != 0
    for message in (told, str(done.exception)):
        assert "third_order cannot be identified" in message
        assert "only the verification poses show it, which a diagnosis uses and a fit leaves out" in message
        assert "move poses from 'verification' to 'poses'" in message
    without = tmp_path / "without.toml"
    without.write_text("\n".join(line for line in text.splitlines() if "verification" not in line), encoding="utf-8")
    refused = CliRunner().invoke(app, ["plan", str(without), "--effects", ",".join(model)])
    assert "third_order cannot be identified" in str(refused.exception)
    assert "verification" not in str(refused.exception)
