"""A recording made elsewhere all the way, as commands: import, diagnose, extend, fit, history, export, report; no certificate."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter
from typer.testing import CliRunner, Result

from benchmarks.made_recordings import Recording, make, samples_of
from pipelines.cli import app
from pipelines.rerun.documents import ImportedFitDocument
from schemas.errors import WrongUse

DWELLS = "time=time_s,x=out_x,y=out_y,z=out_z,sd_x=sd_x,sd_y=sd_y,sd_z=sd_z,n=n,duration=duration_s"
LIMITS = 'name = "bench"\nrule = "simple_acceptance"\n[figures]\nresidual_rms_ug = { max = 300.0, unit = "µg" }\n'
PLAIN = "bias,scale,misalignment"
DRIFTING = Recording(60, "white 280, B 30", warm_up=3000.0, sensor=11)


def run(*words: str | Path, archive: Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words), "--archive", str(archive)])


def document(*words: str | Path, archive: Path) -> tuple[dict[str, Any], int]:
    done = run(*words, "--json", archive=archive)
    assert done.exit_code in (0, 1), done.output
    return json.loads(done.stdout), done.exit_code


def imported(what: Recording, seed: int, folder: Path, *more: str) -> tuple[dict[str, Any], int]:
    """A recording imported as dwells."""
    path = folder / f"hand-{seed}.csv"
    make(what, seed).dwells.to_csv(path, index=False)
    words = ("--map", DWELLS, "--units", "output=LSB", "--unit", "H1", "--rows", "dwells", "--local-g", "9.80665")
    return document("import", path, *words, *more, archive=folder / "archive")


def laboratory(folder: Path) -> Path:
    """A laboratory's file."""
    place = '{name = "L", address = "A", email = "a@b.c"'
    text = f'laboratory = {place}, country = "DE"}}\ncustomer = {place}}}\n'
    text += 'signatory = {name = "S", role = "R"}\nitem = {manufacturer = "M"}\n'
    (folder / "laboratory.toml").write_text(text, encoding="utf-8")
    return folder / "laboratory.toml"


def test_from_a_recording_of_unknown_poses_to_a_report_and_no_certificate(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    archive, model = tmp_path / "archive", tmp_path / "model.toml"
    (tmp_path / "limits.toml").write_text(LIMITS, encoding="utf-8")
    first, status = imported(DRIFTING, 71, tmp_path, "--fit", "norm")
    assert (first["adequate"], status) == (False, 1)
    fresh, _ = imported(DRIFTING, 72, tmp_path)

    diagnosis, _ = document("diagnose", first["run"], archive=archive)
    assert diagnosis["recommended"] == ["warm_up"]
    assert run("extend", model, "warm_up", "--effects", PLAIN, "--run", first["run"], archive=archive).exit_code == 2
    assert CliRunner().invoke(app, ["extend", str(model), "warm_up", "--effects", PLAIN]).exit_code == 0

    fitted, status = document("fit", first["run"], "--model", model, "--limits", "limits.toml", archive=archive)
    assert (fitted["adequate"], status) == (True, 0)
    TypeAdapter(ImportedFitDocument).validate_json(json.dumps(fitted), strict=True, extra="forbid")
    assert [unit["outcome"] for unit in fitted["units"]] == ["pass"]
    assert fitted["error"]["rms_ug"] < 0.3 * first["error"]["rms_ug"]

    history, _ = document("history", model, "--dwells", first["run"], "--fresh", fresh["run"], archive=archive)
    last = history["versions"][-1]
    assert last["confirmed"] is True, last["text"]
    assert last["fresh_ug"] < history["versions"][0]["fresh_ug"]

    exported = json.loads(run("export", fitted["run"], archive=archive).stdout)
    truth = make(DRIFTING, 71)
    unit = exported["units"][0]
    np.testing.assert_allclose(unit["bias"][0], truth.bias, atol=3.0)
    assert "warm_up" in str(unit)

    page = Path(run("report", fitted["run"], archive=archive).stdout.strip())
    text = page.read_text(encoding="utf-8")
    assert "Coefficients" in text
    assert "degrees of freedom" in text
    problem = run("certify", fitted["run"], archive=archive).exception
    assert isinstance(problem, WrongUse)
    assert "was imported without a statement of its references (noise only)" in str(problem)
    problem = run("certificate", "H1", "--laboratory", laboratory(tmp_path), archive=archive).exception
    assert isinstance(problem, WrongUse)
    assert "unit H1 has no certificate, one is needed" in str(problem)
    assert run("verify", archive=archive).exit_code == 0


def test_an_import_a_fit_and_a_diagnosis_of_one_file_say_the_same(tmp_path: Path) -> None:
    first, _ = imported(Recording(40, "white 280, B 30"), 5, tmp_path, "--fit", "norm")
    fitted, _ = document("fit", first["run"], "--effects", PLAIN, archive=tmp_path / "archive")
    judged, _ = document("diagnose", first["run"], archive=tmp_path / "archive")
    for key in ("rms_ug", "floor_ug", "white_noise_ug", "p_value"):
        assert first["error"][key] == fitted["error"][key] == judged["error"][key]
    assert first["adequate"] is fitted["adequate"] is judged["adequate"]
    assert first["error"]["fit_rms_ug"] == pytest.approx(first["error"]["rms_ug"], rel=1e-3)


def test_ten_dwells_and_nine_parameters_are_not_called_adequate(tmp_path: Path) -> None:
    answer, status = imported(Recording(10), 3, tmp_path, "--fit", "norm")
    assert (answer["adequate"], status) == (None, 1)
    assert "15 are needed" in answer["reason"]
    assert answer["evidence"]["degrees_of_freedom"] == 1
    assert len(answer["bias_less_six_parameters"]) == 3


def test_a_bad_dwell_is_named_and_the_fit_without_it_is_a_run_of_its_own(tmp_path: Path) -> None:
    what = Recording(30, "white 280, B 30", bad=1, bad_ug=5000.0)
    spoilt = make(what, 9).spoilt[0]
    answer, _ = imported(what, 9, tmp_path, "--fit", "norm")
    name = f"H1:{spoilt}"
    assert answer["leave_out"]["dwells"] == [{"unit": "H1", "dwell": spoilt}]
    assert any(f"--leave-out {name}" in line for line in answer["lines"])
    fitted, status = document("fit", answer["run"], "--leave-out", name, archive=tmp_path / "archive")
    assert (fitted["adequate"], fitted["left_out"], status) == (True, [name], 0)
    judged, status = document("diagnose", answer["run"], "--leave-out", name, archive=tmp_path / "archive")
    assert (judged["adequate"], status) == (True, 0)
    again, _ = document("diagnose", fitted["run"], archive=tmp_path / "archive")
    assert again["error"]["rms_ug"] == judged["error"]["rms_ug"]


def test_an_import_whose_model_is_not_adequate_gets_no_certificate(tmp_path: Path) -> None:
    (tmp_path / "limits.toml").write_text(LIMITS.replace("300.0", "9000.0"), encoding="utf-8")
    answer, _ = imported(DRIFTING, 71, tmp_path)
    limits = ("--effects", PLAIN, "--limits", tmp_path / "limits.toml")
    fitted, status = document("fit", answer["run"], *limits, archive=tmp_path / "archive")
    assert ([unit["outcome"] for unit in fitted["units"]], fitted["adequate"], status) == (["pass"], False, 1)
    problem = run("certify", fitted["run"], archive=tmp_path / "archive").exception
    assert isinstance(problem, WrongUse)
    assert "is NOT ADEQUATE" in str(problem)


def test_known_poses_go_the_same_way(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    force = np.tile(
        np.concatenate([np.eye(3), -np.eye(3), np.sqrt(0.5) * np.array([[1, 1, 0], [0, 1, 1], [1, 0, 1]])]), (4, 1)
    )
    n = len(force)
    table = make(Recording(n), 6).dwells.drop(columns=["out_x", "out_y", "out_z"])
    out = np.array([0.01, -0.02, 0.03]) + force * [1.01, 0.99, 1.0] + 3e-5 * rng.standard_normal((n, 3))
    sd = {f"sd_{axis}": 3e-5 * np.sqrt(table["n"]) for axis in "xyz"}
    table = table.assign(
        **sd, out_x=out[:, 0], out_y=out[:, 1], out_z=out[:, 2], fx=force[:, 0], fy=force[:, 1], fz=force[:, 2]
    )
    table.assign(hum=40.0 + np.arange(n) % 7).to_csv(tmp_path / "poses.csv", index=False)
    words = (
        "--map",
        f"{DWELLS},force_x=fx,force_y=fy,force_z=fz,hum=hum",
        "--units",
        "output=g",
        "--unit",
        "P1",
        "--rows",
        "dwells",
    )
    answer, _ = document("import", tmp_path / "poses.csv", *words, archive=tmp_path / "archive")
    fitted, status = document("fit", answer["run"], "--effects", f"{PLAIN},covariate:hum", archive=tmp_path / "archive")
    assert (fitted["adequate"], status) == (True, 0)
    unit = json.loads(run("export", fitted["run"], archive=tmp_path / "archive").stdout)["units"][0]
    np.testing.assert_allclose(unit["bias"][0], [0.01, -0.02, 0.03], atol=1e-4)
    assert run("report", fitted["run"], archive=tmp_path / "archive").exit_code == 0


def test_samples_in_the_hand_become_dwells_that_agree_with_the_truth(tmp_path: Path) -> None:
    what = Recording(26, "white 100, axes 1:2:3", sensor=3)
    samples_of(what, 31).round({"x": 2, "y": 2, "z": 2}).to_csv(tmp_path / "hand.csv", index=False)
    words = (
        "--map",
        "time=time_s,x=x,y=y,z=z",
        "--units",
        "output=LSB",
        "--unit",
        "H2",
        "--local-g",
        "9.80665",
        "--fit",
        "norm",
    )
    answer, _ = document("import", tmp_path / "hand.csv", *words, archive=tmp_path / "archive")
    assert 24 <= answer["dwells"] <= 28
    truth = make(what, 31)
    off = np.abs(np.array(answer["bias"]) - truth.bias)
    assert np.all(off < 4.0 * np.array(answer["bias_u_record"]) + 0.5)


def test_advice_for_an_import_that_was_not_fitted(tmp_path: Path) -> None:
    answer, _ = imported(Recording(20), 2, tmp_path)
    for words, advice in (
        (("export", answer["run"]), f"fit it with 'tumbleline fit {answer['run']} --effects"),
        (("report", answer["run"]), f"fit it with 'tumbleline fit {answer['run']} --effects"),
        (("certify", answer["run"]), f"tumbleline fit {answer['run']} --limits FILE"),
    ):
        problem = run(*words, archive=tmp_path / "archive").exception
        assert isinstance(problem, WrongUse)
        assert advice in str(problem)


def test_a_fit_that_fails_leaves_no_run(tmp_path: Path) -> None:
    answer, _ = imported(Recording(20), 2, tmp_path)
    archive = tmp_path / "archive"
    for command in ("fit", "rerun"):
        done = run(command, answer["run"], "--effects", f"{PLAIN},supply_sensitivity", archive=archive)
        assert "supply" in done.output + str(done.exception)
        assert done.exit_code == 1
        listed, _ = document("list", archive=archive)
        assert [one["id"] for one in listed["runs"]] == [answer["run"]]
