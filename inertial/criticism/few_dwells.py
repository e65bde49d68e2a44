"""Few dwells in stated poses: too few to estimate their noise, but the noise of the samples may contradict the model."""

from typing import NamedTuple

import numpy as np

from inertial.decisions import CERTAIN_BELOW
from inertial.errors import NotIdentified
from inertial.estimation.model import Model
from inertial.fits.linear import fit_lot
from inertial.probability import log_chi2_tail

REASON = (
    "the dwells disagree by more than their samples allow, and are too few to show why: poses that are not as stated (1° is "
    "17 mg), wander between the dwells, or a missing effect"
)


class Contradicted(NamedTuple):
    """RMS of the residuals and of the noise of the samples, g, and the log probability of such residuals."""

    rms: float
    samples: float
    log_p: float


def contradicted(base: Model) -> Contradicted | None:
    """The contradiction between the noise of the samples and a model with too few dwells for a verdict; None if there is none.

    Six faces leave six degrees of freedom, too few to estimate the noise, while the noise of the samples is known from hundreds.
    Residuals far above it contradict the model, the stated poses, or the absence of wander. Residuals within it do not show
    adequacy, because most missing effects leave no residual in so few poses. Dwells of unknown orientation are not tested.
    """
    lot = base.problem.lot
    if lot.radial or not lot.recorded:
        return None
    try:
        values = {term.effect.id: term.keywords for term in base.terms if term.keywords}
        fit = fit_lot([term.effect.id for term in base.terms], lot.state, lot.output, lot.error, nonlinear=values)
    except NotIdentified:
        return None
    dof = int(fit.dof.sum()) - fit.shared.size
    log_p = float(log_chi2_tail(float(fit.chi2.sum()), dof)) if dof > 0 else 0.0
    if not log_p < np.log(CERTAIN_BELOW):
        return None
    there = np.isfinite(lot.error)
    rms, samples = (float(np.sqrt(np.mean(series[there] ** 2))) for series in (fit.residuals, lot.error))
    return Contradicted(rms, samples, log_p)
