"""Results by comparison with a reference sensor, for the uncertainty budget; and the curve through a transfer function."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.dynamics.missing_effects import Judged
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis
from pipelines.tables.frames import rows_of
from schemas.comparison import TERMS
from schemas.tables import ADEQUATE, NOT_ADEQUATE, NOT_JUDGED

SHARED = tuple(name for name in TERMS if name not in {"transverse", "phase"})
"""Terms that change a magnitude by their own share."""
OF_RECORDS = ("noise", "repeatability", "nominal_scale", "transverse")
"""Contributions that records and recipe give."""
MIDDLE_HZ = 160.0
"""The reference frequency of ISO 16063-21."""


@dataclass(frozen=True)
class ComparedResult:
    """A result of a unit, with the contributions to its uncertainty.

    point : number of the point that it belongs to; setting : frequency, Hz; NaN: of no frequency
    u : standard uncertainties by the names of :data:`OF_RECORDS`; that of ``transverse`` is by the motion as it was measured
    sensitivities : change of the value per 1 (of phase: per rad) of a term of the comparison
    dof : degrees of freedom of the noise
    """

    quantity: str
    axis: str
    unit: str
    value: float
    u: Mapping[str, float]
    sensitivities: Mapping[str, float] = field(default_factory=dict[str, float])
    point: int = 0
    setting: float = float("nan")
    dof: float = float("inf")

    def row(self) -> dict[str, Any]:
        """The row of the table ``procedure_results``."""
        return {
            "quantity": self.quantity, "axis": self.axis, "unit_text": self.unit, "value": self.value, "point": self.point,
            "setting": self.setting, "dof": self.dof,
            **{f"u_{name}": float(self.u.get(name, 0.0)) for name in OF_RECORDS},
            **{f"c_{name}": float(self.sensitivities.get(name, 0.0)) for name in TERMS},
        }  # fmt: skip


@dataclass(frozen=True)
class JudgedCurve:
    """The model of one unit's points, and the verdict on it.

    names : of the parameters, (p,); covariance : (p, p), in their units; low_hz, high_hz : band of the points
    reason : what is missing, or why it cannot be judged
    """

    axis: str
    model: str
    verdict: str
    p_value: float
    reason: str = ""
    names: tuple[str, ...] = ()
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    low_hz: float = float("nan")
    high_hz: float = float("nan")

    def rows(self) -> list[dict[str, Any]]:
        """The rows of the table ``procedure_curves``: the lower triangle of the covariance, or a single row without it."""
        about = {"axis": self.axis, "model": self.model, "verdict": self.verdict, "reason": self.reason,
                 "p_value": self.p_value, "low_hz": self.low_hz, "high_hz": self.high_hz}  # fmt: skip
        if not self.names:
            return [{**about, "row": 0, "column": 0, "name": "", "value": float("nan")}]
        return [
            {**about, "row": k, "column": j, "name": self.names[k], "value": float(self.covariance[k, j])}
            for k in range(len(self.names))
            for j in range(k + 1)
        ]


def by_share(value: float, names: Sequence[str] = SHARED) -> dict[str, float]:
    """Sensitivities of a magnitude to terms that are shares of it."""
    return dict.fromkeys(names, value)


def response_results(part: Any, rows: pd.DataFrame, out_unit: str) -> list[ComparedResult]:
    """Magnitude and phase at every point of a transfer function, and the sensitivity at the reference frequency.

    Motion across the axis acts by the transverse sensitivity of the unit, at most ``transverse_percent``: with both rectangular
    and their angle uniform its standard uncertainty is that of the motion times the largest sensitivity over √6.
    """
    measured = rows[np.isfinite(rows["value"])]
    share = 1e-2 * part.transverse_percent / np.sqrt(6.0)
    repeated, turned = 1e-2 * part.repeatability_percent, part.repeatability_deg
    results: list[ComparedResult] = []
    for row in rows_of(measured):
        value, across = float(row["value"]), share * 1e-2 * float(row["transverse_percent"])
        noise = without(float(row["uncertainty"]) / value, repeated, across)
        about: dict[str, Any] = {"axis": str(row["axis"]), "point": int(row["point"]), "setting": float(row["setting"])}
        size = {"noise": value * noise, "repeatability": value * repeated, "transverse": value * across}
        of_size = {**by_share(value), "transverse": value * share}
        results.append(ComparedResult("response_magnitude", unit=f"{out_unit}/g", value=value, u=size,
                                      sensitivities=of_size, **about))  # fmt: skip
        degrees = float(row["phase_uncertainty_deg"])
        angle = {"noise": without(degrees, turned, np.degrees(across)), "repeatability": turned,
                 "transverse": float(np.degrees(across))}  # fmt: skip
        of_phase = {"phase": float(np.degrees(1.0)), "transverse": float(np.degrees(share))}
        results.append(ComparedResult("response_phase", unit="°", value=float(row["phase_deg"]), u=angle,
                                      sensitivities=of_phase, **about))  # fmt: skip
    sizes = [result for result in results if result.quantity == "response_magnitude"]
    middle = getattr(part, "level_frequency_hz", MIDDLE_HZ)
    near = min(sizes, key=lambda result: (abs(np.log(result.setting / middle)), result.point))
    return [replace(near, quantity="reference_sensitivity"), *results]


def transfer_results(
    part: Any, diagnosis: TransferDiagnosis, rows: pd.DataFrame, out_unit: str
) -> tuple[list[ComparedResult], list[JudgedCurve]]:
    """The results of a transfer function: its points, and its model with the parameters."""
    curve = transfer_curve(part.axis, diagnosis, rows["setting"].to_numpy(dtype=float))
    return [*response_results(part, rows, out_unit), *curve_results(curve, diagnosis, out_unit)], [curve]


def curve_results(curve: JudgedCurve, diagnosis: TransferDiagnosis, out_unit: str) -> list[ComparedResult]:
    """The parameters of the curve; the sensitivity at rest has the shares that all points have in common."""
    fit = diagnosis.fit
    if not curve.names:
        return []
    size = abs(fit.sensitivity)
    rest = ComparedResult("curve_sensitivity", curve.axis, f"{out_unit}/g", size, {"noise": size * fit.sensitivity_error},
                          by_share(size))  # fmt: skip
    parameters = [(p.unit, *fit.of(p.name)[:2]) for p in fit.parameters]
    return [rest] + [
        ComparedResult(f"curve_{name}", curve.axis, unit or "1", value, {"noise": error}, point=k)
        for k, (name, (unit, value, error)) in enumerate(zip(curve.names[1:], parameters, strict=True), start=1)
    ]


def transfer_curve(axis: str, diagnosis: TransferDiagnosis, frequency: Array) -> JudgedCurve:
    """The judged model of a transfer function, with the covariance of its parameters in their units."""
    fit = diagnosis.fit
    per_unit = np.append(
        abs(fit.sensitivity), [v if p.log else 1.0 for p, v in zip(fit.parameters, fit.values, strict=True)]
    )
    return JudgedCurve(
        axis,
        " + ".join(("sensitivity", *fit.effects)),
        verdict_word(diagnosis.adequate),
        fit.p_value,
        reason_of(diagnosis),
        ("sensitivity", *(p.name for p in fit.parameters)),
        fit.covariance * np.outer(per_unit, per_unit),
        float(frequency.min()),
        float(frequency.max()),
    )


def reason_of(diagnosis: Judged[Any]) -> str:
    """The effects that a model lacks, or why it cannot be judged; empty where neither is known."""
    missing = [" or ".join(missed.effects) for missed in diagnosis.classes]
    return diagnosis.reason or (f"it lacks {', '.join(missing)}" if missing else "")


def verdict_word(verdict: bool | None) -> str:  # noqa: FBT001 - it is the verdict
    """A verdict as tables state it."""
    return NOT_JUDGED if verdict is None else ADEQUATE if verdict else NOT_ADEQUATE


def without(total: float, *parts: float) -> float:
    """Standard uncertainty that remains after the parts are subtracted in quadrature; 0 where they exceed it."""
    return float(np.sqrt(max(0.0, total**2 - sum(part**2 for part in parts))))
