"""The quantities of a budget: coefficients, angles between axes, corrected output, verification, the error over the period."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from inertial import design
from inertial.arrays import Array
from inertial.frames import angles_from_force
from inertial.state import State
from inertial.uncertainty.propagation import Propagated, norm_errors, rms_over
from pipelines.stages.rms_error import OF_UNITS
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.period_error import AxisErrors, largest_error, period_of
from pipelines.tables.calibration import Calibration
from pipelines.tables.dwells import LotArrays
from pipelines.tables.frames import ByUnit
from schemas.decisions import BOUND, LARGEST_ERROR, MEDIAN
from schemas.units import AXES, MICRO

EFFECTS = {
    "bias": "µg",
    "scale": "ppm",
    "misalignment": "µrad",
    "bias_temperature": "µg/K",
    "scale_temperature": "ppm/K",
}
"""Effects whose coefficients have a budget of their own, relative to the scale of their axis."""
PARTS = {
    **dict.fromkeys(EFFECTS, "coefficients"),
    "orthogonality": "angles",
    "output": "outputs",
    **dict.fromkeys(("bias_error", "verification_norm", "bias_error_period", LARGEST_ERROR), "verification"),
}
"""The part of the budget that every quantity is computed in."""
UNSEEN = 0.1
"""Visible share below which the residuals of a fit show nothing of an influence."""


@dataclass(frozen=True)
class VarianceParts:
    """Influences through a fit, with the part that a verification on the same station shows.

    verification : (..., m, 3, q), J·u at the dwells for verification; visible_share : of :attr:`visible`
    """

    fit: Propagated
    verification: Array
    visible_share: Callable[[], Array]

    @cached_property
    def visible(self) -> Array:
        """Visible share of every influence, (q,)."""
        return self.visible_share()


@dataclass(frozen=True)
class LotBudget:
    """The inputs of a budget: dwells, calibration, tables, statements, and the influences through the fit."""

    lot: LotArrays
    calibration: Calibration
    tables: BudgetTables
    terms: BudgetTerms
    variances: VarianceParts

    @cached_property
    def dof(self) -> Array:
        """Degrees of freedom of the noise, those of the whole lot, (units,)."""
        return np.full(len(self.lot.units), float(np.sum(np.asarray(self.tables.wander["dof"], dtype=float))))

    @cached_property
    def scale(self) -> Array:
        """Output per g of every unit and axis, (units, m)."""
        return np.abs(self.calibration.scale)


@dataclass(frozen=True)
class BudgetQuantity:
    """A quantity of every unit of a lot with the error that each influence makes of it.

    value, noise : (units,), in ``unit``; noise is the standard uncertainty of type A
    parts : (units, q), errors per standard uncertainty; for RMS figures their RMS
    shown, unseen : (units,), the part of the budget that the station's own verification shows, and the part that it cannot; None
    where there is
        none
    extra : contributions beyond the run by name, (units,) each; dof_noise : (units,)
    axis_errors : of the error of an axis, where the error over the period is made of it
    of_prior : (units,), share of a prior in the variance of the noise
    """

    name: str
    axis: str
    unit: str
    value: Array
    noise: Array
    parts: Array
    dof_noise: Array
    shown: Array | None = None
    unseen: Array | None = None
    extra: dict[str, Array] = field(default_factory=dict[str, "Array"])
    axis_errors: AxisErrors | None = None
    of_prior: Array | None = None


def quantities_of(budget: LotBudget) -> Iterator[BudgetQuantity]:
    """Every quantity of a budget."""
    for part in dict.fromkeys(PARTS.values()):
        yield from part_of(part, budget)


def part_of(part: str, budget: LotBudget, *, decisions: bool = False) -> Iterator[BudgetQuantity]:
    """The quantities of one part of a budget, a value of :data:`PARTS`.

    Parameters
    ----------
    decisions : whether the parts that a verification shows are left out where no decision depends on them
    """
    if part == "coefficients":
        yield from _coefficients(budget)
    elif part == "angles":
        yield from _angles(budget)
    elif part == "outputs":
        yield from _outputs(budget)
    elif part == "verification" and len(budget.tables.verification):
        # the error over the period is made of the two parts
        split = budget.terms.stability is not None or not decisions
        errors = list(_verification(budget, split=split))
        yield from errors
        yield from _period(errors, budget)


def _coefficients(budget: LotBudget) -> Iterator[BudgetQuantity]:
    calibration, scale = budget.calibration, budget.scale
    spread = np.sqrt(np.diagonal(calibration.covariance, axis1=-2, axis2=-1))
    prior = budget.tables.prior
    shares = None
    if prior is not None and len(prior):
        shares = prior["share"].to_numpy(dtype=float).reshape(calibration.coefficients.shape)
    for effect, unit in EFFECTS.items():
        for axis, letter in enumerate(calibration.letters):
            for column in [k for k, (name, _) in enumerate(calibration.names[axis]) if name == effect]:
                along = letter + calibration.names[axis][column][1][-1] if effect == "misalignment" else letter
                factor = MICRO / scale[:, axis]
                value = factor * calibration.coefficients[:, axis, column]
                parts = factor[:, None] * budget.variances.fit.coefficients[:, axis, column, :]
                noise, nominal = factor * spread[:, axis, column], MICRO if effect == "scale" else 0.0
                share = None if shares is None else shares[:, axis, column]
                yield BudgetQuantity(effect, along, unit, value - nominal, noise, parts, budget.dof, of_prior=share)


def _angles(budget: LotBudget) -> Iterator[BudgetQuantity]:
    """Deviation from 90° of the angle between two axes, (m_ij + m_ji): independent of the seat."""
    calibration, scale, changes = budget.calibration, budget.scale, budget.variances.fit.coefficients
    if "misalignment" not in calibration.effects or len(calibration.axes) < len(AXES):
        return
    noise = calibration.covariance
    for i, j in ((0, 1), (1, 2), (2, 0)):
        columns = [k for k, (name, _) in enumerate(calibration.names[i]) if name == "misalignment"]
        others = [k for k, (name, _) in enumerate(calibration.names[j]) if name == "misalignment"]
        a = columns[(j - i - 1) % 3]
        b = others[(i - j - 1) % 3]
        fi, fj = MICRO / scale[:, i], MICRO / scale[:, j]
        value = fi * calibration.coefficients[:, i, a] + fj * calibration.coefficients[:, j, b]
        parts = fi[:, None] * changes[:, i, a] + fj[:, None] * changes[:, j, b]
        u = np.sqrt((fi**2) * noise[:, i, a, a] + (fj**2) * noise[:, j, b, b])
        yield BudgetQuantity("orthogonality", AXES[i] + AXES[j], "µrad", value, u, parts, budget.dof)


def _outputs(budget: LotBudget) -> Iterator[BudgetQuantity]:
    """Corrected output, worst force and temperature of the certified range."""
    calibration, dof = budget.calibration, budget.dof
    state = certified_range(budget.lot, budget.terms)
    columns = design.local_columns(design.split(calibration.effects)[0], state, calibration.nonlinear)
    errors = budget.variances.fit.user_errors(
        columns, state.force, intrinsic=budget.terms.certificate.frame == "intrinsic"
    )
    noise = output_noise(calibration, columns)
    zero = np.zeros_like(dof)
    for axis, letter in enumerate(calibration.letters):
        yield _worst("output", letter, errors[..., axis, :], noise[..., axis, axis], zero, dof)
    if len(calibration.axes) < len(AXES):
        return  # the norm of the force is that of three
    along = state.force / np.linalg.norm(state.force, axis=-1, keepdims=True)
    of_norm = np.einsum("mi,umij,mj->um", along, noise, along)
    yield _worst("output", "norm", norm_errors(errors, state.force), of_norm, zero, dof)


def output_noise(calibration: Calibration, columns: Array) -> Array:
    """Covariance of the corrected output by the noise of the fit, (units, m, k, k), µg², of the k axes with an output."""
    axes = calibration.axes
    inverse = np.linalg.inv(design.of_axes(design.of_axes(calibration.response, axes, -1), axes, -2))
    variance = np.swapaxes(np.sum(np.matmul(columns, calibration.covariance) * columns, axis=-1), -1, -2)
    return MICRO**2 * np.einsum("uij,umj,ukj->umik", inverse, variance, inverse)


def _worst(name: str, axis: str, errors: Array, variance: Array, value: Array, dof: Array) -> BudgetQuantity:
    """The quantity at the condition where its variance is largest, by unit; errors (units, m, q), g, variance (units, m), µg²."""
    errors = np.broadcast_to(errors, (value.size, *errors.shape[-2:]))
    total = MICRO**2 * np.einsum("umq,umq->um", errors, errors) + variance
    where = np.argmax(total, axis=-1)
    rows = np.arange(value.size)
    return BudgetQuantity(name, axis, "µg", value, np.sqrt(variance[rows, where]), MICRO * errors[rows, where], dof)


def certified_range(lot: LotArrays, terms: BudgetTerms) -> State:
    """Forces along faces, edges and corners of a cube at the ends and the middle of the temperatures."""
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
    low, high = terms.certificate.force_range_g or (-1.0, 1.0)
    force = max(abs(low), abs(high)) * grid / np.linalg.norm(grid, axis=1, keepdims=True)
    read = lot.state.temperature
    given = terms.certificate.temperature_range_C
    ends = given or ((float(np.min(read)), float(np.max(read))) if read is not None else (25.0, 25.0))
    levels = np.unique([ends[0], 0.5 * (ends[0] + ends[1]), ends[1]])
    many = np.tile(force, (levels.size, 1))
    outer, inner = angles_from_force(many)

    def usual(values: Array | None) -> Array | None:
        return None if values is None else np.full(len(many), float(np.median(values)))

    state = lot.state
    return State(
        force=many,
        time=np.full(len(many), float(np.median(state.time))),
        temperature=np.repeat(levels, len(force)),
        chamber=np.repeat(levels, len(force)),
        since_power=usual(state.since_power),
        since_move=usual(state.since_move),
        supply=usual(state.supply),
        vibration=usual(state.vibration),
        outer=outer,
        inner=inner,
        slot=np.zeros(()),
        axes=state.axes,
        covariates={name: np.full(len(many), float(np.median(values))) for name, values in state.covariates.items()},
    )


def _verification(budget: LotBudget, *, split: bool) -> Iterator[BudgetQuantity]:
    """RMS error of each axis for the user, and the magnitude at its worst pose.

    Parameters
    ----------
    split : whether the part that the station's own verification shows, and that which it cannot, are computed
    """
    lot, calibration, variances = budget.lot, budget.calibration, budget.variances
    unseen = lot.of_kind("verification")
    columns = design.local_columns(design.split(calibration.effects)[0], lot.state, calibration.nonlinear)
    columns = columns[..., unseen, :]
    force = np.broadcast_to(lot.state.force, (*lot.output.shape[:1], *lot.state.force.shape[-2:]))[:, unseen]
    intrinsic = budget.terms.certificate.frame == "intrinsic"
    true = MICRO * variances.fit.user_errors(columns, force, intrinsic=intrinsic)
    shown = MICRO * variances.fit.shown_errors(columns, variances.verification) if split else None
    hidden = variances.visible < UNSEEN if split else None
    rows = budget.tables.verification
    for axis, letter in enumerate(calibration.letters):
        pose_errors = rows[f"error_{letter}_ug"].to_numpy().reshape(len(lot.units), -1)
        noise, expected, freedom = (
            rows[name.format(letter)].to_numpy().reshape(len(lot.units), -1)[:, 0] for name in OF_UNITS
        )
        parts = np.sqrt(np.mean(true[..., axis, :] ** 2, axis=-2))
        parts = np.broadcast_to(parts, (len(lot.units), parts.shape[-1]))
        value = np.sqrt(np.mean(pose_errors**2, axis=1))
        quantity = BudgetQuantity("bias_error", letter, "µg", value, noise, parts, budget.dof)
        if shown is not None and hidden is not None:
            seen, unshown = (
                _all(rms_over(part), lot) for part in (shown[..., axis, :], true[..., axis, :][..., hidden])
            )
            # the RMS of the run has in it what the verification shows of the references
            fixed = np.sqrt(np.maximum(np.sum(quantity.parts**2, axis=-1) - seen**2, unshown**2))
            flat = true[..., axis, :].reshape(-1, true.shape[-1])
            errors = AxisErrors(quantity.value, expected, freedom, pose_errors.mean(axis=1), fixed, flat.T @ flat)
            quantity = replace(quantity, shown=seen, unseen=unshown, axis_errors=errors)
        yield quantity
    seen_force = design.of_axes(force, calibration.axes, -1)
    along = norm_errors(true / MICRO, seen_force)
    value, noise = _worst_pose(lot, budget.tables)
    variance = np.zeros(along.shape[:-1]) + noise[:, None] ** 2
    worst = _worst("verification_norm", "norm", along, variance, value, budget.dof)
    if shown is None or hidden is None:
        yield worst
        return
    seen = norm_errors(shown / MICRO, seen_force) * MICRO
    yield replace(
        worst,
        shown=_all(np.sqrt(np.max(np.sum(seen**2, axis=-1), axis=-1)), lot),
        unseen=_all(MICRO * np.sqrt(np.max(np.sum(along[..., hidden] ** 2, axis=-1), axis=-1)), lot),
    )


def _worst_pose(lot: LotArrays, tables: BudgetTables) -> tuple[Array, Array]:
    """Magnitude of the largest error of a pose and its uncertainty by noise, of every unit, µg."""
    rows = ByUnit(tables.verification_poses)
    largest = np.zeros((2, len(lot.units)))
    for index, unit in enumerate(lot.units):
        poses = rows.of(unit)
        error, u = poses["error_ug"], poses["uncertainty_ug"]
        worst = int(np.argmax(np.abs(error)))
        largest[:, index] = abs(error[worst]), u[worst]
    return largest[0], largest[1]


def _all(values: Array, lot: LotArrays) -> Array:
    return np.broadcast_to(values, (len(lot.units),)).copy()


def _period(errors: list[BudgetQuantity], budget: LotBudget) -> Iterator[BudgetQuantity]:
    """RMS error over the period of validity of each axis, and the largest; none if nothing is stated for the time after."""
    lot, tables, terms = budget.lot, budget.tables, budget.terms
    used = lot.of_kind("dwell")
    time = np.broadcast_to(lot.state.time, (len(lot.units), used.size))[:, used]
    span = float(np.ptp(time[0])) + terms.dwell_s
    axes: list[AxisErrors] = []
    for letter in lot.letters:
        of_run = next(q for q in errors if q.name == "bias_error" and q.axis == letter).axis_errors
        growths = [growth for unit in lot.units if (growth := period_of(tables, terms, unit, letter, span)) is not None]
        if len(growths) != len(lot.units) or of_run is None:
            return
        names = dict.fromkeys(name for growth in growths for name in growth)
        later = {name: np.array([growth.get(name, 0.0) for growth in growths]) for name in names}
        axes.append(replace(of_run, later=later))
    zero, none = np.zeros(len(lot.units)), np.zeros((len(lot.units), 0))
    by_axis = [{"run": axis.run, "budget": axis.fixed, **axis.later} for axis in axes]
    for letter, axis, parts in zip(lot.letters, axes, by_axis, strict=True):
        yield BudgetQuantity("bias_error_period", letter, "µg", axis.value, zero, none, budget.dof, extra=parts)
    # of the largest error the parts are those of the axis that is expected to be the worst
    worst = np.argmax([axis.value for axis in axes], axis=0)
    names = dict.fromkeys(name for parts in by_axis for name in parts)
    extra = {
        name: np.stack([parts.get(name, zero) for parts in by_axis])[worst, np.arange(zero.size)] for name in names
    }
    for name, value in zip((MEDIAN, BOUND), largest_error(axes, terms.switch_on_dof), strict=True):
        yield BudgetQuantity(LARGEST_ERROR, name, "µg", value, zero, none, budget.dof, extra=extra)
