"""A correction as it is ordered and reported: how the bias is tracked, and the document of what was done."""

from pathlib import Path

import numpy as np

from inertial.arrays import Array
from inertial.quantities import FORCE_COLUMNS
from pipelines.archive import Run
from pipelines.export.corrected import Corrected, FitOfUnit, Tracking
from pipelines.export.documents import CorrectDocument
from pipelines.export.recording import CorrectableRecording
from schemas.errors import WrongUse
from schemas.foreign import shown
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2


def tracking_of(
    run: Run,
    recording: CorrectableRecording,
    force: str,
    gravity: float | None,
    turn_on: float | None,
    step: float,
    *,
    at_rest: bool,
) -> Tracking | None:
    """The settings of the tracking; None where the force is known at no sample.

    Parameters
    ----------
    force : true specific force as it was given, X,Y,Z in g; empty: what the recording states
    gravity : m/s²; None: that of the run
    turn_on : µg, given or stated by the run; step : s
    """
    if not (force or at_rest or _states_force(recording)):
        return None
    known = None
    if force:
        try:
            known = np.array([float(part) for part in force.split(",")])
        except ValueError:
            known = np.array([])
        if known.shape != (3,) or not np.isfinite(known).all():
            raise WrongUse(
                f"--track: found '{shown(force)}', at-rest or three numbers X,Y,Z in g are needed; correct it"
            )
    if turn_on is None:
        raise WrongUse(
            f"correct: run {run.id} states no change of the bias from switch-on to switch-on, it is needed to weigh the first "
            "updates; give it with --set turn_on=UG (data sheet, or the power cycles of a run)"
        )
    local = gravity if gravity is not None else run.about.get("recipe", {}).get("local_gravity_m_s2")
    magnitude = None
    if at_rest:
        if not isinstance(local, int | float) or not 9.7 < local < 9.9:
            found = f"local gravity {local}"
            raise WrongUse(
                f"correct: {found}, 9.7 to 9.9 m/s² is needed with --track at-rest; give it with --set gravity=M/S2"
            )
        magnitude = float(local) / STANDARD_GRAVITY_M_S2
    return Tracking(known, magnitude, turn_on, step)


def correction_document(
    recording: CorrectableRecording, fit: FitOfUnit, done: Corrected, tracking: Tracking | None, output: Path | None
) -> CorrectDocument:
    """The document of a correction: recording, calibration, uncertainties, and the bias where it was tracked."""
    sd = _deviation_ug(done.covariance)
    certificate = fit.exported.certificate
    document: CorrectDocument = {
        "file": recording.name,
        "run": fit.run,
        "unit": fit.exported.unit,
        "certificate": None if certificate is None else certificate.statement(),
        "samples": len(recording.time),
        "outside_temperature": done.outside,
        "temperatures_C": list(fit.exported.temperatures),
        "u_ug": _by_axis(np.sqrt(np.mean(sd**2, axis=0))),
        "u_contains": [
            "references and noise of the calibration" if fit.budget else "noise of the calibration only",
            *(["bias", "white noise of a sample"] if done.track is not None else []),
        ],
        "output": None if output is None else str(output),
        "filter": None,
        "state": None,
        "bias": None,
    }
    if tracking is None or done.track is None or done.kept is None:
        return document
    track, check = done.track, done.track.consistency
    at_limits = None if done.at_limits is None else _by_axis(_deviation_ug(done.at_limits.covariance[-1]))
    document["bias"] = {
        "force_from": _force_from(recording, tracking),
        "last_ug": _by_axis(MICRO * track.bias[-1]),
        "u_last_ug": _by_axis(_deviation_ug(track.covariance[-1])),
        "u_last_at_limits_ug": at_limits,
        "updates": int(track.updated.sum()),
        "steps": len(track.updated),
        "rejected": track.rejected,
        "nis": check.nis,
        "nis_bounds": [check.low, check.high],
        "lag_1": check.lag_1,
        "lag_1_bound": check.lag_1_bound,
        # more than 1 % of the updates were rejected, beyond five standard deviations
        "stated_uncertainty": "too small" if track.rejected > 1 + 0.01 * check.count else check.stated,
        "processes_s": done.kept.flicker.correlation_s.tolist(),
        "processes_flat": done.kept.flicker.flatness,
    }
    return document


def _states_force(recording: CorrectableRecording) -> bool:
    return bool(np.isfinite(recording.known).all(axis=1).any())


def _force_from(recording: CorrectableRecording, tracking: Tracking) -> list[str]:
    """The sources of the known force, a phrase each; columns that are not used are named as such."""
    columns = f"the file's columns {', '.join(FORCE_COLUMNS)}"
    found = list[str]()
    if tracking.force is not None:
        beside = f", which counts instead of {columns}" if _states_force(recording) else ""
        found.append(f"--track {','.join(f'{value:g}' for value in tracking.force)}{beside}")
    elif _states_force(recording):
        found.append(columns)
    if tracking.magnitude is not None:
        found.append("gravity where the unit is at rest")
    return found


def _deviation_ug(covariance: Array) -> Array:
    """Standard deviations (…, 3), µg, of covariances (…, 3, 3) in g²."""
    return MICRO * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))


def _by_axis(values: Array) -> dict[str, float]:
    return dict(zip(AXES, values.tolist(), strict=False))
