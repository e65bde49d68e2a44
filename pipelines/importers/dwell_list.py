"""List of the dwells of an import: times, means, noise, and with a fit by the norm residual and influence."""

from collections.abc import Mapping as Mapping_
from typing import Any

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.quantities import OUTPUT_COLUMNS, SPREAD_COLUMNS
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import Mapping
from pipelines.importers.record import Imported
from schemas.units import MICRO


def dwell_rows(data: Imported, judged: FitAnswer | None, mapping: Mapping) -> list[dict[str, Any]]:
    """A row per dwell: number, label, start, end, samples, mean and standard deviation by axis, residual and influence.

    The residual is |f| − g in µg, the influence Cook's distance (R. D. Cook, Technometrics 19 (1977) 15): above 1 a dwell
    dominates the fit. Both are None without a fit by the norm of gravity.
    """
    if data.dwells is None:
        return []
    residual, influence = _norm_influence(data.dwells, judged, mapping)
    rows: list[dict[str, Any]] = []
    for k, dwell in enumerate(data.dwells.to_dict("records")):
        half = 0.5 * float(dwell.get("duration_s", 0.0))
        start, end = _ends(data, dwell, half)
        rows.append(
            {
                "dwell": int(dwell["dwell"]),
                "label": str(dwell["pose"]),
                "start_s": start,
                "end_s": end,
                "n": int(dwell["n"]) if "n" in dwell else None,
                "mean": [float(dwell[name]) for name in OUTPUT_COLUMNS if name in dwell],
                "sd": [float(dwell[name]) for name in SPREAD_COLUMNS if name in dwell] if "sd_x" in dwell else None,
                "residual_ug": None if residual is None else MICRO * float(residual[k]),
                "influence": None if influence is None else float(influence[k]),
            }
        )
    return rows


def _ends(data: Imported, dwell: Mapping_[Any, Any], half: float) -> tuple[float, float]:
    if data.samples is None:
        return float(dwell["time_s"]) - half, float(dwell["time_s"]) + half
    time = data.samples.loc[data.samples["record"] == dwell["record"], "time_s"]
    return float(time.iloc[0]), float(time.iloc[-1])


def _norm_influence(
    dwells: pd.DataFrame, judged: FitAnswer | None, mapping: Mapping
) -> tuple[Array | None, Array | None]:
    """Residual of the norm, g, and Cook's distance of every dwell, from the coefficients of the fit."""
    if judged is None or judged.method != "norm" or mapping.norm_g is None:
        return None, None
    bias, response = np.array(judged.document["bias"]), np.array(judged.document["response_per_g"])
    output = dwells[[*OUTPUT_COLUMNS]].to_numpy(dtype=np.float64) - bias
    slope = judged.document.get("temperature_offset_per_C")
    if slope is not None and "unit_C" in dwells.columns:
        warm = dwells["unit_C"].to_numpy(dtype=np.float64) - float(judged.document["reference_C"])
        output = output - warm[:, None] * np.array(slope)
    correction = np.linalg.inv(response)
    force = output @ correction.T
    size = np.linalg.norm(force, axis=1)
    residual = size - mapping.norm_g
    along = force / size[:, None]
    # derivatives of the norm: with respect to the bias −Cᵀu, to the symmetric corrections uᵢaⱼ + uⱼaᵢ
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    shape = [along[:, i] * output[:, j] + (along[:, j] * output[:, i] if i != j else 0.0) for i, j in pairs]
    design = np.column_stack([-along @ correction, *shape])
    design = design / np.maximum(np.linalg.norm(design, axis=0), 1e-300)
    count, parameters = design.shape
    if count <= parameters:
        return residual, None
    leverage = np.clip(np.sum(np.linalg.qr(design)[0] ** 2, axis=1), 0.0, 1.0 - 1e-9)
    variance = float(np.sum(residual**2)) / (count - parameters)
    if not variance > 0.0:
        return residual, None
    return residual, residual**2 * leverage / (parameters * variance * (1.0 - leverage) ** 2)
