"""The tables of a generated lot: its dwells, and the results of ordinary least squares.

A lot is solved in one step by QR, without noise between dwells and without the stages of the product: it represents the
results of an earlier version of the program. Re-runs fit the dwells again with the present program.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import norm

from benchmarks.generated_lots import Lot, dwell_noise, lot_output, table_force
from schemas.limits import Limits
from schemas.recipe import Recipe
from stations.plant.preset import Preset

AXES = np.array(["x", "y", "z"], dtype=object)
EFFECTS = (
    *("bias", "scale", "misalignment", "bias_temperature", "bias_temperature_quadratic"),
    *("scale_temperature", "scale_temperature_quadratic"),
)
OTHERS = ((1, 2), (2, 0), (0, 1))  # the other axes in cyclic order
UP = np.array([0.0, 0.0, 1.0])
DWELL_S, MOVE_S, SOAK_S = 10.0, 6.0, 5400.0
RATE_HZ = 100.0
MICRO = 1e6


class Measured:
    """Dwells of a lot as arrays, and the results of ordinary least squares; s units, n dwells, m of them for verification."""

    def __init__(self, lot: Lot, recipe: Recipe, preset: Preset, rng: np.random.Generator) -> None:
        self.lot, self.preset, self.recipe = lot, preset, recipe
        poses = [*recipe.poses, *recipe.verification]
        soaks, s = len(recipe.temperatures_C), len(lot.serials)
        self.pose = np.array([p.name for p in poses] * soaks, dtype=object)
        kinds = ["dwell"] * len(recipe.poses) + ["verification"] * len(recipe.verification)
        self.kind = np.array(kinds * soaks, dtype=object)
        self.soak = np.repeat(np.arange(soaks), len(poses))
        self.n, self.s = self.pose.size, s
        self.outer = np.tile([p.outer_deg for p in poses], soaks) + 2e-4 * rng.standard_normal(self.n)
        self.inner = np.tile([p.inner_deg for p in poses], soaks) + 2e-4 * rng.standard_normal(self.n)
        self.time = np.arange(self.n) * (DWELL_S + MOVE_S) + SOAK_S * (1 + self.soak)
        self.chamber = np.asarray(recipe.temperatures_C)[self.soak] + 0.02 * rng.standard_normal(self.n)
        own = self.chamber[:, None] + 0.05 * rng.standard_normal(s)
        self.unit_C = np.round(own + 0.01 * rng.standard_normal((self.n, s)), 2)
        true = lot_output(lot, preset, table_force(self.outer, self.inner, lot.up), own)
        noisy = true + dwell_noise(preset, self.time, DWELL_S, s, rng)
        self.out = preset.zero_level + preset.scale * noisy
        spread = 1e-6 * preset.noise_density_ug * np.sqrt(RATE_HZ / 2.0) * preset.scale
        self.samples = int(DWELL_S * RATE_HZ)
        self.sd = (spread * (1.0 + rng.standard_normal(self.out.shape) / np.sqrt(2.0 * self.samples))).astype(
            np.float32
        )
        self.sd = self.sd.astype(float)
        self.force = table_force(self.outer, self.inner, UP)
        self.fit = self.kind == "dwell"
        self._solve()

    def _columns(self) -> np.ndarray:
        """Design of every unit, axis and dwell, (s, 3, n, 8)."""
        theta, one = (self.unit_C.T - 25.0), np.ones((self.s, self.n))
        by_axis = []
        for axis, (j, k) in enumerate(OTHERS):
            f = np.broadcast_to(self.force[:, axis], (self.s, self.n))
            cross = [np.broadcast_to(self.force[:, o], (self.s, self.n)) for o in (j, k)]
            by_axis.append(np.stack([one, f, *cross, theta, theta**2, theta * f, theta**2 * f], axis=-1))
        return np.stack(by_axis, axis=1)

    def _solve(self) -> None:
        design, y = self._columns(), np.moveaxis(self.out, 0, -1)
        q, r = np.linalg.qr(design[:, :, self.fit])
        right = np.einsum("sanp,san->sap", q, y[:, :, self.fit])
        self.coefficients = np.linalg.solve(r, right[..., None])[..., 0]
        left = y - np.einsum("sanp,sap->san", design, self.coefficients)
        self.dof = int(self.fit.sum()) - right.shape[-1]
        self.sigma = np.sqrt(np.sum(left[:, :, self.fit] ** 2, axis=-1) / self.dof)
        back = np.linalg.inv(r)
        self.covariance = np.einsum("sapk,saqk->sapq", back, back) * self.sigma[..., None, None] ** 2
        self.slope = self.coefficients[..., 1]
        self.residual = MICRO * left[:, :, self.fit] / self.slope[..., None]
        self.left = MICRO * left[:, :, ~self.fit] / self.slope[..., None]
        self.unseen = design[:, :, ~self.fit]


def base_tables(measured: Measured) -> dict[str, dict[str, Any]]:
    """Readings, history, verdicts and dwells of a lot."""
    lot, s, n = measured.lot, measured.s, measured.n
    unit, slot = np.repeat(np.array(lot.serials, dtype=object), n), np.repeat(lot.slots, n)
    tiled = {
        "record": np.tile(np.arange(n), s), "kind": np.tile(measured.kind, s), "pose": np.tile(measured.pose, s),
        "soak": np.tile(measured.soak, s), "outer_deg": np.tile(measured.outer, s), "inner_deg": np.tile(measured.inner, s),
        "chamber_C": np.tile(measured.chamber, s), "unit_C": measured.unit_C.T.ravel(),
        "supply_V": np.full(s * n, measured.preset.supply_V), "vibration_g": np.zeros(s * n),
        "since_move_s": np.full(s * n, 2.0), "since_power_s": np.tile(measured.time, s),
        "duration_s": np.full(s * n, DWELL_S),
    }  # fmt: skip
    unit_text = np.full(s * n, measured.preset.output_unit, dtype=object)
    ahead = ("kind", "pose", "soak", "outer_deg", "inner_deg", "chamber_C", "unit_C", "supply_V", "vibration_g",
             "since_move_s", "since_power_s", "duration_s")  # fmt: skip
    readings = {
        "unit": unit, "slot": slot, "record": tiled["record"], **{name: tiled[name] for name in ahead},
        "outer_command_deg": tiled["outer_deg"].round(1), "inner_command_deg": tiled["inner_deg"].round(1),
        "start_s": np.tile(measured.time, s), "rate_hz": np.full(s * n, RATE_HZ), "n": np.full(s * n, measured.samples),
        "overflow": np.zeros(s * n, dtype=bool), "status": np.full(s * n, "ok", dtype=object), "out_unit": unit_text,
        "full_scale": np.full(s * n, measured.preset.full_scale),
    }  # fmt: skip
    output = {f"out_{a}": measured.out[..., i].T.ravel() for i, a in enumerate(AXES)}
    spread = {f"sd_{a}": measured.sd[..., i].T.ravel() for i, a in enumerate(AXES)}
    force = {f"force_{a}": np.tile(measured.force[:, i], s) for i, a in enumerate(AXES)}
    dwells = {
        "unit": unit, "slot": slot, **tiled, "out_unit": unit_text, "time_s": np.tile(measured.time + 0.5 * DWELL_S, s),
        **output, **spread, "n": np.full(s * n, measured.samples), "dwell": tiled["record"], **force,
    }  # fmt: skip
    grid = measured.time[:: max(1, n // 6)]
    air = np.interp(grid, measured.time, measured.chamber)
    history = {
        "time_s": np.tile(grid, s), "chamber_C": np.tile(air, s), "slot": np.repeat(lot.slots, grid.size),
        "unit": np.repeat(np.array(lot.serials, dtype=object), grid.size), "unit_C": np.tile(air, s),
    }  # fmt: skip
    none = np.full(s, "", dtype=object)
    verdicts = {"unit": np.array(lot.serials, dtype=object), "slot": np.array(lot.slots),
                "refused": np.zeros(s, dtype=bool), "fault": none, "reason": none}  # fmt: skip
    return {"readings": readings, "history": history, "verdicts": verdicts, "dwells": dwells}


def fitted_tables(
    measured: Measured, names: list[list[tuple[str, str]]], texts: list[str]
) -> dict[str, dict[str, Any]]:
    """Coefficients, covariance, residuals, predictions and noise of a lot.

    names : per axis, (effect, coefficient) of the columns; texts : units of the columns
    """
    serials, s, p = np.array(measured.lot.serials, dtype=object), measured.s, measured.coefficients.shape[-1]
    error = np.sqrt(np.diagonal(measured.covariance, axis1=-2, axis2=-1))
    coefficients = {
        "unit": np.repeat(serials, 3 * p), "axis": np.tile(np.repeat(AXES, p), s),
        "effect": np.tile(np.array([e for axis in names for e, _ in axis], dtype=object), s),
        "name": np.tile(np.array([c for axis in names for _, c in axis], dtype=object), s),
        "value": measured.coefficients.ravel(), "standard_error": error.ravel(),
        "unit_text": np.tile(np.array(texts * 3, dtype=object), s),
    }  # fmt: skip
    row, column = np.tril_indices(p)
    covariance = {
        "unit": np.repeat(serials, 3 * row.size), "axis": np.tile(np.repeat(AXES, row.size), s),
        "row": np.tile(row, 3 * s), "column": np.tile(column, 3 * s),
        "value": measured.covariance[..., row, column].ravel(),
    }  # fmt: skip
    used = np.flatnonzero(measured.fit)
    n = used.size
    noise = np.repeat(MICRO * (measured.sigma / measured.slope).ravel(), n).reshape(s, 3, n)
    residuals = {
        "unit": np.repeat(serials, 3 * n), "dwell": np.tile(np.repeat(used, 3), s),
        "axis": np.tile(AXES, s * n), "pose": np.tile(np.repeat(measured.pose[used], 3), s),
        "force_g": np.tile(measured.force[used].ravel(), s),
        "residual_ug": measured.residual.transpose(0, 2, 1).ravel(),
        "standard_error_ug": noise.transpose(0, 2, 1).ravel(), "expected_ug": noise.transpose(0, 2, 1).ravel(),
        "unit_C": np.repeat(measured.unit_C[used].T.ravel(), 3),
    }  # fmt: skip
    wander = {
        "unit": np.repeat(serials, 3), "axis": np.tile(AXES, s), "method": np.full(3 * s, "birge", dtype=object),
        "white_ug": MICRO * (measured.sigma / measured.slope).ravel(), "flicker_ug": np.zeros(3 * s),
        "walk_ug": np.zeros(3 * s), "lack_of_fit": np.ones(3 * s), "dof": np.full(3 * s, measured.dof),
    }  # fmt: skip
    tables = {"coefficients": coefficients, "covariance": covariance, "residuals": residuals, "wander": wander}
    return {**tables, "predictions": _predictions(measured, serials)}


def _predicted(measured: Measured) -> np.ndarray:
    """Covariance of the residuals of the verification dwells, (s, 3, m, m), µg²."""
    model = np.einsum("samp,sapq,sakq->samk", measured.unseen, measured.covariance, measured.unseen)
    own = measured.sigma[..., None, None] ** 2 * np.eye(model.shape[-1])
    return (model + own) * (MICRO / measured.slope[..., None, None]) ** 2


def _predictions(measured: Measured, serials: np.ndarray) -> dict[str, Any]:
    dwells, values = np.flatnonzero(~measured.fit), _predicted(measured)
    row, column = np.tril_indices(dwells.size)
    return {
        "unit": np.repeat(serials, 3 * row.size), "axis": np.tile(np.repeat(AXES, row.size), measured.s),
        "dwell": np.tile(dwells[row], 3 * measured.s), "other": np.tile(dwells[column], 3 * measured.s),
        "covariance_ug2": values[..., row, column].ravel(),
    }  # fmt: skip


def decided_tables(measured: Measured, limits: Limits, rule: str) -> dict[str, dict[str, Any]]:
    """Verification, figures and grades of a lot."""
    serials, s = np.array(measured.lot.serials, dtype=object), measured.s
    toward = measured.force[~measured.fit]
    norm_error = np.einsum("sam,ma->sm", measured.left, toward)
    expected = _predicted(measured)
    spread = np.sqrt(np.einsum("ma,samm,ma->sm", toward, expected, toward))
    poses = measured.pose[~measured.fit]
    reading = MICRO * float(np.mean(measured.sd)) / np.sqrt(measured.samples) / abs(measured.preset.scale)
    m = poses.size
    verification = {
        "unit": np.repeat(serials, m), "dwell": np.tile(np.flatnonzero(~measured.fit), s), "pose": np.tile(poses, s),
        "norm_g": 1.0 + 1e-6 * norm_error.ravel(), "error_ug": norm_error.ravel(), "uncertainty_ug": spread.ravel(),
        "reading_ug": np.full(s * m, reading), **{f"error_{a}_ug": measured.left[:, i].ravel() for i, a in enumerate(AXES)},
        "unit_C": measured.unit_C[~measured.fit].T.ravel(),
    }  # fmt: skip
    names = list(dict.fromkeys(poses.tolist()))
    groups = [np.flatnonzero(poses == name) for name in names]
    mean = np.stack([norm_error[:, g].mean(axis=1) for g in groups], axis=1)
    of_mean = np.stack([np.sqrt(np.sum(spread[:, g] ** 2, axis=1)) / g.size for g in groups], axis=1)
    by_pose = {
        "unit": np.repeat(serials, len(names)), "pose": np.tile(np.array(names, dtype=object), s),
        "dwells": np.tile([g.size for g in groups], s), "error_ug": mean.ravel(), "uncertainty_ug": of_mean.ravel(),
    }  # fmt: skip
    values = _figures(measured, norm_error, spread, mean, of_mean)
    return {"verification": verification, "verification_poses": by_pose, **_decisions(measured, values, limits, rule)}


def _figures(
    measured: Measured, error: np.ndarray, spread: np.ndarray, mean: np.ndarray, of_mean: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray, str]]:
    """Value, standard uncertainty (s,) and unit of every figure."""
    scale, errors = measured.slope[..., None], np.sqrt(np.diagonal(measured.covariance, axis1=-2, axis2=-1))
    units = np.arange(measured.s)
    worst = np.argmax(np.abs(mean) + 2.0 * of_mean, axis=1)
    single = np.argmax(np.abs(error), axis=1)
    quantile = float(norm.isf(0.5 * 0.01 / error.shape[1]))
    rms = np.sqrt(np.mean(measured.residual**2, axis=(1, 2)))
    axis_rms = np.sqrt(np.mean(measured.left**2, axis=2)).max(axis=1)
    out = {
        "residual_rms_ug": (rms, rms / np.sqrt(2.0 * measured.residual[0].size), "µg"),
        "verification_norm_ug": (np.abs(mean[units, worst]), of_mean[units, worst], "µg"),
        "verification_dwell_ug": (np.abs(error[units, single]), np.full(measured.s, 2.0), "µg"),
        "verification_ratio": (np.max(np.abs(error) / (quantile * spread), axis=1), np.zeros(measured.s), "1"),
        "bias_error_ug": (axis_rms, axis_rms / np.sqrt(2.0 * error.shape[1]), "µg"),
    }
    plans = (("zero_g_offset_mg", [0], 1e3, measured.preset.zero_level, "mg"), ("misalignment_mrad", [2, 3], 1e3, 0.0, "mrad"),
             ("bias_temperature_ug_K", [4], 1e6, 0.0, "µg/K"), ("scale_temperature_ppm_K", [6], 1e6, 0.0, "ppm/K"))  # fmt: skip
    for name, columns, factor, nominal, text in plans:
        values = (factor * (measured.coefficients[..., columns] - nominal) / scale).reshape(measured.s, -1)
        place = np.argmax(np.abs(values), axis=1)
        own = (factor * errors[..., columns] / scale).reshape(measured.s, -1)
        out[name] = (values[units, place], own[units, place], text)
    return out


def _decisions(
    measured: Measured, values: dict[str, tuple[np.ndarray, np.ndarray, str]], limits: Limits, rule: str
) -> dict[str, dict[str, Any]]:
    rows: dict[str, list[Any]] = {
        "figure": [],
        "value": [],
        "uncertainty": [],
        "limit": [],
        "unit_text": [],
        "outcome": [],
    }
    good = np.ones(measured.s, dtype=bool)
    for name, (value, error, text) in values.items():
        limit = limits.figures[name].max if name in limits.figures else np.nan
        passed = np.abs(value) <= limit - 2.0 * error
        good &= passed | np.isnan(limit)
        outcome = np.where(passed, "pass", np.where(np.abs(value) > limit + 2.0 * error, "fail", "conditional fail"))
        rows["figure"].append(np.full(measured.s, name, dtype=object))
        rows["value"].append(value)
        rows["uncertainty"].append(2.0 * error)
        rows["limit"].append(np.full(measured.s, limit))
        rows["unit_text"].append(np.full(measured.s, text, dtype=object))
        rows["outcome"].append(np.full(measured.s, "no limit") if np.isnan(limit) else outcome)
    stacked = {name: np.stack(parts, axis=1).ravel() for name, parts in rows.items()}
    serials = np.array(measured.lot.serials, dtype=object)
    rules = np.where(stacked["outcome"] == "no limit", "", rule).astype(object)
    figures = {"unit": np.repeat(serials, len(values)), **stacked, "rule": rules}
    names = np.array(["consumer" if ok else "none" for ok in good], dtype=object)
    reasons = np.array(["" if ok else "a figure is outside its limit" for ok in good], dtype=object)
    grades = {"unit": serials, "slot": np.array(measured.lot.slots), "outcome": np.where(good, "pass", "fail").astype(object),
              "grade": names, "reasons": reasons, "rule": np.full(measured.s, rule, dtype=object)}  # fmt: skip
    return {"figures": figures, "grades": grades}
