"""Few dwells in stated poses: too few for an estimate of their noise, but enough for their samples to contradict the model."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from inertial.decisions import CERTAIN_BELOW
from inertial.errors import NotIdentified
from inertial.estimation.model import Model
from inertial.fits.linear import fit_lot
from inertial.probability import log_chi2_tail
from pipelines.tables.sound_lot import error_of


class Told(NamedTuple):
    """A verdict: whether the model is adequate, why it cannot be judged or is not adequate, and the error behind it, µg."""

    adequate: bool | None
    reason: str
    error: dict[str, Any]


def told(base: Model, adequate: bool | None, unjudged: str, error: dict[str, Any]) -> Told:  # noqa: FBT001 - a verdict
    """The verdict of a diagnosis, or that of the samples where there are too few dwells for one.

    Six faces leave six degrees of freedom: no verdict rests on a noise that is estimated from them. The noise of the samples is
    known from hundreds. A residual far beyond it contradicts the model, the stated poses, or dwells without wander; a residual
    within it shows no adequacy, since most missing effects leave nothing on so few poses. Dwells of unknown orientation state
    nothing that their samples could contradict.

    Parameters
    ----------
    base : the judged model
    """
    lot = base.problem.lot
    if adequate is not None or lot.radial or not lot.recorded:
        return Told(adequate, unjudged, error)
    try:
        values = {term.effect.id: term.keywords for term in base.terms if term.keywords}
        fit = fit_lot([term.effect.id for term in base.terms], lot.state, lot.output, lot.error, nonlinear=values)
    except NotIdentified:
        return Told(adequate, unjudged, error)
    dof = int(fit.dof.sum()) - fit.shared.size
    log_p = float(log_chi2_tail(float(fit.chi2.sum()), dof)) if dof > 0 else 0.0
    if not log_p < np.log(CERTAIN_BELOW):
        return Told(adequate, unjudged, error)
    samples = float(np.sqrt(np.mean(lot.error[np.isfinite(lot.error)] ** 2)))
    rms = float(np.sqrt(np.mean(fit.residuals[np.isfinite(lot.error)] ** 2)))
    reason = (
        "the dwells disagree by more than their samples allow, and are too few to show why: poses that are not as stated (1° is "
        "17 mg), wander between the dwells, or a missing effect"
    )
    return Told(False, reason, {**error, **error_of(rms, samples, log_p)})
