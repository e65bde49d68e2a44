"""One command for a file of another system: recognised, imported, fitted, judged, six faces too; it can be pasted."""

import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hand import G, Hand, sensed
from in_process import command, document_of, given, refused
from long_suites import mostly_slow
from scipy.spatial.transform import Rotation

from pipelines.archive import Archive
from pipelines.diagnosis.imported_faces import MODEL
from pipelines.importers.triads import triad
from pipelines.stages.fit import fit

pytestmark = pytest.mark.usefixtures("home", "no_next_measurement")

BIAS = (0.012, -0.021, 0.48)


def hand_held(rng: np.random.Generator, **how: float) -> tuple[Hand, pd.DataFrame]:
    """Columns as a board logs them, without names: time s, m/s² with a bias of half a g on z, rates."""
    hand = Hand(rng, **how)
    force = G * (hand.force + np.array(BIAS)) + 0.02 * rng.normal(size=(hand.n, 3))
    return hand, pd.DataFrame(np.column_stack([hand.time, force, sensed(rng, hand.rate, 1.0, (0.0,) * 3, 0.003)]))


def test_a_hand_held_record_is_recognised_fitted_and_judged_on_one_screen(rng: np.random.Generator) -> None:
    _, frame = hand_held(rng, stops=28, rate=50.0)
    frame.to_csv("board.txt", header=False, index=False, sep="\t", float_format="%.6f")
    document = document_of("improve", "board.txt", status=0)
    one = document["recording"]
    assert 26 <= one["dwells"] <= 30
    assert document["adequate"] is True
    assert any("CHECK AXIS z: its bias is 0.48 of gravity" in line for line in one["lines"])
    table = Archive(None).run(one["run"]).table("coefficients")
    found = {(row["effect"], row["axis"]): row for row in table.to_dict("records")}
    for axis, bias in zip("xyz", BIAS, strict=True):
        row = found["bias", axis]
        assert abs(row["value"] - G * bias) < max(4.0 * row["standard_error"], 2e-3)
    pasted = document_of(*shlex.split(one["command"])[1:], status=0)
    assert pasted["run"] == one["run"]
    _, text, _ = given("improve", "board.txt", columns=120)
    lines = text.rstrip().splitlines()
    assert one["command"] in " ".join(text.split())
    assert lines[-1].split()[:2] == ["tumbleline", "export"]
    for axis, across in (("x", "misalignment y "), ("y", "misalignment z "), ("z", "scale ")):
        line = next(line for line in one["lines"] if line.startswith(f"{axis}: bias"))
        assert across in line  # a frame that rests on x has three angles, each with its U
        assert " ± " in line.split("scale ")[1]
    Path("model.toml").write_text("name = 'other'\n")
    assert "model.toml exists and is not the model" in refused("improve", "board.txt", "-o", "model.toml")


def six_faces(rng: np.random.Generator, lean_deg: float) -> pd.DataFrame:
    """A telephone on each of its faces for 4 s, turned in 0.8 s between; on +y it leans, on the others by 0.3°."""
    up = np.concatenate([np.eye(3), -np.eye(3)])
    parts: list[np.ndarray] = []
    for k, face in enumerate(up):
        about = np.cross(face, rng.standard_normal(3))
        angle = np.radians(lean_deg if k == 1 else 0.3)
        rest = Rotation.from_rotvec(angle * about / np.linalg.norm(about)).apply(face)
        way = rest + np.linspace(0.0, 1.0, 80)[:, None] * (up[(k + 1) % 6] - rest)
        parts += [np.tile(rest, (400, 1)), way / np.linalg.norm(way, axis=1)[:, None]]
    output = 1.01 * np.concatenate(parts) + [0.02, -0.01, 0.03]
    output += 1e-3 * rng.standard_normal(output.shape)
    return pd.DataFrame(output, columns=["acc_x", "acc_y", "acc_z"]).assign(time_s=np.arange(len(output)) / 100.0)


@pytest.mark.slow
def test_a_face_that_stands_askew_is_named_with_its_angle(rng: np.random.Generator) -> None:
    six_faces(rng, 5.0).to_csv("leans.csv", index=False)
    lines = document_of("improve", "leans.csv", status=1)["recording"]["lines"]
    told = next(line for line in lines if line.startswith("CHECK THE FACES"))
    assert "+y and -y disagree with the other faces: one of the two leans by about" in told
    assert 4.0 < float(told.split("about ")[1].split("°")[0]) < 6.0
    six_faces(rng, 30.0).to_csv("falls.csv", index=False)
    assert "of six faces these lean by more than 26°: +y by 30°; stand them against" in refused("improve", "falls.csv")
    six_faces(rng, 0.3).to_csv("stands.csv", index=False)
    assert not any("CHECK" in line for line in document_of("improve", "stands.csv", status=1)["recording"]["lines"])


@pytest.mark.slow
def test_a_still_record_is_blocks_of_one_pose_without_the_hand_at_its_ends(rng: np.random.Generator) -> None:
    time = np.arange(0.0, 600.0, 0.05)
    warm = 40.0 - 0.04 * time
    held = (time < 21.0) | (time > 579.0)
    force = np.array([0.0, 0.02, 1.0]) + 0.0004 * (warm - 25.0)[:, None] + 0.002 * rng.normal(size=(time.size, 3))
    force[held] += 0.2 * rng.normal(size=(int(held.sum()), 3))
    frame = pd.DataFrame({"ms": 1000.0 * time, **dict(zip(["ax", "ay", "az"], force.T, strict=True)), "gtemp": warm})
    frame.to_csv("still.csv", index=False, float_format="%.5f")
    document = document_of("improve", "still.csv", "--no-measure")
    one = document["recording"]
    assert "--set face=+z --set block_s=10" in one["command"]
    assert any(text.startswith("handling at the ends left out: 0 to 3") for text in one["remarks"])
    slope = Archive(None).run(one["run"]).table("dwells")
    fitted = np.polyfit(slope["unit_C"], slope["out_z"], 1)[0]
    assert fitted == pytest.approx(0.0004, rel=0.05)


def test_a_doubt_and_too_few_positions_are_refused_with_what_to_add(rng: np.random.Generator) -> None:
    hand, frame = hand_held(rng, stops=20)
    rates = frame[[0, 4, 5, 6]]
    rates.to_csv("gyro.csv", header=False, index=False)
    said = refused("improve", "gyro.csv")
    assert "columns of acceleration were not recognised" in said
    assert "x=COLUMN" in said
    few = frame[frame[0] < hand.time[-1] * 0.3]
    few.to_csv("few.csv", header=False, index=False)
    assert "10 positions at rest" in refused("improve", "few.csv")
    frame.to_csv("a.csv", index=False)
    assert "'latest' is no file; give one run, or files only" in refused("improve", "latest", "a.csv")
    columns = ["unit", "dwell", "time_s", "out_x", "out_y", "out_z"]
    tables = pd.DataFrame([["A", 0, 0.0, 0.0, 0.0, 1.0]], columns=columns)
    for name in ("d1.csv", "d2.csv"):
        tables.assign(unit=name).to_csv(name, index=False)
    assert "2 tables of dwells, one is needed" in refused("improve", "d1.csv", "d2.csv")
    assert not Path("archive").exists()


@pytest.mark.slow
def test_six_faces_are_named_by_what_they_read_and_two_exchanged_labels_are_told(rng: np.random.Generator) -> None:
    faces = ["+x", "-x", "+y", "-y", "+z", "-z"]
    force = np.array([[float(f"{face[0]}1") * (face[1] == axis) for axis in "xyz"] for face in faces])
    means = force * 1.01 + [0.02, -0.01, 0.03] + 0.002 * rng.normal(size=force.shape)
    sheet = pd.DataFrame(means, columns=["X", "Y", "Z"]).assign(Position=[f"side {k}" for k in range(6)])
    sheet.to_csv("six.csv", index=False, sep=";", decimal=",", float_format="%.4f")
    document = document_of("improve", "six.csv", status=1)
    assert document["recording"]["fit"] == "faces"
    assert document["adequate"] is None  # six positions cannot tell it
    table = Archive(None).run(document["recording"]["run"]).table("coefficients")
    bias = [row["value"] for row in table.to_dict("records") if row["effect"] == "bias"]
    np.testing.assert_allclose(bias, [0.02, -0.01, 0.03], atol=0.004)
    how = ["--map", "x=X,y=Y,z=Z,dwell=Position", "--unit-of", "output=g", "--set", "rows=dwells", "--units", "A"]
    labels = dict(zip([f"side {k}" for k in (2, 1, 0, 3, 4, 5)], faces, strict=True))  # +x and +y exchanged
    poses = ",".join(f"{label}={face}" for label, face in labels.items())
    how += ["--set", f"poses={poses}", "--set", f"local_gravity_m_s2={G}", "--fit", "faces"]
    answer = document_of("import", "six.csv", *how, status=1)
    assert "with +x and +y exchanged they agree" in answer["reason"]


@pytest.mark.slow  # an improvement of a record adds an effect: tests/e2e/test_python.py
def test_a_changed_model_is_not_shown_with_the_coefficients_of_the_import(rng: np.random.Generator) -> None:
    """A cubic term of 4 mg/g³, taken for scale by the fit of the import."""
    force = rng.standard_normal((24, 3))
    force /= np.linalg.norm(force, axis=1, keepdims=True)
    output = 1.012 * force + 4e-3 * force**3 + np.array([0.02, -0.01, 0.03])
    parts = [rng.normal(one, spread, (count, 3)) for one in output for count, spread in ((100, 0.05), (250, 1e-4))]
    frame = pd.DataFrame(np.concatenate(parts), columns=list("xyz"))
    frame.insert(0, "time_s", np.arange(len(frame)) / 50.0)
    frame.to_csv("cubic.csv", index=False)
    status, said, _ = given("improve", "cubic.csv", "--yes")
    assert status == 0
    assert "missing: third_order; added" in said
    assert "scale 0.1" not in said
    assert "residual of the norm by dwell" not in said
    run = Archive(None).runs()[-1].id
    assert f"tumbleline fit {run} --model model.toml" in said
    assert "scale 0.1031" in given("fit", run, "--model", "model.toml")[1]  # 1.012 over 9.80665


@pytest.mark.slow  # as one recording: tests/e2e/test_python.py and test_import.py
def test_several_files_of_one_sensor_are_one_recording_in_one_command(rng: np.random.Generator) -> None:
    """Two sessions with a clock that restarts."""
    _, frame = hand_held(rng, stops=28, rate=50.0)
    half = len(frame) // 2
    for name, part in (("a.csv", frame.iloc[:half]), ("b.csv", frame.iloc[half:])):
        own = part.set_axis(["t", "ax", "ay", "az", "gx", "gy", "gz"], axis=1)
        own.assign(t=np.arange(len(own)) / 50.0).to_csv(name, index=False)
    document = document_of("improve", "a.csv", "b.csv", status=0)
    one = document["recording"]
    assert one["files"] == ["a.csv", "b.csv"]
    assert "--set join=rows" in one["command"]
    assert 26 <= one["dwells"] <= 30
    assert document_of(*shlex.split(one["command"])[1:], status=0)["run"] == one["run"]


SIX = np.array([sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)])
SIX_POSES = ",".join(f"dwell {k}={face}" for k, face in enumerate(("+x", "-x", "+y", "-y", "+z", "-z")))
MAPPED = ("--map", "time=time_s,x=x,y=y,z=z", "--unit-of", "output=g,time=s", "--units", "S1")
FIT = (*MAPPED, "--set", "local_gravity_m_s2=9.80665", "--set", f"poses={SIX_POSES}", "--fit", "faces")


def six_labelled(rng: np.random.Generator, path: str, *, tilt_deg: float = 0.0, moves: bool = True) -> str:
    """A recording of six faces at 50 Hz with 0.3 mg of white noise, a bias, and a label per face."""
    parts, labels = [], []
    for k, face in enumerate(SIX):
        turned = face + np.cross(np.radians(tilt_deg) * rng.standard_normal(3), face)
        for label, count, spread in (("move", 100, 0.05), (f"p{k}", 225, 3e-4))[0 if moves else 1 :]:
            parts.append(turned / np.linalg.norm(turned) + rng.normal(0.0, spread, (count, 3)))
            labels += [label] * count
    table = pd.DataFrame(np.concatenate(parts) + np.array([0.3040, -0.02, 0.01]), columns=list("xyz"))
    table.insert(0, "time_s", np.arange(len(table)) / 50.0)
    (table.assign(pose=labels) if "labels" in path else table).to_csv(path, index=False)
    return path


@pytest.mark.parametrize(("tilt_deg", "adequate"), mostly_slow([(0.0, None), (0.6, False)], (0.6, False)))
def test_six_faces_have_one_verdict_and_one_uncertainty(
    rng: np.random.Generator,
    tilt_deg: float,
    adequate: bool | None,  # noqa: FBT001
) -> None:
    """No lack of fit of six faces shows adequacy; one beyond the noise of the samples is "not adequate"."""
    path = six_labelled(rng, "six.csv", tilt_deg=tilt_deg)
    imported = document_of("import", path, *FIT, status=1)
    improved = document_of("improve", path, "--yes", status=1)
    judged = [imported, improved["diagnosis"], document_of("diagnose", imported["run"], status=1)]
    judged.append(document_of("fit", imported["run"], "--effects", ",".join(MODEL), status=1))
    assert [one["adequate"] for one in (*judged, improved)] == [adequate] * 5
    assert len({one["reason"] for one in judged}) == 1
    assert len({one["error"]["p_value"] for one in judged}) == 1
    assert ("disagree by more than their samples allow" in judged[0]["reason"]) == (adequate is False)
    run = Archive(None).run(imported["run"])
    assert set(run.table("verdict")["verdict"]) == {"not judged" if adequate is None else "not adequate"}
    # the uncertainty is that of every fit
    kept, again = run.table("coefficients"), fit(run.table("dwells"), None, MODEL)["coefficients"]
    pd.testing.assert_frame_equal(kept, again)
    stated = imported["least_squares"]["bias_u"]
    assert kept.query("effect == 'bias'")["standard_error"].tolist() == pytest.approx(stated)
    assert min(stated) > 0.9 * 3e-4 / np.sqrt(6 * 225)  # the noise of the samples, which two residuals may hide
    assert all(f"± {2.0 * u:.2g} g (k = 2;" in line for u, line in zip(stated, imported["lines"], strict=False))


@pytest.mark.parametrize("moves", mostly_slow([True, False], True))
def test_labels_of_a_file_name_its_faces(rng: np.random.Generator, *, moves: bool) -> None:
    path = six_labelled(rng, "labels.csv", moves=moves)
    command = document_of("improve", path, "--yes", status=1)["recording"]["command"]
    assert "dwell=pose" in command
    assert "--set poses=p0=+x,p1=-x,p2=+y,p3=-y,p4=+z,p5=-z" in command
    assert command.startswith(document_of("inspect", path)["command"].split(" --set gaps")[0])


def test_positions_logged_back_to_back_are_faces_and_an_array_of_three_is_a_triad(rng: np.random.Generator) -> None:
    done = command(["improve", six_labelled(rng, "six.csv", moves=False)])
    assert done.returncode in {0, 1}, done.stderr
    assert "x: bias 0.30" in done.stdout
    outputs = 9.81 * np.repeat(SIX, 30, axis=0) + 0.02 * rng.normal(size=(180, 3))
    columns = {f"accelerometer_m_s2[{k}]": outputs[:, k] for k in range(3)} | {"gyro_rad[0]": np.arange(180.0)}
    assert triad(columns, {}).names == tuple(f"accelerometer_m_s2[{k}]" for k in range(3))
