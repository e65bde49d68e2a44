"""The commands that are printed to be given next run as they are printed, in their order, whichever module prints them."""

import re
from pathlib import Path

import inquiries
import numpy as np
import pandas as pd
import pytest
from capture_double import finished_run
from in_process import document_of, given, text_of, typed_document
from long_suites import mostly_slow
from typed_commands import printed_commands

from benchmarks.truth import Run, Spec, make_run
from pipelines.archive import Archive
from pipelines.cli.history import removal


@pytest.fixture(scope="module")
def kept_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a blank in its name: the recipe and the archive of one run, and a recording."""
    folder = tmp_path_factory.mktemp("a") / "my line"
    folder.mkdir()
    finished_run(folder).archive.root.rename(folder / "kept runs")
    (folder / "m.toml").write_text(MODEL, encoding="utf-8")
    _norms().to_csv(folder / "norms.csv", index=False)
    return folder


MODEL = """
[model]
name = "m"
version = 2
effects = ["bias", "scale", "misalignment", "third_order"]

[[change]]
version = 2
effect = "third_order"
by = "Q"
at = 2026-01-01T00:00:00Z
why = "a test"
"""


def _norms() -> pd.DataFrame:
    """Dwells of unknown poses, with an even term that a sphere or an ellipsoid does not have."""
    rng = np.random.default_rng(5)
    force = rng.normal(size=(60, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    out = force + 0.01 + 0.02 * force**2 + 1e-5 * rng.normal(size=force.shape)
    table = pd.DataFrame({"unit": "N1", "dwell": range(60), "time_s": 60.0 * np.arange(60.0), "n": 100})
    for k, axis in enumerate("xyz"):
        table[f"out_{axis}"], table[f"sd_{axis}"] = out[:, k], 1e-4
    return table


def _rerun(folder: Path) -> tuple[int, str, str]:
    return given("rerun", "small", "--limits", "industrial", "--archive", folder / "kept runs")


def _run(folder: Path) -> tuple[int, str, str]:
    return given("run", next(folder.glob("*.toml")), "--direct", "--archive", folder / "kept runs")


def _refuted(folder: Path) -> tuple[int, str, str]:
    return 0, f"  {removal(folder / 'm.toml', (), 'third_order')}", ""


def _imported(folder: Path) -> tuple[int, str, str]:
    columns = "unit=unit,dwell=dwell,time=time_s,x=out_x,y=out_y,z=out_z,n=n"
    words = ("--map", columns, "--unit-of", "output=g", "--set", "rows=dwells", "--fit", "norm")
    words += ("--set", "local_gravity_m_s2=9.80665")
    return given("import", folder / "norms.csv", *words, "--archive", folder / "kept runs")


def _improved(folder: Path) -> tuple[int, str, str]:
    rng = np.random.default_rng(4)
    force = rng.normal(size=(20, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    output = np.repeat(force * [1.01, 0.99, 1.02] + [0.01, 0.02, -0.01], 200, axis=0) + 1e-3 * rng.normal(
        size=(4000, 3)
    )
    pd.DataFrame(output, columns=["acc_x (g)", "acc_y (g)", "acc_z (g)"]).assign(time_s=np.arange(4000) / 100.0).to_csv(
        folder / "turned by hand.csv", index=False
    )
    words = ("--output", folder / "improved.toml", "--archive", folder / "kept runs")
    return given("improve", folder / "turned by hand.csv", *words)


CASES = {"rerun": _rerun, "run": _run, "history": _refuted, "import_": _imported, "improve_text": _improved}


# the lines of a run: tests/e2e/test_walk_of_recipes.py
@pytest.mark.parametrize("module", mostly_slow(CASES, *(one for one in CASES if one != "run")))
def test_the_lines_to_give_next_run_as_they_are_printed(module: str, kept_runs: Path) -> None:
    status, out, err = CASES[module](kept_runs)
    assert status in {0, 1}, err
    lines = printed_commands(out)
    assert lines
    for words in lines:
        assert not [word for word in words if re.fullmatch(r"[A-Z]{3,}(-[A-Z]+)*", word)], words
        status, _, err = given(*words)
        assert status in {0, 1}, (words, err)


def pasted(lines: list[list[str]]) -> str:
    """Give commands as they are printed, runs without the orchestrator, which is tested elsewhere; what the last one prints."""
    for words in lines:
        status, out, err = given(*words, *(["--direct"] if words[0] == "run" else []))
        assert status in {0, 1}, (words, err)
    return " ".join(out.split())


@pytest.fixture
def hardening(home: Path) -> tuple[object, ...]:
    return ("--station", inquiries.station_file(home, hardening=400e-6), "--direct", "--archive", home / "kept runs")


@pytest.mark.slow
def test_the_lines_after_a_diagnosis_of_a_run_measure_it_again_and_judge_by_it(home: Path, hardening) -> None:
    recipe, where = inquiries.recipe_file(home, "fibonacci24"), hardening[-2:]
    text_of("run", recipe, *hardening)
    _, out, _ = given("diagnose", "latest", *where)
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["extend", "run", "history"]
    assert re.search(r"(?<!not )confirmed:", pasted(lines))
    _, _, err = given("improve", "latest", "--output", home / "again.toml", "--yes", *where)
    assert "fresh run: ambiguous-" in err  # the first run is a fresh run of the second


@pytest.mark.slow
def test_improve_lets_the_station_measure_the_fresh_run(home: Path, hardening) -> None:
    kept = Archive(home / "kept runs")
    text_of("run", inquiries.recipe_file(home, "fibonacci24"), *hardening)
    words = ("improve", "latest", "--output", home / "m.toml", "--yes", "--archive", kept.root)
    document = document_of(*words, "--no-measure", status=0)
    assert document["fresh"] is None
    assert [line.split()[1] for line in document["next"]] == ["run", "history"]
    (home / "m.toml").unlink()
    document = document_of(*words, status=0)
    assert document["ladder"][-1]["confirmed"] is True
    assert document["next"] == []
    assert [kept.run(info.id).about["lot"]["repeat"] for info in kept.runs()] == [0, 1]
    assert document["fresh"] == kept.runs()[-1].id


@pytest.mark.slow
def test_the_lines_after_an_investigation_name_the_judged_model(home: Path, hardening) -> None:
    _, out, err = given("investigate", inquiries.recipe_file(home), "--yes", *hardening)
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["extend", "run", "history"], (out, err)
    assert lines[0][lines[0].index("--effects") + 1] == "bias,scale,misalignment"
    pasted(lines)


@pytest.mark.slow
def test_the_lines_after_an_improvement_decide_between_alternatives(home: Path) -> None:
    made = make_run(Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=3), 5)
    written(made, {"dwells": "dwells.parquet", "fresh": "fresh.parquet"})
    _, out, _ = given("improve", "dwells.parquet", "--effects", "bias,scale,misalignment", "--yes")
    lines = printed_commands(out)
    assert len(lines) > 1  # one for each effect of the class
    # the fresh run beside the dwells stands in them: it judges the effect that is chosen, and nothing is left to give
    assert all(words[words.index("--fresh") + 1] == "fresh.parquet" for words in lines)
    status, out, err = given(*lines[0])
    assert status in {0, 1}, err
    assert printed_commands(out) == []


@pytest.mark.slow
def test_the_lines_of_the_demonstration_run_by_hand(home: Path) -> None:
    status, out, err = given("demo", "cubic_transfer", "--seed", "1", "--yes", "--folder", "my game")
    assert status == 0, err
    Path("my game/model.toml").unlink()
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["compare", "diagnose", "extend", "compare"]
    pasted(lines)


def written(run: Run, names: dict[str, str]) -> None:
    for table, name in names.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        getattr(run, table).to_parquet(name)


@pytest.fixture(scope="module")
def lagging() -> Run:
    """A lot whose devices remember the temperature."""
    return make_run(Spec(effects=("thermal_lag",), sizes=(4.0,), plan="six", soaks="ramps", units=3), 12)


pastable = pytest.mark.usefixtures("home", "no_next_measurement")


@pytest.mark.slow
@pastable
def test_files_beside_the_dwells_are_found_and_stand_in_the_printed_lines(lagging: Run) -> None:
    written(
        lagging, {name: f"{name.replace('_', '-')}.parquet" for name in ("dwells", "history", "fresh", "fresh_history")}
    )
    _, out, err = given("diagnose", "dwells.parquet")
    assert "history: history.parquet, found beside the dwells" in err
    lines = printed_commands(out.split("Next:", 1)[1])
    assert lines[-1][lines[-1].index("--temperatures") + 1] == "history.parquet"
    pasted(lines[:1])
    assert document_of(*lines[1])["versions"][-1]["confirmed"] is True
    # the fresh run's own history stands beside it as well
    _, out, err = given(*lines[-1][: lines[-1].index("--fresh")], "--fresh", "fresh.parquet", "--json")
    row = typed_document("history", out)["versions"][-1]
    assert "fresh-history.parquet, found beside" in err
    assert (row["confirmed"], row["warnings"]) == (True, [])
