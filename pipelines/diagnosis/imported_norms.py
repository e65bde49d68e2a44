"""The fits of an import by name, with verdicts: labelled faces, a plane, a temperature ramp, dwells of unknown orientation."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from threadpoolctl import threadpool_limits

from inertial.arrays import Array
from inertial.counts import degrees_of_freedom, number_of
from inertial.fits.norm_noise import RUN_PER_K
from inertial.state import T_REFERENCE
from inertial.uncertainty.rounding import equal, rounded
from pipelines.diagnosis.diagnose import default_model, diagnose
from pipelines.diagnosis.documents import DiagnosisDocument, ErrorFigures, LeaveOut, VerdictEvidence
from pipelines.diagnosis.imported_faces import six_faces
from pipelines.importers.judged import FitAnswer, gravity_of, imported_dwells
from pipelines.importers.mapping import Mapping
from pipelines.importers.plane import plane, shown_turn
from pipelines.importers.pose_check import silent_axis
from pipelines.importers.ramp import ramp
from pipelines.importers.record import Imported
from pipelines.stages.judge import AdequacyDocument, told_by, verdict_table
from pipelines.stages.unknown_poses.fit import FittedNorms, bias_uncertainty, fitted_dwells, norm_tables, norms_fitted
from pipelines.tables.condense import MOST
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

COVERAGE = 2.0
_LARGE_BIAS = 0.25
"""Bias over gravity of an output in units of acceleration above which it is reported: data sheets have 0.1 g at most."""
TEMPERATURE = "bias_temperature"


def norm(data: Imported, mapping: Mapping) -> FitAnswer:
    """The result of ``import --fit norm``: bias, scale, misalignment; with temperature terms if that varies by 5 °C."""
    dwells = imported_dwells(data)
    effects = default_model(dwells)
    answer = fitted(dwells, None, effects, gravity_of(mapping), str(data.out_unit))
    tables = norm_tables(answer.fit, dwells)
    rows = [{str(name): value for name, value in row.items()} for row in tables["coefficients"].to_dict("records")]
    others = {name: tables[name] for name in ("covariance", "residuals", "predictions", "wander")}
    others["verdict"] = verdict_table(answer.verdict, effects)
    return FitAnswer("norm", answer.document["adequate"], answer.document, answer.lines, rows, tuple(effects), others)


@dataclass(frozen=True)
class NormAnswer:
    """A fit under the norm condition: its verdict, its document for JSON, and lines for people."""

    fit: FittedNorms
    document: dict[str, Any]
    lines: tuple[str, ...]
    verdict: AdequacyDocument


def fitted(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], gravity: float, out_unit: str
) -> NormAnswer:
    """The fit of a model to dwells of unknown orientation, and its verdict.

    Parameters
    ----------
    gravity : local gravity, g

    Raises
    ------
    DataRejected
        The dwells do not determine the model.
    """
    with threadpool_limits(1):
        done = norms_fitted(dwells, history, effects, gravity)
        smaller = _smaller(dwells, history, effects, gravity)
    verdict = diagnose(fitted_dwells(dwells), history, list(effects))
    lines = tuple(_lines(done, smaller, verdict, out_unit))
    adequacy = told_by(verdict, dwells["unit"].nunique())
    return NormAnswer(done, _document(done, smaller, verdict), lines, adequacy)


def _smaller(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], gravity: float
) -> FittedNorms | None:
    """The fit of the same model with orthogonal axes; None if the model has no misalignment, or cannot be fitted without."""
    if "misalignment" not in effects:
        return None
    try:
        left = [name for name in effects if name not in {"misalignment", "misalignment_temperature"}]
        return norms_fitted(dwells, history, left, gravity)
    except DataRejected:
        return None


def _bias(done: FittedNorms) -> Array:
    """Bias of every unit, (units, 3), output unit."""
    columns = [[name for name, _ in names].index("bias") for names in done.fit.fit.names]
    return np.stack([done.fit.fit.coefficients[:, axis, k] for axis, k in enumerate(columns)], axis=1)


def _holds_at(done: FittedNorms) -> float | None:
    """Temperature, °C, at which values without temperature terms hold: the mean of the first unit's dwells; None if unknown."""
    heat = done.measured.readings.temperature
    mean = np.nan if heat is None else float(np.mean(heat[0, done.measured.readings.there[0]]))
    return mean if np.isfinite(mean) else None


def _document(done: FittedNorms, smaller: FittedNorms | None, verdict: DiagnosisDocument) -> dict[str, Any]:
    left = done.fit.left[done.measured.readings.there] / done.gravity
    spread = bias_uncertainty(done)
    to_output = done.scale[0] / MICRO
    difference = None if smaller is None else (_bias(done) - _bias(smaller))[0].tolist()
    heat = [done.fit.fit.coefficients[0, axis, [n for n, _ in names].index(TEMPERATURE)] for axis, names in
            enumerate(done.fit.fit.names)] if TEMPERATURE in done.fit.fit.effects else None  # fmt: skip
    return {
        "adequate": verdict["adequate"],
        "reason": verdict["reason"],
        "error": {
            **verdict["error"],
            "fit_rms_ug": MICRO * done.rms,
            "mean_abs_ug": MICRO * float(np.mean(np.abs(left))),
            "worst_ug": MICRO * float(np.max(np.abs(left))),
            "six_parameters_rms_ug": None if smaller is None else MICRO * smaller.rms,
            "dof": int(done.fit.dof[0]),
            "coverage_factor": COVERAGE,
        },
        "evidence": verdict["evidence"],
        "leave_out": verdict["leave_out"],
        "missing": [group["effects"] for group in verdict["classes"] if group["scope"] != "data"],
        "bias": _bias(done)[0].tolist(),
        "bias_less_six_parameters": difference,
        "bias_u_record": (spread["bias_record_u_ug"][0] * to_output).tolist(),
        "bias_u_day": (spread["bias_long_u_ug"][0] * to_output).tolist(),
        "response_per_g": done.fit.fit.response()[0].tolist(),
        "scale_per_m_s2": (done.scale[0] / STANDARD_GRAVITY_M_S2).tolist(),
        "temperature_offset_per_C": None if heat is None else [float(value) for value in heat],
        "reference_C": _holds_at(done) if heat is None else T_REFERENCE,
    }


def _lines(done: FittedNorms, smaller: FittedNorms | None, verdict: DiagnosisDocument, out_unit: str) -> list[str]:
    """The fit and the basis of its verdict."""
    error, evidence = verdict["error"], verdict["evidence"]
    count = int(done.measured.readings.there[0].sum())
    free = count - int(done.fit.dof[0])
    left = done.fit.left[done.measured.readings.there] / done.gravity
    worst = MICRO * float(np.max(np.abs(left)))
    without = "" if smaller is None else f"; with orthogonal axes {MICRO * smaller.rms:.1f}"
    lines = [
        f"{free} parameters, {count} dwells: norm residual {MICRO * done.rms:.1f} µg rms, worst {worst:.1f} µg{without}",
        _noise_line(error, count),
    ]
    if evidence is not None:
        lines.append(_evidence_line(done, smaller, evidence, out_unit))
    spread = bias_uncertainty(done)
    units = range(len(done.measured.units))
    lines += [_axis_line(done, spread, (unit, k), out_unit) for unit in units for k in range(3)]
    warm = _holds_at(done)
    if TEMPERATURE in done.fit.fit.effects:
        heat = np.asarray(done.measured.readings.warm)[done.measured.readings.there]
        lines.append(
            f"values and U at {T_REFERENCE:g} °C, from which the model's terms in temperature count; the dwells were at "
            f"{heat.min():.1f} to {heat.max():.1f} °C"
        )
    elif warm is not None:
        runs = (MICRO * RUN_PER_K[name] for name in (TEMPERATURE, "scale_temperature"))
        lines.append(
            "values and U at {:.1f} °C, the mean of the dwells; U allows a run of bias and scale by {:.0f} µg and {:.0f} ppm "
            "per K, as far as the dwells leave it open".format(warm, *runs)
        )
    share = _bias(done)[0] / done.scale[0]
    if out_unit in {"g", "m/s^2"}:  # the zero of counts and volts may lie anywhere
        lines += [
            f"CHECK AXIS {AXES[k]}: its bias is {share[k]:.2g} of gravity, which no sound sensor has: a factory offset applied "
            "twice, a shifted word, or a damaged axis"
            for k in range(3)
            if abs(share[k]) > _LARGE_BIAS
        ]
    out = verdict["leave_out"]
    if out is not None:
        lines.append(_bad_line(out, verdict))
    missing = [" or ".join(group["effects"]) for group in verdict["classes"] if group["scope"] != "data"]
    if missing:
        lines.append(f"missing: {', and '.join(missing)}")
    if verdict["reason"] and out is None:
        lines.append(f"cannot be judged: {verdict['reason']}")
    return lines


def _noise_line(error: ErrorFigures, count: int) -> str:
    """Noise and probability as text; with the residual of the judged dwells, if these are only a part of a long record."""
    recorded = error.get("white_noise_ug")
    white = "" if recorded is None else f" (white noise alone {recorded:.1f} µg)"
    judged = f"; judged by {MOST} of the dwells, residual {error['rms_ug']:.1f} µg" if count > MOST else ""
    return f"noise of the measurement {error['floor_ug']:.1f} µg{white}; p {equal(error['p_value'])}{judged}"


def _evidence_line(done: FittedNorms, smaller: FittedNorms | None, evidence: VerdictEvidence, out_unit: str) -> str:
    parts = [degrees_of_freedom(evidence["degrees_of_freedom"])]
    if evidence["condition"] is not None:
        parts.append(f"condition {evidence['condition']:.2g}")
    if evidence["bias_jackknife_ug"] is not None:
        level = evidence["bias_jackknife_ug"] * float(np.mean(done.scale[0])) / MICRO
        parts.append(f"bias ± {level:.2g} {out_unit} by leaving out single dwells")
    if smaller is not None:
        moved = float(np.max(np.abs((_bias(done) - _bias(smaller))[0])))
        parts.append(f"bias differs by up to {moved:.2g} {out_unit} from the fit with orthogonal axes")
    return "; ".join(parts)


def _bad_line(out: LeaveOut, verdict: DiagnosisDocument) -> str:
    names = ",".join(f"{d['unit']}:{d['dwell']}" for d in out["dwells"])
    judged = {True: "is adequate", False: "is not adequate", None: "cannot be judged"}[out["adequate_without"]]
    why = f" ({verdict['reason']})" if verdict["reason"] else ""
    left = f"the residual is {verdict['error']['rms_ug']:.1f} µg and the model {judged}{why}"
    return f"bad dwells: {names}; without them {left}; to leave them out: tumbleline fit RUN --leave-out {names}"


def _axis_line(done: FittedNorms, spread: dict[str, Array], index: tuple[int, int], unit: str) -> str:
    u, k = index
    level = float(done.scale[u, k]) / MICRO
    record, long = (COVERAGE * float(spread[name][u, k]) * level for name in ("bias_record_u_ug", "bias_long_u_ug"))
    whose = f"{done.measured.units[u]} " if len(done.measured.units) > 1 else ""
    later = f"± {long:.2g} over the next day" if np.isfinite(long) else "over the next day not known"
    fit = done.fit.fit
    errors = COVERAGE * np.sqrt(np.diagonal(fit.covariance[u, k]))
    value = {name: (fit.coefficients[u, k, j], errors[j]) for j, (_, name) in enumerate(fit.names[k])}
    scale = _stated(np.array([done.scale[u, k], value.get("K1", (0.0, 0.0))[1]]) / STANDARD_GRAVITY_M_S2)
    across = [
        f"{other} {_stated(1e3 * np.array(value[name]) / done.scale[u, k])}"
        for other in AXES
        if (name := f"K{AXES[k]}{other}") in value
        and value[name][1] > 0.0  # the other three are 0 by the choice of the axes
    ]
    turned = f", misalignment {', '.join(across)} mrad" if across else ""
    return (
        f"{whose}{AXES[k]}: bias {_bias(done)[u, k]:.7g} ± {record:.2g} {unit} over the record ({later}; k = {COVERAGE:g}), "
        f"scale {scale} {unit} per m/s²{turned}"
    )


def _stated(value: Array) -> str:
    """A value and its U (2,) as they are written."""
    return " ± ".join(rounded(float(value[0]), float(value[1]))) if value[1] > 0.0 else f"{value[0]:.6g}"


METHODS: dict[str, Callable[[Imported, Mapping], FitAnswer]] = {
    "norm": norm,
    "faces": six_faces,
    "plane": plane,
    "temperature": ramp,
}

_NORM_NEEDS = 9
"""Bias, scale and the angles between the axes."""


def judge(method: str, data: Imported, mapping: Mapping) -> FitAnswer:
    """The fit ``method`` of :data:`METHODS` to the import of a unit, with the verdict on its adequacy."""
    if data.dwells is not None:
        imported_dwells(data)  # refuses what no fit at import can use
    silent = silent_axis(data.dwells) if method == "norm" and data.dwells is not None else ""
    if silent and (turned := shown_turn(data, mapping)) is not None:
        return turned
    if silent:  # more poses, which the fit requests, do not help
        raise DataRejected(
            f"import: axis {silent}; three axes that respond to gravity are needed for --fit norm; correct --map {silent[0]}=…"
        )
    if method == "norm" and data.dwells is not None and not mapping.poses and len(data.dwells) <= _NORM_NEEDS:
        raise DataRejected(
            f"import: {number_of(len(data.dwells), 'dwell')} of unknown orientation, more than {_NORM_NEEDS} are needed for "
            "--fit norm; add positions; or, if faces were up, name them with --set poses=LABEL=+x,LABEL=-x,… and give --fit faces"
        )
    return METHODS[method](data, mapping)
