"""`diagnose` and `compare` on small lots with something hidden in them: verdict, report, formula, next recipe, refusals."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from capture_double import AT_ROOM, small_run
from each import each
from in_process import document_of, given, refused, text_of
from root_process import ROOT
from typed_commands import printed_commands

from inertial import effects
from pipelines.cli.text.diagnosis_text import print_diagnosis
from pipelines.diagnosis.next_measurement import next_recipe
from pipelines.jobs.job import Request
from pipelines.jobs.recipes import load_recipe
from schemas.errors import RecipeInvalid

from physics import OUTSIDE  # isort: skip
from benchmarks.hand_turned import make as turned_by_hand
from benchmarks.truth import Spec, case, make_run

from world import World, make  # isort: skip

PLAIN = "bias,scale,misalignment"
LINE_SIX = ROOT / "deploy" / "recipes" / "line-six.toml"
STEP = {"outer_deg": 45.0, "inner_deg": 30.0, "chamber_C": 25.1, "why": "a | b", "wait_s": 2.0, "soaked": True}
OWN = '''\
"""An effect from outside the tree."""

from inertial.effects.base import SensorEffect, stack


class Damp(SensorEffect):
    """Glue that swells with moisture."""

    id = "damp"
    symbol = "kW"
    equation = "kW·(h − 45)"
    source = "a guess"
    typical_ug = (1.0, 1000.0)
    breaker = "dry the chamber"
    simplicity = 1

    def columns(self, state, axis, **nonlinear):
        return stack(state, [state.need("humidity_pct", self.id) - 45.0])

    def names(self, axis):
        return ("kW",)
'''


@pytest.fixture(scope="module")
def cubic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dwells with a cubic term on a plan that shows it."""
    spec = Spec(effects=("third_order",), sizes=(3.0,), plan="fibonacci24", soaks="one", repeats=3, units=4)
    return written(spec, 5, tmp_path_factory.mktemp("cubic"))


@pytest.fixture(scope="module")
def humid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dwells whose bias follows a recorded humidity."""
    humidity = {"effects": ("covariate:humidity_pct",), "decoys": ("humidity_pct",)}
    spec = Spec(**humidity, sizes=(3.0,), plan="fibonacci24", soaks="one", repeats=3, units=4)
    return written(spec, 8, tmp_path_factory.mktemp("humid"))


def written(spec: Spec, seed: int, folder: Path) -> Path:
    run = make_run(spec, seed)
    for name in ("dwells", "fresh", "history"):
        getattr(run, name).to_parquet(folder / f"{name}.parquet")
    return folder


@pytest.mark.usefixtures("no_next_measurement")
def test_diagnose_names_what_is_missing_in_text_document_and_report(cubic: Path, tmp_path: Path) -> None:
    lot, report = (cubic / "dwells.parquet", "--temperatures", cubic / "history.parquet"), tmp_path / "report.html"
    printed = text_of("diagnose", *lot, status=1)
    for part in (
        "NOT ADEQUATE", "on which third_order depends", "third_order (K3)", "This plan cannot show", "Next:",
        "tumbleline extend model.toml third_order --effects bias,scale,misalignment",
    ):  # fmt: skip
        assert part in printed
        printed = printed[printed.index(part) :]  # in this order: verdict, picture, class, and the next command last
    assert len(printed.splitlines()) <= 3
    document = document_of("diagnose", *lot, "--output", report, status=1)
    assert document["recommended"] == ["third_order"]
    text = report.read_text(encoding="utf-8")
    for part in ("third_order", "Residuals on the sphere", "Candidates", "Effects that this plan cannot show", "<svg"):
        assert part in text
    outside = re.sub(r'xmlns(:\w+)?="[^"]*"|"http://www.w3.org/[^"]*"', "", text)
    assert "content=\"default-src 'none'; script-src 'sha256-" in text  # its two scripts by their hashes, and no other
    assert not re.search(r'<script[^>]*\bsrc=|(src|href)="(https?:)?//', outside)
    assert text_of("diagnose", *lot, "--effects", f"{PLAIN},third_order", status=0).startswith("ADEQUATE")


def test_a_lot_of_faulty_units_is_blocked(cubic: Path, tmp_path: Path) -> None:
    dwells = pd.read_parquet(cubic / "dwells.parquet")
    dwells.assign(out_x=dwells["out_x"].iloc[0]).to_csv(tmp_path / "stuck.csv", index=False)
    printed = text_of("diagnose", tmp_path / "stuck.csv", "--output", tmp_path / "stuck.html", status=1)
    assert printed.startswith("CANNOT BE JUDGED: every unit")
    assert "Data faults" in (tmp_path / "stuck.html").read_text(encoding="utf-8")


def printed(document: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> str:
    print_diagnosis(document, data=None, model=None)
    return " ".join(capsys.readouterr().out.split())


FORMULA = '[[formula]]\nid = "{}"\ncolumns = ["{}"]\n'
UNUSABLE = {
    "--effects bias,scael": "unknown effect 'scael'; did you mean scale",
    "--effects bias --model m.toml": "leave one out",
    "--effects bias,scale,vibration_rectification": "vibration_rectification: the dwells have no vibration",
    "--temperatures nowhere.csv": "nowhere.csv",
    "--model nowhere.toml": "nowhere.toml cannot be read",
    "--effect-file nowhere.py": "no such Python file",
    "--model wet.toml": "the dwells have no 'temprature'; did you mean temperature",
    "--output next.toml": "add --recipe FILE",
}


@each(UNUSABLE)
def test_unusable_input_is_one_message(
    words: str, cubic: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    pd.read_parquet(cubic / "dwells.parquet").drop(columns=["vibration_g"]).to_parquet("d.parquet")
    model = '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment", "wet"]\n'
    Path("wet.toml").write_text(model + FORMULA.format("wet", "temprature*f"), encoding="utf-8")
    message = refused("diagnose", "d.parquet", *words.split())
    assert [part for part in UNUSABLE[words].split("; ") if part not in message] == [], message
    assert not Path("next.toml").exists()
    if words == "--output next.toml":
        pd.read_parquet("d.parquet").rename(columns={"out_x": "outx"}).to_csv("d.csv", index=False)
        assert "column out_x is missing; out_x: did you mean outx" in refused("diagnose", "d.csv")


@pytest.mark.usefixtures("no_next_measurement")
def test_what_no_physics_explains_is_offered_as_a_formula_that_then_explains_it(humid: Path, tmp_path: Path) -> None:
    dwells, model = humid / "dwells.parquet", tmp_path / "model.toml"
    document = document_of("diagnose", dwells, status=1)
    assert document["unexplained"]["driver"] == "humidity_pct"
    text_of("extend", model, "third_order", "--effects", PLAIN)
    model.write_text(model.read_text(encoding="utf-8") + "\n" + document["offer"]["toml"] + "\n", encoding="utf-8")
    assert document_of("extend", model, document["offer"]["id"])["effects"][-1] == "humidity_pct_bias"
    assert document_of("compare", dwells, "--model", model)["rms_ug"] < 0.6 * document["error"]["rms_ug"]
    text_of("extend", tmp_path / "other.toml", "covariate:humidity_pct", status=0)


@pytest.mark.slow
def test_an_effect_that_is_suspected_is_added_where_it_is_asked_for(tmp_path: Path) -> None:
    dwells, model = tmp_path / "dwells.csv", tmp_path / "model.toml"
    turned_by_hand("hysteresis", 9101).to_csv(dwells, index=False)
    words = printed_commands(given("diagnose", dwells)[1])[-1]
    assert (words[0], words[-2:]) == ("improve", ["--effect", "thermal_hysteresis"])
    document = document_of(*words, "--output", model, status=0)
    assert document["added"] == ["thermal_hysteresis"]
    assert document["ladder"][-1]["fitted_ug"] < 0.2 * document["ladder"][0]["fitted_ug"]
    assert document["ladder"][-1]["confirmed"] is None  # these dwells do not decide it
    assert "suspects it" in model.read_text(encoding="utf-8")


OF_NO_CATALOGUE = {
    "scale_warms_up": ("scale", "the scale factor follows"),
    "axes_warm_up": ("axes", "the directions of the axes follow"),
    "axes_bend_with_heat": ("axes", "the directions of the axes follow"),
    "cubic_with_heat": ("transfer", "the transfer curve follows"),
    "fixture_bends": ("axes", "the directions of the axes follow"),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", OF_NO_CATALOGUE)
def test_the_suggested_formula_explains_what_no_effect_does(tmp_path: Path, name: str, capsys) -> None:
    assert set(OF_NO_CATALOGUE) == set(OUTSIDE)
    made = make(World(hidden=((name, 3.0),)), 6_400_002)
    for kind in ("dwells", "history", "fresh", "fresh_history"):
        getattr(made, kind).to_parquet(tmp_path / f"{kind}.parquet")
    data = (tmp_path / "dwells.parquet", "--temperatures", tmp_path / "history.parquet")
    document = document_of("diagnose", *data, status=1)
    part, text = OF_NO_CATALOGUE[name]
    assert document["recommended"] == []
    assert document["unexplained"]["part"] == part
    assert document["unexplained"]["text"].startswith(text)
    assert " ".join(document["unexplained"]["text"].split()) in printed(document, capsys)
    offer, own = document["offer"], ",".join(document["effects"])
    formula = ("--formula", f"{offer['id']}={'; '.join(offer['columns'])}")
    fresh = ("--fresh", tmp_path / "fresh.parquet", "--fresh-temperatures", tmp_path / "fresh_history.parquet")
    before = document_of("compare", *data, *fresh, "--effects", own)
    after = document_of("compare", *data, *fresh, "--effects", f"{own},{offer['id']}", *formula)
    assert before["rms_ug"] > 2.5 * made.floor_ug
    assert after["rms_ug"] < 1.1 * made.floor_ug
    assert after["fresh_rms_ug"] < 0.6 * before["fresh_rms_ug"]  # the day of the fresh run wanders, too


@pytest.mark.slow
def test_the_course_of_a_day_is_offered_with_its_period_and_leaves_no_more_than_the_noise(
    tmp_path: Path, capsys
) -> None:
    run = case("withheld", 5, 771)
    run.dwells.to_parquet(tmp_path / "dwells.parquet")
    run.history.to_parquet(tmp_path / "history.parquet")
    data = (tmp_path / "dwells.parquet", "--temperatures", tmp_path / "history.parquet", "--effects")
    document = document_of("diagnose", *data, "bias,scale,misalignment", status=1)
    floor = run.sealed.floor_ug
    assert document["error"]["floor_ug"] == pytest.approx(floor, rel=0.05)
    assert document["where"][0]["driver"] == "time_s"
    assert document["where"][0]["share"] > 0.9
    period = run.sealed.effects[0].parameters["period_s"]
    assert document["unexplained"]["period_s"] == pytest.approx(period, rel=0.01)
    assert "min (p < 0.001)" in printed(document, capsys)
    offer, rate = document["offer"], 2.0 * np.pi * 3600.0 / period
    assert float(offer["columns"][0].split("(")[1].split()[0]) == pytest.approx(rate, rel=0.01)
    formula = ("--formula", f"{offer['id']}={'; '.join(offer['columns'])}")
    after = document_of("compare", *data, f"bias,scale,misalignment,{offer['id']}", *formula, status=0)
    assert after["rms_ug"] == pytest.approx(floor, rel=0.05)


@pytest.mark.slow
def test_an_effect_file_takes_part_and_the_lines_after_it_carry_it_and_dwells_left_out_and_run(
    humid: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("my damp.py").write_text(OWN, encoding="utf-8")
    first = pd.read_parquet(humid / "dwells.parquet").iloc[0]
    left = f"{first['unit']}:{first['dwell']}"
    words = ("diagnose", humid / "dwells.parquet", "--effect-file", "my damp.py", "--leave-out", left)
    with effects.additions_forgotten():
        _, out, _ = given(*words)
    lines = printed_commands(out.split("Next:", 1)[1])
    assert "damp" in {word for one in lines for word in one}
    assert [one[0] for one in lines] == [*["extend"] * (len(lines) - 1), "history"]
    assert all(one[one.index("--effect-file") + 1] == "my damp.py" for one in lines)
    assert lines[-1][lines[-1].index("--leave-out") + 1] == left
    for one in lines:
        with effects.additions_forgotten():  # as in a process of its own
            assert given(*one)[0] in {0, 1}, one


def test_an_installed_package_takes_part(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "damp_effects.py").write_text(OWN, encoding="utf-8")
    about = tmp_path / "damp_effects-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: damp-effects\nVersion: 1.0\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))

    def entry(place: str) -> None:
        (about / "entry_points.txt").write_text(f"[tumbleline.effects]\ndamp = {place}\n", encoding="utf-8")
        effects._built_in.cache_clear()

    try:
        for place in ("damp_effects", "damp_effects:Damp"):
            entry(place)
            assert effects.get("damp").symbol == "kW"
        entry("not_there")
        with pytest.raises(effects.BrokenEffect, match="entry point damp = not_there: does not load"):
            effects.catalogue()
    finally:
        monkeypatch.undo()
        effects._built_in.cache_clear()
    assert "damp" not in effects.catalogue()


@pytest.mark.slow
def test_a_formula_is_fitted_by_the_chain_and_told_of_by_export(tmp_path: Path) -> None:
    run, model = small_run(tmp_path, None, *AT_ROOM), tmp_path / "model.toml"
    own = json.dumps([*run.about["recipe"]["effects"], "curl"])
    head = f'[model]\nname = "line"\nversion = 1\neffects = {own}\n'
    model.write_text(head + FORMULA.format("curl", "fj*fk*maximum(fj, 0)"), encoding="utf-8")
    where = ("--archive", run.archive.root)
    again = document_of("fit", run.id, "--model", model, *where)["run"]
    assert again != run.id
    with effects.additions_forgotten():
        effects._extra.clear()
        assert "curl" in {row["effect"] for row in document_of("show", again, "coefficients", *where)["rows"]}
        assert "curl" in text_of("export", again, "--include", "failed", "--json", *where, status=0)


@pytest.fixture(scope="module")
def six(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Dwells on six faces with a square term, which no face separates from a fourth order."""
    spec = Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=4)
    return written(spec, 5, tmp_path_factory.mktemp("six"))


def test_the_proposed_steps_are_a_recipe_that_plan_and_run_accept_and_that_separates_the_class(
    six: Path, tmp_path: Path
) -> None:
    target = tmp_path / "next.toml"
    words = ("diagnose", six / "dwells.parquet", "--effects", PLAIN, "--output", target, "--recipe", LINE_SIX)
    rows = document_of(*words, status=1)["next_measurements"]
    steps = [row for row in rows if row.get("measurable", True)]
    assert steps
    recipe = load_recipe(str(target))
    assert len(recipe.poses_at(0)) == 6 + sum(row.get("repeats", 1) for row in steps)
    assert recipe.effects == PLAIN.split(",")
    begun = Request(recipe=str(target)).job().recipe  # what 'run' begins with; the station adds what it states
    assert begun.model_copy(update={"stability": recipe.stability}) == recipe
    before, after = (document_of("plan", path, status=0) for path in (LINE_SIX, target))
    aliases = [
        next(row["alias_exact"] for row in plan["effects"] if row["effect"] == "second_order")
        for plan in (before, after)
    ]
    assert ["fourth_order" in names for names in aliases] == [True, False]  # on faces fi² and fi⁴ are one column


def test_steps_at_the_same_temperature_join_the_soak_and_others_begin_one() -> None:
    base = load_recipe(str(LINE_SIX))
    rows = [
        {**STEP, "repeats": 2},
        {**STEP, "chamber_C": 60.0, "wait_s": 30.0, "off_s": 120.0},
        {**STEP, "measurable": False, "outer_deg": 1.0},
        {**STEP, "chamber_C": 0.0, "soaked": False, "outer_deg": base.poses[0].outer_deg,
         "inner_deg": base.poses[0].inner_deg},
    ]  # fmt: skip
    recipe = next_recipe(base, rows, "Next one")
    assert recipe.temperatures_C == [25.0, 60.0, 0.0]
    assert [len(recipe.poses_at(k)) for k in range(3)] == [8, 1, 1]
    assert recipe.poses_at(2)[0] == base.poses[0]
    assert (recipe.waits_at(1), recipe.off_at(1)) == ([30.0], [120.0])
    assert [recipe.settles_at(k) for k in range(3)] == [True, True, False]
    assert [len(recipe.verification_at(k)) for k in range(3)] == [2, 0, 0]
    with pytest.raises(RecipeInvalid):
        next_recipe(base, [{**STEP, "chamber_C": 1e6}], "next")
