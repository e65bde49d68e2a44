"""The commands that are printed to be given next run as they are printed, in their order.

The modules that print such commands are discovered: each has a case here, or its lines are run by the test that is named in
``ELSEWHERE``.
"""

import ast
import contextlib
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import CaptureDouble, small_job
from in_process import given
from typed_commands import printed_commands

from pipelines.archive import Archive
from pipelines.archive.signatures import VARIABLE
from pipelines.chain.runner import Runner
from pipelines.cli.history import removal

HERE = "tests/e2e/test_next_lines.py::"
ELSEWHERE = {
    "diagnosis_text": "tests/e2e/test_printed_next_lines.py::"
    "test_files_beside_the_dwells_are_found_and_stand_in_the_printed_lines",
    "diagnose": HERE + "test_the_lines_after_a_diagnosis_of_a_run_measure_it_again_and_judge_by_it",
    "investigate": HERE + "test_the_lines_after_an_investigation_name_the_judged_model",
    "improve_text": HERE + "test_the_lines_after_an_improvement_decide_between_alternatives",
    "demo": HERE + "test_the_lines_of_the_demonstration_run_by_hand",
    "optimal": "tests/e2e/test_plan_optimise.py::test_the_line_after_a_search_measures_the_new_recipe",
}
"""Where the lines of a module are run that prints them after minutes only, or after several commands."""

PRINTING = {"command_line", "print_next", "print_extension", "removal"}
"""Functions that make or print a command to give next."""

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a blank in its name: the recipe and the archive of one run, and a recording."""
    folder = tmp_path_factory.mktemp("a") / "my line"
    folder.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(VARIABLE, "")
        runner = Runner(small_job(folder), Archive(folder / "kept runs"), measure=CaptureDouble())
        list(runner.all())
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
    return 0, f"  {removal(folder / 'm.toml', 'third_order')}", ""


def _imported(folder: Path) -> tuple[int, str, str]:
    columns = "unit=unit,dwell=dwell,time=time_s,x=out_x,y=out_y,z=out_z,n=n"
    words = ("--map", columns, "--units", "output=g", "--rows", "dwells", "--fit", "norm", "--local-g", "9.80665")
    return given("import", folder / "norms.csv", *words, "--archive", folder / "kept runs")


CASES = {"rerun": _rerun, "run": _run, "history": _refuted, "import_text": _imported}


@pytest.mark.parametrize("module", CASES)
def test_the_lines_to_give_next_run_as_they_are_printed(module: str, line: Path, monkeypatch) -> None:
    monkeypatch.setenv(VARIABLE, "")
    status, out, err = CASES[module](line)
    assert status in {0, 1}, err
    lines = printed_commands(out)
    assert lines
    for words in lines:
        assert not [word for word in words if re.fullmatch(r"[A-Z]{3,}(-[A-Z]+)*", word)], words
        status, _, err = given(*words)
        assert status in {0, 1}, (words, err)


def called(path: Path) -> set[str]:
    """Names of the functions that a module calls."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    calls = [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]
    return {f.id if isinstance(f, ast.Name) else f.attr for f in calls if isinstance(f, ast.Name | ast.Attribute)}


def test_every_module_that_prints_a_command_to_give_next_is_run_by_a_test() -> None:
    modules = {path.stem for path in (ROOT / "pipelines" / "cli").rglob("*.py") if called(path) & PRINTING} - {
        "next_commands"
    }
    assert modules == set(CASES) | set(ELSEWHERE)
    for test in ELSEWHERE.values():
        file, name = test.split("::")
        assert f"def {name}(" in (ROOT / file).read_text(encoding="utf-8")


@pytest.mark.slow
def test_the_lines_after_a_diagnosis_of_a_run_measure_it_again_and_judge_by_it(tmp_path: Path) -> None:
    """A lot on the simulated station with a mechanism in it: diagnosed, extended, measured again, judged."""
    import inquiries

    recipe = inquiries.recipe_file(tmp_path, "fibonacci24")
    station = inquiries.station_file(tmp_path, hardening=400e-6)
    place = ("--archive", tmp_path / "kept runs")
    assert given("run", recipe, "--station", station, "--direct", *place)[0] in {0, 1}
    status, out, err = given("diagnose", "latest", *place)
    assert status == 1, err
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["extend", "run", "history"]
    with contextlib.chdir(tmp_path):
        for words in lines:
            direct = ["--direct"] if words[0] == "run" else []  # the orchestrator is tested elsewhere
            status, out, err = given(*words, *direct)
            assert status in {0, 1}, (words, err)
    assert re.search(r"(?<!not )confirmed:", " ".join(out.split()))
    status, out, err = given("improve", "latest", "--out", tmp_path / "again.toml", "--yes", *place)
    assert status == 0, err
    assert "fresh run: ambiguous-" in err  # the first run is a fresh run of the second


@pytest.mark.slow
def test_improve_lets_the_station_measure_the_fresh_run(tmp_path: Path) -> None:
    import json

    import inquiries

    recipe = inquiries.recipe_file(tmp_path, "fibonacci24")
    station = inquiries.station_file(tmp_path, hardening=400e-6)
    kept = Archive(tmp_path / "kept runs")
    given("run", recipe, "--station", station, "--direct", "--archive", kept.root)
    words = ("improve", "latest", "--out", tmp_path / "m.toml", "--yes", "--json", "--archive", kept.root)
    status, out, err = given(*words, "--no-measure")
    document = json.loads(out)
    assert (status, document["fresh"]) == (0, None), err
    assert [line.split()[1] for line in document["next"]] == ["run", "history"]
    (tmp_path / "m.toml").unlink()
    status, out, err = given(*words)
    document = json.loads(out)
    assert status == 0, err
    assert document["ladder"][-1]["confirmed"] is True
    assert document["next"] == []
    assert [kept.run(info.id).about["lot"]["repeat"] for info in kept.runs()] == [0, 1]
    assert document["fresh"] == kept.runs()[-1].id


@pytest.mark.slow
def test_the_lines_after_an_investigation_name_the_judged_model(tmp_path: Path) -> None:
    import inquiries

    recipe = inquiries.recipe_file(tmp_path)
    station = inquiries.station_file(tmp_path, hardening=400e-6)
    place = ("--archive", tmp_path / "kept runs")
    _, out, err = given("investigate", recipe, "--station", station, "--direct", "--yes", *place)
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["extend", "run", "history"], (out, err)
    assert lines[0][lines[0].index("--effects") + 1] == "bias,scale,misalignment"
    with contextlib.chdir(tmp_path):
        for words in lines:
            status, out, err = given(*words, *(["--direct"] if words[0] == "run" else []))
            assert status in {0, 1}, (words, err)


@pytest.mark.slow
def test_the_lines_after_an_improvement_decide_between_alternatives(tmp_path: Path) -> None:
    from benchmarks.truth import Spec, make_run

    made = make_run(Spec(effects=("second_order",), sizes=(4.0,), plan="six", soaks="one", repeats=4, units=3), 5)
    made.dwells.to_parquet(tmp_path / "dwells.parquet")
    made.fresh.to_parquet(tmp_path / "fresh.parquet")
    with contextlib.chdir(tmp_path):
        _, out, _ = given("improve", "dwells.parquet", "--effects", "bias,scale,misalignment", "--yes")
        lines = printed_commands(out)
        assert len(lines) > 1  # one for each effect of the class
        status, out, err = given(*lines[0])
        assert status in {0, 1}, err
        for words in printed_commands(out):
            status, _, err = given(*words)
            assert status in {0, 1}, (words, err)


@pytest.mark.slow
def test_the_lines_of_the_demonstration_run_by_hand(tmp_path: Path) -> None:
    folder = tmp_path / "my game"
    status, out, err = given("demo", "--effect", "cubic_transfer", "--seed", "1", "--auto", "--folder", folder)
    assert status == 0, err
    (folder / "model.toml").unlink()
    lines = printed_commands(out)
    assert [words[0] for words in lines] == ["compare", "diagnose", "extend", "compare"]
    for words in lines:
        status, _, err = given(*words)
        assert status in {0, 1}, (words, err)
