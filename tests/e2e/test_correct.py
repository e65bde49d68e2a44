"""``tumbleline correct``: the force, its uncertainty and the bias of recordings whose truth is known; the guide's commands."""

import json
import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from c_compiler import FIXED, REAL, compiled
from capture_double import LSB_PER_G, CaptureDouble, small_job
from pydantic import TypeAdapter
from typer.testing import CliRunner

from inertial.correction import correct as correct_output
from inertial.correction import output_covariance
from inertial.state import State
from pipelines.archive import Archive, Run
from pipelines.archive.signatures import VARIABLE
from pipelines.chain.runner import Runner
from pipelines.cli import app
from pipelines.export import ExportSettings, export_text, unit_calibrations
from pipelines.export.documents import CorrectDocument
from pipelines.tables.calibration import read_calibration
from schemas.errors import DataRejected, WrongUse

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "correct-a-recording.md").read_text(encoding="utf-8")
EXAMPLES = [block.partition("\n") for block in re.findall(r"```console\n\$ (.*?)```", GUIDE, flags=re.DOTALL)]
RATE, GRAVITY_G = 100.0, 9.8123 / 9.80665


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder = tmp_path_factory.mktemp("correct")
    runner = Runner(small_job(folder), Archive(folder / "archive"), measure=CaptureDouble(noise_g=2e-5))
    list(runner.all())
    return runner.run


def raw(
    run: Run,
    force: np.ndarray,
    temperature: np.ndarray,
    rng: np.random.Generator,
    bias: np.ndarray,
    *,
    noise_g: float = 2e-5,
    unit: int = 0,
) -> pd.DataFrame:
    """Output of unit A1 by the physics of the double, under forces (n, 3) at temperatures (n,), with another bias (n, 3) in g."""
    slot = run.about["lot"]["units"][unit]["slot"]
    own = np.random.default_rng([99, slot])
    zero, tempco = own.normal(0.0, 0.01, 3), own.normal(0.0, 5e-5, 3)
    matrix = np.eye(3) + own.normal(0.0, 3e-3, (3, 3))
    theta = (temperature - 25.0)[:, None]
    mean = zero + bias + tempco * theta + (force @ matrix.T) * (1.0 + 1e-4 * theta)
    values = np.round(LSB_PER_G * (mean + noise_g * rng.normal(size=force.shape)))
    table = pd.DataFrame(values, columns=["x", "y", "z"])
    read = temperature + 0.02 * slot  # by the thermometer that the unit was calibrated with
    return table.assign(time_s=np.arange(len(values)) / RATE, unit_C=read)


def correct(run: Run, *words: str) -> tuple[dict, int]:
    done = CliRunner().invoke(app, ["correct", *words, "--archive", str(run.archive.root), "--json"])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    TypeAdapter(CorrectDocument).validate_json(done.stdout, strict=True, extra="forbid")
    return json.loads(done.stdout), done.exit_code


def test_forces_come_back_within_their_uncertainty(run: Run, tmp_path: Path, rng: np.random.Generator) -> None:
    force = rng.normal(size=(4000, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    raw(run, force, rng.uniform(0.0, 50.0, 4000), rng, np.zeros(3)).to_csv(tmp_path / "a.csv", index=False)
    document, status = correct(
        run, str(tmp_path / "a.csv"), "--calibration", "latest:A1", "-o", str(tmp_path / "o.csv")
    )
    table = pd.read_csv(tmp_path / "o.csv")
    error = table[["force_x_g", "force_y_g", "force_z_g"]].to_numpy() - force
    assert status == 0
    assert error.std() < 3e-5
    assert document["bias"] is None
    assert document["u_contains"] == ["references and noise of the calibration"]
    # the seat of the fixture is stated to 1 mrad (rotations about each axis): √(1 − f²) of it on an axis
    across = np.sqrt(1.0 - force[:, 0] ** 2)
    assert table["u_x_ug"].to_numpy() == pytest.approx(1000.0 * across, rel=0.02, abs=15.0)
    assert document["samples"] == 4000


def test_the_covariance_of_the_noise_covers_the_error(run: Run, rng: np.random.Generator) -> None:
    calibration = read_calibration(run.table("coefficients"), run.table("covariance"))
    p, pulls = calibration.coefficients.shape[-1], []
    for u in range(3):
        covariance = np.zeros((3, p, 3, p))
        for axis in range(3):
            covariance[axis, :, axis] = calibration.covariance[u, axis]
        force = rng.normal(size=(60, 3))
        table = raw(run, force, rng.uniform(0.0, 50.0, 60), rng, np.zeros(3), noise_g=0.0, unit=u)
        state = State(force=np.zeros((60, 3)), time=np.arange(60.0), temperature=table["unit_C"].to_numpy())
        corrected = correct_output(
            calibration.effects, state, table[["x", "y", "z"]].to_numpy(), calibration.coefficients[u], {}
        )
        seen = replace(state, force=corrected)
        own = output_covariance(
            calibration.effects, seen, calibration.coefficients[u], {}, covariance.reshape(3 * p, -1)
        )
        pulls.append((corrected - force) / np.sqrt(np.diagonal(own, axis1=1, axis2=2) + (0.29 / LSB_PER_G) ** 2))
    assert 0.65 < np.sqrt(np.mean(np.square(pulls))) < 1.35  # 45 coefficients were drawn


def test_the_arithmetic_is_that_of_the_exported_c(run: Run, tmp_path: Path, rng: np.random.Generator) -> None:
    force = rng.normal(size=(300, 3))
    table = raw(
        run, force / np.linalg.norm(force, axis=1)[:, None], np.round(rng.uniform(0, 50, 300), 3), rng, np.zeros(3)
    )
    table.to_csv(tmp_path / "a.csv", index=False)
    correct(run, str(tmp_path / "a.csv"), "--calibration", "latest:A1", "-o", str(tmp_path / "o.parquet"))
    corrected = pd.read_parquet(tmp_path / "o.parquet")[["force_x_g", "force_y_g", "force_z_g"]].to_numpy()
    unit = unit_calibrations(run, ("A1",), failed=True)
    for arithmetic, call, within in (("double", REAL.replace("REAL", "double"), 1e-9), ("q24", FIXED, 1e-6)):
        header = export_text("c", unit, run.id, ExportSettings(arithmetic=arithmetic))
        own = compiled(header, call, table[["x", "y", "z", "unit_C"]].to_numpy(), tmp_path, "A1")
        assert np.max(np.abs(own - corrected)) < within


def test_the_bias_is_found_where_the_force_is_known_and_its_uncertainty_grows_after(
    run: Run, tmp_path: Path, rng: np.random.Generator
) -> None:
    n, bias = 12_000, np.array([1.5e-3, -2e-3, 0.8e-3])
    force = np.tile([0.0, 0.6, 0.8], (n, 1))
    table = raw(run, force, np.full(n, 30.0), rng, bias)
    table[["force_x", "force_y", "force_z"]] = force
    table.loc[6000:, ["force_x", "force_y", "force_z"]] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    words = [str(tmp_path / "a.csv"), "--calibration", "latest:A1", "--turn-on", "2000", "-o", str(tmp_path / "o.csv")]
    document, status = correct(run, *words)
    done = pd.read_csv(tmp_path / "o.csv")
    own = document["bias"]
    u = np.array([own["u_last_ug"][axis] for axis in "xyz"])
    calibration = np.array([1e6 * 3e-5] * 3)  # what the fit itself is wrong by in this pose is found as bias
    error = np.array([own["last_ug"][axis] for axis in "xyz"]) - 1e6 * bias
    assert np.all(np.abs(error) < 4.0 * np.hypot(u, calibration))
    assert own["updates"] == 60
    assert own["steps"] == 120
    grown = done["u_bias_x_ug"].to_numpy()
    assert np.all(np.diff(grown[6100:]) >= -1e-9)
    assert grown[-1] > 1.3 * grown[6050]
    assert grown[0] > 1900.0
    assert status in {0, 1}


def test_at_rest_the_bias_along_gravity_alone_is_found(run: Run, tmp_path: Path, rng: np.random.Generator) -> None:
    n, bias = 6000, np.array([0.0, 0.0, 3e-3])
    raw(run, np.tile([0.0, 0.0, GRAVITY_G], (n, 1)), np.full(n, 25.0), rng, bias).to_csv(
        tmp_path / "a.csv", index=False
    )
    document, _ = correct(run, str(tmp_path / "a.csv"), "--calibration", "latest:A1", "--turn-on", "3000", "--at-rest")
    own = document["bias"]
    assert own["last_ug"]["z"] == pytest.approx(3000.0, abs=150.0)
    assert own["u_last_ug"]["x"] > 2900.0
    assert own["u_last_ug"]["z"] < 300.0


def test_a_wrong_force_is_told_by_the_innovations(run: Run, tmp_path: Path, rng: np.random.Generator) -> None:
    n = 6000
    wander = np.cumsum(2e-5 * rng.normal(size=(n, 3)), axis=0)  # far more than the unit's noise
    raw(run, np.tile([0.0, 0.0, 1.0], (n, 1)), np.full(n, 25.0), rng, wander).to_csv(tmp_path / "a.csv", index=False)
    document, status = correct(
        run, str(tmp_path / "a.csv"), "--calibration", "latest:A1", "--turn-on", "300", "--force", "0,0,1"
    )
    assert document["bias"]["stated_uncertainty"] == "too small"
    assert status == 1


def test_a_gap_in_the_recording_changes_neither_steps_nor_uncertainty(
    run: Run, tmp_path: Path, rng: np.random.Generator
) -> None:
    n = 6000
    table = raw(run, np.tile([0.0, 0.0, 1.0], (n, 1)), np.full(n, 25.0), rng, np.zeros(3))
    later = table.assign(time_s=table["time_s"] + 600.0 * (np.arange(n) >= n // 2))
    words, uncertainties = ["--calibration", "latest:A1", "--turn-on", "300", "--force", "0,0,1"], []
    for name, one in (("whole", table), ("gap", later)):
        one.to_csv(tmp_path / f"{name}.csv", index=False)
        document, _ = correct(run, str(tmp_path / f"{name}.csv"), *words, "-o", str(tmp_path / f"{name}.parquet"))
        assert document["bias"]["steps"] == 60
        uncertainties.append(pd.read_parquet(tmp_path / f"{name}.parquet")["u_x_ug"].to_numpy())
    whole, gap = uncertainties
    np.testing.assert_allclose(gap[: n // 2], whole[: n // 2], rtol=1e-6)
    assert gap[n // 2] > whole[n // 2]  # the bias has drifted meanwhile


def test_samples_after_the_last_whole_step_have_the_uncertainty_of_their_time(
    run: Run, tmp_path: Path, rng: np.random.Generator
) -> None:
    n, tail = 6050, 50  # half a step, an hour later
    table = raw(run, np.tile([0.0, 0.0, 1.0], (n, 1)), np.full(n, 25.0), rng, np.zeros(3))
    table["time_s"] += 3600.0 * (np.arange(n) >= n - tail)
    table.to_csv(tmp_path / "a.csv", index=False)
    words = ["--calibration", "latest:A1", "--turn-on", "300", "--force", "0,0,1", "-o", str(tmp_path / "o.parquet")]
    document, _ = correct(run, str(tmp_path / "a.csv"), *words)
    corrected = pd.read_parquet(tmp_path / "o.parquet")
    own = corrected["u_bias_x_ug"].to_numpy()
    assert np.all(own[-tail:] > 1.5 * own[-tail - 1])
    assert not corrected["updated"][-tail:].any()
    assert (document["bias"]["updates"], document["bias"]["steps"]) == (60, 61)
    assert document["bias"]["u_last_ug"]["x"] == pytest.approx(own[-1])


def test_refusals_say_what_is_missing(
    run: Run, tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = raw(run, np.tile([0.0, 0.0, 1.0], (500, 1)), np.full(500, 25.0), rng, np.zeros(3))
    table.to_csv(tmp_path / "a.csv", index=False)
    table.drop(columns="unit_C").to_csv(tmp_path / "cold.csv", index=False)
    table.iloc[::-1].to_csv(tmp_path / "back.csv", index=False)
    a = str(tmp_path / "a.csv")
    with pytest.raises(WrongUse, match="3 units, one is needed as RUN:UNIT"):
        correct(run, a, "--calibration", "latest")
    with pytest.raises(WrongUse, match="no unit A9"):
        correct(run, a, "--calibration", "latest:A9")
    monkeypatch.setattr("pipelines.jobs.terms.archived_terms", lambda about: None)
    with pytest.raises(WrongUse, match="--turn-on"):
        correct(run, a, "--calibration", "latest:A1", "--force", "0,0,1")
    with pytest.raises(WrongUse, match="three numbers X,Y,Z"):
        correct(run, a, "--calibration", "latest:A1", "--force", "0,0", "--turn-on", "300")
    with pytest.raises(DataRejected, match="does not always increase"):
        correct(run, str(tmp_path / "back.csv"), "--calibration", "latest:A1")
    with pytest.raises(Exception, match="temperature"):
        correct(run, str(tmp_path / "cold.csv"), "--calibration", "latest:A1")
    with pytest.raises(WrongUse, match=r"\.csv or \.parquet"):
        correct(run, a, "--calibration", "latest:A1", "--output", str(tmp_path / "o.txt"))


def test_the_guide_runs(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", str(run.archive.root))
    rng = np.random.default_rng(3)
    force = np.tile([0.0, 0.0, 1.00057], (6000, 1))
    raw(run, force, np.full(6000, 28.0), rng, np.array([2e-3, 0.0, -1e-3])).to_csv("bench.csv", index=False)
    assert len(EXAMPLES) == 2
    for command, _, printed in EXAMPLES:
        done = CliRunner().invoke(app, shlex.split(command)[1:])
        assert done.exit_code == 0, (command, done.output, done.exception)
        assert re.fullmatch(re.escape(printed.strip()).replace("…", ".*?"), done.stdout.strip()), done.stdout
