"""An import whose references are stated, to its certificate: budget of the norm fit, verification on dwells held out."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from typer.testing import CliRunner, Result

from benchmarks.made_recordings import Recording, make
from pipelines.archive import Archive
from pipelines.cli import app
from schemas.errors import DataRejected, RecipeInvalid, WrongUse

DWELLS = "time=time_s,x=out_x,y=out_y,z=out_z,sd_x=sd_x,sd_y=sd_y,sd_z=sd_z,n=n,duration=duration_s"
LABORATORY = """\
laboratory = { name = "L", address = "A", email = "a@b.c", country = "DE" }
customer = { name = "L", address = "A", email = "a@b.c" }
signatory = { name = "S", role = "R" }
item = { manufacturer = "M" }
"""
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
LIMITS = """\
name = "hand-held"
grade = "consumer"
[figures]
verification_norm_ug = { max = 3000.0, unit = "µg" }
bias_error_ug = { max = 3000.0, unit = "µg" }
zero_g_offset_mg = { max = 150.0, unit = "mg" }
"""
STATED = ("--references", "lab.toml", "--measured", "2026-11-20", "--verify", "8", "--zero-output", "32768")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "lab.toml").write_text(REFERENCES, encoding="utf-8")
    (tmp_path / "limits.toml").write_text(LIMITS, encoding="utf-8")
    make(Recording(48, "white 280, B 30"), 4714).dwells.to_csv(tmp_path / "hand.csv", index=False)
    return tmp_path


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


def imported(*more: str) -> Result:
    words = ("hand.csv", "--map", DWELLS, "--units", "output=LSB", "--unit", "H1", "--rows", "dwells", *more)
    return run("import", *words, "--json")


def document(result: Result) -> dict[str, Any]:
    assert result.exit_code in (0, 1), (result.output, result.exception)
    return json.loads(result.stdout)


def test_from_a_recording_with_stated_references_to_its_certificate(folder: Path) -> None:
    first = document(imported(*STATED, "--fit", "norm"))
    assert any(remark.startswith("held out for verification: H1: ") for remark in first["remarks"])
    fitted = document(run("fit", first["run"], "--limits", "limits.toml", "--json"))
    assert fitted["units"][0]["outcome"] == "pass", fitted
    done = Archive(None).run(fitted["run"])
    verified = done.table("verification")
    assert len(verified) == 8
    assert verified["error_ug"].abs().max() < 4.0 * verified["uncertainty_ug"].max()
    sums = done.table("uncertainties").set_index(["quantity", "axis"])
    # local gravity is the scale, one to one, and the thermometer's 1 K the bias of a device of 150 µg/K
    assert sums.loc[("scale", "x"), "u_b"] == pytest.approx(200.0, rel=0.02)
    assert sums.loc[("bias", "z"), "u_b"] == pytest.approx(150.0, rel=0.02)
    # verification on the same g cannot show it
    assert sums.loc[("bias_error", "x"), "shown"] < 1.0
    assert sums.loc[("bias_error", "x"), "unseen"] > 100.0
    assert not {("misalignment", axis) for axis in ("yx", "zx", "zy")} & set(sums.index)

    assert run("report", fitted["run"]).exit_code == 0
    certified = document(run("certify", fitted["run"], "--json"))
    assert [one["certificate"] for one in certified["certified"]] == ["H1/1"]
    assert certified["certified"][0]["station"] == "lab-2"
    page = done.report.read_text(encoding="utf-8")
    for words in (
        "H1/1",
        "Uncertainty budget",
        "G-2025-7",
        "dwells were held out of the fit",
        "rms error of the worst axis",
    ):
        assert words in page
    assert "not stated: level" not in page
    unit = json.loads(run("export", fitted["run"]).stdout)["units"][0]
    assert "H1/1" in json.dumps(unit)
    (folder / "laboratory.toml").write_text(LABORATORY, encoding="utf-8")
    assert run("certificate", "H1").exit_code == 0
    assert "local gravity" in (folder / "H1_1.xml").read_text(encoding="utf-8")
    assert run("verify").exit_code == 0
    assert run("revoke", "H1", "--reason", "fell to the floor").exit_code == 0
    page = done.report.read_text(encoding="utf-8")  # made again, as that of a captured run is
    assert '<span class="tag fail">revoked</span>' in page
    assert "fell to the floor" in page


def test_without_a_statement_an_import_stays_noise_only(folder: Path) -> None:
    first = document(imported("--local-g", "9.80942", "--zero-output", "32768", "--verify", "15%"))
    fitted = document(run("fit", first["run"], "--limits", "limits.toml", "--json"))
    done = Archive(None).run(fitted["run"])
    assert set(done.table("grades")["basis"]) == {"noise only"}
    problem = run("certify", fitted["run"]).exception
    assert isinstance(problem, WrongUse)
    assert "import the recording again with --references FILE" in str(problem)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('grade_source = "certificates"', 'grade_source = "assumed"', "rests on assumed uncertainties"),
        pytest.param(
            "thermometer = ",
            "timing = { wait_u_s = 0.1, source = 'tests' }\n# thermometer = ",
            "not stated: thermometer",
            marks=pytest.mark.slow,  # the fast part has tests/unit/test_certify.py
        ),
        pytest.param(
            "due = 2027-03-02",
            "due = 2026-11-19",
            "reference standard PT-7 (certificate K-26-118) was due on 2026-11-19",
            marks=pytest.mark.slow,  # the fast part has tests/faults/test_archive_trouble.py
        ),
        ("horizon_days = 400.0", "horizon_days = 40.0", "no error over the period of validity (12 months)"),
    ],
)
def test_the_rules_of_the_budget_hold_for_an_import(folder: Path, old: str, new: str, words: str) -> None:
    (folder / "lab.toml").write_text(REFERENCES.replace(old, new), encoding="utf-8")
    first = document(imported(*STATED))
    fitted = document(run("fit", first["run"], "--limits", "limits.toml", "--json"))
    problem = run("certify", fitted["run"]).exception
    assert isinstance(problem, WrongUse)
    assert words in str(problem)


@pytest.mark.parametrize(
    ("old", "new", "more", "words"),
    [
        ("u_ppm = 200.0", "u_ppm = 0.5", ("--local-g", "9.80665"), "they differ by -282 ppm; leave --local-g out"),
        ("value_m_s2 = 9.80942", "value_m_s2 = 9.80665", (), "9.80665 is standard gravity, not a site's value"),
        ('reference = "PT-7"', 'reference = "PT-8"', (), "no [[reference]] is called 'PT-8'"),
        ("gravity = ", "# gravity = ", (), "key 'uncertainty.gravity' is missing"),
        ("offset_U_K = 2.0", "offset_K = 2.0", (), "offset_U_K"),
        ("", "", ("--measured", "2999-01-01"), "--measured 2999-01-01 lies in the future"),
        ("", "", ("--measured", "yesterday"), "measured"),
        ("", "", ("--verify", "40"), "leaves 8 of them, 12 are needed for the fit"),
        ("", "", ("--verify", "some"), "a number of dwells or a share such as 20% is needed"),
    ],
)
def test_a_statement_with_a_slip_is_refused(
    folder: Path, old: str, new: str, more: tuple[str, ...], words: str
) -> None:
    (folder / "lab.toml").write_text(REFERENCES.replace(old, new) if old else REFERENCES, encoding="utf-8")
    result = imported(*STATED, *more)
    assert isinstance(result.exception, (RecipeInvalid, WrongUse, DataRejected)), result.output
    assert words in str(result.exception)


def test_the_day_of_the_measurement_is_needed_beside_references(folder: Path) -> None:
    assert (folder / "lab.toml").is_file()
    problem = imported("--references", "lab.toml").exception
    assert isinstance(problem, WrongUse)
    assert "add --measured YYYY-MM-DD" in str(problem)


def test_a_level_error_of_a_plate_is_named_where_the_headings_are_given(folder: Path) -> None:
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
    frame.to_csv(folder / "plate.csv", index=False)
    words = ("plate.csv", "--map", "x=x,y=y,z=z,dwell=label", "--units", "output=g", "--rate", "100", "--unit", "P")
    known = ("--poses", ",".join(poses), "--local-g", "9.80665")
    with_headings = document(run("import", *words, *known, "--headings", ",".join(headings), "--json"))
    diagnosis = document(run("diagnose", with_headings["run"], "--json"))
    assert [group["effects"] for group in diagnosis["classes"]] == [["level_error"]]
    fitted = document(run("fit", with_headings["run"], "--effects", "bias,scale,misalignment,level_error", "--json"))
    assert fitted["adequate"] is True
    rows_of = Archive(None).run(fitted["run"]).table("coefficients")
    level = rows_of[rows_of["effect"] == "level_error"].set_index("name")["value"]
    assert [level["level_1"], level["level_2"]] == pytest.approx([3e-3, -2e-3], abs=5e-5)
    problem = run("import", *words, *known, "--headings", ",".join(headings[:-1])).exception
    assert isinstance(problem, RecipeInvalid)
    assert "a heading for every pose is needed" in str(problem)


def test_a_file_of_one_plane_is_calibrated_in_that_plane(folder: Path) -> None:
    rng = np.random.default_rng(5)
    angle = np.radians(15.0 * np.arange(24))
    force = np.stack([np.sin(angle), 0.0 * angle, np.cos(angle)], axis=1)
    out = force * [1.01, 0.99, 1.005] + [0.01, 0.02, -0.03] + 2e-5 * rng.standard_normal((24, 3))
    columns = {f"out_{axis}": out[:, k] for k, axis in enumerate("xyz")}
    frame = pd.DataFrame({**columns, **{f"f{axis}": force[:, k] for k, axis in enumerate("xyz")}})
    frame.assign(time_s=30.0 * np.arange(24), sd=2e-4, n=100).to_csv(folder / "tilt.csv", index=False)
    columns_of = "time=time_s,x=out_x,y=out_y,z=out_z,sd_x=sd,sd_y=sd,sd_z=sd,n=n"
    words = (
        "tilt.csv",
        "--units",
        "output=g,time=s",
        "--unit",
        "T",
        "--rows",
        "dwells",
        "--local-g",
        "9.80665",
        "--json",
    )
    unknown = document(run("import", *words, "--map", columns_of, "--fit", "norm"))
    assert (unknown["adequate"], unknown["across"]) == (True, "y")
    assert "scale of y" in unknown["open"]
    assert unknown["bias"] == pytest.approx([0.01, 0.02, -0.03], abs=5e-5)
    known = document(run("import", *words, "--map", f"{columns_of},force_x=fx,force_y=fy,force_z=fz"))
    fitted = document(run("fit", known["run"], "--json"))
    assert fitted["adequate"] is True
    assert fitted["open"][0] == "scale of y"
    rows = Archive(None).run(fitted["run"]).table("coefficients")
    scale = rows[rows["effect"] == "scale"].set_index("axis")["value"]
    assert dict(scale) == pytest.approx({"x": 1.01, "z": 1.005}, abs=5e-5)
    for command, words_of in (("export", "the scale of y is not known"), ("certify", "the scale of y is not known")):
        assert words_of in str(run(command, fitted["run"]).exception)
