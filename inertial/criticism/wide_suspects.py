"""Curves of a driver that is not felt as a bias: across the axes, by the fixture, or as a change of the transfer curve."""

import numpy as np
from numpy.typing import NDArray

from inertial.criticism.drivers import across, curve, forces_along, quantities, transfer, varies
from inertial.criticism.unknown import Suspect, alike
from inertial.estimation.alternative import by_block, rotated_force
from inertial.estimation.candidate import Candidate
from inertial.estimation.problem import Problem
from inertial.quantities import is_clock

Array = NDArray[np.float64]

_KNOTS = 6  # of a smooth curve over a driver
_TURNED_KNOTS = 2  # of the same for the fixture's rotation, whose every column has three coefficients of the whole lot
_FORCE_KNOTS = 7  # of the same over the force along an axis
_LEAST = 3  # columns of a curve; fewer are a line, or levels that handling errors already are


def wide_suspects(problem: Problem) -> list[Suspect]:
    """For every driver that varies in a lot, curves of its misalignment, of the fixture's rotation and of the transfer curve.

    A lot of columns: they are suspected only where several causes, changes of handling among them, were found together.
    """
    if problem.lot.radial:
        return []
    state = problem.lot.state
    along = forces_along(problem)
    rotated = rotated_force(problem.lot)
    suspected: list[Suspect] = []
    for name, values, _ in quantities(state):
        if not varies(values) or (name == "chamber_C" and alike(values, state.temperature)):
            continue
        own = curve(values, _KNOTS)  # (units or 1, n, d)
        if own.shape[-1] < _LEAST - 1:
            continue
        suspected.append(Suspect(name, Candidate(across(along, own)[:, :, None, :], shared=False), ways=2, part="axes"))
        turned = rotated[..., :, None] * curve(values, _TURNED_KNOTS + is_clock(name))[:, :, None, None, :]
        whole = np.broadcast_to(turned, (problem.blocks // 3, *turned.shape[1:]))
        columns = by_block(whole.reshape(*whole.shape[:3], -1))
        suspected.append(Suspect(name, Candidate(columns[:, :, None, :], shared=True), part="axes"))
        columns = transfer(along, values, _FORCE_KNOTS)
        suspected.append(Suspect(name, Candidate(columns[:, :, None, :], shared=False), part="transfer"))
    return suspected
