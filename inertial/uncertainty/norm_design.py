"""A fit by the norm of gravity as a linear map from errors of the outputs to errors of its coefficients.

The residual of a dwell is ρ = |f| − g, its derivative by a coefficient of axis i is −(uᵀK⁻¹)ᵢ·column with the direction u of the
force. Errors δy of the outputs change it by uᵀK⁻¹·δy, and the coefficients by −(RᵀV⁻¹R)⁻¹RᵀV⁻¹·uᵀK⁻¹·δy. An error of direction,
such as a table that is not level, is across u and has no effect.
"""

from dataclasses import dataclass

import numpy as np

from inertial import design
from inertial.arrays import Array, Flags
from inertial.fits.linear import response_matrix
from inertial.norm_fit import is_free
from inertial.state import State
from inertial.uncertainty.influences import MeasurementModel, Sensitivity
from inertial.uncertainty.propagation import Propagated


@dataclass(frozen=True)
class NormDesign:
    """The fit of one unit as a linear map.

    rows : (n, k), derivatives of the residuals of all dwells by the free coefficients; along : (n, 3), uᵀK⁻¹, g per output unit
    gain : (k, f), from the residuals of the f dwells of the fit; used : (n,), which these are
    free : (3, p), which coefficients are; names : per axis, (effect id, coefficient) of the p columns
    """

    rows: Array
    along: Array
    gain: Array
    used: Flags
    free: Flags
    names: tuple[tuple[tuple[str, str], ...], ...]

    def coefficient_errors(self, changes: Array) -> Array:
        """Errors of the coefficients, (3, p, q), of changes of the outputs of all dwells (n, 3, q)."""
        errors = np.zeros((*self.free.shape, changes.shape[-1]))
        errors[self.free] = -self.gain @ self._shown(changes)[self.used]
        return errors

    def visible_share(self, changes: Array) -> Array:
        """Share (q,) of the influences on the norms that the residuals of the fit can show."""
        shown = self._shown(changes)[self.used]
        left = shown - self.rows[self.used] @ (self.gain @ shown)
        total = np.linalg.norm(shown, axis=0)
        return np.linalg.norm(left, axis=0) / np.where(total > 0.0, total, 1.0)

    def prediction(self, covariance: Array) -> Array:
        """Covariance (m, m) of the residuals of the dwells that are not fitted, g², by the noise of all dwells (n, n)."""
        unseen = ~self.used
        into = np.zeros((int(unseen.sum()), self.used.size))
        into[:, self.used] = -self.rows[unseen] @ self.gain
        into[np.arange(len(into)), np.flatnonzero(unseen)] = 1.0
        return into @ covariance @ into.T

    def _shown(self, changes: Array) -> Array:
        return np.einsum("nj,njq->nq", self.along, changes)


def norm_design(model: MeasurementModel, state: State, covariance: Array, used: Flags) -> NormDesign:
    """The map of a norm fit of one unit.

    Parameters
    ----------
    model : coefficients (1, 3, p); state : (1, n) dwells with the force that explains their outputs
    covariance : (n, n), of the noise of the norms; its scale does not matter; used : (n,), dwells of the fit
    """
    sensor, _ = design.split(model.effects)
    names = tuple(design.local_names(sensor, axis, model.nonlinear) for axis in range(3))
    columns = np.broadcast_to(design.local_columns(sensor, state, model.nonlinear), (1, 3, used.size, len(names[0])))[0]
    inverse = np.linalg.inv(response_matrix(model.coefficients, names))[0]
    direction = state.force[0] / np.linalg.norm(state.force[0], axis=-1, keepdims=True)
    along = direction @ inverse
    free = np.array([[is_free(axis, pair) for pair in names[axis]] for axis in range(3)])
    rows = -np.einsum("nj,jnp->njp", along, columns)[:, free]
    size = np.linalg.norm(rows[used], axis=0)
    scaled = rows[used] / np.where(size > 0.0, size, 1.0)
    weighted = np.linalg.solve(covariance[np.ix_(used, used)], scaled)
    gain = np.linalg.pinv(scaled.T @ weighted, rcond=1e-13) @ weighted.T / np.where(size > 0.0, size, 1.0)[:, None]
    return NormDesign(rows, along, gain, used, free, names)


def propagated_by_norm(map_: NormDesign, source: Sensitivity, response: Array) -> Propagated:
    """The influences on one unit (1, n, 3, q) through a norm fit."""
    return Propagated(map_.coefficient_errors(source.changes[0])[None], map_.names, source, response)
