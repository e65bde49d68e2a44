"""Fit of a model to the dwells of a lot: coefficients, covariance, residuals and the noise between dwells."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd

from inertial import design
from inertial.errors import InertialError
from inertial.fits.linear import LotFit, felt_force, fit_lot, pseudo_inverses
from inertial.fits.wander import WanderFit, fit_lot_with_wander, student
from pipelines.stages.bias_measurands import COLUMNS, BiasNoise, bias_measurands
from pipelines.stages.nonlinear import profiled
from pipelines.tables.calibration import coefficient_rows, covariance_rows
from pipelines.tables.dwells import LotArrays, LotTables
from pipelines.tables.frames import empty_table, picked
from schemas.errors import DataRejected
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]

FEWEST_TO_SPARE = 4  # degrees of freedom of the lot, below which the kind of its noise cannot be estimated

_PER_G = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2}
"""Output per g by the name of the output's unit, for models without a scale."""

_TURNED_G = 0.1  # difference of force between dwells from which on they have more than one orientation
LONG_S = 3600.0  # shortest record whose walk is extrapolated over a day: it then grows by a factor of three at most


@dataclass(frozen=True)
class _Noisy:
    """A fit, and the noise by its residuals; arrays in the output's unit.

    noise, expected : (units, n, 3), standard deviations of one dwell's noise, and of its residual
    predicted : (units, 3, m, m), covariance of the residuals of the m dwells for verification
    flicker, walk, white : (units, 3), standard deviations; walk at the end of the record; walk_shown : whether the walk is
    distinguished from flicker
    lack_of_fit : (units, 3), variance over that of the noise, one where it is no larger
    per_g : (units, 3), output per g
    gain : (units, 3, p, n), derivative of the coefficients by every output of the n fitted dwells; known : factor of their errors
    """

    method: Literal["wander", "birge"]
    fit: LotFit
    noise: Array
    expected: Array
    predicted: Array
    white: Array
    flicker: Array
    walk: Array
    lack_of_fit: Array
    nonlinear_error: dict[str, dict[str, float]]
    per_g: Array
    gain: Array
    known: float = 1.0
    walk_shown: bool = False


def fit(dwells: pd.DataFrame, history: pd.DataFrame, effects: Sequence[str]) -> dict[str, pd.DataFrame]:
    """Coefficients, covariance, residuals and noise of the recipe's effects for every unit of a lot.

    The white-noise error sd/√n of a dwell is a lower bound. Wander between dwells is estimated with the coefficients
    (method ``wander``); where there are too few dwells for that, the covariance is scaled by χ²/ν (method ``birge``: Birge
    ratio squared). The table ``wander`` says which. Tables without rows come back where no unit was accepted.

    Parameters
    ----------
    dwells : of every kind; those for verification are not fitted; they only state earlier conditions
    history : temperatures between the dwells
    """
    return fit_tables(LotTables(dwells, history), effects)


def fit_tables(tables: LotTables, effects: Sequence[str]) -> dict[str, pd.DataFrame]:
    """:func:`fit` of tables that other stages read as well."""
    if not np.any(tables.dwells["kind"] == "dwell"):
        return _nothing()
    lot = tables.fitted_kinds
    try:
        fitted = _fitted(lot, effects)
    except InertialError as problem:
        raise DataRejected(str(problem)) from None
    return {
        "coefficients": coefficient_rows(
            lot.units, fitted.fit, fitted.fit.covariance, lot.out_unit, fitted.nonlinear_error
        ),
        "covariance": covariance_rows(lot.units, fitted.fit.covariance),
        "residuals": _residual_rows(lot, fitted),
        "predictions": _prediction_rows(lot, fitted),
        "wander": _wander_rows(lot, fitted),
    }


def _fitted(lot: LotArrays, effects: Sequence[str]) -> _Noisy:
    used = lot.of_kind("dwell")
    lot = replace(lot, state=replace(lot.state, felt=_felt(lot, used), memory={}))
    values = profiled(lot, effects, used)
    error = np.where(used[:, None], lot.standard_error, np.inf)
    plain = fit_lot(effects, lot.state, lot.output, error, nonlinear=values)
    known = lot.standard_error[:, used]
    spare = int(plain.dof.sum()) - plain.shared.size
    if spare < FEWEST_TO_SPARE or np.any(plain.dof < 1) or not np.all(np.isfinite(known) & (known > 0.0)):
        return _by_birge(lot, plain, used)
    fitted = fit_lot_with_wander(
        effects, lot.state, lot.output, lot.standard_error, nonlinear=values, used=used, plain=plain
    )
    return _by_wander(lot, fitted, used)


def _felt(lot: LotArrays, used: NDArray[np.bool_]) -> Array:
    """Force along the sensors' own axes at every dwell, (units, n, 3), g; misalignment from the dwells of the fit alone."""
    force, own = lot.state.force, lot.state.force[:, used]
    turn = pseudo_inverses(own) @ felt_force(own, lot.output[:, used])
    return force @ turn


def _by_wander(lot: LotArrays, fitted: WanderFit, used: NDArray[np.bool_]) -> _Noisy:
    level = np.sqrt(np.mean(lot.standard_error[:, used] ** 2, axis=1)) * np.sqrt(fitted.lack_of_fit)
    return _Noisy(
        method="wander",
        fit=fitted.fit,
        noise=fitted.noise,
        expected=fitted.expected,
        predicted=fitted.predicted,
        white=level * fitted.white,
        flicker=level * fitted.flicker,
        walk=level * fitted.walk,
        lack_of_fit=fitted.lack_of_fit,
        nonlinear_error=fitted.nonlinear_error,
        per_g=_per_g(lot, fitted.fit),
        gain=fitted.gain,
        known=fitted.widened,
        walk_shown=fitted.walk_shown,
    )


def _by_birge(lot: LotArrays, plain: LotFit, used: NDArray[np.bool_]) -> _Noisy:
    """The plain fit with its covariance scaled, by Student's factor too; all its noise is taken to be white."""
    stretch = birge_squared(plain)
    noise = lot.standard_error * np.sqrt(stretch)[:, None, :]
    columns = design.local_columns(design.split(plain.effects)[0], lot.state, plain.nonlinear)
    known = np.where(stretch <= 1.0, 1.0, np.vectorize(student, otypes=[np.float64])(np.maximum(plain.dof, 1)))
    covariance = plain.covariance * (known**2 * stretch)[..., None, None]
    unseen = columns[..., ~used, :]
    model = np.einsum("...np,...pq,...mq->...nm", unseen, covariance, unseen)
    own = np.swapaxes(noise[:, ~used] ** 2, -1, -2)
    return _Noisy(
        method="birge",
        fit=replace(plain, covariance=covariance),
        noise=noise,
        expected=noise,
        predicted=model + own[..., None] * np.eye(own.shape[-1]),
        white=np.sqrt(np.mean(noise**2, axis=1)),
        flicker=np.zeros_like(stretch),
        walk=np.zeros_like(stretch),
        lack_of_fit=stretch,
        nonlinear_error={},
        per_g=_per_g(lot, plain),
        gain=np.zeros((*plain.coefficients.shape, int(used.sum()))),  # no wander that the coefficients could follow
    )


def _per_g(lot: LotArrays, lot_fit: LotFit) -> Array:
    """Output per g of every unit and axis, (units, 3): the scale of the model, or what the output's unit says where it has none.

    Raises
    ------
    DataRejected
        The model has no scale, and the output is in a unit of its own: its size in g is unknown.
    """
    scale = np.abs(np.diagonal(lot_fit.response(), axis1=-2, axis2=-1))
    if "scale" in lot_fit.effects:
        return scale
    if lot.out_unit not in _PER_G:
        turned = bool(np.any(np.ptp(lot.state.force.reshape(-1, 3), axis=0) > _TURNED_G))
        scale_too = "add 'scale' to the effects, or " if turned else "one orientation cannot show it; "
        raise DataRejected(
            f"fit: the model {', '.join(lot_fit.effects)} has no 'scale', and the outputs are in {lot.out_unit}: residuals in µg "
            f"need the output per g; {scale_too}divide the outputs by that of the data sheet and import them with "
            "--units output=g"
        )
    return np.full_like(scale, _PER_G[lot.out_unit])


def birge_squared(lot_fit: LotFit) -> Array:
    """χ²/ν of every unit and axis, never below one, (units, 3)."""
    return np.maximum(1.0, lot_fit.chi2 / np.maximum(lot_fit.dof, 1))


def _residual_rows(lot: LotArrays, fitted: _Noisy) -> pd.DataFrame:
    used = lot.of_kind("dwell")
    scale = fitted.per_g[:, None, :]
    force = np.broadcast_to(lot.state.force, lot.output.shape)[:, used]
    u, n, a = (index.ravel() for index in np.meshgrid(*(np.arange(size) for size in force.shape), indexing="ij"))
    temperature = lot.state.temperature
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "dwell": lot.dwells[used][n],
            "axis": picked(AXES, a),
            "pose": picked(lot.poses, np.flatnonzero(used)[n]),
            "force_g": force.ravel(),
            "residual_ug": (MICRO * fitted.fit.residuals / scale)[:, used].ravel(),
            "standard_error_ug": (MICRO * fitted.noise / scale)[:, used].ravel(),
            "expected_ug": (MICRO * fitted.expected / scale)[:, used].ravel(),
            "unit_C": np.full(u.size, np.nan) if temperature is None else temperature[:, used][u, n],
        }
    )


def _prediction_rows(lot: LotArrays, fitted: _Noisy) -> pd.DataFrame:
    """Covariance of the expected residuals of the dwells for verification, as a long table of lower triangles."""
    scale = fitted.per_g
    dwells = lot.dwells[~lot.of_kind("dwell")]
    row, column = np.tril_indices(dwells.size)
    u, a, k = (
        i.ravel() for i in np.meshgrid(np.arange(len(lot.units)), np.arange(3), np.arange(row.size), indexing="ij")
    )
    values = fitted.predicted * (MICRO / scale[..., None, None]) ** 2
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "axis": picked(AXES, a),
            "dwell": dwells[row][k],
            "other": dwells[column][k],
            "covariance_ug2": values[..., row, column].ravel(),
        }
    )


def _wander_rows(lot: LotArrays, fitted: _Noisy) -> pd.DataFrame:
    """The method that estimates the noise of the dwells, and the parts of the noise, by unit and axis."""
    scale = fitted.per_g
    u, a = (index.ravel() for index in np.meshgrid(np.arange(len(lot.units)), np.arange(3), indexing="ij"))
    parts = {"white_ug": fitted.white, "flicker_ug": fitted.flicker, "walk_ug": fitted.walk}
    return pd.DataFrame(
        {
            "unit": picked(lot.units, u),
            "axis": picked(AXES, a),
            "method": picked([fitted.method], np.zeros(u.size, dtype=np.intp)),
            **{name: (MICRO * values / scale).ravel() for name, values in parts.items()},
            "lack_of_fit": fitted.lack_of_fit.ravel(),
            "dof": fitted.fit.dof.ravel(),
            **{name: values.ravel() for name, values in _bias_of(lot, fitted, scale).items()},
        }
    )


def _bias_of(lot: LotArrays, fitted: _Noisy, scale: Array) -> dict[str, Array]:
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
    own = np.mean(lot.standard_error[:, used] ** 2, axis=1)
    time = np.broadcast_to(lot.state.time, (len(lot.units), used.size))[0]
    carried = fitted.walk_shown or np.ptp(time[used]) >= LONG_S
    walk = fitted.walk if carried else np.zeros_like(fitted.walk)
    excess = np.sqrt(np.maximum(fitted.white**2 - own, 0.0) + 0.5 * (fitted.walk**2 - walk**2))
    record = np.stack([errors[:, axis, place] for axis, place in enumerate(places)], axis=1)
    record, flicker, whole, walk, excess = (
        MICRO * part / scale for part in (record, fitted.flicker, fitted.walk, walk, excess)
    )
    noise = BiasNoise(
        error=record,
        gain=np.stack([fitted.gain[:, axis, place] for axis, place in enumerate(places)], axis=1),
        flicker=flicker,
        walk=whole,
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
        "covariance": empty_table(texts="unit axis", numbers="value", whole="row column"),
        "residuals": empty_table(
            texts="unit axis pose", numbers="force_g residual_ug standard_error_ug expected_ug unit_C", whole="dwell"
        ),
        "predictions": empty_table(texts="unit axis", numbers="covariance_ug2", whole="dwell other"),
        "wander": empty_table(
            texts="unit axis method",
            numbers=" ".join(("white_ug flicker_ug walk_ug lack_of_fit", *COLUMNS)),
            whole="dof",
        ),
    }
