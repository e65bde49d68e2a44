"""The smallest size of each effect that a measurement detects, with its own noise and without the slow part of it.

The slow part, 1/f and random walk, is estimated from the same dwells and can contain an effect of the same shape. So a model that
is adequate with such noise is adequate only for effects larger than these sizes.
"""

from dataclasses import dataclass

import numpy as np

from inertial.arrays import Array, Flags
from inertial.criticism.field import Candidates
from inertial.decisions import MATERIAL, NAMED_BELOW
from inertial.distributions import chi2_upper
from inertial.estimation.bases import SEEN
from inertial.estimation.candidate import Candidate
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares
from inertial.estimation.penalty import price
from inertial.estimation.space import Space

_DIGITS = 6
"""Decimals to which ratios of sizes are compared."""


@dataclass(frozen=True)
class Smallest:
    """The size of an effect, g rms over the dwells, that is detected; the same without slow noise."""

    effect: str
    size: float
    without_slow: float


def smallest_named(field: Candidates, model: Model) -> list[Smallest]:
    """The smallest detected sizes of the visible effects, those that slow noise hides most first.

    Of an effect with nonlinear parameters the median over the values at which it is visible.
    """
    noise = model.noise
    spaces = model.at(noise), model.at(Noise(Shares(), noise.scale, noise.prior))
    least = MATERIAL * model.scatter()
    held = {t.effect.id for t in model.terms}
    smallest: list[Smallest] = []
    for name in (e.id for e in field.effects if e.id not in held):
        sizes = _sizes(field, model, spaces, name, least)
        sizes = sizes[:, np.isfinite(sizes).all(axis=0) & (sizes > 0.0).all(axis=0)]
        if sizes.size:
            smallest.append(Smallest(name, *np.median(sizes, axis=1).tolist()))
    # of effects that the plan shows alike the order is that of the catalogue, not that of rounding errors
    return sorted(smallest, key=lambda s: -round(s.size / s.without_slow, _DIGITS))


def _sizes(field: Candidates, model: Model, spaces: tuple[Space, Space], name: str, least: float) -> Array:
    """RMS, g, of the effect's most visible column that is detected in the mean, (2, grid), in each space; else infinite.

    Parameters
    ----------
    spaces : with the noise that was found, and with its white part alone
    least : RMS, g, of the part of an effect beyond the model below which it is never reported
    """
    problem, effect = model.problem, field.of(name)
    values: list[Array] = []
    for piece in problem.pieces(effect, field.grids[name]):
        raw = np.sqrt(_squares(piece, problem.covariance.there) / problem.count)
        grid, p = piece.columns.shape[2:]
        coefficients = float(p if piece.shared else problem.blocks * p) + len(field.grids[name][0]) * (
            len(field.grids[name]) > 1
        )
        needed = _needed(coefficients, field.looks, problem.count)
        each: list[Array] = []
        share = np.ones((grid, p))
        for space in spaces:
            found = space.products(piece)
            seen = np.diagonal(found.left, axis1=-2, axis2=-1).sum(axis=0)
            whole = found.squares.sum(axis=0)
            visible = seen > SEEN**2 * whole
            share = np.where(visible, seen / np.where(visible, whole, 1.0), 0.0)
            with np.errstate(over="ignore"):  # an almost invisible column would need an arbitrary size
                factor = np.sqrt(needed / np.where(visible, seen, 1.0))
            visible &= np.isfinite(factor)
            each.append(np.where(visible, raw * np.where(visible, factor, 0.0), np.inf))
        material = least / np.sqrt(np.where(share > 0.0, share, 1.0))
        values.append(np.stack([np.min(np.maximum(each[0], material), axis=1), np.min(each[1], axis=1)]))
    return np.concatenate(values, axis=1)


def _squares(piece: Candidate, there: Flags) -> Array:
    """Sums of squares (grid, p) of columns in g over the dwells (blocks, n) that are there."""
    each = piece.columns**2
    if piece.rows is None:
        return np.einsum("bngp,bn->gp", each, there.astype(np.float64))
    order = np.argsort(piece.rows, kind="stable")
    first = np.searchsorted(piece.rows[order], np.arange(len(each)))
    count = np.add.reduceat(there[order].astype(np.float64), first, axis=0)
    return np.einsum("bngp,bn->gp", each, count)


def _needed(coefficients: float, looks: int, count: int) -> float:
    """Noncentrality from which an effect with this number of coefficients is detected in the mean."""
    deviance = max(float(chi2_upper(NAMED_BELOW / max(looks, 1), coefficients)), coefficients)
    while deviance - price(deviance, coefficients) < np.log(max(count, 2)):
        deviance *= 1.02
    return max(deviance - coefficients, 1.0)
