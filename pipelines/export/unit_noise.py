"""Noise of a unit for export: the terms N, B and K of its static record by axis."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Flags, Index
from pipelines.archive import Run
from pipelines.tables.frames import rows_of
from schemas.errors import WrongUse
from schemas.units import AXES

TERMS = ("N", "B", "K")


@dataclass(frozen=True)
class UnitNoise:
    """Terms of IEEE Std 952 of x, y and z: the value where it is identified, else its upper limit (95 %).

    value : (3,) by symbol: N in µg/√Hz (two-sided: σ(τ) = N/√τ), B in µg, K in µg/√s; NaN for an axis without noise or output
    identified : (3,) by symbol
    rate_hz : of the static record
    """

    value: Mapping[str, Array]
    identified: Mapping[str, Flags]
    rate_hz: float

    def remark(self, symbol: str) -> str:
        """Remark on the axes that have an upper limit instead of a value; empty where no axis has."""
        limits = [axis for axis, known in zip(AXES, self.identified[symbol], strict=False) if not known]
        return f"upper limit (95 %), not identified: {', '.join(limits)}" if limits else ""


def noise_of_units(run: Run) -> dict[str, UnitNoise]:
    """Noise of the units of a run by serial; empty where the run has no static record."""
    if not {"noise", "readings"} <= set(run.tables()):
        return {}
    table, readings = run.table("noise"), run.table("readings")
    rates = readings.loc[readings["kind"] == "allan", "rate_hz"]
    if table.empty or rates.empty:
        return {}
    rows = {(str(r["unit"]), str(r["term"]), str(r["axis"])): r for r in rows_of(table)}
    noises: dict[str, UnitNoise] = {}
    for unit in dict.fromkeys(key[0] for key in rows):
        axes = [axis for axis in AXES if any((unit, symbol, axis) in rows for symbol in TERMS)]
        by_symbol = {symbol: [rows[unit, symbol, axis] for axis in axes] for symbol in TERMS}
        value = {
            s: np.array([float(r["value"] if r["identified"] else r["high"]) for r in by_symbol[s]]) for s in TERMS
        }
        identified = {s: np.array([bool(r["identified"]) for r in by_symbol[s]]) for s in TERMS}
        noises[unit] = UnitNoise(value, identified, float(rates.iloc[0]))
    return noises


@dataclass(frozen=True)
class UnitCurve:
    """Allan deviation (m, t) of the axes with an output in µg, at ``m`` (t,) samples, of ``n`` at ``rate_hz``."""

    deviation: Array
    m: Index
    n: int
    rate_hz: float


def curve_of_unit(run: Run, unit: str) -> UnitCurve | None:
    """The Allan curves of a unit's static record; None where an axis has none or no mixture of noise terms explains it."""
    if not {"allan", "readings"} <= set(run.tables()):
        return None
    curves = run.table("allan")
    curves = curves[curves["unit"] == unit]
    axes = [rows for axis in AXES if len(rows := curves[curves["axis"] == axis])]
    readings = run.table("readings")
    readings = readings[(readings["kind"] == "allan") & (readings["unit"] == unit) & (readings["status"] == "ok")]
    if readings.empty or len({len(rows) for rows in axes}) != 1 or curves["fitted_ug"].isna().any():
        return None
    tau = axes[0]["tau_s"].to_numpy(dtype=np.float64)
    rate = 1.0 / float(tau[0])  # of the means that the curve begins with
    n = int(readings["n"].iloc[0]) // max(1, round(float(readings["rate_hz"].iloc[0]) / rate))
    deviation = np.stack([rows["deviation_ug"].to_numpy(dtype=np.float64) for rows in axes])
    return UnitCurve(deviation, np.rint(tau * rate).astype(np.int64), n, rate)


def required_noise(noise: UnitNoise | None, unit: str, run: str, form: str, without: str = "") -> UnitNoise:
    """The noise of a unit; refused where the run does not state it, with ``without``: what does without it."""
    if noise is None or not all(np.all(np.isfinite(noise.value[s])) for s in ("N", "K")):
        raise WrongUse(
            f"run {run}: it has no noise terms of unit {unit}, {form} needs them; measure with static_record_s above 0 in the "
            f"recipe (an import has none; 'tumbleline noise allan RECORD' computes them){without}"
        )
    return noise
