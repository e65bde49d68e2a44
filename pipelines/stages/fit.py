"""Fit of a model to the dwells of a lot: coefficients, covariance, residuals and the noise between dwells."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from inertial import design
from inertial.arrays import Array
from inertial.errors import InertialError
from inertial.fits.wander import student
from inertial.population.family import Family
from pipelines.stages.noisy_fit import NoisyFit, fitted_with_noise
from pipelines.stages.uncertainty.bias_measurands import COLUMNS, BiasNoise, bias_measurands
from pipelines.tables.calibration import (
    Calibration,
    calibration_of,
    coefficient_rows,
    covariance_rows,
    read_calibration,
    symmetric,
)
from pipelines.tables.dwells import LotArrays, LotTables
from pipelines.tables.frames import empty_table, joined_parts, picked
from schemas.errors import DataRejected
from schemas.units import MICRO

MOST = 4000  # dwells of a unit: 2 GB and ten minutes, with the square and the cube of their number
LONG_S = 3600.0  # shortest record whose random walk is extrapolated to a day, by a factor of about three at most


def fit(
    dwells: pd.DataFrame, history: pd.DataFrame | None, effects: Sequence[str], family: Family | None = None
) -> dict[str, pd.DataFrame]:
    """Tables of coefficients, covariance, residuals and noise of the recipe's effects for every unit of a lot.

    The white-noise error sd/√n of a dwell is a lower bound. Wander between dwells is estimated together with the coefficients
    (method ``wander``); with too few dwells for that, the covariance is scaled by χ²/ν (method ``birge``: squared Birge ratio).
    The table ``wander`` states the method, ``prior`` the contribution of the device family. The tables have no rows if no unit
    was accepted. Units without some dwells of the others are fitted to those they have: with the noise of units with the same
    dwells, or, if the model has values shared by all units, in one fit of the lot.

    Parameters
    ----------
    dwells : dwells of every kind; those for verification are not fitted, but belong to the history of the others
    history : temperatures between the dwells; None if not recorded
    family : family of the devices, for a prior; None for a fit without one
    """
    return fit_tables(LotTables(dwells, history), effects, family)


def fit_tables(tables: LotTables, effects: Sequence[str], family: Family | None = None) -> dict[str, pd.DataFrame]:
    """:func:`fit` of tables that are shared with other stages."""
    if not np.any(tables.dwells["kind"] == "dwell"):
        return _nothing()
    if (most := int(tables.dwells["unit"].value_counts().max())) > MOST:
        fewer = f"average neighbours, or import one of {most // MOST + 1}"
        raise DataRejected(f"fit: {most} dwells of a unit, at most {MOST} can be fitted together; {fewer}")
    done = [(lot, _fitted(lot, effects, family)) for lot in _lots(tables, effects)]
    return joined_parts([{**_rows(*part), "predictions": _prediction_rows(*part)} for part in done])


def _lots(tables: LotTables, effects: Sequence[str]) -> list[LotArrays]:
    """The parts of a lot that are each fitted together: units with the same dwells, or all units for a model of shared values."""
    if len(tables.parts) == 1:
        return [tables.fitted_kinds]
    sensor, station = design.split(effects)
    state = tables.parts[0].fitted_kinds.state
    if station or any(effect.parameters(state) for effect in sensor):
        return [tables.with_gaps]
    return [part.fitted_kinds for part in tables.parts]


class FittedLot(NamedTuple):
    """A fit for later stages in memory.

    tables : as of :func:`fit`; calibration : the coefficients as arrays, None if no unit was fitted
    expected : covariances (units, 3, m, m), µg², of the m verification dwells; or the table ``predictions`` if dwells are missing
    """

    tables: dict[str, pd.DataFrame]
    expected: Array | pd.DataFrame
    calibration: Calibration | None


def fit_in_memory(tables: LotTables, effects: Sequence[str], family: Family | None = None) -> FittedLot:
    """:func:`fit_tables` with the same numbers also as arrays, which later stages read."""
    if not np.any(tables.dwells["kind"] == "dwell"):
        return FittedLot(_nothing(), np.zeros((0, 3, 0, 0)), None)
    if len(tables.parts) > 1:
        made = fit_tables(tables, effects, family)
        return FittedLot(made, made["predictions"], read_calibration(made["coefficients"], made["covariance"]))
    lot = tables.fitted_kinds
    fitted = _fitted(lot, effects, family)
    made = _rows(lot, fitted)
    values = symmetric(_predicted(fitted))
    return FittedLot(made, values, calibration_of(lot.units, fitted.fit, made["coefficients"], made["covariance"]))


def _fitted(lot: LotArrays, effects: Sequence[str], family: Family | None) -> NoisyFit:
    try:
        return fitted_with_noise(lot, effects, family)
    except InertialError as problem:
        raise DataRejected(str(problem)) from None


def _rows(lot: LotArrays, fitted: NoisyFit) -> dict[str, pd.DataFrame]:
    return {
        "coefficients": coefficient_rows(
            lot.units, fitted.fit, fitted.fit.covariance, lot.out_unit, fitted.nonlinear_error
        ),
        "covariance": covariance_rows(lot.units, fitted.fit.covariance, lot.letters),
        "residuals": _residual_rows(lot, fitted),
        "wander": _wander_rows(lot, fitted),
        "prior": _prior_rows(lot, fitted),
    }


def _prior_rows(lot: LotArrays, fitted: NoisyFit) -> pd.DataFrame:
    """The prior of every coefficient and its share in the variance; without rows if there is no prior."""
    prior = fitted.prior
    if prior is None or fitted.of_prior is None:
        return empty_table(**_PRIOR)
    names = fitted.fit.names
    u, a, c = np.indices(fitted.of_prior.shape).reshape(3, -1)
    deviation = np.sqrt(np.diagonal(prior.covariance, axis1=-2, axis2=-1))
    factors = np.array([prior.widened.get(effect, (1.0, 1.0)) for effect, _ in names[0]])
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "axis": picked(lot.letters, a),
            "effect": picked([effect for terms in names for effect, _ in terms], a * len(names[0]) + c),
            "name": picked([name for terms in names for _, name in terms], a * len(names[0]) + c),
            "mean": prior.mean[u, a, c],
            "standard_deviation": deviation[u, a, c],
            "share": fitted.of_prior.ravel(),
            "widened": np.sqrt(factors.max(axis=1))[c],
            "p_value": prior.p_unit[u],
            "fits": prior.fits[u],
            "units": np.full(u.size, prior.family.units),
            "own": np.array([unit in prior.family.own for unit in lot.units])[u],
        }
    )


_PRIOR: dict[str, Any] = {
    "texts": "unit axis effect name",
    "numbers": "mean standard_deviation share widened p_value",
    "integers": "units",
    "flags": "fits own",
}


def _residual_rows(lot: LotArrays, fitted: NoisyFit) -> pd.DataFrame:
    used = lot.of_kind("dwell")
    scale = fitted.per_g[:, None, :]
    force = np.broadcast_to(lot.state.force[..., lot.state.axes], lot.output.shape)[:, used]
    u, n, a = np.indices(force.shape).reshape(3, -1)
    has = np.ones(u.size, dtype=bool) if lot.missing is None else ~lot.missing[:, used][u, n]
    temperature = lot.state.temperature
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "dwell": lot.dwells[used][n],
            "axis": picked(lot.letters, a),
            "pose": picked(lot.poses, np.flatnonzero(used)[n]),
            "force_g": force.ravel(),
            "residual_ug": (MICRO * fitted.fit.residuals / scale)[:, used].ravel(),
            "standard_error_ug": (MICRO * fitted.noise / scale)[:, used].ravel(),
            "expected_ug": (MICRO * fitted.expected / scale)[:, used].ravel(),
            "unit_C": np.full(u.size, np.nan) if temperature is None else temperature[:, used][u, n],
        }
    )[has].reset_index(drop=True)


def _prediction_rows(lot: LotArrays, fitted: NoisyFit) -> pd.DataFrame:
    """Covariance of the expected residuals of the dwells for verification, as a long table of lower triangles."""
    dwells = lot.dwells[~lot.of_kind("dwell")]
    row, column = np.tril_indices(dwells.size)
    u, a, k = np.indices((len(lot.units), len(lot.letters), row.size)).reshape(3, -1)
    values = _predicted(fitted)
    lacks = (
        np.zeros((len(lot.units), dwells.size), bool) if lot.missing is None else lot.missing[:, ~lot.of_kind("dwell")]
    )
    has = ~(lacks[u, row[k]] | lacks[u, column[k]])
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "axis": picked(lot.letters, a),
            "dwell": dwells[row][k],
            "other": dwells[column][k],
            "covariance_ug2": values[..., row, column].ravel(),
        }
    )[has].reset_index(drop=True)


def _predicted(fitted: NoisyFit) -> Array:
    """Covariance of the expected residuals of the dwells for verification, (units, 3, m, m), µg²."""
    return fitted.predicted * (MICRO / fitted.per_g[..., None, None]) ** 2


def _wander_rows(lot: LotArrays, fitted: NoisyFit) -> pd.DataFrame:
    """The method that estimates the noise of the dwells, and the parts of the noise, by unit and axis."""
    scale = fitted.per_g
    u, a = np.indices((len(lot.units), len(lot.letters))).reshape(2, -1)
    parts = {"white_ug": fitted.white, "flicker_ug": fitted.flicker, "walk_ug": fitted.walk}
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "axis": picked(lot.letters, a),
            "method": picked([fitted.method], np.zeros(u.size, dtype=np.intp)),
            **{name: (MICRO * values / scale).ravel() for name, values in parts.items()},
            "lack_of_fit": fitted.lack_of_fit.ravel(),
            "dof": fitted.fit.dof.ravel(),
            **{name: values.ravel() for name, values in _bias_of(lot, fitted, scale).items()},
        }
    )


def _bias_of(lot: LotArrays, fitted: NoisyFit, scale: Array) -> dict[str, Array]:
    """Uncertainties of the bias by measurand, (units, 3), µg; none for a model without a bias.

    Scatter that the dwells' own samples do not show counts as flicker here: few dwells do not show its kind, and white noise
    would not last beyond the record. The walk of a short record that flicker explains equally well also counts as flicker: a walk
    of two minutes, extrapolated over a day, would grow by a factor of fifteen.
    """
    places = [
        [name for name, _ in names].index("bias") if ("bias", "K0") in names else -1 for names in fitted.fit.names
    ]
    if min(places) < 0:
        return {name: np.full(scale.shape, np.nan) for name in COLUMNS}
    used = lot.of_kind("dwell")
    errors = np.sqrt(np.diagonal(fitted.fit.covariance, axis1=-2, axis2=-1))
    counted = np.mean(lot.standard_error[:, used] ** 2, axis=1)
    time = np.broadcast_to(lot.state.time, (len(lot.units), used.size))[0]
    carried = fitted.walk_shown or np.ptp(time[used]) >= LONG_S
    walk = fitted.walk if carried else np.zeros_like(fitted.walk)
    excess = np.sqrt(np.maximum(fitted.white**2 - counted, 0.0) + 0.5 * (fitted.walk**2 - walk**2))
    record = np.stack([errors[:, axis, column] for axis, column in enumerate(places)], axis=1)
    record, flicker, walk, excess = (MICRO * part / scale for part in (record, fitted.flicker, walk, excess))
    noise = BiasNoise(
        error=record,
        gain=np.stack([fitted.gain[:, axis, column] for axis, column in enumerate(places)], axis=1),
        flicker=flicker,
        carried=walk,
        excess=excess,
        time=time[used],
        every=time,
        known=fitted.known,
        widened=student(max(int(np.sum(fitted.fit.dof)) - 2, 1)),
    )
    return bias_measurands(noise)


def _nothing() -> dict[str, pd.DataFrame]:
    return {
        "coefficients": empty_table(texts="unit axis effect name unit_text", numbers="value standard_error"),
        "covariance": empty_table(texts="unit axis", numbers="value", integers="row column"),
        "residuals": empty_table(
            texts="unit axis pose", numbers="force_g residual_ug standard_error_ug expected_ug unit_C", integers="dwell"
        ),
        "predictions": empty_table(texts="unit axis", numbers="covariance_ug2", integers="dwell other"),
        "wander": empty_table(
            texts="unit axis method",
            numbers=" ".join(("white_ug flicker_ug walk_ug lack_of_fit", *COLUMNS)),
            integers="dof",
        ),
        "prior": empty_table(**_PRIOR),
    }
