"""Nonlinear parameters of a model, found on the dwells of a lot: time constants, kinks, steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inertial import effects as catalogue
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import terms_of
from inertial.fits.linear import fit_lot

if TYPE_CHECKING:
    from pipelines.tables.dwells import LotArrays

PLAIN = ("bias", "scale", "misalignment")


def profiled(lot: LotArrays, effects: Sequence[str], used: NDArray[np.bool_]) -> dict[str, dict[str, Any]]:
    """Values of nonlinear parameters and constants by effect id, one or one per axis; none for a linear model.

    Parameters
    ----------
    used : (n,), the dwells that are fitted
    """
    model = catalogue.get_all(effects)
    if not any(effect.parameters(lot.state) for effect in model):
        return {}
    return {term.effect.id: term.keywords for term in terms_of(model, Problem(_in_g(lot, used))) if term.keywords}


def _in_g(lot: LotArrays, used: NDArray[np.bool_]) -> Lot:
    """The lot in g, over the nominal scale of each unit and axis; dwells that are not fitted count as missing."""
    response = fit_lot(PLAIN, lot.state, lot.output, np.where(used[:, None], lot.standard_error, np.inf)).response()
    scale = np.abs(np.diagonal(response, axis1=-2, axis2=-1))
    scale = np.where(scale > 0.0, scale, 1.0)
    error = lot.standard_error / scale[:, None, :]
    error = np.where(error > 0.0, error, np.median(error))
    return Lot(
        lot.state,
        np.where(used[:, None], lot.output / scale[:, None, :], 0.0),
        np.where(used[:, None], error, np.inf),
        response / scale[..., None],
    )
