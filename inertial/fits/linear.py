"""Weighted least squares of a model for all units of a lot at once.

Per unit and axis z = H·θ + v is solved as θ̂ = (HᵀWH)⁻¹HᵀWz, refined once where the system is ill-conditioned. Parameters
of the station, which all units share, are found after projecting the units' own columns out (Frisch–Waugh–Lovell), so
the cost stays linear in the units.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.design import Values
from inertial.errors import NotIdentified
from inertial.frames import shown_force
from inertial.state import ALL_AXES, State

_SINGULAR = 1e-11
"""Smallest eigenvalue of the scaled normal matrix: below, a coefficient is not determined."""

_DELICATE = 1e3
"""Variance inflation of a coefficient above which the solution is refined once."""

_SUSPICIOUS = 1e9
"""Variance inflation above which the eigenvalues are looked at."""


@dataclass(frozen=True)
class LotFit:
    """Coefficients of a model for every unit of a lot.

    effects : ids of the model, in order
    coefficients : (..., 3, p), output unit per unit of the column
    covariance : (..., 3, p, p), from the standard errors given, or from the residuals where none were
    names : per axis, (effect id, coefficient) of the p columns
    shared : (q,), parameters of the station; shared_covariance : (q, q); shared_names likewise
    nonlinear : values of nonlinear parameters and constants by effect id
    residuals : (..., n, 3), output unit, output minus model
    chi2 : (..., 3), sum of squared residuals over the variance; dof : (..., 3), degrees of freedom
    """

    effects: tuple[str, ...]
    coefficients: Array
    covariance: Array
    names: tuple[tuple[tuple[str, str], ...], ...]
    shared: Array
    shared_covariance: Array
    shared_names: tuple[tuple[str, str], ...]
    nonlinear: dict[str, dict[str, float]]
    residuals: Array
    chi2: Array
    dof: Array
    axes: tuple[int, ...] = ALL_AXES

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the coefficients, (..., 3, p)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1))

    def scale(self) -> Array:
        """Output per g along itself of every axis that has an output, (..., m); zero without a scale in the model."""
        return own_terms(self.response()[..., self.axes, :], self.axes)

    def response(self) -> Array:
        """The matrix K of each unit, (..., 3, 3), output per g: scale on the diagonal, misalignment beside it."""
        return response_matrix(self.coefficients, self.names, self.axes)


def response_matrix(
    coefficients: Array, names: Sequence[Sequence[tuple[str, str]]], axes: Sequence[int] = ALL_AXES
) -> Array:
    """K from coefficients (..., m, p) of the m axes: ``scale`` and ``misalignment``, (..., 3, 3); other rows are zero."""
    k = np.zeros((*coefficients.shape[:-2], 3, 3))
    for row, axis in enumerate(axes):
        for column, (effect, name) in enumerate(names[row]):
            if effect == "scale":
                k[..., axis, axis] = coefficients[..., row, column]
            elif effect == "misalignment":
                k[..., axis, "xyz".index(name[-1])] = coefficients[..., row, column]
    return k


def fit_lot(
    effects: Sequence[str],
    state: State,
    output: Array,
    standard_error: Array | None = None,
    *,
    nonlinear: Values | None = None,
) -> LotFit:
    """Least-squares fit of a model to the dwells of a lot.

    Parameters
    ----------
    effects : ids of the model
    state : the dwells; arrays may leave out the batch dimension where all units share them
    output : (..., n, 3), mean output of each dwell, in the output's unit
    standard_error : (..., n, 3), output unit; infinity takes a value out of the fit; None weighs all alike
    nonlinear : values of nonlinear parameters by effect id; the middle of their bounds otherwise
        (:func:`inertial.estimation.refinement.terms_of` finds them)

    Raises
    ------
    NotIdentified
        The plan cannot determine a coefficient; it is named.
    UnknownEffect, MissingInput
        An effect is not in the catalogue, or needs a quantity that the dwells do not carry.
    """
    sensor, station = design.split(effects)
    if state.felt is None and any(e.sharp for e in sensor):
        felt = felt_force(state.force, output, state.theta, state.axes)
        first = fit_lot(effects, replace(state, felt=felt, memory={}), output, standard_error, nonlinear=nonlinear)
        better = own_axes(replace(state, felt=felt), first.response())
        return first if better is None else fit_lot(effects, better, output, standard_error, nonlinear=nonlinear)
    values = design.starting_values([*sensor, *station], state)
    for name, given in (nonlinear or {}).items():
        values[name] = {**values.get(name, {}), **given}
    z = np.swapaxes(output, -1, -2)
    names = tuple(design.local_names(sensor, axis, values) for axis in state.axes)
    weight = None if standard_error is None else 1.0 / np.swapaxes(standard_error, -1, -2)
    shared, shared_covariance = np.zeros(0), np.zeros((0, 0))
    local = _LocalColumns(design.local_columns(sensor, state, values), weight, names, state.axes)
    theta = local.solve(z)
    if station:
        columns = design.shared_columns(station, state, values, response_matrix(theta, names, state.axes))
        shared, shared_covariance, z = _solve_shared(local, columns, z, design.shared_names(station))
        theta = local.solve(z)
    residual = local.apply(theta)
    np.subtract(z, residual, out=residual)  # no third array of the size of the lot
    chi2, dof = local.chi2(residual)
    covariance = local.inverse
    if weight is None:
        variance = chi2 / np.maximum(dof, 1)
        covariance = covariance * variance[..., None, None]
        shared_covariance = shared_covariance * float(chi2.sum() / max(dof.sum() - shared.size, 1))
    return LotFit(
        effects=tuple(dict.fromkeys(effects)),
        coefficients=theta,
        covariance=np.broadcast_to(covariance, (*theta.shape, theta.shape[-1])),
        names=names,
        shared=shared,
        shared_covariance=shared_covariance,
        shared_names=design.shared_names(station),
        nonlinear=values,
        residuals=np.swapaxes(residual, -1, -2),
        chi2=chi2,
        dof=dof,
        axes=state.axes,
    )


_SAME_G = 1e-5
"""Change of the force along an axis, g, that adds less than 0.1 µg to the run of a scale factor of 200 ppm/K over 35 K."""

_WARM = 5.0
"""Range of temperature, K, from which on the bias' run with it would be taken for response where poses differ between soaks."""


def felt_force(force: Array, output: Array, theta: Array | None = None, axes: tuple[int, ...] = ALL_AXES) -> Array:
    """Specific force along the sensor's own axes, (..., n, 3), g, from a plain fit of response and bias.

    Parameters
    ----------
    theta : (..., n), temperature above the reference, K: a bias that follows it is no response
    """
    x = np.concatenate([np.ones((*force.shape[:-1], 1)), shown_force(force, axes)], axis=-1)
    if theta is not None and float(np.ptp(theta)) > _WARM:
        warm = np.stack([theta, theta**2], axis=-1) / float(np.max(np.abs(theta)))
        batch = np.broadcast_shapes(x.shape[:-1], warm.shape[:-1])
        x = np.concatenate([np.broadcast_to(c, (*batch, c.shape[-1])) for c in (x, warm)], axis=-1)
    coefficients = pseudo_inverses(x) @ output
    return force_along_axes(of_every_axis(np.swapaxes(coefficients[..., 1:4, :], -1, -2), axes), force)


def of_every_axis(rows: Array, axes: tuple[int, ...], fill: float = 0.0) -> Array:
    """Rows (..., m, k) of the axes with an output at their indices among three, (..., 3, k); the others hold ``fill``."""
    if len(axes) == 3:
        return rows
    of_all = np.full((*rows.shape[:-2], 3, rows.shape[-1]), fill)
    of_all[..., axes, :] = rows
    return of_all


def own_terms(rows: Array, axes: tuple[int, ...]) -> Array:
    """The response of each axis to the force along itself, (..., m), from rows (..., m, 3)."""
    return rows[..., np.arange(len(axes)), axes]


def force_along_axes(response: Array, force: Array) -> Array:
    """Specific force along the sensor's own axes, (..., n, 3), g: rows of the response (..., 3, 3) over their diagonal."""
    return np.einsum("...ij,...nj->...ni", axis_rows(response), force)


def own_axes(state: State, response: Array) -> State | None:
    """The state with the force along the axes of a fitted response; None where it has that force already."""
    felt = force_along_axes(response, state.force)
    if state.felt is None:
        return replace(state, felt=felt, memory={})
    moved = np.max(np.abs(felt - state.felt), axis=(-2, -1), keepdims=True) > _SAME_G
    # unit by unit: the coefficients of a unit do not depend on the others of its lot
    return replace(state, felt=np.where(moved, felt, state.felt), memory={}) if np.any(moved) else None


def axis_rows(response: Array) -> Array:
    """Rows of a response (..., 3, 3) over their diagonal; a model without a scale factor has one of 1."""
    diagonal = np.diagonal(response, axis1=-2, axis2=-1)
    rows = np.array(response / np.where(diagonal == 0.0, 1.0, diagonal)[..., :, None])
    rows[..., range(3), range(3)] = 1.0
    return rows


def pseudo_inverses(columns: Array) -> Array:
    """Pseudo-inverses (..., p, n) of columns (..., n, p); one serves all units where they have the same columns."""
    many = columns.reshape(-1, *columns.shape[-2:])
    if len(many) > 1 and np.array_equal(many, np.broadcast_to(many[0], many.shape)):
        inverse = np.asarray(np.linalg.pinv(many[0], rcond=1e-9), dtype=np.float64)
        return np.broadcast_to(inverse, (*columns.shape[:-2], *inverse.shape))
    return np.asarray(np.linalg.pinv(columns, rcond=1e-9), dtype=np.float64)


def _solve_shared(
    local: "_LocalColumns", columns: Array, z: Array, names: Sequence[tuple[str, str]]
) -> tuple[Array, Array, Array]:
    """Shared parameters, their covariance, and the targets without their part."""
    columns = np.broadcast_to(columns, (*z.shape, columns.shape[-1]))
    free = local.project_out(columns)
    target = local.project_out(z[..., None])[..., 0]
    q = free.shape[-1]
    flat = free.reshape(-1, q)
    size, before = np.linalg.norm(flat, axis=0), np.linalg.norm(columns.reshape(-1, q), axis=0)
    lost = np.flatnonzero(
        size <= 1e-7 * np.maximum(before * (1.0 if local.weight is None else float(np.max(local.weight))), 1e-300)
    )
    if lost.size:
        effect, name = names[int(lost[0])]
        raise NotIdentified(
            f"fit: {effect} ({name}) is one with what every unit fits for itself; leave it out of the model"
        )
    scaled = flat / size
    gram = scaled.T @ scaled
    if np.linalg.eigvalsh(gram)[0] < _SINGULAR:
        raise NotIdentified(
            f"fit: the plan cannot tell these apart: {', '.join(f'{e} ({n})' for e, n in names)}; leave one out of the model"
        )
    inverse = np.linalg.inv(gram)
    shared = (inverse @ (scaled.T @ target.reshape(-1))) / size
    return shared, inverse / np.outer(size, size), z - np.matmul(columns, shared)


class _LocalColumns:
    """Normal equations of the units' own columns, scaled; one system serves all units where they share design and weights."""

    def __init__(
        self,
        columns: Array,
        weight: Array | None,
        names: Sequence[Sequence[tuple[str, str]]],
        axes: Sequence[int],
    ) -> None:
        self.letters = ["xyz"[axis] for axis in axes]
        self.columns, self.weight = columns, weight
        self.weighted = columns if weight is None else columns * weight[..., None]
        # columns are not scaled one by one: that is a second array as large as they are
        gram = np.swapaxes(self.weighted, -1, -2) @ self.weighted
        self.scale = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
        self._refuse_empty(names)
        self.gram_inverse = self._inverted(gram / (self.scale[..., :, None] * self.scale[..., None, :]), names)
        # the largest variance inflation: 1/v² of the column that the others leave least of
        self.delicate = float(np.max(np.diagonal(self.gram_inverse, axis1=-2, axis2=-1))) > _DELICATE
        self.inverse = self.gram_inverse / (self.scale[..., :, None] * self.scale[..., None, :])

    def _refuse_empty(self, names: Sequence[Sequence[tuple[str, str]]]) -> None:
        empty = np.argwhere(self.scale <= 0.0)
        if empty.size:
            axis, column = int(empty[0, -2]), int(empty[0, -1])
            effect, name = names[axis][column]
            raise NotIdentified(
                f"fit: {effect} ({name} of axis {self.letters[axis]}) is zero in every dwell; "
                f"the plan must excite it; add poses or conditions that do, or leave it out of the model"
            )

    def _inverted(self, gram: Array, names: Sequence[Sequence[tuple[str, str]]]) -> Array:
        """Inverse of the scaled normal matrices; a singular one is refused with the coefficients it confuses."""
        inverse: Array
        try:
            inverse = np.linalg.inv(gram).astype(np.float64)
        except np.linalg.LinAlgError:
            inverse = np.full(gram.shape, np.inf)
        inflation = np.diagonal(inverse, axis1=-2, axis2=-1)
        if np.all(inflation < _SUSPICIOUS) and np.all(inflation > 0.0):
            return inverse
        self._refuse_singular(gram, names)
        return inverse

    def _refuse_singular(self, gram: Array, names: Sequence[Sequence[tuple[str, str]]]) -> None:
        values, vectors = np.linalg.eigh(gram)
        bad = np.argwhere(values[..., 0] < _SINGULAR)
        if not bad.size:
            return
        where = tuple(int(i) for i in bad[0])
        axis = where[-1]
        share = np.abs(vectors[(*where, slice(None), 0)])
        involved = [names[axis][i] for i in np.argsort(-share) if share[i] > 0.1]
        listed = ", ".join(f"{effect} ({name})" for effect, name in involved)
        raise NotIdentified(
            f"fit: the plan cannot tell these coefficients of axis {self.letters[axis]} apart: {listed}; "
            f"add poses or temperatures that separate them, or leave one out of the model"
        )

    def solve(self, z: Array) -> Array:
        """Coefficients (..., 3, p) for targets (..., 3, n); with one step of refinement against the rounding of HᵀWH."""
        theta = self._step(z)
        return theta + self._step(z - self.apply(theta)) if self.delicate else theta

    def _step(self, z: Array) -> Array:
        weighted = z if self.weight is None else z * self.weight
        right = _apply(np.swapaxes(self.weighted, -1, -2), weighted) / self.scale
        return _apply(self.gram_inverse, right) / self.scale

    def apply(self, theta: Array) -> Array:
        """The model's output (..., 3, n)."""
        return _apply(self.columns, theta)

    def project_out(self, columns: Array) -> Array:
        """Weighted columns (..., 3, n, q) less what the local columns explain."""
        weighted = columns if self.weight is None else columns * self.weight[..., None]
        scaled = self.weighted / self.scale[..., None, :]
        inside = np.matmul(self.gram_inverse, np.matmul(np.swapaxes(scaled, -1, -2), weighted))
        return weighted - np.matmul(scaled, inside)

    def chi2(self, residual: Array) -> tuple[Array, Array]:
        """Weighted sum of squares and degrees of freedom, each (..., 3)."""
        weighted = residual if self.weight is None else residual * self.weight
        count = (
            np.full(residual.shape[:-1], residual.shape[-1])
            if self.weight is None
            or self.weight.all()  # to count along an axis takes as long as a product of all columns
            else np.count_nonzero(np.broadcast_to(self.weight, residual.shape), axis=-1)
        )
        return np.einsum("...n,...n->...", weighted, weighted), count - self.columns.shape[-1]


def _apply(matrices: Array, vectors: Array) -> Array:
    """Matrices (..., 3, m, k) times vectors (..., 3, k), (..., 3, m).

    Matrices that all units share are put side by side in one (3k, 3m), so that the whole lot is a single product without a copy.
    """
    if matrices.ndim > 3 or vectors.ndim != 3:
        return np.matmul(matrices, vectors[..., None])[..., 0]
    axes, m, k = matrices.shape
    together = np.zeros((k, axes, m, axes))
    for axis in range(axes):
        together[:, axis, :, axis] = matrices[axis].T
    flat = np.swapaxes(vectors, -1, -2).reshape(-1, axes * k)
    return np.swapaxes((flat @ together.reshape(axes * k, axes * m)).reshape(-1, m, axes), -1, -2)
