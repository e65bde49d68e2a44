"""`tumbleline plan` from the command line: what other programs read, and what it refuses."""

import json

import pytest
from typer.testing import CliRunner

from inertial.errors import NotIdentified
from pipelines.cli import app

RECIPE = """
name = "faces"
device = "adxl355"
local_gravity_m_s2 = 9.80665
poses = "six"
temperatures_C = [25.0]
effects = ["bias", "scale", "misalignment"]
"""
KEYS = {"effect", "seen", "left", "variance_inflation", "floor_ug", "alias", "breaker"}


@pytest.fixture
def faces(tmp_path):
    path = tmp_path / "faces.toml"
    path.write_text(RECIPE, encoding="utf-8")
    return path


def test_plan_says_for_every_effect_whether_six_faces_see_it(faces):
    done = CliRunner().invoke(app, ["plan", str(faces), "--json"])
    assert done.exit_code == 0
    rows = {row["effect"]: row for row in json.loads(done.stdout)["effects"]}
    assert all(set(row) >= KEYS for row in rows.values())
    assert rows["second_order"]["seen"]
    assert rows["second_order"]["left"] == pytest.approx(0.82, abs=0.01)
    assert {"scale_asymmetry", "fourth_order"} <= set(rows["second_order"]["alias"])
    assert not rows["cross_coupling"]["seen"]
    assert rows["cross_coupling"]["floor_ug"] is None
    assert "45" in rows["cross_coupling"]["breaker"] or "90" in rows["cross_coupling"]["breaker"]


def test_plan_of_the_built_in_recipe_adds_up_its_minutes():
    done = CliRunner().invoke(app, ["plan", "--json"])
    minutes = json.loads(done.stdout)["minutes"]
    parts = [minutes[k] for k in ("soaks", "moves", "dwells", "static_record")]
    assert minutes["total"] == pytest.approx(sum(parts), abs=0.05)


def test_plan_refuses_a_model_that_the_recipe_cannot_determine(faces):
    faces.write_text(RECIPE.replace('"misalignment"]', '"misalignment", "third_order"]'), encoding="utf-8")
    done = CliRunner().invoke(app, ["plan", str(faces)])
    assert isinstance(done.exception, NotIdentified)
    assert "third_order" in str(done.exception)
