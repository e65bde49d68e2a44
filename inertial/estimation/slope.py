"""Response of a unit's output to temperature by its fitted model: the effect of an error of the thermometer."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inertial.estimation.comparison import estimate
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.state import History

Array = NDArray[np.float64]

_STEP = 0.5  # K


def slope_of(model: Model) -> Array | None:
    """∂E/∂T of every unit at every dwell, (units, n, 3), g/K; None if no temperature is recorded or the model has none."""
    lot = model.problem.lot
    state = lot.state
    if state.temperature is None or lot.radial:
        return None
    fit = estimate(model)
    ends: list[Array] = []
    for sign in (1.0, -1.0):
        history = (
            None if state.history is None else History(state.history.time, state.history.temperature + sign * _STEP)
        )
        moved = replace(state, temperature=state.temperature + sign * _STEP, history=history, memory={})
        problem = Problem(replace(lot, state=moved))
        local = [t for t in fit.terms if not t.shared]
        columns = [problem.columns(t.effect, t.keywords)[..., : t.first] for t in local]
        whole = np.concatenate(columns, axis=-1)
        ends.append(np.einsum("bnp,bp->bn", whole, fit.local[:, : whole.shape[-1]]))
    slope = (ends[0] - ends[1]) / (2.0 * _STEP)
    if float(np.max(np.abs(slope))) <= 0.0:
        return None
    return np.swapaxes(slope.reshape(state.time.shape[0], 3, -1), 1, 2)
