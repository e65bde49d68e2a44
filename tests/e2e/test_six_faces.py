"""Six faces: one uncertainty, one verdict at every door, and labels that a file brings along."""

import numpy as np
import pandas as pd
import pytest
from in_process import document_of
from long_suites import mostly_slow

from pipelines.archive import Archive
from pipelines.diagnosis.imported_faces import MODEL
from pipelines.stages.fit import fit

pytestmark = pytest.mark.usefixtures("home", "no_next_measurement")

FACES = np.array([sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)])
POSES = ",".join(f"dwell {k}={face}" for k, face in enumerate(("+x", "-x", "+y", "-y", "+z", "-z")))
MAPPED = ("--map", "time=time_s,x=x,y=y,z=z", "--unit-of", "output=g,time=s", "--units", "S1")
FIT = (*MAPPED, "--set", "local_gravity_m_s2=9.80665", "--set", f"poses={POSES}", "--fit", "faces")


def recorded(rng: np.random.Generator, path: str, *, tilt_deg: float = 0.0, moves: bool = True) -> str:
    """A recording of six faces at 50 Hz with 0.3 mg of white noise, a bias, and a label per face."""
    parts, labels = [], []
    for k, face in enumerate(FACES):
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
    path = recorded(rng, "six.csv", tilt_deg=tilt_deg)
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
    path = recorded(rng, "labels.csv", moves=moves)
    command = document_of("improve", path, "--yes", status=1)["recording"]["command"]
    assert "dwell=pose" in command
    assert "--set poses=p0=+x,p1=-x,p2=+y,p3=-y,p4=+z,p5=-z" in command
    assert command.startswith(document_of("inspect", path)["command"].split(" --set gaps")[0])
