"""Propagation of influences through the fit's own design: errors of coefficients, of corrected outputs, of verification.

y = H·c + J·δ + ε, with the fit ĉ = G·y and G = (HᵀWH)⁻¹HᵀW: the coefficients are wrong by G·J·δ, an output that is corrected with
them by −K⁻¹·H·G·J·δ, and a verification on the same station shows K⁻¹·(J_v − H_v·G·J)·δ of it (JCGM 102, 6.2).
"""

from dataclasses import dataclass

import numpy as np

from inertial import design
from inertial.arrays import Array, Flags
from inertial.design import of_axes
from inertial.fits.linear import response_matrix
from inertial.noise.dwells import whitener
from inertial.state import ALL_AXES, State
from inertial.uncertainty.influences import MeasurementModel, Sensitivity


@dataclass(frozen=True)
class FitDesign:
    """The fit as a linear map.

    columns : (..., 3, n, p), H; gain : (..., 3, p, n), G; names : per axis, (effect id, coefficient) of the p columns
    shared : (..., 3, n, s), columns of parameters that the lot shares; none where s = 0
    whitening : (n, n), root of the weights; axes : the m axes with an output, of x, y, z
    """

    columns: Array
    gain: Array
    names: tuple[tuple[tuple[str, str], ...], ...]
    shared: Array
    whitening: Array
    axes: tuple[int, ...] = ALL_AXES

    def coefficient_errors(self, changes: Array) -> Array:
        """Errors of the coefficients, (..., 3, p, q), of changes of the outputs (..., n, 3, q)."""
        along = np.moveaxis(changes, -2, -3)
        if self.shared.shape[-1]:
            along = along - self.shared @ self._shared_errors(along)
        return self.gain @ along

    def _shared_errors(self, along: Array) -> Array:
        """Errors (s, q) of the parameters that all units share; the changes are taken to be the same influences for the lot."""
        white, columns = self.whitening, self.columns
        h, s, j = white @ columns, white @ self.shared, white @ along
        inner = np.linalg.inv(np.swapaxes(h, -1, -2) @ h) @ np.swapaxes(h, -1, -2)
        left, target = s - h @ (inner @ s), j - h @ (inner @ j)
        flat = np.broadcast_to(left, (*target.shape[:-1], left.shape[-1])).reshape(-1, left.shape[-1])
        return np.asarray(np.linalg.lstsq(flat, target.reshape(-1, target.shape[-1]), rcond=None)[0], dtype=np.float64)

    def visible_share(self, changes: Array, errors: Array | None = None) -> Array:
        """‖(1 − P_H)·J‖/‖J‖ of every influence, (q,), over all units and axes: what residuals can show of it.

        Parameters
        ----------
        errors : those that :meth:`coefficient_errors` gives of the same changes, where they are known
        """
        explained = self.columns @ (self.coefficient_errors(changes) if errors is None else errors)
        left = np.subtract(np.moveaxis(changes, -2, -3), explained, out=explained)
        total = _sizes(changes)
        return _sizes(left) / np.where(total > 0.0, total, 1.0)


def _sizes(columns: Array) -> Array:
    """Roots of the sums of squares of q columns (..., q), over everything else, (q,)."""
    flat = columns.reshape(-1, columns.shape[-1])
    return np.sqrt(np.einsum("nq,nq->q", flat, flat))


def _turned(matrix: Array, columns: Array) -> Array:
    """Products of matrices (..., 3, 3) with the axes of columns (..., 3, m, q), in the order (..., m, 3, q)."""
    flat = columns.reshape(*columns.shape[:-2], -1)
    return np.moveaxis(np.matmul(matrix, flat).reshape(*flat.shape[:-1], *columns.shape[-2:]), -3, -2)


def fit_design(model: MeasurementModel, state: State, covariance: Array, used: Flags | None = None) -> FitDesign:
    """The map of a generalised least-squares fit.

    Parameters
    ----------
    covariance : (n, n), of the noise of the dwells of the fit; its scale does not matter
    used : the dwells of the fit; all where None
    """
    sensor, station = design.split(model.effects)
    columns = design.local_columns(sensor, state, model.nonlinear)
    there = np.ones(columns.shape[-2], dtype=bool) if used is None else used
    columns = columns[..., there, :]
    names = tuple(design.local_names(sensor, axis, model.nonlinear) for axis in state.axes)
    white = whitener(covariance)
    h = white @ columns
    scale = np.linalg.norm(h, axis=-2, keepdims=True)
    scaled = h / scale
    gram = np.swapaxes(scaled, -1, -2) @ scaled
    gain = np.linalg.solve(gram, np.swapaxes(scaled, -1, -2)) @ white / np.swapaxes(scale, -1, -2)
    shared = np.zeros((*columns.shape[:-1], 0))
    if station:
        response = response_matrix(model.coefficients, names, state.axes)
        shared = design.shared_columns(station, state, model.nonlinear, response)[..., there, :]
    return FitDesign(columns, gain, names, shared, white, state.axes)


_GENERATORS = np.array(
    [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]],
    dtype=np.float64,
)
"""Rotations about x, y and z by a small angle."""


@dataclass(frozen=True)
class Propagated:
    """Errors per standard uncertainty of every influence.

    coefficients : (..., 3, p, q); names : per axis, (effect id, coefficient)
    source : the influences, of the same q columns
    axes : the m axes with an output, of x, y, z
    """

    coefficients: Array
    names: tuple[tuple[tuple[str, str], ...], ...]
    source: Sensitivity
    response: Array
    axes: tuple[int, ...] = ALL_AXES

    def _inverse(self) -> Array:
        """K⁻¹ of the axes with an output, (..., m, m), g per unit of the output."""
        response = of_axes(of_axes(self.response, self.axes, -1), self.axes, -2)
        return np.asarray(np.linalg.inv(response), dtype=np.float64)

    def covariance(self) -> Array:
        """Covariance of the coefficients of all axes in one vector, (..., 3p, 3p)."""
        flat = self.coefficients.reshape(*self.coefficients.shape[:-3], -1, self.coefficients.shape[-1])
        return flat @ np.swapaxes(flat, -1, -2)

    def output_errors(self, columns: Array) -> Array:
        """Errors of a corrected output, (..., m, 3, q), g, at m conditions with the columns (..., 3, m, p)."""
        return _turned(-self._inverse(), columns @ self.coefficients)

    def rotation(self) -> Array:
        """The antisymmetric part of K⁻¹·δK at 25 °C, (..., m, 3, q): a rotation of the whole unit.

        With fewer than three outputs it is the rotation nearest to K⁻¹·δK by least squares: of one axis all that turns its row.
        """
        moved = np.moveaxis(response_matrix(np.moveaxis(self.coefficients, -1, 0), self.names, self.axes), 0, -1)
        moved = of_axes(moved, self.axes, -3)
        flat = moved.reshape(*moved.shape[:-2], -1)
        relative = np.matmul(self._inverse(), flat).reshape(moved.shape)
        if len(self.axes) == len(ALL_AXES):
            return 0.5 * (relative - np.swapaxes(relative, -3, -2))
        rows = np.matmul(self._inverse(), of_axes(self.response, self.axes, -2))
        turned = np.moveaxis(np.matmul(rows[..., None, :, :], _GENERATORS), -3, -1)  # (..., m, 3, 3 rotations)
        span = turned.reshape(*turned.shape[:-3], -1, turned.shape[-1])
        nearest = span @ np.linalg.pinv(span) @ relative.reshape(*relative.shape[:-3], -1, relative.shape[-1])
        return nearest.reshape(relative.shape)

    def user_errors(self, columns: Array, force: Array, *, intrinsic: bool = False) -> Array:
        """Errors that a user meets, (..., m, 3, q), g, at forces (m, 3) with the columns (..., 3, m, p).

        Parameters
        ----------
        intrinsic : whether the frame is the unit's own, in which a rotation of the whole unit is no error
        """
        errors = self.output_errors(columns)
        if not intrinsic:
            return errors
        rotation = np.moveaxis(self.rotation(), -2, -3)  # (..., 3, m, q)
        turned = np.matmul(force, rotation.reshape(*rotation.shape[:-2], -1))
        return errors + turned.reshape(*turned.shape[:-1], *rotation.shape[-2:])

    def shown_errors(self, columns: Array, changes: Array) -> Array:
        """What a verification on the same station shows, (..., m, 3, q), g, with its own changes J_v·u (..., m, 3, q)."""
        return self.output_errors(columns) + _turned(self._inverse(), np.moveaxis(changes, -3, -2))


def propagated(design_: FitDesign, source: Sensitivity, response: Array) -> Propagated:
    """The influences through a fit.

    Parameters
    ----------
    response : (..., 3, 3), output per g
    """
    return Propagated(design_.coefficient_errors(source.changes), design_.names, source, response, design_.axes)


def norm_errors(errors: Array, force: Array) -> Array:
    """Errors of the magnitude, (..., m, q), of errors (..., m, k, q) at forces (m, k) along k axes; of one axis its errors."""
    if force.shape[-1] == 1:
        return errors[..., 0, :]
    size = np.linalg.norm(force, axis=-1, keepdims=True)
    along = force / np.where(size > 0.0, size, 1.0)
    return np.einsum("...mi,...miq->...mq", along, errors)


def rms_over(errors: Array) -> Array:
    """Root of the mean over m conditions of the variance over q influences, (...), of errors (..., m, q)."""
    return np.sqrt(np.mean(np.sum(errors**2, axis=-1), axis=-1))
