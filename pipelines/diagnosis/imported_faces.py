"""Six labelled faces: the usual fit with its noise, the published method for comparison, and the verdict."""

from itertools import combinations

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.fits.faces import Faces, faces, ferraris
from inertial.quantities import OUTPUT_COLUMNS, SPREAD_COLUMNS
from inertial.uncertainty.rounding import equal
from pipelines.diagnosis.diagnose import diagnose
from pipelines.importers.judged import FitAnswer, gravity_of, imported_dwells
from pipelines.importers.mapping import FACES, Mapping
from pipelines.importers.record import Imported
from pipelines.stages.fit import fit
from pipelines.stages.judge import told_by, verdict_table
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

MODEL = ("bias", "scale", "misalignment")
COVERAGE = 2.0
"""Coverage factor k of the printed uncertainties; the standard errors of a fit already include Student's factor."""
GROSS = 0.05
"""Largest misfit of the faces over gravity: a face placed by hand at 18° has cos 18° = 0.95 of gravity along it."""
_ON_AXIS = 0.9
"""Smallest cosine of the angle between an output and its axis: 25° for a device turned by hand."""
_ODD = 0.5
"""Ratio of the smallest to the middle distance between the sums of two pairs of faces, below which the third pair leans."""
_NOISELESS = 1e-6
"""Noise over gravity that is assumed if none was recorded: far below any scatter, which then decides alone."""


def six_faces(data: Imported, mapping: Mapping) -> FitAnswer:
    """Bias, scale and misalignment of six labelled faces, with the published method and the lack of fit of each output."""
    dwells = imported_dwells(data)
    gravity = gravity_of(mapping)
    up, down, error = _by_face(dwells, mapping)
    published, plain = ferraris(up, down, gravity), faces(up, down, gravity, error)
    with threadpool_limits(1):
        tables = fit(_with_noise(dwells, plain), None, MODEL)
    verdict = diagnose(dwells, None, MODEL)
    bias, response = _values(tables["coefficients"], "value")
    bias_u, response_u = _values(tables["coefficients"], "standard_error")
    per_g = np.linalg.norm(plain.response, axis=1)
    why = verdict["reason"] or ""
    share = float(np.max(plain.rms / (per_g * gravity)))
    if not share <= GROSS:
        why = (
            f"the faces disagree by {100.0 * share:.3g} % of gravity, far beyond noise; check the labels of the faces"
            f"{_exchanged(up, down, gravity)}"
        )
    document = {
        "adequate": verdict["adequate"],
        "reason": why or None,
        "error": {**verdict["error"], "coverage_factor": COVERAGE},
        "evidence": verdict["evidence"],
        "published": {
            "scale_per_m_s2": (np.diagonal(published.scale) / STANDARD_GRAVITY_M_S2).tolist(),
            "rotation": published.rotation.tolist(),
            "bias": published.bias.tolist(),
        },
        "least_squares": {
            "bias": bias.tolist(),
            "bias_u": bias_u.tolist(),
            "response_per_g": response.tolist(),
            "response_u": response_u.tolist(),
            "residuals": plain.residuals.tolist(),
            "rms_ug": (MICRO * plain.rms / per_g).tolist(),
            "samples_ug": (MICRO * plain.pure_error / per_g).tolist(),
            "p_value": plain.p_value.tolist(),
        },
    }
    lines = [_line(k, (bias[k], bias_u[k], float(published.bias[k])), plain, data.out_unit) for k in range(3)]
    lines += [f"data fault {fault['fault']}: {fault['evidence']}" for fault in verdict["blocked_by"]]
    lines += [why] if why else []
    if verdict["adequate"] is False and share <= GROSS and (askew := _askew(up, down, plain.response * gravity)):
        lines.append(askew)
    rows = [{str(name): value for name, value in row.items()} for row in tables.pop("coefficients").to_dict("records")]
    tables["verdict"] = verdict_table(told_by(verdict, 1), MODEL)
    return FitAnswer("faces", verdict["adequate"], document, tuple(lines), rows, MODEL, tables)


def _with_noise(dwells: pd.DataFrame, plain: Faces) -> pd.DataFrame:
    """The dwells with their noise; if none is recorded, with one so small that the scatter about the fit decides."""
    if {*SPREAD_COLUMNS, "n"} <= set(dwells.columns):
        return dwells
    made = dwells.assign(n=1)
    made[list(SPREAD_COLUMNS)] = _NOISELESS * float(np.abs(plain.response).max())
    return made


def _values(coefficients: pd.DataFrame, column: str) -> tuple[Array, Array]:
    """Bias (3,) and response (3, 3) of a column of the table of coefficients."""
    bias, response = np.zeros(3), np.zeros((3, 3))
    for row in coefficients.to_dict("records"):
        axis = AXES.index(row["axis"])
        if row["effect"] == "bias":
            bias[axis] = row[column]
        else:
            response[axis, axis if row["effect"] == "scale" else AXES.index(row["name"][-1])] = row[column]
    return bias, response


def _exchanged(up: Array, down: Array, gravity: float) -> str:
    """A text with the two labels whose exchange makes the faces agree; empty if there are none or several.

    Each output must respond mainly to its own axis, because an exchange of two axes would fit as well.
    """
    means = np.concatenate([up, down])
    names = [f"{sign}{axis}" for sign in "+-" for axis in AXES]
    agreeing: list[str] = []
    for first, second in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[first, second]] = order[[second, first]]
        fit = faces(means[order[:3]], means[order[3:]], gravity)
        size = np.linalg.norm(fit.response, axis=1)
        cosines = np.diagonal(fit.response) / size
        if float(np.max(fit.rms / (size * gravity))) < GROSS and float(np.min(cosines)) > _ON_AXIS:
            agreeing.append(f"{names[first]} and {names[second]}")
    return f"; with {agreeing[0]} exchanged they agree" if len(agreeing) == 1 else ""


def _askew(up: Array, down: Array, response: Array) -> str:
    """A message that names the pair of faces of which one leans; empty if the three pairs disagree by similar amounts.

    The outputs of a pair add up to twice the bias; a face that leans by an angle adds a force of that angle across it.

    Parameters
    ----------
    response : (3, 3), output unit, output under gravity
    """
    sums = (up + down) @ np.linalg.inv(response).T
    apart = np.array([np.linalg.norm(sums[k - 1] - sums[k - 2]) for k in range(3)])  # of the two other pairs
    odd = int(np.argmin(apart))
    if apart[odd] > _ODD * np.sort(apart)[1]:
        return ""
    lean = np.degrees(np.linalg.norm(sums[odd] - 0.5 * (sums[odd - 1] + sums[odd - 2])))
    pair = f"+{AXES[odd]} and -{AXES[odd]}"
    return (
        f"CHECK THE FACES: {pair} disagree with the other faces: one of the two leans by about {lean:.1f}°; stand the device "
        "against a right angle, or record 10 positions, whose fit needs no face"
    )


def _by_face(dwells: pd.DataFrame, mapping: Mapping) -> tuple[Array, Array, Array]:
    """Mean outputs (3, 3) with each axis up, the same with it down, and the standard errors (3,) of a mean, output unit."""
    faces_there = {mapping.poses.get(str(label), ""): k for k, label in enumerate(dwells["pose"])}
    missing = [face for face in FACES if face not in faces_there]
    if missing or len(dwells) != len(FACES):
        raise DataRejected(
            f"import: {number_of(len(dwells), 'dwell')}, faces {', '.join(missing) or 'none'} missing; each of "
            f"{', '.join(FACES)} is needed once; name them with --set poses=LABEL=+x,…"
        )
    means = dwells[list(OUTPUT_COLUMNS)].to_numpy(dtype=np.float64)
    up, down = (means[[faces_there[f"{sign}{axis}"] for axis in AXES]] for sign in "+-")
    if not {*SPREAD_COLUMNS, "n"} <= set(dwells.columns):
        return up, down, np.full(3, np.nan)
    variance = dwells[list(SPREAD_COLUMNS)].to_numpy(dtype=np.float64) ** 2
    return up, down, np.sqrt(np.mean(variance / dwells["n"].to_numpy(dtype=np.float64)[:, None], axis=0))


def _line(k: int, bias: tuple[float, float, float], plain: Faces, unit: str) -> str:
    """An output as text; ``bias``: its value, its standard error, and the bias of the published method."""
    value, error, published = bias
    text = f"{AXES[k]}: bias {value:.7g} ± {COVERAGE * error:.2g} {unit} (k = {COVERAGE:g}; published method {published:.7g})"
    misfit = f"lack of fit {plain.rms[k]:.3g}"
    if not np.isfinite(plain.p_value[k]):
        return f"{text}; {misfit} {unit}"
    return f"{text}; {misfit}, the samples allow {plain.pure_error[k]:.2g} {unit} (p {equal(plain.p_value[k])})"
