"""Fit of a model to dwells of unknown orientation: coefficients, covariance, residuals of the norm and its noise, as tables."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from inertial import effects as catalogue
from inertial.arrays import Array
from inertial.errors import InertialError
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import LONGEST
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.fits.norm_noise import PlausibleNoise, runs_left_out, thin_whitener, with_runs
from inertial.fits.wander import student
from inertial.noise.flicker import SLOWEST_DIAGNOSED, flicker_kernel
from inertial.noise.measurands import DAY_S, instability, of_a_day, walk_kernel
from inertial.norm_fit import NormFit, fit_norms
from pipelines.stages.uncertainty.bias_measurands import COLUMNS
from pipelines.tables.calibration import coefficient_rows, covariance_rows
from pipelines.tables.dwells import Measured, lot_of, measured
from pipelines.tables.frames import empty_table, picked
from pipelines.tables.norms import expansion
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO

FEW_DWELLS = 300
"""Dwells up to which standard errors are averaged over the plausible shares of wander."""

_RUN, _SPARE = "bias_temperature", 6
"""The run that the noise is estimated beside, and degrees of freedom that are left to the noise then."""

NORM = "norm"
"""The axis of a residual of the norm."""


@dataclass(frozen=True)
class FittedNorms:
    """A fit of norms with its inputs.

    whitener : as :func:`inertial.norm_fit.fit_norms` has it; scale : (units, 3), output unit per g
    white, flicker, walk : (units,), standard deviations of one dwell's noise, g; walk at the end of the record
    """

    measured: Measured
    model: Model
    fit: NormFit
    scale: Array
    white: Array
    flicker: Array
    walk: Array
    gravity: float

    @property
    def rms(self) -> float:
        """Residual of the norm over all dwells, g of local gravity."""
        there = self.measured.readings.there
        return float(np.sqrt(np.mean((self.fit.left[there] / self.gravity) ** 2)))


def norms_fitted(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], gravity: float = 1.0
) -> FittedNorms:
    """A model fitted to dwells of unknown orientation, with the noise that a diagnosis estimates.

    Parameters
    ----------
    gravity : where it was measured, g

    Raises
    ------
    DataRejected
        The dwells do not determine the model, or lack a quantity that it needs.
    """
    try:
        measurement = measured(fitted_dwells(dwells), history)
        lot = lot_of(measurement, square="misalignment" not in effects)
        problem = Problem(lot)
        runs = runs_left_out(effects, lot.state.temperature, lot.state.force, measurement.readings.there)
        model = _with_run(Model(problem, terms_of(catalogue.get_all(effects), problem)), effects, runs)
        values = {t.effect.id: t.keywords for t in model.terms if t.keywords}
        output = measurement.readings.output
        typical = np.nan_to_num(np.nanmedian(output, axis=(0, 1)), nan=1.0)
        filled = np.where(measurement.readings.there[..., None], output, typical)
        shape = "six" if "misalignment" not in effects else "nine"
        origin = [expansion(measurement.readings, unit, shape=shape) for unit in range(len(measurement.units))]
        start = np.stack([o.bias for o in origin]), np.stack([o.response for o in origin]) / gravity
        fit = fit_norms(
            effects,
            lot.state,
            filled,
            whitener(model, runs),
            start,
            norm=gravity,
            nonlinear=values,
            plausible=plausible_noises(model, runs),
            weights=measurement.readings.duration,
        )
    except InertialError as problem_found:
        raise DataRejected(str(problem_found)) from None
    noise, covariance = model.noise, problem.covariance
    return FittedNorms(
        measured=measurement,
        model=model,
        fit=fit,
        scale=np.abs(np.diagonal(fit.fit.response(), axis1=-2, axis2=-1)),
        white=noise.scale * covariance.level,
        flicker=noise.scale * np.sqrt(covariance.white * noise.shares.flicker),
        walk=noise.scale * np.sqrt(covariance.white * noise.shares.walk),
        gravity=gravity,
    )


def _with_run(model: Model, effects: Sequence[str], runs: Array) -> Model:
    """The model with the run of its bias with temperature beside it, where it lacks it and the dwells can bear its coefficients.

    Else a drift with the temperature passes for a random walk, and the bias of each axis is that of another temperature.
    """
    problem = model.problem
    free = float(model.at(problem.covariance.white_noise()).by_block.min())
    if not runs.any() or _RUN in effects or free < len(AXES) + _SPARE:
        return model
    return Model(problem, [*model.terms, *terms_of([catalogue.get(_RUN)], problem)])


def whitener(model: Model, runs: Array) -> Array:
    """Whiteners of the units' norms, g⁻¹; thin ones of white noise and runs for records too long for a model of wander.

    ``runs`` are those of :func:`inertial.fits.norm_noise.runs_left_out`.
    """
    covariance, noise, n = model.problem.covariance, model.noise, model.problem.n
    if n > LONGEST:
        return thin_whitener(model.problem.error * noise.scale[:, None], runs)
    eye = np.broadcast_to(np.eye(n), (model.problem.blocks, n, n))
    return with_runs(covariance.whiten(eye, noise.shares) / noise.scale[:, None, None], runs)


def fitted_dwells(dwells: pd.DataFrame) -> pd.DataFrame:
    """The dwells without those that are held out for verification."""
    return dwells[dwells["kind"] == "dwell"] if "kind" in dwells.columns else dwells


def plausible_noises(model: Model, runs: Array) -> Iterator[PlausibleNoise]:
    """The noises that the residuals do not rule out.

    None for long records: their shares of wander are known well.
    """
    problem = model.problem
    if problem.n > FEW_DWELLS:
        return
    eye = np.broadcast_to(np.eye(problem.n), (problem.blocks, problem.n, problem.n))
    time, white = problem.lot.state.time, problem.covariance.white
    kernels = np.stack([flicker_kernel(times) for times in time]), np.stack([walk_kernel(times) for times in time])
    for shares, weight in model.plausible_shares():
        square = model.noise_at(shares).scale[:, None, None] ** 2
        slow = white * (shares.flicker * kernels[0] + shares.walk * kernels[1])
        whiten = with_runs(problem.covariance.whiten(eye, shares) / np.sqrt(square), runs)
        yield PlausibleNoise(weight, whiten, square * slow)


def fit_of_norms(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], gravity: float = 1.0
) -> dict[str, pd.DataFrame]:
    """The tables of :func:`pipelines.stages.fit.fit` for dwells of unknown orientation; residuals have the axis ``norm``."""
    return norm_tables(norms_fitted(dwells, history, effects, gravity), dwells)


def norm_tables(done: FittedNorms, dwells: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """A fit of norms as tables."""
    out_unit = str(dwells["out_unit"].iloc[0])
    fit = done.fit
    return {
        "coefficients": coefficient_rows(
            done.measured.units, fit.fit, fit.fit.covariance, out_unit, fit.nonlinear_error
        ),
        "covariance": covariance_rows(done.measured.units, fit.fit.covariance),
        "residuals": _residual_rows(done, dwells),
        "predictions": empty_table(texts="unit axis", numbers="covariance_ug2", integers="dwell other"),
        "wander": _wander_rows(done),
    }


def _residual_rows(done: FittedNorms, dwells: pd.DataFrame) -> pd.DataFrame:
    u, n = np.nonzero(done.measured.readings.there)
    state, numbers = done.measured.state, done.measured.dwells[n]
    error = done.model.problem.error * done.model.noise.scale[:, None]
    expected = np.hypot(error, np.hypot(done.flicker, done.walk)[:, None])
    poses = dwells.drop_duplicates("dwell").set_index("dwell")["pose"].astype(str) if "pose" in dwells.columns else None
    return pd.DataFrame(
        {
            "unit": picked(done.measured.units, u),
            "dwell": numbers,
            "axis": NORM,
            "pose": [f"dwell {k}" for k in numbers] if poses is None else poses.reindex(numbers).tolist(),
            "force_g": np.linalg.norm(done.fit.force, axis=-1)[u, n],
            "residual_ug": MICRO * done.fit.left[u, n] / done.gravity,
            "standard_error_ug": MICRO * error[u, n],
            "expected_ug": MICRO * expected[u, n],
            "unit_C": np.full(u.size, np.nan) if state.temperature is None else state.temperature[u, n],
        }
    )


def _wander_rows(done: FittedNorms) -> pd.DataFrame:
    units = len(done.measured.units)
    u, a = np.indices((units, 3)).reshape(2, -1)
    parts = {"white_ug": done.white, "flicker_ug": done.flicker, "walk_ug": done.walk}
    return pd.DataFrame(
        {
            "unit": picked(done.measured.units, u),
            "axis": picked(AXES, a),
            "method": "wander",
            **{name: MICRO * values[u] for name, values in parts.items()},
            "lack_of_fit": 1.0,
            "dof": done.fit.dof[u],
            **{name: values.ravel() for name, values in bias_uncertainty(done).items()},
        }
    )


def bias_uncertainty(done: FittedNorms) -> dict[str, Array]:
    """Standard uncertainties of the bias by measurand, (units, 3) each, µg.

    The names are those of :mod:`pipelines.stages.uncertainty.bias_measurands`.

    The flicker of a diagnosis has time constants to four times the record. Scatter that the samples of the dwells do not show
    counts as flicker: few dwells do not show its kind.
    """
    bias = [[name for name, _ in names].index("bias") for names in done.fit.fit.names]
    errors = np.sqrt(np.diagonal(done.fit.fit.covariance, axis1=-2, axis2=-1))
    record = np.stack([errors[:, axis, k] for axis, k in enumerate(bias)], axis=1)
    record = MICRO * (record if done.fit.record is None else done.fit.record) / done.scale
    lot = done.model.problem.lot
    known = done.model.problem.covariance.level if lot.recorded else done.white
    wander = MICRO * np.sqrt(done.flicker**2 + np.maximum(done.white**2 - known**2, 0.0))
    wander = np.repeat(wander[:, None], 3, axis=1)
    time = np.sort(lot.state.time[0])
    walk = MICRO * done.walk / np.sqrt(max(float(np.ptp(time)), 1e-9))
    widened = student(max(int(done.fit.dof.sum()), 1))
    long = of_a_day(record, wander, time, slowest=SLOWEST_DIAGNOSED, widened=widened)
    by_measurand: dict[str, Any] = {
        "bias_instability_ug": instability(wander, time, slowest=SLOWEST_DIAGNOSED),
        "bias_record_u_ug": record,
        "bias_long_u_ug": long,
        "bias_long_s": np.full_like(record, DAY_S),
        "bias_switch_on_u_ug": np.full_like(record, np.nan),
        "bias_walk_ug_rts": np.repeat(walk[:, None], 3, axis=1),
    }
    return {name: by_measurand[name] for name in COLUMNS}
