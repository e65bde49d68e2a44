"""A model of any of the sensor's effects fitted to dwells of unknown orientation, by the norm of gravity alone.

The force of each dwell is the one that explains its output, f = M⁻¹(a), and the residual |f| − g. A rotation in front
changes no norm, so x stays along the sensor's own x axis: the matrix K is upper triangular. Gauss–Newton with
dρ/dc = −(uᵀK⁻¹)ᵢ·column for a coefficient c of axis i and the direction u of the force.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial import design
from inertial.arrays import Array, Flags, Index
from inertial.correction import correct
from inertial.counts import number_of
from inertial.design import Values
from inertial.errors import NotIdentified
from inertial.fits.descent import descended
from inertial.fits.linear import LotFit, force_along_axes, response_matrix
from inertial.fits.norm_noise import PlausibleNoise, SolvedNorms, whitened
from inertial.state import State

_SETTLED = 1e-10  # share of the cost that a step no longer takes off
_SINGULAR = 1e-6  # smallest singular value of the whitened columns of unit length, over the largest
_STEP = 1e-3  # relative, for the derivative by a nonlinear parameter


@dataclass(frozen=True)
class NormFit:
    """A fit under the norm condition.

    fit : coefficients (units, 3, p), output unit; its ``residuals`` (units, n, 3) lie along the force
    force : (units, n, 3), g, with the axes of the sensor; left : (units, n), |f| − g
    rows : (units, n, k), derivatives of ``left`` by the free coefficients; free : (3, p), which of the coefficients are
    covariance : (units, k, k), of the free coefficients of all axes together
    record : (units, 3), standard error of the bias as the mean of its record, wander included, output unit; None without noises
    nonlinear_error : standard errors of nonlinear parameters, the largest over the units
    """

    fit: LotFit
    force: Array
    left: Array
    rows: Array
    free: Flags
    covariance: Array
    record: Array | None
    dof: Index
    nonlinear_error: dict[str, dict[str, float]]


def fit_norms(  # noqa: PLR0913 - what a fit needs, and what its errors are averaged over
    effects: Sequence[str],
    state: State,
    output: Array,
    whiten: Array,
    start: tuple[Array, Array],
    *,
    norm: float = 1.0,
    nonlinear: Values | None = None,
    plausible: Iterable[PlausibleNoise] = (),
    weights: Array | None = None,
) -> NormFit:
    """Coefficients of a model from dwells of unknown orientation.

    Parameters
    ----------
    effects : ids of the model, all of the sensor; bias and scale among them
    output : (units, n, 3), output unit; state : of the dwells, its force is not read
    whiten : (units, n, n), inverse root of the covariance of the norms up to a factor, or one of
        :func:`inertial.fits.norm_noise.thin_whitener`; zeros leave dwells out
    start : bias (units, 3) and response (units, 3, 3) to begin with
    norm : gravity in g
    nonlinear : values of nonlinear parameters and constants by effect id
    plausible : noises that the residuals do not rule out: standard errors are averaged over them
    weights : (units, n), of the dwells in the mean of the record, such as their durations; alike where None

    Raises
    ------
    NotIdentified
        The model has effects of the station or no scale, or the dwells leave a coefficient undetermined; it is named.
    """
    sensor, station = design.split(effects)
    _refuse(effects, [e.id for e in station])
    values = design.starting_values(sensor, replace(state, force=output, memory={}))
    for name, given in (nonlinear or {}).items():
        values[name] = {**values.get(name, {}), **given}
    work = _Work(tuple(effects), state, output, whiten, norm, values)
    theta = descended(work.begun(*start), work.step, work.cost, _SETTLED)
    return work.finished(theta, list(plausible), weights)


def _refuse(effects: Sequence[str], station: Sequence[str]) -> None:
    if station:
        raise NotIdentified(
            f"fit: {', '.join(station)} is an effect of the station, and without commanded poses only the norm of gravity is "
            "known; leave it out"
        )
    if not {"bias", "scale"} <= set(effects):
        raise NotIdentified("fit: the norm of gravity needs bias and scale in the model; add them")


class _Work:
    """The fit of a lot: residuals, derivatives and steps of all units."""

    def __init__(
        self, effects: tuple[str, ...], state: State, output: Array, whiten: Array, norm: float, values: dict
    ) -> None:
        self.effects, self.state, self.output, self.whiten, self.norm = effects, state, output, whiten, norm
        self.values = values
        self.sensor = design.split(effects)[0]
        self.names = tuple(design.local_names(self.sensor, axis, values) for axis in range(3))
        self.free = np.array([[is_free(axis, pair) for pair in self.names[axis]] for axis in range(3)])

    def begun(self, bias: Array, response: Array) -> Array:
        """Coefficients (units, 3, p) of the start: everything but bias and response is zero."""
        theta = np.zeros((len(self.output), *self.free.shape))
        for axis in range(3):
            across = iter(((axis + 1) % 3, (axis + 2) % 3))
            for column, (effect, _) in enumerate(self.names[axis]):
                if effect == "bias":
                    theta[:, axis, column] = bias[:, axis]
                elif effect == "scale":
                    theta[:, axis, column] = response[:, axis, axis]
                elif effect == "misalignment":
                    theta[:, axis, column] = response[:, axis, next(across)]
        return np.where(self.free, theta, 0.0)

    def force(self, theta: Array) -> Array:
        """Force (units, n, 3), g, that explains the output."""
        return correct(self.effects, self.state, self.output, theta, self.values)

    def left(self, theta: Array) -> Array:
        """|f| − g, (units, n)."""
        return np.linalg.norm(self.force(theta), axis=-1) - self.norm

    def white(self, columns: Array) -> Array:
        """Columns (units, n, m) with white noise of one variance in them."""
        return whitened(self.whiten, columns)

    def cost(self, theta: Array) -> Array:
        """Whitened sum of squares, (units,)."""
        squares = np.sum(self.white(self.left(theta)[..., None]) ** 2, axis=(-2, -1))
        return np.where(np.isfinite(squares), squares, np.inf)

    def rows(self, theta: Array) -> tuple[Array, Array]:
        """Derivatives of the residuals by the free coefficients, (units, n, k), and by the nonlinear parameters."""
        force = self.force(theta)
        felt = force_along_axes(response_matrix(theta, self.names), force)
        state = replace(self.state, force=force, felt=felt, memory={})
        columns = design.local_columns(self.sensor, state, self.values)
        columns = np.broadcast_to(columns, (len(self.output), *columns.shape[-3:]))
        direction = force / np.linalg.norm(force, axis=-1, keepdims=True)
        along = np.einsum("uni,uij->unj", direction, np.linalg.inv(response_matrix(theta, self.names)))
        by_axis = -np.einsum("unj,ujnp->unjp", along, columns)
        slopes = [self._slope(theta, state, along, *parameter) for parameter in self.parameters()]
        return by_axis[:, :, self.free], np.stack(slopes, axis=-1) if slopes else np.zeros((*force.shape[:2], 0))

    def parameters(self) -> list[tuple[str, str]]:
        """Effect and name of the continuous nonlinear parameters with one value for all axes."""
        return [
            (effect.id, p.name)
            for effect in self.sensor
            for p in effect.parameters(self.state)
            if not p.choices and isinstance(self.values.get(effect.id, {}).get(p.name), float)
        ]

    def _slope(self, theta: Array, state: State, along: Array, effect: str, name: str) -> Array:
        middle = self.values[effect][name]
        step = _STEP * max(abs(middle), 1e-6)
        ends = []
        for sign in (1.0, -1.0):
            moved = {**self.values, effect: {**self.values[effect], name: middle + sign * step}}
            columns = design.local_columns(self.sensor, replace(state, memory={}), moved)
            ends.append(np.einsum("...jnp,...jp->...nj", columns, theta))
        return -np.sum(along * (ends[0] - ends[1]) / (2.0 * step), axis=-1)

    def step(self, theta: Array) -> Array:
        """Change (units, 3, p) of the coefficients by the linear model about them."""
        white, left = self.white(self.rows(theta)[0]), self.white(self.left(theta)[..., None])[..., 0]
        step = np.zeros_like(theta)
        for unit, (rows, target) in enumerate(zip(white, left, strict=True)):
            step[unit][self.free] = -self._solved(rows, target)
        return step

    def _solved(self, rows: Array, target: Array) -> Array:
        """Least squares of one unit; refused where a direction of the coefficients does not show."""
        size = np.linalg.norm(rows, axis=0)
        unit = rows / np.where(size > 0.0, size, 1.0)
        _, values, turn = np.linalg.svd(unit, full_matrices=False)
        if np.any(size <= 0.0) or values.size < rows.shape[1] or values[-1] < _SINGULAR * values[0]:
            share = np.where(size > 0.0, np.abs(turn[-1]), 2.0)
            # of columns that stand for each other the one that was added last to the model
            weak = np.argwhere(self.free)[share > 0.3 * share.max()]
            axis, column = weak[int(np.argmax(weak[:, 1]))].tolist()
            effect, name = self.names[axis][column]
            raise NotIdentified(
                f"fit: {name} of {effect} on axis {'xyz'[axis]} does not show in the norm of gravity over these dwells; leave "
                f"{effect} out, or measure other orientations and conditions"
            )
        return np.linalg.lstsq(unit, target, rcond=None)[0] / size

    def finished(self, theta: Array, plausible: Sequence[PlausibleNoise], weights: Array | None) -> NormFit:
        """The fit with covariances, residuals and degrees of freedom."""
        rows, more = self.rows(theta)
        used = np.any(self.whiten != 0.0, axis=-1)
        free, count = int(self.free.sum()), used.sum(axis=-1)
        dof = count - free - more.shape[-1]
        if np.any(dof < 1):
            raise NotIdentified(
                f"fit: {number_of(int(count.min()), 'dwell')}, more than {free + more.shape[-1]} are needed for this model; add "
                "poses, or leave effects out"
            )
        left, force = self.left(theta), self.force(theta)
        white_left = self.white(left[..., None])[..., 0]
        every = np.concatenate([rows, more], axis=-1)
        chi2 = np.sum(white_left**2, axis=-1)
        covariance = np.zeros((*theta.shape, theta.shape[-1]))
        nonlinear = np.zeros((len(theta), more.shape[-1]))
        indices = np.argwhere(self.free)
        together = np.zeros((len(theta), free, free))
        record = np.zeros((len(theta), 3)) if plausible else None
        direction = force / np.linalg.norm(force, axis=-1, keepdims=True)
        response = response_matrix(theta, self.names)
        for unit in range(len(theta)):
            noises = [
                SolvedNorms(every[unit], left[unit], noise.weight, noise.whiten[unit], 1.0) for noise in plausible
            ]
            noises = noises or [SolvedNorms(every[unit], left[unit], 1.0, self.whiten[unit])]
            joint = np.sum([noise.weight * noise.covariance(int(dof[unit])) for noise in noises], axis=0)
            together[unit] = joint[:free, :free]
            if record is not None:
                share = used[unit] * (1.0 if weights is None else np.nan_to_num(weights[unit]))
                share = share if share.sum() > 0.0 else used[unit].astype(np.float64)
                columns = [self._bias_column(axis) for axis in range(3)]
                gain = SolvedNorms(every[unit], left[unit], 1.0, self.whiten[unit]).gain
                square = [
                    solved.weight
                    * solved.of_record(
                        columns, direction[unit], noise.slow[unit], share, response[unit], int(dof[unit]), gain
                    )
                    for solved, noise in zip(noises, plausible, strict=True)
                ]
                record[unit] = np.sqrt(np.sum(square, axis=0))
            for axis in range(3):
                here = np.flatnonzero(indices[:, 0] == axis)
                covariance[unit, axis][np.ix_(indices[here, 1], indices[here, 1])] = joint[np.ix_(here, here)]
            nonlinear[unit] = np.sqrt(np.maximum(np.diagonal(joint)[free:], 0.0))
        errors: dict[str, dict[str, float]] = {}
        for k, (effect, name) in enumerate(self.parameters()):
            errors.setdefault(effect, {})[name] = float(nonlinear[:, k].max())
        scale = np.abs(np.diagonal(response_matrix(theta, self.names), axis1=-2, axis2=-1))
        fit = LotFit(
            effects=self.effects,
            coefficients=theta,
            covariance=covariance,
            names=self.names,
            shared=np.zeros(0),
            shared_covariance=np.zeros((0, 0)),
            shared_names=(),
            nonlinear=self.values,
            residuals=left[..., None] * direction * scale[:, None, :],
            chi2=np.repeat(chi2[:, None] / 3.0, 3, axis=1),
            dof=np.repeat(dof[:, None], 3, axis=1),
        )
        return NormFit(fit, force, left, rows, self.free, together, record, dof.astype(np.int64), errors)

    def _bias_column(self, axis: int) -> int:
        """Index of the bias of an axis among the free coefficients."""
        column = [effect for effect, _ in self.names[axis]].index("bias")
        return int(np.flatnonzero((np.argwhere(self.free) == (axis, column)).all(axis=1))[0])


def is_free(axis: int, pair: tuple[str, str]) -> bool:
    """Whether a coefficient is fitted: those of K below the diagonal are a rotation, and zero."""
    effect, name = pair
    return effect not in {"misalignment", "misalignment_temperature"} or "xyz".index(name[2]) > axis
