"""diagnose, compare, extend and history from the command line, on small lots with something hidden in them."""

import io
import json
import re
import sys
from pathlib import Path

import pandas as pd
import pytest
from capture_double import small_run
from in_process import Given, given
from pydantic import TypeAdapter

from benchmarks.truth import Run, Spec, make_run
from inertial import effects
from pipelines.cli.documents.models import DemoDocument
from pipelines.demo.measure import DemoLot, measure
from pipelines.demo.scenes import scene

KEYS = {
    "adequate",
    "blocked_by",
    "error",
    "where",
    "classes",
    "recommended",
    "unexplained",
    "unseen",
    "next_measurements",
}
THERMAL = "bias,scale,misalignment,bias_temperature,scale_temperature"
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
    spec = Spec(effects=("third_order",), sizes=(3.0,), plan="fibonacci24", soaks="one", repeats=3, units=4)
    return written(make_run(spec, 5), tmp_path_factory.mktemp("cubic"))


@pytest.fixture(scope="module")
def humid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    spec = Spec(
        effects=("covariate:humidity_pct",), sizes=(3.0,), plan="fibonacci24", soaks="one", repeats=3, units=4,
        decoys=("humidity_pct",),
    )  # fmt: skip
    return written(make_run(spec, 8), tmp_path_factory.mktemp("humid"))


def written(run: Run, folder: Path) -> Path:
    run.dwells.to_parquet(folder / "dwells.parquet")
    run.fresh.to_parquet(folder / "fresh.parquet")
    run.history.to_parquet(folder / "history.parquet")
    return folder


@pytest.fixture
def command(no_next_measurement: None) -> Given:
    """The command line in this process: status, standard output, standard error; its diagnoses propose no measurement."""
    return lambda *words: given(*words, columns=120)


def test_diagnose_names_what_is_missing_and_the_next_command(command, cubic):
    status, out, _ = command("diagnose", cubic / "dwells.parquet", "--history", cubic / "history.parquet")
    assert status == 1
    assert "NOT ADEQUATE" in out
    assert "third_order (K3)" in out
    assert "tumbleline extend model.toml third_order --effects bias,scale,misalignment" in out
    assert "Effects that this plan cannot show" in out


def test_diagnose_as_json_has_the_keys_of_the_contract(command, cubic):
    status, out, _ = command("diagnose", cubic / "dwells.parquet", "--json")
    document = json.loads(out)
    assert status == 1
    assert set(document) >= KEYS
    assert document["recommended"] == ["third_order"]
    assert set(document["breakers"]) == set(document["unseen"])


def test_an_adequate_model_leaves_with_status_0(command, cubic):
    wanted = ("--effects", "bias,scale,misalignment,third_order")
    status, out, _ = command("diagnose", cubic / "dwells.parquet", *wanted)
    assert status == 0
    assert out.startswith("ADEQUATE")


def test_a_lot_of_faulty_units_is_blocked(command, cubic, tmp_path):
    dwells = pd.read_parquet(cubic / "dwells.parquet")
    dwells["out_x"] = dwells["out_x"].iloc[0]
    dwells.to_csv(tmp_path / "stuck.csv", index=False)
    status, out, _ = command("diagnose", tmp_path / "stuck.csv", "--report", tmp_path / "stuck.html")
    assert status == 1
    assert out.startswith("CANNOT BE JUDGED: every unit")
    assert "Data faults" in (tmp_path / "stuck.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--effects", "bias,scael"], "unknown effect 'scael'; did you mean scale"),
        (["--effects", "bias", "--model", "m.toml"], "leave one out"),
        (["--effects", "bias,scale,vibration_rectification"], "vibration_rectification: the dwells have no vibration"),
        (["--history", "nowhere.csv"], "nowhere.csv"),
        (["--model", "nowhere.toml"], "nowhere.toml cannot be read"),
        (["--effect-file", "nowhere.py"], "no such Python file"),
    ],
)
def test_unusable_input_is_one_message_and_status_2(command, cubic, tmp_path, words, message):
    dwells = pd.read_parquet(cubic / "dwells.parquet").drop(columns=["vibration_g"])
    dwells.to_parquet(tmp_path / "d.parquet")
    status, out, err = command("diagnose", tmp_path / "d.parquet", *words)
    assert status == 2
    assert message in err
    assert "Traceback" not in err
    assert out == ""


def test_a_missing_column_is_named(command, cubic, tmp_path):
    pd.read_parquet(cubic / "dwells.parquet").rename(columns={"out_x": "outx"}).to_csv(tmp_path / "d.csv", index=False)
    status, _, err = command("diagnose", tmp_path / "d.csv")
    assert status == 2
    assert re.search(r"column out_x is missing; out_x: did you mean outx", err)


def test_compare_extend_and_history_see_the_error_fall(command, cubic, tmp_path):
    model, lot = tmp_path / "model.toml", (cubic / "dwells.parquet", "--fresh", cubic / "fresh.parquet")
    status, out, _ = command(
        "extend", model, "third_order", "--effects", "bias,scale,misalignment", "--why", "the maps", "--by", "Q"
    )
    assert status == 0
    assert "created with version 1" in out
    status, out, _ = command("extend", model, "bias_asymmetry", "--json")
    assert json.loads(out)["version"] == 3
    status, out, _ = command("compare", *lot, "--model", model, "--json")
    after = json.loads(out)
    status, out, _ = command("compare", *lot, "--effects", "bias,scale,misalignment", "--json")
    before = json.loads(out)
    assert status == 0
    assert after["fresh_rms_ug"] < 0.5 * before["fresh_rms_ug"]
    picture = tmp_path / "history.png"
    words = ("history", model, "--dwells", lot[0], *lot[1:], "--picture", picture)
    status, out, _ = command(*words, "--json")
    rows = json.loads(out)["versions"]
    assert [row["confirmed"] for row in rows[:2]] == [None, True]
    assert rows[2]["confirmed"] is not True
    assert rows[1]["fall_ug"] > 3.0 * rows[1]["fall_u_ug"] > 0.0
    assert (rows[1]["by"], rows[1]["why"]) == ("Q", "the maps")
    assert picture.read_bytes().startswith(b"\x89PNG")
    status, out, _ = command(*words)
    assert status == 0
    assert "not decided" in out or "refuted" in out


def test_compare_prints_for_people(command, cubic):
    status, out, _ = command(
        "compare", cubic / "dwells.parquet", "--effects", "bias,scale,misalignment,adc_nonlinearity"
    )
    assert status == 0
    assert "dwells left out" in out
    assert "Worst poses" in out
    assert "adc_nonlinearity" in out


def test_extend_refuses_and_leaves_the_file_alone(command, tmp_path):
    model = tmp_path / "model.toml"
    command("extend", model, "third_order")
    text = model.read_text(encoding="utf-8")
    for effect, message in (("third_order", "in version 2 already"), ("forth_order", "did you mean fourth_order")):
        status, _, err = command("extend", model, effect)
        assert status == 2
        assert message in err
    status, _, err = command("extend", model, "second_order", "--effects", "bias")
    assert (status, "--effects is for a new file" in err) == (2, True)
    assert model.read_text(encoding="utf-8") == text
    assert [path.name for path in tmp_path.iterdir()] == ["model.toml"]
    command("extend", model, "second_order", "--out", tmp_path / "next.toml")
    assert model.read_text(encoding="utf-8") == text
    assert "second_order" in (tmp_path / "next.toml").read_text(encoding="utf-8")


def test_history_without_dwells_tells_the_changes(command, tmp_path):
    command("extend", tmp_path / "m.toml", "third_order")
    status, out, _ = command("history", tmp_path / "m.toml")
    assert status == 0
    assert "+ third_order" in out
    status, _, err = command("history", tmp_path / "m.toml", "--picture", tmp_path / "p.png")
    assert (status, "they need --dwells" in err) == (2, True)


def test_what_no_physics_explains_is_offered_as_a_formula_that_then_explains_it(command, humid, tmp_path):
    dwells, model = humid / "dwells.parquet", tmp_path / "model.toml"
    status, out, _ = command("diagnose", dwells, "--json")
    document = json.loads(out)
    assert status == 1
    assert document["unexplained"]["driver"] == "humidity_pct"
    command("extend", model, "third_order", "--effects", "bias,scale,misalignment")
    model.write_text(model.read_text(encoding="utf-8") + "\n" + document["offer"]["toml"] + "\n", encoding="utf-8")
    status, out, _ = command("extend", model, document["offer"]["id"], "--json")
    assert json.loads(out)["effects"][-1] == "humidity_pct_bias"
    status, out, _ = command("compare", dwells, "--model", model, "--json")
    assert json.loads(out)["rms_ug"] < 0.6 * document["error"]["rms_ug"]
    status, out, _ = command("extend", tmp_path / "other.toml", "covariate:humidity_pct")
    assert status == 0


def test_a_formula_that_speaks_of_what_is_not_there_is_refused(command, cubic, tmp_path):
    model = tmp_path / "model.toml"
    model.write_text(
        '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment", "wet"]\n'
        '[[formula]]\nid = "wet"\ncolumns = ["temprature*f"]\n', encoding="utf-8",
    )  # fmt: skip
    status, _, err = command("diagnose", cubic / "dwells.parquet", "--model", model)
    assert status == 2
    assert "the dwells have no 'temprature'" in err
    assert "did you mean temperature" in err


def test_an_effect_file_takes_part(command, humid, tmp_path):
    own = tmp_path / "damp.py"
    own.write_text(OWN, encoding="utf-8")
    status, out, _ = command("diagnose", humid / "dwells.parquet", "--effect-file", own, "--json")
    document = json.loads(out)
    assert status == 1
    assert "damp" in {name for group in document["classes"] for name in group["effects"]}
    assert "damp" in document["recommended"]


def test_an_installed_package_takes_part(monkeypatch, tmp_path):
    (tmp_path / "damp_effects.py").write_text(OWN, encoding="utf-8")
    about = tmp_path / "damp_effects-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: damp-effects\nVersion: 1.0\n", encoding="utf-8")
    (about / "entry_points.txt").write_text("[tumbleline.effects]\ndamp = damp_effects\n", encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    effects._built_in.cache_clear()
    try:
        assert effects.get("damp").symbol == "kW"
        (about / "entry_points.txt").write_text("[tumbleline.effects]\ndamp = damp_effects:Damp\n", encoding="utf-8")
        effects._built_in.cache_clear()
        assert "damp" in effects.catalogue()
        (about / "entry_points.txt").write_text("[tumbleline.effects]\ndamp = not_there\n", encoding="utf-8")
        effects._built_in.cache_clear()
        with pytest.raises(effects.BrokenEffect, match="entry point damp = not_there: does not load"):
            effects.catalogue()
    finally:
        monkeypatch.undo()
        effects._built_in.cache_clear()
    assert "damp" not in effects.catalogue()


def test_the_report_is_one_file_that_needs_no_network(command, cubic, tmp_path):
    report = tmp_path / "report.html"
    command("diagnose", cubic / "dwells.parquet", "--report", report)
    text = report.read_text(encoding="utf-8")
    for part in ("third_order", "Residuals on the sphere", "Candidates", "Effects that this plan cannot show", "<svg"):
        assert part in text
    outside = re.sub(r'xmlns(:\w+)?="[^"]*"|"http://www.w3.org/[^"]*"', "", text)
    assert "content=\"default-src 'none'; script-src 'sha256-" in text  # its two scripts by their hashes, and no other
    assert not re.search(r"<script[^>]*\bsrc=", outside)
    assert not re.search(r'(src|href)="(https?:)?//', outside)


@pytest.fixture(scope="module")
def measured() -> DemoLot:
    """What the demonstration measures with a cubic transfer hidden, for the tests that play it."""
    return measure(scene("cubic_transfer", 7), 7)


def test_the_demonstration_finds_what_it_hid(command, measured, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr("pipelines.demo.measure.measure", lambda *which: asked.append(which[:2]) or measured)
    status, out, _ = command(
        "demo", "--effect", "cubic_transfer", "--seed", "7", "--json", "--folder", tmp_path / "game"
    )
    document = TypeAdapter(DemoDocument).validate_json(out, extra="forbid")
    assert status == 0
    assert asked == [(scene("cubic_transfer", 7), 7)]
    assert document["hidden"]["effect"] == "third_order"
    assert document["found"] is True
    assert document["added"] == ["third_order"]
    assert document["after"]["fresh_rms_ug"] < 0.8 * document["before"]["fresh_rms_ug"]
    tables = {f"{name}.parquet" for name in ("dwells", "history", "fresh", "fresh-history")}
    assert {path.name for path in (tmp_path / "game").iterdir()} == {*tables, "model.toml", "report.html"}


def test_the_demonstration_names_close_matches(command, tmp_path):
    status, _, err = command("demo", "--effect", "cubic_transfr", "--auto", "--folder", tmp_path / "game")
    assert (status, "did you mean cubic_transfer" in err) == (2, True)
    assert not (tmp_path / "game").exists()


def test_a_run_of_the_archive_brings_its_own_history(command, tmp_path):
    run = small_run(tmp_path)
    where = ("--archive", run.archive.root)
    assert "history" in run.tables()
    status, out, _ = command("compare", "latest", "--fresh", run.id, "--json", *where)
    document = json.loads(out)
    assert status == 0
    assert document["fresh_rms_ug"] == pytest.approx(document["rms_ug"], rel=1e-6)
    status, out, _ = command("diagnose", run.id, "--json", *where)
    assert status in {0, 1}
    assert set(json.loads(out)) >= KEYS
    status, _, err = command("diagnose", "no-such-run", *where)
    assert (status, "no run is called 'no-such-run'" in err) == (2, True)


def test_a_formula_is_fitted_by_the_chain_and_told_of_by_export(command, tmp_path):
    run = small_run(tmp_path)
    where = ("--archive", run.archive.root)
    model = tmp_path / "model.toml"
    text = (
        '[model]\nname = "line"\nversion = 1\n'
        'effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "curl"]\n'
        '[[formula]]\nid = "curl"\ncolumns = ["fj*fk*maximum(fj, 0)"]\n'
    )
    model.write_text(text, encoding="utf-8")
    status, out, err = command("fit", run.id, "--model", model, "--json", *where)
    assert status in {0, 1}, err
    again = json.loads(out)["run"]
    assert again != run.id
    with effects.additions_forgotten():
        effects._extra.clear()
        status, out, err = command("show", again, "coefficients", "--json", *where)
        assert "curl" in {row["effect"] for row in json.loads(out)["rows"]}, err
        status, out, err = command("export", again, "--failed", "--json", *where)
    assert status == 0, err
    assert "curl" in out


def test_a_player_may_add_something_else(command, measured, monkeypatch, tmp_path):
    monkeypatch.setattr("pipelines.demo.measure.measure", lambda *_: measured)
    monkeypatch.setattr(sys, "stdin", io.StringIO("\n\nfifth_order\n\n\n\n\n"))
    status, out, err = command("demo", "--effect", "cubic_transfer", "--seed", "7", "--folder", tmp_path / "game")
    assert status == 0, err
    assert "a spring that hardens" in out
    assert "Found." in out
    assert "fifth_order" in (tmp_path / "game" / "model.toml").read_text(encoding="utf-8")
