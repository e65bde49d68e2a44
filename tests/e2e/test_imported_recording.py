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

reference = [
    { id = "G-01", what = "local gravity", certificate = "G-2025-7", due = 2035-05-02 },
    { id = "PT-7", what = "temperature", certificate = "K-26-118", due = 2027-03-02, U = 0.1, k = 2.0, unit = "K" },
]

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
    texts = {"lab": REFERENCES, "limits": HAND_HELD, "bench": BENCH, "laboratory": LABORATORY}
    for name, text in texts.items():
        (home / f"{name}.toml").write_text(text, encoding="utf-8")
    return home


def words_of(what: Recording, seed: int, *more: str) -> tuple[str, ...]:
    path = f"hand-{seed}.csv"
    make(what, seed).dwells.to_csv(path, index=False)
    return ("import", path, "--map", DWELLS, "--unit-of", "output=LSB", "--units", "H1", "--set", "rows=dwells", *more)


def imported(what: Recording, seed: int, *more: str, status: int | None = DONE) -> dict[str, Any]:
    return document_of(*words_of(what, seed, *STANDARD, *more), status=status)


def hand_held(*more: str) -> tuple[str, ...]:
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
    assert (first["device"], "device: " in str(first["remarks"])) == ("ADXL355", False)
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
    text_of("show", fitted["run"], "--report", status=0)  # makes it
    (certified,) = document_of("certificate", "issue", fitted["run"])["certified"]
    assert (certified["certificate"], certified["station"], certified["device"]) == ("H1/1", "lab-2", "ADXL355")
    audited = text_of("audit", "--device", "ADXL355")
    assert "1 calibration, 1 unit, 1 run, 1 station" in audited
    page = Archive(None).run(fitted["run"]).report.read_text(encoding="utf-8")
    for words in ("H1/1", "Uncertainty budget", "G-2025-7", "dwells were held out of the fit", "of the worst axis"):
        assert words in page
    assert "H1/1" in text_of("export", fitted["run"])
    text_of("certificate", "write", "H1", status=0)
    text_of("verify", status=0)
    text_of("certificate", "revoke", "H1", "--reason", "fell to the floor", status=0)
    assert "H1/1 REVOKED (fell to the floor); measure the unit again" in refused("certificate", "write", fitted["run"])
    page = Archive(None).run(fitted["run"]).report.read_text(encoding="utf-8")  # made again, as that of a captured run
    assert '<span class="tag fail">revoked</span>' in page
    assert "fell to the floor" in page


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
    given = ["import", "tilt.csv", "--unit-of", "output=g,time=s", "--units", "T", "--set", "rows=dwells"]
    words = (*given, *STANDARD, "--map")
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
