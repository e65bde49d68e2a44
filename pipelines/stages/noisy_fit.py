"""The fit of a lot, with the noise of its dwells estimated from the residuals."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from inertial import design
from inertial import effects as catalogue
from inertial.arrays import Array, Flags
from inertial.counts import number_of
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import terms_of
from inertial.fits.linear import LotFit, felt_force, fit_lot, of_every_axis, own_axes, pseudo_inverses
from inertial.fits.prior import Combined, Prior, combined, judged
from inertial.fits.wander import WanderFit, fit_lot_with_wander, student
from inertial.population.family import Family
from pipelines.tables.dwells import LotArrays
from schemas.errors import DataRejected
from schemas.units import STANDARD_GRAVITY_M_S2

FEWEST_TO_SPARE = 4  # degrees of freedom of the lot below which wander cannot be separated from white noise
_PER_G = {"g": 1.0, "m/s^2": STANDARD_GRAVITY_M_S2}
"""Output per g by the name of the output's unit, for models without a scale."""
_TURNED_G = 0.1  # difference of force between dwells from which on they have more than one orientation


PLAIN = ("bias", "scale", "misalignment")


@dataclass(frozen=True)
class NoisyFit:
    """A fit, and the noise estimated from its residuals; arrays in the output's unit.

    noise, expected : (units, n, 3), standard deviations of the noise, and of the residual, of each dwell
    predicted : (units, 3, m, m), covariance of the residuals of the m verification dwells
    white, flicker, walk : (units, 3), standard deviations; walk at the end of the record
    walk_shown : whether the random walk is distinguished from 1/f noise
    lack_of_fit : (units, 3), variance of the residuals over that of the noise, at least 1
    per_g : (units, 3), output per g
    gain : (units, 3, p, n), derivative of the coefficients by the outputs of the n fitted dwells; known : factor on their errors
    prior : prior of the lot; of_prior : (units, 3, p), its share in the variance of every coefficient; None without a prior
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
    prior: Prior | None = None
    of_prior: Array | None = None


def fitted_with_noise(lot: LotArrays, effects: Sequence[str], family: Family | None = None) -> NoisyFit:
    """The fit of a lot with wander between its dwells, or by the Birge ratio where too few dwells allow to estimate wander.

    family : family of the lot's devices, whose coefficients are the prior
    """
    used = lot.of_kind("dwell")
    there = used if lot.missing is None else used & ~lot.missing
    error = np.where(there[..., None], lot.standard_error, np.inf)
    if lot.missing is not None:
        # outputs of missing dwells have no weight; values close to the model avoid loss of digits
        _refuse_short(lot, effects, there)
        near = fit_lot(effects, lot.state, lot.output, error)
        lot = replace(lot, output=np.where(lot.missing[..., None], lot.output - near.residuals, lot.output))
    lot = replace(lot, state=replace(lot.state, felt=_felt(lot, used), memory={}))
    values = profiled(lot, effects, there)
    plain = fit_lot(effects, lot.state, lot.output, error, nonlinear=values)
    better = own_axes(lot.state, plain.response())
    if better is not None:
        lot = replace(lot, state=better)
        plain = fit_lot(effects, lot.state, lot.output, error, nonlinear=values)
    known = lot.standard_error[:, used]
    believed = None if family is None else _Belief(family, [effect for effect, _ in plain.names[0]], lot.units)
    spare = int(plain.dof.sum()) - plain.shared.size
    if spare < FEWEST_TO_SPARE or np.any(plain.dof < 1) or not np.all(np.isfinite(known) & (known > 0.0)):
        return _by_birge(lot, plain, used, believed)
    fitted = fit_lot_with_wander(
        effects,
        lot.state,
        lot.output,
        lot.standard_error,
        nonlinear=values,
        used=used,
        plain=plain,
        missing=lot.missing,
        believed=believed,
    )
    return replace(_by_wander(lot, fitted, used), prior=believed and believed.prior, of_prior=fitted.of_prior)


def _refuse_short(lot: LotArrays, effects: Sequence[str], there: Flags) -> None:
    """Refuse a lot that has a unit with fewer dwells than coefficients on an axis.

    Raises
    ------
    DataRejected
        Names the unit.
    """
    sensor, _ = design.split(effects)
    values = design.starting_values(sensor, lot.state)
    least = max(len(design.local_names(sensor, axis, values)) for axis in lot.state.axes)
    for unit, count in zip(lot.units, there.sum(axis=1).tolist(), strict=True):
        if count < least:
            raise DataRejected(
                f"fit: unit {unit} has {number_of(count, 'dwell')}, at least {least} are needed for its coefficients on an axis, "
                "in a model with values that all units share; leave the unit out, or measure it again"
            )


class _Belief:
    """The prior of a lot, tested against the lot's own estimates when these are known."""

    def __init__(self, family: Family, effects: Sequence[str], units: Sequence[str]) -> None:
        self.family, self.effects, self.units = family, effects, units
        self.prior: Prior | None = None

    def __call__(self, coefficients: Array, covariance: Array) -> Combined:
        self.prior = judged(self.family, self.effects, coefficients, covariance, self.units)
        return combined(coefficients, covariance, self.prior.mean, self.prior.precision)


def _felt(lot: LotArrays, used: Flags) -> Array:
    """Force along the sensors' input axes at every dwell, (units, n, 3), g; misalignment from the fitted dwells only."""
    force, fitted = lot.state.force, lot.state.force[:, used]
    theta = None if lot.state.theta is None else np.broadcast_to(lot.state.theta, lot.output.shape[:2])[:, used]
    turn = pseudo_inverses(fitted) @ felt_force(fitted, lot.output[:, used], theta, lot.state.axes)
    return force @ turn


def _by_wander(lot: LotArrays, fitted: WanderFit, used: Flags) -> NoisyFit:
    level = np.sqrt(np.mean(lot.standard_error[:, used] ** 2, axis=1)) * np.sqrt(fitted.lack_of_fit)
    return NoisyFit(
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


def _by_birge(lot: LotArrays, plain: LotFit, used: Flags, believed: _Belief | None) -> NoisyFit:
    """The plain fit with its covariance scaled by χ²/ν and Student's factor; all noise is assumed white."""
    stretch = np.maximum(1.0, plain.chi2 / np.maximum(plain.dof, 1))  # χ²/ν, never below one
    noise = lot.standard_error * np.sqrt(stretch)[:, None, :]
    columns = design.local_columns(design.split(plain.effects)[0], lot.state, plain.nonlinear)
    known = np.where(stretch <= 1.0, 1.0, np.vectorize(student, otypes=[np.float64])(np.maximum(plain.dof, 1)))
    covariance = plain.covariance * (known**2 * stretch)[..., None, None]
    of_prior = None
    if believed is not None:
        both = believed(plain.coefficients, covariance)
        step = np.einsum("...np,...p->...n", columns, both.coefficients - plain.coefficients)
        left = plain.residuals - np.swapaxes(step, -1, -2)
        plain = replace(plain, coefficients=both.coefficients, residuals=left)
        covariance, of_prior = both.covariance, both.share
    unseen = columns[..., ~used, :]
    model = np.einsum("...np,...pq,...mq->...nm", unseen, covariance, unseen)
    variance = np.swapaxes(noise[:, ~used] ** 2, -1, -2)
    return NoisyFit(
        method="birge",
        fit=replace(plain, covariance=covariance),
        noise=noise,
        expected=noise,
        predicted=model + variance[..., None] * np.eye(variance.shape[-1]),
        white=np.sqrt(np.mean(noise**2, axis=1)),
        flicker=np.zeros_like(stretch),
        walk=np.zeros_like(stretch),
        lack_of_fit=stretch,
        nonlinear_error={},
        per_g=_per_g(lot, plain),
        gain=np.zeros((*plain.coefficients.shape, int(used.sum()))),  # no wander that the coefficients could follow
        prior=believed and believed.prior,
        of_prior=of_prior,
    )


def _per_g(lot: LotArrays, lot_fit: LotFit) -> Array:
    """Output per g of every unit and axis, (units, 3): the scale of the model, else that of the output's unit.

    Raises
    ------
    DataRejected
        The model has no scale, and the output is in a unit that is not g: its size in g is unknown.
    """
    scale = np.abs(lot_fit.scale())
    if "scale" in lot_fit.effects:
        return scale
    if lot.out_unit not in _PER_G:
        turned = bool(np.any(np.ptp(lot.state.force.reshape(-1, 3), axis=0) > _TURNED_G))
        scale_too = "add 'scale' to the effects, or " if turned else "one orientation cannot show it; "
        raise DataRejected(
            f"fit: the model {', '.join(lot_fit.effects)} has no 'scale', and the outputs are in {lot.out_unit}: residuals in µg "
            f"need the output per g; {scale_too}divide the outputs by that of the data sheet and import them with "
            "--unit-of output=g"
        )
    return np.full_like(scale, _PER_G[lot.out_unit])


def profiled(lot: LotArrays, effects: Sequence[str], used: Flags) -> dict[str, dict[str, Any]]:
    """Values of nonlinear parameters and constants by effect id, one value or one per axis; empty for a linear model.

    Parameters
    ----------
    used : (n,) or (units, n), the dwells that are fitted
    """
    model = catalogue.get_all(effects)
    if not any(effect.parameters(lot.state) for effect in model):
        return {}
    return {term.effect.id: term.keywords for term in terms_of(model, Problem(_in_g(lot, used))) if term.keywords}


def _in_g(lot: LotArrays, used: Flags) -> Lot:
    """The lot in g, outputs divided by the fitted scale of each unit and axis; dwells that are not fitted count as missing."""
    plain = fit_lot(PLAIN, lot.state, lot.output, np.where(used[..., None], lot.standard_error, np.inf))
    scale = np.abs(plain.scale())
    scale = np.where(scale > 0.0, scale, 1.0)
    error = lot.standard_error / scale[:, None, :]
    error = np.where(error > 0.0, error, np.median(error))
    return Lot(
        lot.state,
        np.where(used[..., None], lot.output / scale[:, None, :], 0.0),
        np.where(used[..., None], error, np.inf),
        plain.response() / of_every_axis(scale[..., None], lot.state.axes, 1.0),
    )
