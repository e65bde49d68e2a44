"""A device with one axis from its recipe to certificate and memory, beside the same devices as triads."""

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from in_process import document_of, given, text_of
from laboratory import laboratory_file
from long_suites import mostly_slow

from pipelines.archive import Archive
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Request
from schemas.errors import UNUSABLE
from tumbleline import Calibration

RECIPE = """
name = "{name}"
device = "sf1500"
units = ["SF-01", "SF-02", "SF-03"]
local_gravity_m_s2 = 9.80665
poses = "eighteen"
verification = [[35.0, 15.0], [105.0, -100.0]]
temperatures_C = [0.0, 50.0]
settle_s = 1.0
dwell_s = 2.0
rate_hz = 50.0
static_record_s = 30.0
effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
limits = "own.limits.toml"
"""
LIMITS = """
name = "own"
rule = "guarded_acceptance"
grade = "consumer"
[figures]
verification_norm_ug = { max = 5000.0, unit = "µg" }
"""
ONE = 'device = "sf1500"\nsensor_axes = 1\n'
ORTHOGONAL = 'orthogonality_mrad = { max = 5.0, unit = "mrad" }\n'


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, str]]:
    """The folder of recipes and archive, and the run of the first axis alone."""
    folder = tmp_path_factory.mktemp("axes")
    (folder / "own.limits.toml").write_text(LIMITS, encoding="utf-8")
    for name, text in (("three", RECIPE), ("one", RECIPE.replace('device = "sf1500"\n', ONE))):
        (folder / f"{name}.toml").write_text(text.format(name=name), encoding="utf-8")
    return folder, {"one": document_of("run", folder / "one.toml", "--direct", "--archive", folder / "archive")["run"]}


@pytest.fixture(scope="module")
def both(measured: tuple[Path, dict[str, str]]) -> tuple[Path, dict[str, str]]:
    """The same with the run of the triads, without verdict and report."""
    folder, runs = measured
    store = Archive(folder / "archive")
    triads = Runner(Request(str(folder / "three.toml")).job(store), store)
    for stage in ORDER[:-1]:
        if stage != "judge":  # takes longest, and is of the one axis
            triads.stage(stage)
    return folder, {**runs, "three": triads.run.id}


def table(measured: tuple[Path, dict[str, str]], name: str, which: str) -> pd.DataFrame:
    folder, runs = measured
    return Archive(folder / "archive").run(runs[which]).table(name)


@pytest.mark.slow
def test_one_axis_has_the_outputs_and_coefficients_of_that_axis_of_a_triad(both) -> None:
    one, three = (table(both, "dwells", which) for which in ("one", "three"))
    assert np.array_equal(one["out_x"], three["out_x"])
    key = ["unit", "axis", "effect", "name"]
    own, triad = (table(both, "coefficients", which).set_index(key) for which in ("one", "three"))
    assert set(own.index.get_level_values("axis")) == {"x"}
    beside = own.join(triad, suffixes=("", "_triad"))
    # the weights differ: a triad's noise is estimated from three axes
    apart = (beside["value"] - beside["value_triad"]).abs() / beside["standard_error_triad"]
    assert apart.max() < 1.0


@pytest.mark.slow
def test_the_budget_of_one_axis_is_that_of_the_axis_of_a_triad(both) -> None:
    key = ["unit", "quantity", "axis"]
    rows = [table(both, "uncertainties", which).set_index(key) for which in ("one", "three")]
    beside = rows[0].join(rows[1], suffixes=("", "_triad"))
    stated = beside[beside["u_b"] > 0.0]
    assert {"bias", "scale", "misalignment", "output", "bias_error"} <= set(stated.index.get_level_values("quantity"))
    ratio = (stated["u_b"] / stated["u_b_triad"]).groupby("quantity")
    for name in ("bias", "scale", "misalignment"):
        assert np.allclose(ratio.get_group(name), 1.0, atol=0.05)
    for name in ("output", "bias_error"):  # of a triad, the symmetric part of what its axes answer across is one, too
        assert (ratio.get_group(name) < 1.01).all()
        assert (ratio.get_group(name) > 0.7).all()
    assert "orthogonality" not in rows[0].index.get_level_values("quantity")


@pytest.mark.slow
def test_samples_noise_verdict_grades_and_report_are_those_of_one_axis(measured) -> None:
    folder, runs = measured
    run = Archive(folder / "archive").run(runs["one"])
    first = next(run.records.samples([0]))
    assert np.isfinite(first["x"]).all()
    assert first[["y", "z"]].isna().all(axis=None)
    assert set(run.table("noise")["axis"]) == set(run.table("residuals")["axis"]) == {"x"}
    assert (run.table("grades")["outcome"] == "pass").all()
    found = document_of("diagnose", runs["one"], "--archive", folder / "archive", "--json")
    assert (found["adequate"], found["classes"]) == (True, [])
    report = run.report.read_bytes().decode()
    assert "error of |a| on poses not used, worst pose</td><td>all</td>" in report
    for words in ("error of the magnitude", "difference between the magnitude", ">norm</td>"):
        assert words not in report


@pytest.mark.slow
def test_its_certificate_and_its_memory_hold_one_axis(measured, tmp_path: Path) -> None:
    folder, runs = measured
    archive = ("--archive", folder / "archive")
    assert "SF-01/1" in text_of("certificate", "issue", runs["one"], *archive)
    text_of("certificate", "write", "SF-02", *archive, "--laboratory", laboratory_file(tmp_path), "--output", tmp_path)
    text = next(tmp_path.glob("*.xml")).read_text(encoding="utf-8")
    assert "error of the corrected output, verification (largest of the poses)" in text
    assert "norm of gravity" not in text
    shown = document_of("show", "SF-01", *archive, "--json")
    assert {row["axis"] for row in shown["calibration"]["coefficients"]} == {"x"}
    exported = text_of("export", runs["one"], *archive, "--format", "c")
    assert "axes x; output[1] and output[2]: force along that axis in g" in exported
    programmed = document_of("station", "program", runs["one"], *archive, "--units", "SF-01", "--yes", "--json")
    assert [unit["outcome"] for unit in programmed["units"]] == ["proved"]
    fixed = document_of(
        "station", "program", runs["one"], *archive, "--units", "SF-02", "--format", "q24", "--yes", "--json"
    )
    assert [unit["outcome"] for unit in fixed["units"]] == ["proved"]
    header = text_of("export", runs["one"], *archive, "--format", "c", "--set", "arithmetic=q24", "--units", "SF-02")
    assert "output[1] and output[2]: force along that axis in g * 16777216, 0 where it is not known" in header


def test_a_trajectory_along_its_axis_comes_back_through_simulate_and_correct(measured, tmp_path: Path) -> None:
    folder, runs = measured
    time = np.arange(500) / 50.0
    force = np.column_stack([0.8 * np.sin(0.7 * time), np.zeros((time.size, 2))])
    columns = {"time_s": time, **{f"force_{axis}": force[:, k] for k, axis in enumerate("xyz")}, "unit_C": 20.0 + time}
    pd.DataFrame(columns).to_csv(tmp_path / "way.csv", index=False)
    calibration, archive = f"{runs['one']}:SF-02", ("--archive", folder / "archive")
    made = document_of(
        "simulate", tmp_path / "way.csv", calibration, "--seed", "none", "--output", tmp_path / "raw.csv", *archive
    )
    assert list(made["error_at_25_C_ug"]) == ["x"]
    raw = pd.read_csv(tmp_path / "raw.csv")
    assert {"x", "force_x"} <= set(raw)
    assert not {"y", "z"} & set(raw)
    raw[["time_s", "x", "unit_C"]].to_csv(tmp_path / "output.csv", index=False)
    done = document_of("correct", tmp_path / "output.csv", calibration, "--output", tmp_path / "done.csv", *archive)
    assert list(done["u_ug"]) == ["x"]
    corrected = pd.read_csv(tmp_path / "done.csv")
    assert np.abs(corrected["force_x_g"] - force[:, 0]).max() < 1e-8
    assert not {"force_y_g", "u_y_ug", "cov_xy_ug2"} & set(corrected)
    text_of("export", runs["one"], "--waveforms", "0", "--output", tmp_path / "waves.csv", *archive)
    assert [name.split(" [")[0] for name in pd.read_csv(tmp_path / "waves.csv")] == ["time", "SF-01 x"]
    ours = Calibration(Archive(str(folder / "archive")).run(runs["one"]))
    done_here = ours.correct(raw["x"].to_numpy(), unit="SF-02", temperature=raw["unit_C"], rate_hz=50.0)
    assert np.abs(done_here["force_x_g"] - force[:, 0]).max() < 1e-8
    noisy = document_of(
        "simulate", tmp_path / "way.csv", calibration, "--seed", "1", "--output", tmp_path / "n.csv", *archive
    )
    assert {len(values) for values in noisy["noise"].values()} == {1}
    status, _, told = given("correct", tmp_path / "output.csv", calibration, "--track", "at-rest", *archive)
    assert status == UNUSABLE
    assert "correct: --track needs three axes, and unit SF-02 has x alone" in " ".join(told.split())


@pytest.mark.slow
def test_its_plan_speaks_of_one_axis(measured) -> None:
    folder, _ = measured
    planned = document_of("plan", folder / "one.toml", "--output", folder / "plan.html", "--json")
    assert {row["axis"] for row in planned["coefficients"]} == {"x"}
    assert {len(row["left_by_axis"]) for row in planned["effects"]} == {1}
    page = (folder / "plan.html").read_text(encoding="utf-8")
    assert "error x, 1σ" in page
    assert "error y, 1σ" not in page
    for words in ("magnitude", ">norm<", "verification norm", ", norm"):
        assert words not in page


TWO = 'procedures = [{{ kind = "multi_position" }}, {{ kind = "{}" }}]'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('device = "sf1500"', 'device = "adxl355"', "sensor_axes: 1 of device ADXL355, its digital output sends 3"),
        ("static_record_s = 30.0", TWO.format("transverse"), "it measures axis y, z, the device has x"),
        ("static_record_s = 30.0", TWO.format('sweep", axis = "z'), "it measures axis z, the device has x"),
        ("sensor_axes = 1", "sensor_axes = 4", "sensor_axes"),
        ("", ORTHOGONAL, "orthogonality_mrad needs sensor_axes = 3"),
    ],
)
def test_what_a_device_with_one_axis_cannot_do_is_said(
    measured, old: str, new: str, words: str, tmp_path: Path
) -> None:
    text = (measured[0] / "one.toml").read_text(encoding="utf-8")
    assert old in text
    (tmp_path / "other.toml").write_text(text.replace(old, new) if old else text, encoding="utf-8")
    (tmp_path / "own.limits.toml").write_text(LIMITS if old else LIMITS + new, encoding="utf-8")
    status, _, err = given("run", tmp_path / "other.toml", "--archive", tmp_path / "archive")
    assert status == UNUSABLE
    assert words in " ".join(err.split())
    assert not (tmp_path / "archive").exists()


def test_a_discovery_in_runs_of_one_axis_says_that_no_lot_can_be_used_and_why(
    measured, tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    folder, _ = measured
    shutil.copytree(folder / "archive", tmp_path / "archive", ignore=shutil.ignore_patterns("three-*"))
    archive = ("--archive", tmp_path / "archive")
    text = " ".join(text_of("discover", *archive, "--html", tmp_path / "page.html").split())
    reason = "no lot can be used: its devices have fewer than three axes (1 run)"
    assert reason in text
    assert "e^" not in text
    assert reason in (tmp_path / "page.html").read_text(encoding="utf-8")
    assert document_of("discover", *archive, "--json")["error_control"]["log_e_needed"] is None
    assert not [one for one in recwarn if "divide" in str(one.message)]


@pytest.mark.parametrize(("which", "letters"), mostly_slow([("three", "xyz"), ("one", "x")], ("one", "x")))
def test_teds_of_every_axis_are_in_the_memory_of_the_device_and_stay_there(
    request: pytest.FixtureRequest, tmp_path: Path, which: str, letters: str
) -> None:
    folder, runs = request.getfixturevalue("both" if which == "three" else "measured")
    shutil.copytree(folder / "archive", tmp_path / "archive")
    sheet = "teds=manufacturer=17,model=4507,version=B5,mass_g=4.6,initials=QA,period_days=365"
    words = ("--format", "teds", "--set", sheet, "--archive", tmp_path / "archive")
    exported = given("export", runs[which], *words, "--output", tmp_path / "files")
    assert exported[0] == 0, exported
    done = document_of("station", "program", runs[which], *words, "--yes")
    assert [one["outcome"] for one in done["teds"]] == ["proved"] * 3
    for one in done["teds"]:
        assert [page["axis"] for page in one["pages"]] == list(letters)
        assert not any(bytes.fromhex(one["before"]))
        for page in one["pages"]:
            content = bytes.fromhex(page["content"])
            assert content == (tmp_path / "files" / f"{one['unit']}-{page['axis']}.teds").read_bytes()
            assert sum(content) % 256 == 0
    # the memory keeps them: a second writing finds what the first left, and certificates stay as they are
    again = document_of("station", "program", runs[which], *words, "--yes", "--units", "SF-02")
    (one,) = again["teds"]
    memory = bytes.fromhex(one["before"])
    held = [memory[start : start + 32] for start in range(0, len(memory), 32)]
    assert held[: len(letters)] == [bytes.fromhex(page["content"]) for page in one["pages"]]
    assert not any(b"".join(held[len(letters) :]))
