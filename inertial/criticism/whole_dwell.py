"""Whether a wrong pose is all that is wrong with a dwell."""

import numpy as np

from inertial.decisions import CERTAIN_BELOW
from inertial.estimation.candidate import Candidate
from inertial.estimation.model import Model
from inertial.estimation.term import Term
from inertial.probability import log_chi2_tail

_FEWEST = 3  # units
_INEXACT = 0.01
"""Share of a wrong angle that the scale factors and misalignments of the devices leave of it."""


def only_tilted(model: Model, term: Term) -> bool:
    """Whether two wrong angles leave no more of a dwell than noise, and than their own second order.

    A supply that sags, or a bias of the whole lot that is up for one dwell, pushes each unit and axis by its own amount. Some of
    it looks like two angles, and the rest of it says that it is none. The unit with the largest rest is not counted: its dwell
    may be bad for a reason of its own.
    """
    richer = model.with_term(term)
    problem = model.problem
    units = problem.lot.state.time.shape[0]
    if units < _FEWEST or problem.lot.radial:
        return True
    here = np.arange(problem.n) == int(float(np.mean(term.keywords["at"])))
    column = np.broadcast_to(here.astype(np.float64)[None, :, None, None], (problem.blocks, problem.n, 1, 1))
    gain = richer.space.gain(Candidate(column, shared=False))
    of_units = gain.by_block[:, 0].reshape(units, 3).sum(axis=1)
    # both angles are off by no more than this: their second order, and what each device makes of them
    angle = float(np.linalg.norm(richer.shared_sizes(term)))
    by_tilt = float(model.at(richer.noise).gain(term.candidate(problem)).drop[0])
    second = (2.0 * (0.5 * angle + _INEXACT)) ** 2 * by_tilt
    left = float(of_units.sum() - of_units.max()) - second
    # as far beyond noise as adequacy asks for where tails are heavy, for the best of all dwells
    return left <= 0.0 or float(log_chi2_tail(left, 3.0 * (units - 1))) > np.log(CERTAIN_BELOW**2 / problem.n)
