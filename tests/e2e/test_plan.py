"""`tumbleline plan` and `plan optimise`: what a plan sees and costs; a recipe that is usable, cheaper and as good as it says."""

import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from capture_double import CaptureDouble, recipe_file
from each import each
from in_process import document_of, given, refused, text_of
from root_process import ROOT
from typed_commands import printed_commands

from inertial.frames import force_from_angles
from pipelines.archive import Archive
from pipelines.chain.runner import Runner
from pipelines.cli.next_commands import fit_refusal
from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import minutes
from schemas.recipe import Recipe
from schemas.station import load_station

OWN = 'limits = "own.toml"\n'
LIMITS = 'name = "own"\n[figures]\n{figure} = {{ max = 1000.0, unit = "µg" }}\n'
RECIPE = f"""{OWN}
name = "faces"
device = "adxl355"
local_gravity_m_s2 = 9.80665
poses = "six"
temperatures_C = [25.0]
effects = ["bias", "scale", "misalignment"]
"""
PLAIN = "bias,scale,misalignment"
THERMAL = f"{PLAIN},bias_temperature,scale_temperature"


def planned(*words: object) -> dict[str, Any]:
    return document_of("plan", *words, status=0)


@pytest.fixture
def faces(tmp_path: Path) -> Path:
    path = tmp_path / "faces.toml"
    path.write_text(RECIPE, encoding="utf-8")
    path.with_name("own.toml").write_text(LIMITS.format(figure="residual_rms_ug"), encoding="utf-8")
    return path


def test_plan_says_for_every_effect_whether_six_faces_see_it_and_for_every_coefficient_its_error(faces: Path) -> None:
    document = planned(faces, "--noise", "25,0")
    seen = {row["effect"]: row for row in document["effects"]}
    square, cross, shaken = seen["second_order"], seen["cross_coupling"], seen["vibration_rectification"]
    assert (square["seen"], square["why"]) == (True, "")
    assert square["left"] == pytest.approx(0.82, abs=0.01)
    assert {"scale_asymmetry", "fourth_order"} <= set(square["alias"])
    assert (cross["seen"], cross["floor_ug"]) == (False, None)
    # K2·fx² is 1 in two of six faces and 0 in the others
    assert square["floor_size_ug"] == pytest.approx(square["floor_ug"] / 3**0.5, rel=1e-3)
    assert shaken["floor_size_ug"] < 1e-3 * shaken["floor_ug"]
    rows = {(r["effect"], r["axis"]): r for r in document["coefficients"] if r["effect"] != "misalignment"}
    white = document["dwell_error_ug"]["white"]
    assert white == pytest.approx(25.0 / 20.0**0.5)
    # six faces: the bias from six dwells, the scale from the two along the axis
    assert rows["bias", "x"]["uncertainty_ug"] == pytest.approx(white / 6.0**0.5, rel=1e-6)
    assert rows["scale", "z"]["uncertainty_ug"] == pytest.approx(white / 2.0**0.5, rel=1e-6)


def test_plan_marks_what_would_have_to_be_larger_than_it_ever_is_and_adds_up_its_minutes() -> None:
    document = planned("production")
    rows = [row for row in document["effects"] if row["seen"]]
    faint = {row["effect"] for row in rows if row["floor_size_ug"] > row["typical_ug"][1]}
    assert "scale_aging" in faint
    assert f"seen only where larger than usual: {', '.join(sorted(faint))}" in text_of("plan", "production")
    parts = [document["minutes"][k] for k in ("soaks", "moves", "dwells", "static_record")]
    assert document["minutes"]["total"] == pytest.approx(sum(parts), abs=0.05)


def test_plan_refuses_a_model_that_the_recipe_cannot_determine_with_what_is_missing(faces: Path) -> None:
    faces.write_text(RECIPE.replace('"misalignment"]', '"misalignment", "cross_coupling"]'), encoding="utf-8")
    message = refused("plan", faces)
    assert "cross_coupling cannot be identified: β in 90° steps makes" in message
    assert "add poses at β = 45°" in message


@pytest.mark.slow
def test_the_error_of_a_verification_pose_is_planned_with_its_noise_and_limits_at_risk_are_told(faces: Path) -> None:
    text = f"verification = [[35.0, 55.0]]\n{RECIPE}"
    faces.write_text(text, encoding="utf-8")
    faces.with_name("own.toml").write_text(LIMITS.format(figure="verification_norm_ug"), encoding="utf-8")
    for density, status, key in ((1500, 0, "at_risk"), (2500, 1, "unreachable")):
        document = document_of("plan", faces, "--noise", f"{density},0", status=status)
        row = next(one for one in document["uncertainty"]["quantities"] if one["quantity"] == "verification_norm")
        # six faces: its own dwell, a sixth of the bias, a half of the response
        expected = document["dwell_error_ug"]["white"] * (1.0 + 1.0 / 6.0 + 0.5) ** 0.5
        assert row["u"] == pytest.approx(expected, rel=1e-3)
        assert row["shares"]["noise of the dwells"] > 0.99
        assert "verification_norm_ug" in [one.split(":")[0] for one in document["uncertainty"][key]]
    # U = 866 µg of 1000 µg leaves 0.31 standard deviations
    printed = text_of("plan", faces, "--noise", "1500,0")
    assert (
        "mean of its dwells: limit 1000 µg, U (k = 2) 866 µg; by noise alone 76 % of good units or more fail" in printed
    )


REFUSED_BY_RUN = {
    "[stop]\nbias_ug = 1.0\n": "[stop] asks for U = 1 µg of bias, the references alone have U = ",
    'limits = "consumr"\n': "no file and no built-in limits are called 'consumr'",
    'seed = 1\nlimits = "consumer"\n': "verification_norm_ug, verification_ratio, bias_error_ug need verification poses",
    "static_record_s = 60.0\nstatic_temperature_C = 300.0\n": "key 'static_temperature_C': 300 °C, the chamber",
}


def test_a_lot_larger_than_the_fixture_is_told_with_its_fillings(tmp_path: Path) -> None:
    recipe = recipe_file(tmp_path, ('"A1"', ", ".join(f'"B{k}"' for k in range(9)) + ', "A1"'))
    told = given("plan", recipe)[2]
    assert "the fixture has 8 slots: 2 fillings, each of the station time below" in " ".join(told.split())


@each(
    REFUSED_BY_RUN
)  # of a device with one axis: tests/e2e/test_one_axis.py; of [stop]: tests/e2e/test_run_that_ends.py
def test_what_run_refuses_is_told_by_plan_with_its_exit_status(row: str, faces: Path) -> None:
    faces.write_text((RECIPE.replace(OWN, "") if "limits" in row else RECIPE) + row, encoding="utf-8")
    status, _, told = given("plan", faces, "--noise", "25,0")
    told = " ".join(told.split())
    assert status == 1
    assert REFUSED_BY_RUN[row] in told
    assert "'tumbleline run' refuses this recipe" in told


def rows(text: str) -> list[tuple[str, ...]]:
    """Rows of a change and of what is said of it: the old text, the new one, the message."""
    return [tuple(line.replace("\\n", "\n").split(" → ")) for line in text.strip().splitlines()]


PLAIN_WORDS = rows(r"""
poses = "six" → poses = [[0, 0], [90]] → key 'poses', number 2: found [90]: the two angles [outer, inner] of a pose
poses = "six" → poses = [[0, 0], [4000, 0]] → key 'poses', number 2.1: found 4000
[25.0] → [25.0, "warm"] → key 'temperatures_C', number 2: found 'warm'
[25.0] → [25.0]\nfaults = [{kind = "a"}, {kinds = "b"}] → unknown key 'faults.kinds', number 2; did you mean kind
[25.0] → [25.0]\nprocedures = [{kind = "tilt"}, {kind = "rotation", rates_deg_s = [1, "x"]}] → key 'rates_deg_s', number 2
[25.0] → [] → key 'temperatures_C': found []: 1 or more entries are needed
"faces" → "" → key 'name': found '': 1 or more characters are needed
[25.0] → [25.0]\nprocedures = ["rotation"] → write [[procedures]], and below it kind = "rotation"
"misalignment"] → "misalignment"]\n[prior]\nfull = "missing.toml" → key 'prior.full': recipe: no file and no recipe
"misalignment"] → "misalignment"]\n[prior] → holds no archive, one with runs is needed
""")


@each(PLAIN_WORDS)
def test_a_wrong_recipe_is_told_in_plain_words(row: tuple[str, str, str], faces: Path, tmp_path: Path) -> None:
    old, new, said = row
    faces.write_text(RECIPE.replace(old, new), encoding="utf-8")
    assert said in refused("plan", faces, "--archive", tmp_path / "archive")


def test_the_page_of_a_plan_opens_without_a_network(faces: Path, tmp_path: Path) -> None:
    text_of("plan", faces, "--output", tmp_path / "plan.html", status=0)
    text = (tmp_path / "plan.html").read_text(encoding="utf-8")
    assert text.count("<svg") == 5
    assert not re.search(r"(src|href)=.http", text)
    assert "β in 90° steps" in text
    _, _, err = given("plan", faces, "--output", tmp_path / "plan.html" / "plan.html")
    assert "cannot be written" in err


def test_an_effect_that_only_the_verification_poses_show_is_refused_with_the_reason(tmp_path: Path) -> None:
    """The diagnosis of such a run names it, as it uses every dwell; the plan says why a fit cannot have it."""
    source = ROOT / "deploy" / "recipes"
    text = (source / "line-twelve.toml").read_text(encoding="utf-8")
    (tmp_path / "line-temperature.limits.toml").write_bytes((source / "line-temperature.limits.toml").read_bytes())
    recipe, without = tmp_path / "twelve.toml", tmp_path / "without.toml"
    recipe.write_text(text, encoding="utf-8")
    runner = Runner(Request(str(recipe)).job(), Archive(tmp_path / "archive"), measure=CaptureDouble())
    runner.stage("capture")
    own = runner.job.recipe.effects
    model = [*own, "third_order"]
    assert fit_refusal(runner.run, own) == ""
    for message in (fit_refusal(runner.run, model), refused("plan", recipe, "--effects", ",".join(model))):
        assert "third_order cannot be identified" in message
        assert "only the verification poses show it, which a diagnosis uses and a fit leaves out" in message
        assert "move poses from 'verification' to 'poses'" in message
    without.write_text("\n".join(line for line in text.splitlines() if "verification" not in line), encoding="utf-8")
    message = refused("plan", without, "--effects", ",".join(model))
    assert "third_order cannot be identified" in message
    assert "verification" not in message


def optimise(*options: str) -> tuple[object, ...]:
    return ("plan", "optimise", "--device", "analogue", "--effects", THERMAL, *options)


def optimised(target: Path, *options: str) -> dict[str, Any]:
    """The document of a search, which has no type yet."""
    status, out, err = given(*optimise(*options), "-o", target, "--json")
    assert status == 0, err
    return json.loads(out)


@pytest.fixture(scope="module")
def optimal(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Any], Path]:
    """The cheapest recipe with errors up to four times the textbook plan's: little to search."""
    target = tmp_path_factory.mktemp("optimal") / "found.toml"
    return optimised(target, "--set", "factor=4"), target


def forces(recipe: Recipe, poses: str) -> np.ndarray:
    return force_from_angles(*np.radians([(p.outer_deg, p.inner_deg) for p in getattr(recipe, poses)]).T)


def test_the_recipe_that_is_written_is_what_was_told_and_as_good_as_wanted_in_less_time(optimal) -> None:
    document, target = optimal
    recipe, told = load_recipe(str(target)), planned(target, "--device", "analogue")
    assert (told["minutes"], told["dwells"]) == (document["minutes"], document["dwells"])
    assert recipe.temperatures_C == document["temperatures_C"]
    taken = minutes(steps(recipe), load_station(), recipe)
    assert taken.total == pytest.approx(document["minutes"]["total"], abs=0.05)
    assert all(row["uncertainty_ug"] <= row["wanted_ug"] for row in document["coefficients"])
    assert document["share"] < 0.6
    left = {row["effect"]: row["left"] for row in document["plan"]["effects"]}
    assert min(left[e] for e in ("aging_linear", "thermal_hysteresis", "cross_coupling", "third_order")) > 0.1
    assert "cross_coupling" in document["seen_besides"]  # more physics than on faces


def test_the_new_recipe_is_compared_with_the_own_one_and_the_textbook_plan(optimal) -> None:
    document, _ = optimal
    own = planned("production", "--device", "analogue", "--effects", THERMAL)
    assert document["own_minutes"] == own["minutes"]
    assert document["textbook_minutes"]["total"] > document["own_minutes"]["total"]
    expected = [row["uncertainty_ug"] for row in own["coefficients"]]
    assert [row["own_ug"] for row in document["coefficients"]] == pytest.approx(expected, rel=0.05)
    ratios = [row["own_ug"] / row["wanted_ug"] for row in document["coefficients"]]
    assert document["own_worst"] == pytest.approx(max(ratios))


def test_soaks_come_back_and_verification_poses_are_apart_and_measured_as_often_as_in_the_recipe(optimal) -> None:
    base, recipe = load_recipe(), load_recipe(str(optimal[1]))
    check = forces(recipe, "verification")
    assert len(check) == 6
    assert np.degrees(np.arccos(np.max(check @ forces(recipe, "poses").T))) > 8.0
    assert len(set(recipe.temperatures_C)) < len(recipe.temperatures_C)  # soaks come back, and meet both ends
    assert {min(recipe.temperatures_C), max(recipe.temperatures_C)} == {-10.0, 60.0}
    ends = {pose.name for k in range(len(recipe.soaks)) for pose in (recipe.poses_at(k)[0], recipe.poses_at(k)[-1])}
    assert len(ends) == 1  # each begins and ends with one reference pose
    taken = [[pose.name for pose in recipe.verification_at(k)] for k in range(len(recipe.soaks))]
    of_each = Counter(name for names in taken for name in names)
    assert set(of_each.values()) == {len(base.verification) // 6 * len(base.temperatures_C)}
    assert optimal[0]["verification_dwells"] == sum(of_each.values())
    assert max(map(len, taken)) - min(map(len, taken)) <= 6


REFUSED = {
    "--criterion worts": "did you mean worst",
    "--set poses=twelv": "did you mean twelve",
    "--set temperatures=cold,warm": "write -10,25,60",
    "--wanted bais=50": "did you mean bias",
    "--wanted bias=-3": "positive error",
    "--wanted third_ordre": "third_order",
    "--criterion T": "write --criterion T:third_order,odd_quadratic",
    "--criterion T:third_order": "two or more are needed",
    "--criterion T:third_order,odd_quadratics": "odd_quadratic",
    "--criterion T:third_order,level_error": "an effect of the station",
    "--criterion T:third_order,odd_quadratic --set factor=2": "--set factor does not go",
    "--criterion A:third_order,odd_quadratic": "write --criterion T:a,b, or worst",
    "--criterion X:foo": "write --criterion T:a,b, or worst",
}


@each(REFUSED)
def test_what_cannot_be_asked_is_told_in_one_message(options: str, tmp_path: Path) -> None:
    target = tmp_path / "found.toml"
    assert REFUSED[options] in refused(*optimise(*options.split()), "-o", target)
    assert not target.exists()


@pytest.mark.slow
@pytest.mark.timeout(1200)  # a whole run of the recipe that was found
def test_the_line_after_a_search_measures_the_new_recipe(tmp_path: Path) -> None:
    target = tmp_path / "my new recipe.toml"
    own = ("--archive", str(tmp_path / "archive"))
    (words,) = printed_commands(given(*optimise("--set", "factor=4"), "-o", target, *own)[1])
    assert words == ["run", str(target), *own]
    text_of(*words, "--direct")


@pytest.mark.slow
def test_errors_that_no_recipe_reaches_are_refused_and_the_textbook_plan_is_matched_in_six_tenths(
    tmp_path: Path,
) -> None:
    message = refused(*optimise("--wanted", "bias=0.01"), "-o", tmp_path / "none.toml")
    assert "times those" in message
    assert "uninterrupted measurement" in message
    document = optimised(tmp_path / "found.toml", "--set", "verification=1")
    assert document["share"] <= 0.60
    assert document["worst"] <= 1.0
