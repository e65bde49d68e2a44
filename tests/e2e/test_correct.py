"""``tumbleline correct``: the force, its uncertainty and the bias of recordings whose truth is known; the guide's commands."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import printed_pages as pages
import pytest
from c_compiler import FIXED, REAL, compiled
from capture_double import LSB_PER_G, CaptureDouble, small_job
from each import each
from in_process import document_of, given, refused, text_of
from long_suites import mostly_slow
from scipy import signal
from scipy.io import loadmat
from test_guides import wrong

from inertial.correction import correct as correct_output
from inertial.correction import output_covariance
from inertial.state import State
from pipelines.archive import Archive, Run
from pipelines.chain.runner import Runner
from pipelines.export import ExportSettings, export_files, unit_calibrations
from pipelines.tables.calibration import read_calibration

pytestmark = pytest.mark.usefixtures("home")
RATE, GRAVITY_G = 100.0, 9.8123 / 9.80665
FORCES = [f"force_{axis}_g" for axis in "xyz"]
BIAS = np.array([1.5e-3, -2e-3, 0.8e-3])


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


def corrected(
    run: Run, table: pd.DataFrame, *words: object, status: int | None = None
) -> tuple[dict[str, Any], pd.DataFrame]:
    """Document and table of a correction; the recording and its correction stand in the working folder."""
    table.to_csv("a.csv", index=False)
    own = ("a.csv", "latest:A1", "--archive", run.archive.root, "--output", "o.parquet", *words)
    return document_of("correct", *own, status=status), pd.read_parquet("o.parquet")


def still(run: Run, rng: np.random.Generator, n: int, *, warm: float = 25.0, **how: Any) -> pd.DataFrame:
    force, bias = how.get("force", (0.0, 0.0, 1.0)), how.get("bias", np.zeros(3))
    return raw(run, np.tile(force, (n, 1)), np.full(n, warm), rng, bias)


def test_forces_come_back_within_their_uncertainty(run: Run, rng: np.random.Generator) -> None:
    force = rng.normal(size=(4000, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    document, table = corrected(run, raw(run, force, rng.uniform(0.0, 50.0, 4000), rng, np.zeros(3)), status=0)
    assert (table[FORCES].to_numpy() - force).std() < 3e-5
    assert document["u_contains"] == ["references and noise of the calibration"]
    # the seat of the fixture is stated to 1 mrad (rotations about each axis): √(1 − f²) of it on an axis
    across = np.sqrt(1.0 - force[:, 0] ** 2)
    assert table["u_x_ug"].to_numpy() == pytest.approx(1000.0 * across, rel=0.02, abs=15.0)


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


def test_the_arithmetic_is_that_of_the_exported_c(run: Run, home: Path, rng: np.random.Generator) -> None:
    force = rng.normal(size=(300, 3))
    force /= np.linalg.norm(force, axis=1)[:, None]
    table = raw(run, force, np.round(rng.uniform(0, 50, 300), 3), rng, np.zeros(3))
    _, done = corrected(run, table)
    unit = unit_calibrations(run, ("A1",), failed=True)
    for arithmetic, call, within in (("double", REAL.replace("REAL", "double"), 1e-9), ("q24", FIXED, 1e-6)):
        [header] = export_files("c", unit, run.id, ExportSettings(arithmetic=arithmetic)).values()
        own = compiled(header.decode(), call, table[["x", "y", "z", "unit_C"]].to_numpy(), home, "A1")
        assert np.max(np.abs(own - done[FORCES].to_numpy())) < within


def test_the_bias_is_found_where_the_force_is_known_and_its_uncertainty_grows_after(
    run: Run, rng: np.random.Generator
) -> None:
    document, done = corrected(run, tracked(run, rng), "--set", "turn_on=2000")
    own = document["bias"]
    error, u = (np.array([own[name][axis] for axis in "xyz"]) for name in ("last_ug", "u_last_ug"))
    # 30 µg: what the fit itself is wrong by in this pose is found as bias
    assert np.all(np.abs(error - 1e6 * BIAS) < 4.0 * np.hypot(u, 30.0))
    assert (own["updates"], own["steps"]) == (60, 120)
    grown = done["u_bias_x_ug"].to_numpy()
    assert np.all(np.diff(grown[6100:]) >= -1e-9)
    assert grown[-1] > 1.3 * grown[6050]
    assert grown[0] > 1900.0


def test_at_rest_the_bias_along_gravity_alone_is_found_and_a_wrong_force_told(
    run: Run, rng: np.random.Generator
) -> None:
    table = still(run, rng, 6000, force=[0.0, 0.0, GRAVITY_G], bias=np.array([0.0, 0.0, 3e-3]))
    document, _ = corrected(run, table, "--set", "turn_on=3000", "--track", "at-rest")
    own = document["bias"]
    assert own["last_ug"]["z"] == pytest.approx(3000.0, abs=150.0)
    assert own["u_last_ug"]["x"] > 2900.0
    assert own["u_last_ug"]["z"] < 300.0
    wander = np.cumsum(2e-5 * rng.normal(size=(6000, 3)), axis=0)  # far more than the unit's noise
    document, _ = corrected(run, still(run, rng, 6000, bias=wander), *UP, status=1)
    assert document["bias"]["stated_uncertainty"] == "too small"


UP = ("--set", "turn_on=300", "--track", "0,0,1")


FILTERED_C = """
        static tumbleline_bias_state bias, kept_bias;
        static tumbleline_filter_state low_pass, kept_low_pass;
        static double sum[3];
        static int n;
        double output[3] = {x, y, z}, force[3], b[3], known[3] = {0.0, 0.6, 0.8};
        if (n == 0) tumbleline_bias_begin(&tumbleline_bias_A1, &bias);
        if (n % 100 == 0) {
            tumbleline_bias_step(&tumbleline_bias_A1, &bias);
            memset(sum, 0, sizeof sum);
        }
        if (n == 5000) {  /* the power fails: memory is spoilt, and what was kept is put back */
            kept_bias = bias;
            kept_low_pass = low_pass;
            memset(&bias, 0xAA, sizeof bias);
            memset(&low_pass, 0xAA, sizeof low_pass);
            bias = kept_bias;
            low_pass = kept_low_pass;
        }
        if (tumbleline_correct(&tumbleline_A1, output, t, force)) return 1;
        tumbleline_bias(&bias, b);
        for (int i = 0; i < 3; i++) {
            sum[i] += force[i] / 100;
            force[i] -= b[i];
        }
        if (n == 0) tumbleline_filter_begin(&low_pass, force);
        tumbleline_filter_step(&low_pass, force, force);
        if (++n % 100 == 0 && n <= 6000) tumbleline_bias_known(&tumbleline_bias_A1, &bias, sum, known);
        printf("%.17g %.17g %.17g\\n", force[0], force[1], force[2]);
"""


def tracked(run: Run, rng: np.random.Generator) -> pd.DataFrame:
    """Two minutes in one pose with another bias; the force is known in the first."""
    force = [0.0, 0.6, 0.8]
    table = still(run, rng, 12_000, warm=30.0, force=force, bias=BIAS)
    table[["force_x", "force_y", "force_z"]] = force
    table.loc[6000:, ["force_x", "force_y", "force_z"]] = np.nan
    return table


@pytest.mark.parametrize("kind", mostly_slow(("butterworth", "fir", "moving-average"), "butterworth"))
def test_the_filters_are_those_of_scipy_and_of_the_exported_c_with_the_bias(
    run: Run, home: Path, rng: np.random.Generator, kind: str
) -> None:
    table = tracked(run, rng)
    own = ("--set", "turn_on=2000")
    _, plain = corrected(run, table, *own)
    force = plain[FORCES].to_numpy()
    document, done = corrected(run, table, *own, "--filter", f"{kind}:9")
    one = document["filter"]
    b, a = (np.array(one[name]) for name in ("numerator", "denominator"))
    expected = signal.lfilter(b, a, force - force[0], axis=0) + force[0]
    assert np.allclose(done[FORCES].to_numpy(), expected, atol=1e-12)
    f, h = signal.freqz(b, a, fs=RATE, worN=2**14)
    assert one["cutoff_hz"] == pytest.approx(f[np.argmax(np.abs(h) < np.sqrt(0.5))], abs=0.02)
    assert one["cutoff_hz"] == pytest.approx(9.0, rel=0.03 if kind == "moving-average" else 1e-3)  # whole samples
    assert one["delay_s"] == pytest.approx(float(-np.angle(h[4])) / (2 * np.pi * f[4]), rel=1e-3)
    assert one["noise_bandwidth_hz"] == pytest.approx(float(np.trapezoid(np.abs(h) ** 2, f)), rel=1e-3)
    after = slice(8000, None)
    fall = done[FORCES].to_numpy()[after].var(axis=0) / force[after].var(axis=0)
    assert fall.mean() == pytest.approx(2.0 * one["noise_bandwidth_hz"] / RATE, rel=0.3)
    assert done["u_x_ug"].iloc[-1] < plain["u_x_ug"].iloc[-1]
    words = f"--format c --include failed --units A1 --filter {kind}:9 --rate 100 --set track=yes".split()
    assert given("export", run.id, "--archive", run.archive.root, *words, *own, "--output", "out.h")[0] == 0
    header = Path("out.h").read_text(encoding="utf-8")
    rows = table[["x", "y", "z", "unit_C"]].to_numpy()
    assert np.max(np.abs(compiled(header, FILTERED_C, rows, home, "A1") - done[FORCES].to_numpy())) < 1e-10


@pytest.mark.slow
def test_a_recording_goes_on_where_the_one_before_it_ended(run: Run, rng: np.random.Generator) -> None:
    table = tracked(run, rng)
    words = ("--set", "turn_on=2000", "--filter", "butterworth:12")
    _, whole = corrected(run, table, *words)
    _, first = corrected(run, table.iloc[:7000], *words, "--state", "kept.json")
    _, second = corrected(
        run, table.iloc[7000:].assign(force_x=0.0, force_y=0.6, force_z=0.8), *words, "--state", "kept.json"
    )
    assert np.allclose(first[FORCES].to_numpy(), whole[FORCES].to_numpy()[:7000], atol=1e-12)
    assert np.allclose(second[FORCES].to_numpy()[:100], whole[FORCES].to_numpy()[7000:7100], atol=1e-9)
    assert second["u_bias_x_ug"].iloc[0] == pytest.approx(whole["u_bias_x_ug"].iloc[7000], rel=1e-6)
    table.iloc[:500].to_csv("a.csv", index=False)
    how = ("correct", "a.csv", "latest:A1", "--archive", run.archive.root, "--set", "turn_on=2000")
    assert "it begins at 0 s, the state was kept at" in refused(*how, "--state", "kept.json")
    assert "the state of unit A1, that of A2 is needed" in refused(
        *how[:2], "latest:A2", *how[3:], "--state", "kept.json"
    )
    Path("kept.json").write_text("{}", encoding="utf-8")
    assert "not the state that" in refused(*how, "--state", "kept.json")
    assert "no bandwidth of unit A1 was measured" in refused(*how, "--filter", "fir")
    assert "did you mean butterworth" in refused(*how, "--filter", "buterworth:3")
    assert "at most 40 Hz is needed" in refused(*how, "--filter", "fir:49")
    assert "as butterworth:50" in refused(*how, "--filter", ":49")
    export = ("export", run.id, "--archive", run.archive.root, "--include", "failed", "--units", "A1")
    assert "need --set arithmetic=double or float" in refused(
        *export, "--format", "c", "--filter", "fir:3", "--rate", "100", "--set", "arithmetic=q24"
    )
    assert "are for format c" in refused(*export, "--format", "csv", "--set", "track=yes")


@pytest.mark.slow
def test_a_trajectory_comes_back_from_the_output_of_a_unit(run: Run, rng: np.random.Generator) -> None:
    n = 3000
    turns = 2.0 * np.pi * np.cumsum(rng.normal(size=(n, 3)), axis=0) / 40.0
    flight = pd.DataFrame(np.sin(turns), columns=["force_x", "force_y", "force_z"])
    flight = flight.assign(time_s=np.arange(n) / RATE, unit_C=np.linspace(5.0, 45.0, n))
    flight.to_csv("flight.csv", index=False)
    own = ("simulate", "flight.csv", "latest:A1", "--archive", run.archive.root, "--include", "failed")
    document = document_of(*own, "--seed", "none", "--output", "raw.csv", status=0)
    assert (document["samples"], document["noise"], document["clipped"], document["seed"]) == (n, {}, 0, None)
    back = ("correct", "raw.csv", "latest:A1", "--archive", run.archive.root)
    document_of(*back, "--map", "x,y,z", "--output", "back.parquet")
    force = flight[["force_x", "force_y", "force_z"]].to_numpy()
    away = pd.read_parquet("back.parquet")[FORCES].to_numpy() - force
    assert np.max(np.abs(away)) < 0.6 / LSB_PER_G  # whole counts
    noise = document_of(*own, "--seed", "3", "--output", "raw.npy")["noise"]
    seen = np.load("raw.npy")
    plain = pd.read_csv("raw.csv")
    added = np.stack([seen[axis] - plain[axis] for axis in "xyz"], axis=1) / LSB_PER_G
    expected = 1e-6 * np.array(noise["N_ug_rtHz"]) * np.sqrt(RATE)
    assert np.diff(added, axis=0).std(axis=0) / np.sqrt(2.0) == pytest.approx(expected, rel=0.1)
    document_of(*own, "--seed", "3", "--bandwidth", "5", "--output", "raw.mat")
    slow = loadmat("raw.mat")
    assert np.std(slow["x"][:, 0] - seen["x"]) > 100.0
    flight.drop(columns="unit_C").assign(force_x=400.0).to_csv("flight.csv", index=False)
    clipped = document_of(*own, "--output", "raw.csv")
    assert clipped["told"][0] == "no unit_C: 25 °C taken"
    assert "the force was taken in g; for m/s², give --unit-of force=m/s^2" in clipped["told"][1]
    assert clipped["clipped"] == n
    assert "a name that ends in .csv" in refused(*own, "--output", "raw.xls")
    assert "one of g, m/s^2" in refused(*own, "--unit-of", "force=mg", "--output", "raw.csv")
    assert "at most 40 Hz" in refused(*own, "--bandwidth", "70", "--output", "raw.csv")


def test_it_is_said_where_the_force_comes_from_and_what_is_stated_counts(run: Run, rng: np.random.Generator) -> None:
    bias = np.array([2e-3, 0.0, -1e-3])
    # the force of the columns is wrong by 10 mg
    table = still(run, rng, 6000, bias=bias).assign(force_x=0.01, force_y=0.0, force_z=1.0)
    own = ("--set", "turn_on=3000")
    columns = "the file's columns force_x, force_y, force_z"
    document, _ = corrected(run, table, *own)
    assert (document["bias"]["force_from"], document["bias"]["updates"]) == ([columns], 60)
    assert document["bias"]["last_ug"]["x"] == pytest.approx(1e6 * bias[0] - 10_000.0, abs=200.0)
    document, _ = corrected(run, table, *own, "--track", "0,0,1")
    assert document["bias"]["force_from"] == [f"--track 0,0,1, which counts instead of {columns}"]
    assert document["bias"]["last_ug"]["x"] == pytest.approx(1e6 * bias[0], abs=200.0)
    document, done = corrected(run, table, "--track", "none")
    assert (document["bias"], "bias_x_ug" in done) == (None, False)
    command = ("correct", "a.csv", "latest:A1", "--archive", run.archive.root, *own)
    assert f"force by which the bias is tracked: {columns} bias" in text_of(*command)
    both = ("--track", "none", "--track", "at-rest")
    assert "--track none and at-rest, one of them is needed" in refused(*command, *both)


@pytest.mark.slow
def test_a_gap_changes_neither_steps_nor_uncertainty_and_samples_after_the_last_step_have_that_of_their_time(
    run: Run, rng: np.random.Generator
) -> None:
    n = 6000
    table = still(run, rng, n)
    later = table.assign(time_s=table["time_s"] + 600.0 * (np.arange(n) >= n // 2))
    (one, whole), (other, gap) = (corrected(run, recording, *UP) for recording in (table, later))
    assert one["bias"]["steps"] == other["bias"]["steps"] == 60
    np.testing.assert_allclose(gap["u_x_ug"][: n // 2], whole["u_x_ug"][: n // 2], rtol=1e-6)
    assert gap["u_x_ug"][n // 2] > whole["u_x_ug"][n // 2]  # the bias has drifted meanwhile
    tail = 50  # half a step, an hour later
    table = still(run, rng, n + tail)
    table["time_s"] += 3600.0 * (np.arange(n + tail) >= n)
    document, done = corrected(run, table, *UP)
    own = done["u_bias_x_ug"].to_numpy()
    assert np.all(own[-tail:] > 1.5 * own[-tail - 1])
    assert not done["updated"][-tail:].any()
    assert (document["bias"]["updates"], document["bias"]["steps"]) == (60, 61)
    assert document["bias"]["u_last_ug"]["x"] == pytest.approx(own[-1])


REFUSED = {
    "a.csv latest": "3 units, one is needed as RUN:UNIT",
    "a.csv latest:A9": "no unit A9",
    "a.csv latest:A1 --track 0,0,1": "--set turn_on",
    "a.csv latest:A1 --track 0,0 --set turn_on=300": "three numbers X,Y,Z",
    "back.csv latest:A1": "does not always increase",
    "cold.csv latest:A1": "temperature",
    "a.csv latest:A1 --output o.txt": ".csv or .parquet",
}


@each(REFUSED)
def test_refusals_say_what_is_missing(
    words: str, run: Run, tmp_path: Path, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("pipelines.stages.uncertainty.budget_terms.archived_terms", lambda about: None)
    table = still(run, rng, 500)
    for name, one in {"a": table, "cold": table.drop(columns="unit_C"), "back": table.iloc[::-1]}.items():
        one.to_csv(f"{name}.csv", index=False)
    assert REFUSED[words] in refused("correct", *words.split(), "--archive", run.archive.root)


@pytest.mark.slow
def test_the_guide_to_corrections_prints_what_it_says(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TUMBLELINE_ARCHIVE", str(run.archive.root))
    bias, rng = np.array([2e-3, 0.0, -1e-3]), np.random.default_rng(3)
    still(run, rng, 6000, warm=28.0, force=[0.0, 0.0, 1.00057], bias=bias).to_csv("bench.csv", index=False)
    examples = pages.examples("docs/how-to/correct-a-recording.md")
    assert len(examples) == 2
    assert [found for command, printed in examples if (found := wrong(command, printed, 0.0))] == []
