"""Columns of a model of a lot at all its dwells, those of the nonlinear parameters among them."""

from dataclasses import replace

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.design import Values
from inertial.fits.generalised import Solved
from inertial.fits.linear import LotFit
from inertial.state import State

_STEP = 1e-3
"""Relative step for the derivative by a nonlinear parameter."""


class LotColumns:
    """Columns of a model at all dwells: those of the blocks, those of the station, and derivatives by nonlinear parameters.

    local : (..., 3, n, p); shared : (..., 3, n, q), output unit, the station's first; station : how many those are
    """

    def __init__(self, plain: LotFit, state: State, given: Values) -> None:
        self._plain, self._state = plain, state
        self._sensor, self._station = design.split(plain.effects)
        self._response = plain.response()
        self.local = design.local_columns(self._sensor, state, plain.nonlinear)
        shape = np.broadcast_shapes(self.local.shape[:-1], plain.coefficients[..., 0, None].shape)
        shared = self._shared(plain.nonlinear)
        self.station = 0 if shared is None else shared.shape[-1]
        self._free = self._parameters(given)
        slopes = [self._slope(*parameter) for parameter in self._free]
        parts = [np.broadcast_to(part, (*shape, part.shape[-1])) for part in ([] if shared is None else [shared])]
        parts += [np.broadcast_to(slope, shape)[..., None] for slope in slopes]
        self.shared = np.concatenate(parts, axis=-1) if parts else np.zeros((*shape, 0))

    def _shared(self, values: Values) -> Array | None:
        return design.shared_columns(self._station, self._state, values, self._response) if self._station else None

    def _parameters(self, given: Values) -> list[tuple[str, str, int | None]]:
        """(effect, parameter, axis) of every continuous nonlinear parameter given; no axis where one value serves all."""
        free: list[tuple[str, str, int | None]] = []
        for effect in (*self._sensor, *self._station):
            for parameter in effect.parameters(self._state):
                if parameter.choices or parameter.name not in given.get(effect.id, {}):
                    continue
                by_axis = isinstance(given[effect.id][parameter.name], tuple)
                free += [(effect.id, parameter.name, axis) for axis in (range(3) if by_axis else (None,))]
        return free

    def _slope(self, effect: str, name: str, axis: int | None) -> Array:
        """Change of the model's output (..., 3, n) per unit of a nonlinear parameter."""
        value = self._plain.nonlinear[effect][name]
        middle = value if axis is None or not isinstance(value, tuple) else value[axis]
        step = _STEP * max(abs(middle), 1e-6)
        ends = [self._output(effect, name, axis, middle + sign * step) for sign in (1.0, -1.0)]
        return (ends[0] - ends[1]) / (2.0 * step)

    def _output(self, effect: str, name: str, axis: int | None, value: float) -> Array:
        old = self._plain.nonlinear[effect][name]
        new = value if axis is None or not isinstance(old, tuple) else (*old[:axis], value, *old[axis + 1 :])
        values = {**self._plain.nonlinear, effect: {**self._plain.nonlinear[effect], name: new}}
        state = replace(self._state, memory={})
        out = np.einsum("...np,...p->...n", design.local_columns(self._sensor, state, values), self._plain.coefficients)
        shared = self._shared(values)
        return out if shared is None else out + shared @ self._plain.shared

    def errors(self, solved: Solved) -> dict[str, dict[str, float]]:
        """Standard errors of the nonlinear parameters that were given; the largest where axes differ."""
        spread = np.sqrt(solved.variance * np.diagonal(solved.shared_inverse))[self.station :]
        largest: dict[str, dict[str, float]] = {}
        for (effect, name, _), error in zip(self._free, spread.tolist(), strict=True):
            of_effect = largest.setdefault(effect, {})
            of_effect[name] = max(of_effect.get(name, 0.0), self._within_bounds(effect, name, error))
        return largest

    def _within_bounds(self, effect: str, name: str, error: float) -> float:
        """A standard error; of the state in which a run began no more than of what its bounds leave.

        Where the path takes up that state before the first dwell, the column is zero and its inverse, too: nothing is known.
        """
        every = (p for e in (*self._sensor, *self._station) if e.id == effect for p in e.parameters(self._state))
        parameter = next(p for p in every if p.name == name)
        if not parameter.of_run:
            return error
        rectangular = (parameter.high - parameter.low) / np.sqrt(12.0)
        return float(min(error, rectangular)) if error > 0.0 else float(rectangular)
