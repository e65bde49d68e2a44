"""A recording made elsewhere all the way, as commands: import, diagnose, extend, fit, history, export, report, certificate."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from in_process import document_of, given, refused, text_of
from laboratory import LABORATORY
from scipy.spatial.transform import Rotation

from benchmarks.made_recordings import Recording, make
from inertial.frames import force_from_angles
from inertial.quantities import OUTPUT_COLUMNS, SPREAD_COLUMNS
from pipelines.archive import Archive
from schemas.errors import DONE

pytestmark = pytest.mark.usefixtures("no_next_measurement")

COLUMNS = "time=time_s,x=out_x,y=out_y,z=out_z"
DWELLS = f"{COLUMNS},sd_x=sd_x,sd_y=sd_y,sd_z=sd_z,n=n,duration=duration_s"
PLAIN = "bias,scale,misalignment"
BENCH = 'name = "bench"\nrule = "simple_acceptance"\n[figures]\nresidual_rms_ug = { max = 300.0, unit = "µg" }\n'
DRIFTING = Recording(60, "white 280, B 30", warm_up=3000.0, sensor=11)
REFERENCES = """\
name = "lab-2"

[[reference]]
id = "G-01"
what = "local gravity"
certificate = "G-2025-7"
due = 2035-05-02

[[reference]]
id = "PT-7"
what = "temperature"
certificate = "K-26-118"
due = 2027-03-02
U = 0.1
k = 2.0
unit = "K"

[uncertainty]
grade_source = "certificates"
gravity = { value_m_s2 = 9.80942, u_ppm = 200.0, reference = "G-01" }
thermometer = { measures = "chamber", offset_U_K = 2.0, slope_U_percent = 0.01, k = 2.0, reference = "PT-7" }
gradient = { u_K = 0.01, source = "nine sensors" }
reader = { exact = true }

[stability]
switch_on_ug = 50.0
horizon_days = 400.0
source = "history"
temperature_of = "chamber"
bias_temperature_ug_K = 150.0

[certificate]
validity_months = 12
"""
HAND_HELD = """\
name = "hand-held"
grade = "consumer"
[figures]
verification_norm_ug = { max = 3000.0, unit = "µg" }
bias_error_ug = { max = 3000.0, unit = "µg" }
zero_g_offset_mg = { max = 150.0, unit = "mg" }
"""
STATED = ("--references", "lab.toml", "--set", "measured=2026-11-20", "--set", "verify=8", "--set", "zero_output=32768")
STANDARD = ("--set", "local_gravity_m_s2=9.80665")


@pytest.fixture(autouse=True)
def bench(home: Path) -> Path:
    """A working folder with statements, limits and a laboratory's file."""
    texts = {"lab": REFERENCES, "limits": HAND_HELD, "bench": BENCH, "laboratory": LABORATORY}
    for name, text in texts.items():
        (home / f"{name}.toml").write_text(text, encoding="utf-8")
    return home


def words_of(what: Recording, seed: int, *more: str) -> tuple[str, ...]:
    """The import of a recording as dwells."""
    path = f"hand-{seed}.csv"
    make(what, seed).dwells.to_csv(path, index=False)
    return ("import", path, "--map", DWELLS, "--unit-of", "output=LSB", "--units", "H1", "--set", "rows=dwells", *more)


def imported(what: Recording, seed: int, *more: str, status: int | None = DONE) -> dict[str, Any]:
    return document_of(*words_of(what, seed, *STANDARD, *more), status=status)


def hand_held(*more: str) -> tuple[str, ...]:
    """The import of a recording whose references are stated."""
    return words_of(Recording(48, "white 280, B 30"), 4714, *more)


def table(run: str, name: str) -> pd.DataFrame:
    return Archive(None).run(run).table(name)


@pytest.mark.slow
def test_from_a_recording_of_unknown_poses_to_a_report_and_no_certificate() -> None:
    first = imported(DRIFTING, 71, "--fit", "norm", "--device", "adxl357", status=1)
    assert "device: adxl357 is not one that the program knows; did you mean ADXL355?" in str(first["remarks"])
    assert first["adequate"] is False
    assert document_of("diagnose", first["run"])["recommended"] == ["warm_up"]
    text_of("extend", "model.toml", "warm_up", "--effects", PLAIN, status=0)
    fitted = document_of("fit", first["run"], "--model", "model.toml", "--limits", "bench.toml", status=0)
    assert fitted["adequate"] is True
    assert [unit["outcome"] for unit in fitted["units"]] == ["pass"]
    assert fitted["error"]["rms_ug"] < 0.3 * first["error"]["rms_ug"]
    (unit,) = json.loads(given("export", fitted["run"])[1])["units"]
    np.testing.assert_allclose(unit["bias"][0], make(DRIFTING, 71).bias, atol=3.0)
    assert "warm_up" in str(unit)
    page = Path(given("show", fitted["run"], "--report")[1].strip()).read_text(encoding="utf-8")
    assert "Coefficients" in page
    assert "degrees of freedom" in page
    assert "was imported without a statement of its references (noise only)" in refused(
        "certificate", "issue", fitted["run"]
    )
    told = refused("certificate", "write", "H1", "--laboratory", "laboratory.toml")
    assert "unit H1 has no certificate, one is needed" in told
    # an adequate model is needed besides, however wide the limits are
    Path("wide.toml").write_text(BENCH.replace("300.0", "9000.0"), encoding="utf-8")
    plain = document_of("fit", first["run"], "--effects", PLAIN, "--limits", "wide.toml", status=1)
    assert ([unit["outcome"] for unit in plain["units"]], plain["adequate"]) == (["pass"], False)
    assert "is NOT ADEQUATE" in refused("certificate", "issue", plain["run"])
    text_of("verify", status=0)


@pytest.mark.slow
def test_an_import_a_fit_and_a_diagnosis_of_one_file_say_the_same() -> None:
    first = imported(Recording(40, "white 280, B 30"), 5, "--fit", "norm", status=None)
    fitted = document_of("fit", first["run"], "--effects", PLAIN)
    judged = document_of("diagnose", first["run"])
    for key in ("rms_ug", "floor_ug", "white_noise_ug", "p_value"):
        assert first["error"][key] == fitted["error"][key] == judged["error"][key]
    assert first["adequate"] is fitted["adequate"] is judged["adequate"]
    assert first["error"]["fit_rms_ug"] == pytest.approx(first["error"]["rms_ug"], rel=1e-3)


@pytest.mark.slow
def test_a_bad_dwell_is_named_and_the_fit_without_it_is_a_run_of_its_own() -> None:
    what = Recording(30, "white 280, B 30", bad=1, bad_ug=5000.0)
    spoilt = make(what, 9).spoilt[0]
    answer = imported(what, 9, "--fit", "norm", status=None)
    without = ("--leave-out", f"H1:{spoilt}")
    assert answer["leave_out"]["dwells"] == [{"unit": "H1", "dwell": spoilt}]
    assert any(" ".join(without) in line for line in answer["lines"])
    fitted = document_of("fit", answer["run"], *without, status=0)
    assert (fitted["adequate"], fitted["left_out"]) == (True, [without[1]])
    judged = document_of("diagnose", answer["run"], *without, status=0)
    assert fitted["error"]["rms_ug"] == judged["error"]["rms_ug"]


@pytest.mark.slow
def test_angles_of_a_table_are_poses_for_a_fit_as_for_a_diagnosis() -> None:
    rng = np.random.default_rng(5)
    outer, inner = (
        angles.ravel() for angles in np.meshgrid([0.0, 45.0, 90.0, 135.0, 180.0], [-120.0, -30.0, 60.0, 150.0])
    )
    force = force_from_angles(np.radians(outer), np.radians(inner))
    dwells = make(Recording(len(outer)), 6).dwells.assign(outer_deg=outer, inner_deg=inner, hum=40.0)
    dwells["hum"] += np.arange(len(outer)) % 7
    dwells[[*OUTPUT_COLUMNS]] = (
        force * [1.01, 0.99, 1.0] + [0.01, -0.02, 0.03] + 3e-5 * rng.standard_normal(force.shape)
    )
    dwells[[*SPREAD_COLUMNS]] = np.outer(3e-5 * np.sqrt(dwells["n"]), np.ones(3))
    dwells.assign(unit="P1", dwell=range(len(outer))).to_csv("table.csv", index=False)
    words = ("--unit-of", "output=g", "--units", "P1", "--set", "rows=dwells", "--map")
    poses = "outer=outer_deg,inner=inner_deg,hum=hum"
    run = document_of("import", "table.csv", *words, f"{DWELLS},{poses}")["run"]
    fitted, of_file = document_of("fit", run, status=0), document_of("diagnose", "table.csv", status=0)
    assert fitted["adequate"] is of_file["adequate"] is True
    assert document_of("diagnose", run)["error"] == pytest.approx(of_file["error"])
    bare = document_of("import", "table.csv", *words, f"{COLUMNS},{poses}")["run"]
    by_residuals = document_of("fit", bare, status=0)  # the noise that no samples tell is that of the residuals
    assert by_residuals["adequate"] is True
    units = [json.loads(given("export", answer["run"])[1])["units"][0] for answer in (fitted, by_residuals)]
    np.testing.assert_allclose(units[1]["bias"], units[0]["bias"], atol=2e-5)
    followed = document_of("fit", run, "--effects", f"{PLAIN},covariate:hum", status=0)  # what is recorded besides
    assert followed["adequate"] is True
    np.testing.assert_allclose(units[0]["bias"][0], [0.01, -0.02, 0.03], atol=1e-4)


def test_an_import_that_was_not_fitted_is_advised_and_a_fit_that_fails_leaves_no_run() -> None:
    run = imported(Recording(20), 2)["run"]
    for words in (("export", run), ("show", run, "--report")):
        _, _, err = given(*words)
        assert f"fit it with 'tumbleline fit {run} --effects" in " ".join(err.split())
    assert f"tumbleline fit {run} --limits FILE" in refused("certificate", "issue", run)
    for command in ("fit", "rerun"):
        status, out, err = given(command, run, "--effects", f"{PLAIN},supply_sensitivity")
        assert "supply" in out + err
        assert status != 0
        assert [one["id"] for one in document_of("list")["runs"]] == [run]


def test_from_a_recording_with_stated_references_to_its_certificate() -> None:
    make(Recording(48, "white 280, B 30"), 4714).dwells.assign(unit="H1", pose="by hand").to_csv(
        "table.csv", index=False
    )
    words = ("--unit-of", "output=LSB", *STATED, "--fit", "norm", "--device", "adxl355")
    first = document_of("import", "table.csv", *words)  # in the exchange format
    assert "columns that are not read with --references, --fit or --set: pose" in first["remarks"]
    assert (first["device"], "device: " in str(first["remarks"])) == ("ADXL355", False)
    assert any(remark.startswith("held out for verification: H1: ") for remark in first["remarks"])
    fitted = document_of("fit", first["run"], "--limits", "limits.toml")
    assert fitted["units"][0]["outcome"] == "pass", fitted
    verified = table(fitted["run"], "verification")
    assert len(verified) == 8
    assert verified["error_ug"].abs().max() < 4.0 * verified["uncertainty_ug"].max()
    sums = table(fitted["run"], "uncertainties").set_index(["quantity", "axis"])
    # local gravity is the scale, one to one, and the thermometer's 1 K the bias of a device of 150 µg/K
    assert sums.loc[("scale", "x"), "u_b"] == pytest.approx(200.0, rel=0.02)
    assert sums.loc[("bias", "z"), "u_b"] == pytest.approx(150.0, rel=0.02)
    # verification on the same g cannot show it
    assert sums.loc[("bias_error", "x"), "shown"] < 1.0
    assert sums.loc[("bias_error", "x"), "unseen"] > 100.0
    assert not {("misalignment", axis) for axis in ("yx", "zx", "zy")} & set(sums.index)
    text_of("show", fitted["run"], "--report", status=0)
    (certified,) = document_of("certificate", "issue", fitted["run"])["certified"]
    assert (certified["certificate"], certified["station"], certified["device"]) == ("H1/1", "lab-2", "ADXL355")
    audited = text_of("audit", "--device", "ADXL355")
    assert "1 calibration, 1 unit, 1 run, 1 station" in audited
    assert "ledger 1 certificate; 1 of 1 units" in audited
    page = Archive(None).run(fitted["run"]).report.read_text(encoding="utf-8")
    for words in ("H1/1", "Uncertainty budget", "G-2025-7", "dwells were held out of the fit", "of the worst axis"):
        assert words in page
    assert "not stated: level" not in page
    assert "H1/1" in text_of("export", fitted["run"])
    text_of("certificate", "write", "H1", status=0)
    assert "local gravity" in Path("H1_1.xml").read_text(encoding="utf-8")
    text_of("verify", status=0)
    text_of("certificate", "revoke", "H1", "--reason", "fell to the floor", status=0)
    assert "H1/1 REVOKED (fell to the floor); measure the unit again" in refused("certificate", "write", fitted["run"])
    page = Archive(None).run(fitted["run"]).report.read_text(encoding="utf-8")  # made again, as that of a captured run
    assert '<span class="tag fail">revoked</span>' in page
    assert "fell to the floor" in page


RULES = {
    "rests on assumed uncertainties": ('grade_source = "certificates"', 'grade_source = "assumed"'),
    "no error over the period of validity (12 months)": ("horizon_days = 400.0", "horizon_days = 40.0"),
    "not stated: thermometer": ("thermometer = ", "timing = { wait_u_s = 0.1, source = 'tests' }\n# thermometer = "),
    "reference standard PT-7 (certificate K-26-118) was due on 2026-11-19": ("due = 2027-03-02", "due = 2026-11-19"),
}


# each by itself: tests/unit/pipelines/chain/test_certify.py and tests/faults/test_archive_trouble.py
@pytest.mark.slow
@pytest.mark.parametrize("words", RULES)
def test_the_rules_of_the_budget_hold_for_an_import(words: str) -> None:
    Path("lab.toml").write_text(REFERENCES.replace(*RULES[words]), encoding="utf-8")
    fitted = document_of("fit", document_of(*hand_held(*STATED))["run"], "--limits", "limits.toml")
    assert words in refused("certificate", "issue", fitted["run"])


SLIPS = {
    "they differ by -282 ppm; leave local_gravity_m_s2 out": ("u_ppm = 200.0", "u_ppm = 0.5", *STANDARD),
    "9.80665 is standard gravity, not a site's value": ("value_m_s2 = 9.80942", "value_m_s2 = 9.80665"),
    "no [[reference]] is called 'PT-8'": ('reference = "PT-7"', 'reference = "PT-8"'),
    "key 'uncertainty.gravity' is missing": ("gravity = ", "# gravity = "),
    "offset_U_K": ("offset_U_K = 2.0", "offset_K = 2.0"),
    "measured 2999-01-01 lies in the future": ("", "", "--set", "measured=2999-01-01"),
    "measured": ("", "", "--set", "measured=yesterday"),
    "leaves 8 of them, 12 are needed for the fit": ("", "", "--set", "verify=40"),
    "a number of dwells or a share such as 20% is needed": ("", "", "--set", "verify=some"),
}


@each([*SLIPS, "add --set measured=YYYY-MM-DD"])
def test_a_statement_with_a_slip_or_without_a_day_is_refused(words: str) -> None:
    old, new, *more = SLIPS.get(words, ("", ""))
    Path("lab.toml").write_text(REFERENCES.replace(old, new) if old else REFERENCES, encoding="utf-8")
    stated = STATED if words in SLIPS else STATED[:2]
    assert words in refused(*hand_held(*stated, *more))


@pytest.mark.slow
def test_a_level_error_of_a_plate_is_named_where_the_headings_are_given() -> None:
    """24 placements on a plate that is 3 mrad and −2 mrad out of level: six faces, four headings each."""
    rng = np.random.default_rng(3)
    up = np.array([3e-3, -2e-3, 1.0])
    rows, labels, poses, headings = [], [], [], []
    for face in ("+x", "-x", "+y", "-y", "+z", "-z"):
        vertical = np.eye(3)["xyz".index(face[1])] * (1.0 if face[0] == "+" else -1.0)
        pointer = np.eye(3)[1 if face[1] == "x" else 0]
        for heading in (0, 90, 180, 270):
            ahead = [np.cos(np.radians(heading)), np.sin(np.radians(heading)), 0.0]
            to_lab = Rotation.align_vectors([[0.0, 0.0, 1.0], ahead], [vertical, pointer])[0]
            samples = to_lab.inv().apply(up) * [1.01, 0.99, 1.0] + [0.01, 0.02, -0.03]
            label = f"{face}{heading}".replace("+", "p").replace("-", "m")
            rows.append(samples + 2e-4 * rng.standard_normal((200, 3)))
            labels += [label] * 200
            poses.append(f"{label}={face}")
            headings.append(f"{label}={heading}")
    frame = pd.DataFrame(np.concatenate(rows), columns=["x", "y", "z"]).assign(label=labels)
    frame.to_csv("plate.csv", index=False)
    words = ("plate.csv", "--map", "x=x,y=y,z=z,dwell=label", "--unit-of", "output=g", "--rate", "100", "--units", "P")
    known = ("import", *words, "--set", f"poses={','.join(poses)}", *STANDARD, "--set")
    run = document_of(*known, f"headings={','.join(headings)}")["run"]
    assert [group["effects"] for group in document_of("diagnose", run)["classes"]] == [["level_error"]]
    fitted = document_of("fit", run, "--effects", f"{PLAIN},level_error")
    assert fitted["adequate"] is True
    found = table(fitted["run"], "coefficients")
    level = found[found["effect"] == "level_error"].set_index("name")["value"]
    assert [level["level_1"], level["level_2"]] == pytest.approx([3e-3, -2e-3], abs=5e-5)
    assert "a heading for every pose is needed" in refused(*known, f"headings={','.join(headings[:-1])}")


def test_a_file_of_one_plane_is_calibrated_in_that_plane() -> None:
    rng = np.random.default_rng(5)
    angle = np.radians(15.0 * np.arange(24))
    force = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    out = force * [1.01, 0.99, 1.005] + [0.01, 0.02, -0.03] + 2e-5 * rng.standard_normal((24, 3))
    columns = {f"out_{axis}": out[:, k] for k, axis in enumerate("xyz")}
    frame = pd.DataFrame({**columns, **{f"f{axis}": force[:, k] for k, axis in enumerate("xyz")}})
    frame.assign(time_s=30.0 * np.arange(24), sd=2e-4, n=100).to_csv("tilt.csv", index=False)
    words = (
        "import",
        "tilt.csv",
        "--unit-of",
        "output=g,time=s",
        "--units",
        "T",
        "--set",
        "rows=dwells",
        *STANDARD,
        "--map",
    )
    mapped = f"{COLUMNS},sd_x=sd,sd_y=sd,sd_z=sd,n=n"
    unknown = document_of(*words, mapped, "--fit", "norm")
    assert (unknown["adequate"], unknown["across"]) == (True, "y")
    assert "scale of y" in unknown["open"]
    assert unknown["bias"] == pytest.approx([0.01, 0.02, -0.03], abs=5e-5)
    fitted = document_of("fit", document_of(*words, f"{mapped},force_x=fx,force_y=fy,force_z=fz")["run"])
    assert fitted["adequate"] is True
    assert fitted["open"][0] == "scale of y"
    found = table(fitted["run"], "coefficients")
    scale = found[found["effect"] == "scale"].set_index("axis")["value"]
    assert dict(scale) == pytest.approx({"x": 1.01, "z": 1.005}, abs=5e-5)
    for words in (("export",), ("certificate", "issue")):
        assert "the scale of y is not known" in refused(*words, fitted["run"])
