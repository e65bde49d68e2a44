"""Uncertainty that a recipe can reach on its station, before it is measured, and its largest contributions."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from inertial import design
from inertial.arrays import Array, Index
from inertial.state import State
from inertial.uncertainty.influences import MeasurementModel, sensitivity
from inertial.uncertainty.propagation import FitDesign, Propagated, fit_design, norm_errors, propagated, rms_over
from pipelines.stages.uncertainty.budget import with_device_temperature
from pipelines.stages.uncertainty.budget_terms import BudgetTerms
from pipelines.stages.uncertainty.contributions import DwellConditions, influences
from pipelines.stages.uncertainty.measurands import EFFECTS
from pipelines.stages.uncertainty.period_error import AxisErrors, after_run, largest_error
from schemas.decisions import BOUND, GRADES, LARGEST_ERROR
from schemas.limits import Limits
from schemas.units import AXES, MICRO

LEAST_SHARE = 0.01
"""Smallest share of a contribution that a reason names."""
LEAST_MARGIN = 2.0
"""Between limit and U, in standard deviations of the error by noise: less fails one good unit in twenty, or more."""
FIGURES = {
    "bias_error": ("bias_error_ug", 1.0),
    LARGEST_ERROR: ("bias_error_period_ug", 1.0),
    "verification_norm": ("verification_norm_ug", 1.0),
    "bias": ("zero_g_offset_mg", 1e-3),
    "misalignment": ("misalignment_mrad", 1e-3),
    "bias_temperature": ("bias_temperature_ug_K", 1.0),
    "scale_temperature": ("scale_temperature_ppm_K", 1.0),
}
"""Figures that may have limits by the quantity whose uncertainty is theirs, with the figure's unit per unit of the quantity."""


@dataclass(frozen=True)
class PlannedDwells:
    """The dwells that a recipe plans.

    fit, verification : states, (n,) and (m,); soak, target_C : (n,), of the fit's
    covariance : (n, n), of the dwells of the fit, g²; run_ug : expected error of a dwell within the run
    instability_ug : bias instability B of the device
    joint : (n + m, n + m), covariance of the dwells of the fit, then of the verification, g²; None: no noise
    """

    fit: State
    verification: State | None
    soak: Index
    target_C: Array
    covariance: Array
    run_ug: float
    instability_ug: float
    joint: Array | None = None


@dataclass(frozen=True)
class Reach:
    """A quantity and its reachable uncertainty.

    u : standard uncertainty, or the expected RMS of an error, or the 95 % bound of the largest
    parts : by contribution, in ``unit``
    """

    quantity: str
    axis: str
    unit: str
    u: float
    parts: dict[str, float]

    @property
    def shares(self) -> dict[str, float]:
        """Share of each contribution in the sum of their squares, the largest first."""
        variance = sum(part**2 for part in self.parts.values())
        shares = {name: part**2 / variance for name, part in self.parts.items()} if variance > 0.0 else {}
        return dict(sorted(shares.items(), key=lambda item: -item[1]))


def reachable(planned: PlannedDwells, terms: BudgetTerms, effects: Sequence[str]) -> list[Reach]:
    """The reachable uncertainty of a recipe; empty if no uncertainty is stated.

    The device is nominal: response 1, with the temperature coefficients that its stability states.
    """
    if terms.stated is None:
        return []
    nominal = _nominal(effects, planned.fit, 0.0 if terms.stability is None else terms.stability.zero_level_g)
    axes = planned.fit.axes
    model = with_device_temperature(nominal, np.eye(3), terms.stability, axes)
    at = DwellConditions(
        planned.fit, planned.soak, planned.target_C, terms.soak_min_s, terms.room_C, np.ones(len(axes))
    )
    source = sensitivity(model, planned.fit, *influences(terms.stated, at, terms.stability))
    fit = fit_design(nominal, planned.fit, planned.covariance)
    propagation = propagated(fit, source, np.eye(3))
    names = np.array(source.contributions, dtype=object)
    noise = fit.gain @ planned.covariance @ np.swapaxes(fit.gain, -1, -2)
    out: list[Reach] = []
    for effect, unit in EFFECTS.items():
        for axis, letter in enumerate(AXES[k] for k in axes):
            for column in [k for k, (name, _) in enumerate(fit.names[axis]) if name == effect]:
                noise_u = float(np.sqrt(noise[axis, column, column]))
                out.append(_reach(effect, letter, unit, noise_u, propagation.coefficients[axis, column], names))
    if planned.verification is not None:
        out += _errors(planned, terms, nominal, propagation, names, fit)
    return out


def _nominal(effects: Sequence[str], state: State, zero_level_g: float) -> MeasurementModel:
    usual = {"scale": 1.0, "bias": zero_level_g}
    sensor, station = design.split(effects)
    values = design.starting_values([*sensor, *station], state)
    names = [design.local_names(sensor, axis, values) for axis in state.axes]
    coefficients = np.array([[usual.get(effect, 0.0) for effect, _ in terms] for terms in names])
    return MeasurementModel(tuple(effects), coefficients, values)


def _reach(quantity: str, axis: str, unit: str, noise: float, errors: Array, names: Array) -> Reach:
    parts = {"noise": MICRO * noise}
    for group in dict.fromkeys(names.tolist()):
        parts[group] = MICRO * float(np.sqrt(np.sum(errors[names == group] ** 2)))
    return Reach(quantity, axis, unit, _combined(parts), parts)


def _combined(parts: dict[str, float]) -> float:
    return float(np.sqrt(sum(part**2 for part in parts.values())))


def _errors(
    planned: PlannedDwells,
    terms: BudgetTerms,
    model: MeasurementModel,
    propagation: Propagated,
    names: Array,
    fit: FitDesign,
) -> list[Reach]:
    """RMS error for the user, by the references alone, and over the period; error in a pose of the verification."""
    state = planned.verification
    if state is None:
        return []
    columns = design.local_columns(design.split(model.effects)[0], state, model.nonlinear)
    errors = propagation.user_errors(columns, state.force, intrinsic=terms.certificate.frame == "intrinsic")
    out: list[Reach] = []
    axes: list[AxisErrors] = []
    later = after_run(terms, float(np.ptp(planned.fit.time)) + terms.dwell_s, planned.instability_ug)
    if later is not None:
        later = {name: value for name, value in later.items() if value > 0.0}
    for axis, letter in enumerate(AXES[k] for k in state.axes):
        changes = errors[..., axis, :]
        parts = {
            group: MICRO * float(rms_over(changes[..., names == group])) for group in dict.fromkeys(names.tolist())
        }
        u = _combined(parts)
        out.append(Reach("bias_error", letter, "µg", u, parts))
        if later is not None:
            over_period = {"run": planned.run_ug, "budget": u, **later}
            out.append(Reach("bias_error_period", letter, "µg", _combined(over_period), over_period))
            flat = changes.reshape(-1, changes.shape[-1])
            run, fixed, dof = (np.array([value]) for value in (planned.run_ug, u, float(len(state.force))))
            after = {name: np.array([value]) for name, value in later.items()}
            axes.append(AxisErrors(run, run, dof, 0.0 * run, fixed, flat.T @ flat, after))
    if axes:
        worst = max((reach for reach in out if reach.quantity == "bias_error_period"), key=lambda reach: reach.u)
        _, bound = largest_error(axes, terms.switch_on_dof)
        out.append(Reach(LARGEST_ERROR, BOUND, "µg", float(bound[0]), worst.parts))
    noise = {} if planned.joint is None else {"noise": _noise_of_pose(planned.joint, columns, fit, state)}
    return [*out, _norm(errors, state, names, noise)]


def _noise_of_pose(joint: Array, columns: Array, fit: FitDesign, state: State) -> float:
    """Standard deviation, µg, of the magnitude's error by noise, mean over the dwells of the pose where it is largest.

    White noise and wander of these dwells, and of those of the fit through the coefficients of a device of response 1, as the
    verification of a run states it (:func:`pipelines.stages.verify.verify`); what a lot shares of the station is left out.

    columns : (3, m, p), of the verification
    """
    force = design.of_axes(state.force, state.axes, -1)
    toward = force / np.linalg.norm(force, axis=-1, keepdims=True)
    to_dwells = np.concatenate(
        [-columns @ fit.gain, np.broadcast_to(np.eye(len(force)), (*columns.shape[:2], len(force)))], -1
    )
    expected = to_dwells @ joint @ np.swapaxes(to_dwells, -1, -2)
    along = np.einsum("ja,ajk,ka->jk", toward, expected, toward)
    _, pose = np.unique(force.round(9), axis=0, return_inverse=True)
    mean = (pose == np.arange(pose.max() + 1)[:, None]) / np.bincount(pose)[:, None]
    return MICRO * float(np.sqrt(np.max(np.einsum("pj,jk,pk->p", mean, along, mean))))


def _norm(errors: Array, state: State, names: Array, noise: dict[str, float]) -> Reach:
    """Magnitude at the pose of the verification where it is least certain, with its noise."""
    along = MICRO * norm_errors(errors, design.of_axes(state.force, state.axes, -1))
    worst = along[int(np.argmax(np.sum(along**2, axis=-1)))]
    parts = {group: float(np.sqrt(np.sum(worst[names == group] ** 2))) for group in dict.fromkeys(names.tolist())}
    parts |= noise
    return Reach("verification_norm", "norm", "µg", _combined(parts), parts)


def unreachable(reaches: Sequence[Reach], limits: Limits, months: int) -> list[str]:
    """Why limits cannot be met, a sentence each: U of the references, or the error expected over the period, exceeds them.

    A unit whose U exceeds the limit is not decided, whatever its value is: every unit of the lot would be.
    """
    from pipelines.stages.uncertainty.tables import LABELS

    out: list[str] = []
    worst = {q: max((r for r in reaches if r.quantity == q), key=lambda r: r.u, default=None) for q in FIGURES}
    for quantity, (figure, factor) in FIGURES.items():
        reach = worst[quantity]
        needed = limits.figures[figure].max if figure in limits.figures else None
        if quantity == LARGEST_ERROR:
            needed = min((limit for limit in (needed, GRADES.get(limits.grade)) if limit is not None), default=None)
        if reach is None or needed is None:
            continue
        period = quantity == LARGEST_ERROR
        reached = factor * (reach.u if period else limits.coverage_factor * reach.u)
        if reached > needed:
            unit = limits.figures[figure].unit if figure in limits.figures else reach.unit
            what = f"expected over {months} months" if period else f"U (k = {limits.coverage_factor:g})"
            shares = [(name, share) for name, share in reach.shares.items() if share >= LEAST_SHARE][:3]
            rulers = ", ".join(f"{LABELS[name]} {100.0 * share:.0f} %" for name, share in shares)
            out.append(f"{figure}: limit {shown(needed)} {unit}, {what} {shown(reached)} {unit} ({rulers})")
    return out


def at_risk(reaches: Sequence[Reach], limits: Limits) -> list[str]:
    """The limit of a pose of verification that noise alone makes good units miss, a sentence; it can be met."""
    figure, reach = "verification_norm_ug", next((r for r in reaches if r.quantity == "verification_norm"), None)
    limit = limits.figures[figure].max if figure in limits.figures else None
    if reach is None or limit is None:
        return []
    expanded = limits.guard_factor * reach.u
    noise = reach.parts.get("noise", 0.0)
    if not 0.0 < limit - expanded < LEAST_MARGIN * noise:
        return []
    share, k = 2.0 * ndtr(-(limit - expanded) / noise), limits.coverage_factor
    text = (
        f"{figure}: limit {shown(limit)} µg, U (k = {k:g}) {shown(k * reach.u)} µg; by noise alone {100.0 * share:.0f} % of good "
        "units or more fail; add soaks, poses of the fit or repetitions of the verification"
    )
    return [text]


def shown(value: float) -> str:
    """A value with three digits, without an exponent."""
    return f"{float(f'{value:.3g}'):g}"
