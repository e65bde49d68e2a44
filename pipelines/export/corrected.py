"""A recording corrected with a calibration: specific force, its covariance, and the bias where the force is known."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.linalg import block_diag

from inertial import static_intervals
from inertial.arrays import Array, Flags
from inertial.correction import correct, output_covariance, remaining_step
from inertial.design import carried_over
from inertial.errors import MissingInput
from inertial.noise.bias_filter import BiasState, Track, track
from inertial.noise.gauss_markov import FlickerTerms, bias_model, flicker_of_steps
from inertial.noise.terms import LikelyTerms, likely_terms
from pipelines.archive import Run
from pipelines.export.polynomials import UnitCalibration, refuse_fewer_axes, unit_calibrations
from pipelines.export.recording import CorrectableRecording
from pipelines.export.unit_noise import UnitCurve, curve_of_unit, required_noise
from pipelines.importers.exchange import refuse_other_procedures
from pipelines.tables.calibration import read_calibration, symmetric
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.units import AXES, MICRO

PAIRS = ((0, 1), (0, 2), (1, 2))
CONVERGED_G = 1e-6
"""Largest further step of a correction that has converged, g."""
HIDDEN = float(np.sqrt(np.sqrt(2.0 / np.pi) / 1.96))
"""Expected B over its upper limit (95 %) where none shows: B² is a half of a normal distribution, mean √(2/π), limit 1.96 sd."""
LONGEST_STEPS = 200_000
GAP = 3.0
"""Multiple of the usual interval of samples above which an interval is a gap in the recording."""


@dataclass(frozen=True)
class FitOfUnit:
    """Coefficients of one unit.

    coefficients : (m, p); covariance : (mp, mp), x before y before z; budget : whether it includes the stated references
    curve : Allan deviation of its static record; None where there is none that noise terms explain
    """

    run: str
    exported: UnitCalibration
    effects: tuple[str, ...]
    coefficients: Array
    covariance: Array
    nonlinear: Mapping[str, Mapping[str, Any]]
    budget: bool
    curve: UnitCurve | None = None


@dataclass(frozen=True)
class KeptTrack:
    """A filter of the bias between two recordings: state, middle of its last step, s, and processes of flicker noise."""

    state: BiasState
    time_s: float
    flicker: FlickerTerms


@dataclass(frozen=True)
class Tracking:
    """Settings of the tracking of the bias.

    force : (3,), g, of all samples, whatever the recording states; None: as it states
    magnitude : g, of the force on a unit at rest; None: the recording is not searched for rest
    turn_on_ug : standard deviation of the bias from one switch-on to the next
    step_s : time between updates
    begin : the filter of an earlier recording, to go on with; None: the unit was switched on
    """

    force: Array | None
    magnitude: float | None
    turn_on_ug: float
    step_s: float = 1.0
    begin: KeptTrack | None = None


@dataclass(frozen=True)
class Corrected:
    """A corrected recording.

    force : (n, 3), g, zero across the axes
    covariance : (n, m, m), g², of the calibration; with a track also of the bias and of noise
    track : of the steps, and of the samples after the last whole step as one step without update
    at_limits : the track with upper limits (95 %) of the terms that the static record does not identify; None where it goes on
    kept : the state from which the next recording continues · white : (3,), g/√Hz, of the samples
    bias, bias_covariance : at the samples; None without tracking
    outside : samples beyond the temperatures that were measured
    """

    force: Array
    covariance: Array
    outside: int
    track: Track | None = None
    bias: Array | None = None
    bias_covariance: Array | None = None
    updated: Flags | None = None
    at_limits: Track | None = None
    kept: KeptTrack | None = None
    white: Array | None = None


def fit_of_unit(run: Run, unit: str, *, failed: bool, revoked: bool) -> FitOfUnit:
    """The fitted coefficients of one unit; as in an export, a unit that failed or was revoked is refused.

    Parameters
    ----------
    unit : serial number; may be empty where the run has a single unit
    """
    refuse_other_procedures(run, "coefficients")
    missing = [name for name in ("coefficients", "covariance") if name not in run.tables()]
    if missing:
        again = "repeat its 'tumbleline run'" if run.about.get("capture") else f"fit it with 'tumbleline fit {run.id}'"
        raise WrongUse(f"run {run.id}: it has no {' and no '.join(missing)}, a fitted run is needed; {again}")
    calibration = read_calibration(run.table("coefficients"), run.table("covariance"))
    if not unit and len(calibration.units) > 1:
        raise WrongUse(
            f"RUN:UNIT: run {run.id} has {len(calibration.units)} units, one is needed as RUN:UNIT; "
            f"{did_you_mean('', calibration.units)}"
        )
    serial = unit or next(iter(calibration.units))
    exported = unit_calibrations(run, (serial,), failed=failed, revoked=revoked)[0]
    u = calibration.units.index(serial)
    p = calibration.coefficients.shape[-1]
    covariance: Array = np.asarray(block_diag(*list(calibration.covariance[u])), dtype=np.float64)
    budget = _budget(run, serial, len(calibration.axes) * p)
    return FitOfUnit(
        run.id,
        exported,
        calibration.effects,
        calibration.coefficients[u],
        covariance if budget is None else budget,
        carried_over(calibration.nonlinear),
        budget is not None,
        curve_of_unit(run, serial),
    )


def _budget(run: Run, unit: str, size: int) -> Array | None:
    """Covariance of the coefficients by the uncertainty budget; None where no references are stated."""
    if "budget_covariance" not in run.tables():
        return None
    rows = run.table("budget_covariance")
    rows = rows[rows["unit"] == unit]
    if len(rows) != size * (size + 1) // 2:
        return None
    matrix = np.zeros((size, size))
    row, column, value = (rows[name].to_numpy() for name in ("row", "column", "value"))
    matrix[row, column] = value
    return symmetric(matrix)


def corrected(recording: CorrectableRecording, fit: FitOfUnit, tracking: Tracking | None) -> Corrected:
    """The specific force of a recording, its covariance and, where ``tracking`` is given, the bias.

    Raises
    ------
    DataRejected
        The model needs a quantity that the recording does not have, or the force is known nowhere.
    """
    model = (fit.effects, recording.state)
    with np.errstate(over="ignore", invalid="ignore"):  # a sample without a solution is refused below
        try:
            force = correct(*model, recording.output, fit.coefficients, fit.nonlinear)
        except MissingInput as problem:
            raise DataRejected(
                f"{recording.name}: no column {problem.quantity}, which {problem.effect} of run {fit.run} needs; give the column "
                f"that has it this name (further columns: {', '.join(map(shown, recording.state.covariates)) or 'none'})"
            ) from None
        step = remaining_step(*model, recording.output, fit.coefficients, fit.nonlinear, force)
    unsolved = ~(np.max(np.abs(step), axis=-1) < CONVERGED_G)  # a nan is not converged
    if unsolved.any():
        raise DataRejected(
            f"{recording.name}: {int(unsolved.sum())} samples have no force that explains them (first: sample "
            f"{int(np.argmax(unsolved))}), output within the range of the calibration is needed; leave these samples out"
        )
    covariance = output_covariance(
        fit.effects, replace(recording.state, force=force, memory={}), fit.coefficients, fit.nonlinear, fit.covariance
    )
    temperature = recording.state.temperature
    low, high = fit.exported.temperatures
    outside = 0 if temperature is None else int(np.sum((temperature < low - 0.5) | (temperature > high + 0.5)))
    plain = Corrected(force, covariance, outside)
    if tracking is not None:
        refuse_fewer_axes([fit.exported], "correct: --track")
    return plain if tracking is None else _tracked(recording, fit, tracking, plain)


def _tracked(recording: CorrectableRecording, fit: FitOfUnit, tracking: Tracking, plain: Corrected) -> Corrected:
    time, rate, gap = recording.time, *rate_and_gaps(recording.time)
    per = max(1, round(tracking.step_s * rate))
    steps = len(time) // per
    if not 2 <= steps <= LONGEST_STEPS:
        raise DataRejected(
            f"{recording.name}: {steps} steps of {tracking.step_s:g} s, 2 to {LONGEST_STEPS} are needed to track the bias; "
            "change the step with --set step=S"
        )
    middle, force = (_means(values, per) for values in (time, plain.force))
    known, magnitude = _references(recording, tracking, plain.force, per, rate)
    gap[::per] = False  # between two steps the filter lets the time pass
    torn = _means(gap.astype(np.float64), per) > 0.0  # such a step is no mean over its length
    known[torn], magnitude[torn] = np.nan, np.nan
    if not (np.all(np.isfinite(known), axis=1) | np.isfinite(magnitude)).any():
        raise DataRejected(
            f"{recording.name}: the force is known nowhere and the unit is never at rest, one of them is needed to track the "
            "bias; give --track X,Y,Z, columns force_x, force_y, force_z, or record the unit at rest"
        )
    if len(time) % per:  # the samples after the last whole step are too few for an update: time passes in the filter
        middle = np.append(middle, time[-1])
        force, known = (np.vstack([values, np.full((1, 3), np.nan)]) for values in (force, known))
        magnitude = np.append(magnitude, np.nan)
    begin = tracking.begin
    if begin is not None and not time[0] > begin.time_s:
        raise DataRejected(
            f"{recording.name}: it begins at {time[0]:g} s, the state was kept at {begin.time_s:g} s; a recording that goes on "
            "after it is needed, or no --state"
        )
    flicker = steps_flicker(per / rate, float(time[-1] - time[0])) if begin is None else begin.flicker
    terms, limits = terms_of_unit(fit)
    tracks = [
        track(
            bias_model(noise.white, noise.instability, noise.walk, tracking.turn_on_ug / MICRO, flicker),
            middle, force, known, magnitude, per / rate, None if begin is None else (begin.state, begin.time_s),
        )
        for noise in ((terms, limits) if begin is None else (terms,))
    ]  # fmt: skip
    bias_track, at_limits = tracks[0], tracks[1] if begin is None else None
    last = np.arange(len(time)) // per
    bias, bias_covariance = bias_track.expected[last], bias_track.expected_covariance[last]
    covariance = plain.covariance + bias_covariance + np.diag(_within_a_step(terms, per, rate))
    return replace(
        plain, force=plain.force - bias, covariance=covariance, track=bias_track, bias=bias, bias_covariance=bias_covariance,
        updated=bias_track.updated[last], at_limits=at_limits, white=terms.white,
        kept=KeptTrack(bias_track.end, float(middle[-1]), flicker),
    )  # fmt: skip


def steps_flicker(step_s: float, lasting_s: float) -> FlickerTerms:
    """Processes of flicker noise for steps, over the length of a recording and a thousand steps at least."""
    return flicker_of_steps(step_s, max(1000.0 * step_s, lasting_s))


def terms_of_unit(
    fit: FitOfUnit, what: str = "tracking the bias", without: str = ""
) -> tuple[LikelyTerms, LikelyTerms]:
    """The likeliest terms of a unit's noise in g, and their upper limits where its static record does not identify them.

    Parameters
    ----------
    what : needs them, for messages; without : what does without them

    Raises
    ------
    WrongUse, DataRejected
        The run has no static record, or B of the unit is not known.
    """
    noise = required_noise(fit.exported.noise, fit.exported.unit, fit.run, what, without)
    if not np.all(np.isfinite(noise.value["B"])):
        raise DataRejected(
            f"run {fit.run}: B of unit {fit.exported.unit} is not known; record the unit at rest for longer"
        )
    limits = LikelyTerms(*(noise.value[symbol] / MICRO for symbol in ("N", "B", "K")))
    return (limits if fit.curve is None else _likely(fit.curve, limits, noise.identified["B"])), limits


def _likely(curve: UnitCurve, limits: LikelyTerms, identified: Flags) -> LikelyTerms:
    """The likeliest terms in g; where white noise hides B, what is to be expected below its limit, as no bias is constant."""
    likely = likely_terms(curve.deviation / MICRO, curve.m, curve.n, curve.rate_hz)
    return replace(likely, instability=np.where(identified, likely.instability, HIDDEN * limits.instability))


def _within_a_step(terms: LikelyTerms, per: int, rate: float) -> Array:
    """Variance (3,), g², of a sample about the mean of its step of ``per`` samples: N²·rate + B²·ln(per)/π + K²·Δt/6.

    The flicker term is the variance of 1/f noise with the Allan variance 2 ln2/π·B² in a record of ``per`` samples: D. W. Allan,
    Proc. IEEE 54 (1966) 221; NIST SP 1065, B₁ = N·ln N/(2(N − 1)·ln 2). It does not depend on what the filter knows.
    """
    return terms.white**2 * rate + terms.instability**2 * np.log(per) / np.pi + terms.walk**2 * per / rate / 6.0


def rate_and_gaps(time: Array) -> tuple[float, Flags]:
    """Rate of the samples, Hz, and which samples (n,) follow a gap: over the whole time, a gap would count as a lower rate."""
    step = np.diff(time)
    usual = step <= GAP * np.median(step)
    return float(usual.sum() / step[usual].sum()), np.concatenate([[False], ~usual])


def _references(
    recording: CorrectableRecording, tracking: Tracking, force: Array, per: int, rate: float
) -> tuple[Array, Array]:
    """True force (m, 3) and its magnitude (m,) at the steps, g; NaN where they are not known."""
    known = recording.known if tracking.force is None else np.broadcast_to(tracking.force, (len(force), 3))
    stated = _means(known, per)  # a step with a sample of unknown force is unknown
    magnitude = np.full(len(stated), np.nan)
    if tracking.magnitude is not None:
        rest = np.zeros(len(force))
        intervals = static_intervals.find(force, rate)
        for start, stop in zip(intervals.start, intervals.stop, strict=True):
            rest[start:stop] = 1.0
        magnitude[_means(rest, per) == 1.0] = tracking.magnitude
    return stated, magnitude


def _means(values: Array, per: int) -> Array:
    """Means of ``per`` samples each, (n // per, …)."""
    steps = len(values) // per
    return values[: steps * per].reshape(steps, per, *values.shape[1:]).mean(axis=1)


def table_of(recording: CorrectableRecording, done: Corrected) -> pd.DataFrame:
    """One row per sample: time, force in g, standard uncertainties and covariances, and the bias where it is tracked, in µg."""
    columns: dict[str, Array] = {"time_s": recording.time}
    axes = recording.state.axes
    columns |= {f"force_{AXES[axis]}_g": done.force[:, axis] for axis in axes}
    sd = np.sqrt(np.maximum(np.diagonal(done.covariance, axis1=1, axis2=2), 0.0))
    columns |= {f"u_{AXES[axis]}_ug": MICRO * sd[:, k] for k, axis in enumerate(axes)}
    columns |= {f"cov_{AXES[i]}{AXES[j]}_ug2": MICRO**2 * done.covariance[:, i, j] for i, j in PAIRS if j < len(axes)}
    if done.bias is not None and done.bias_covariance is not None and done.updated is not None:
        bias_sd = np.sqrt(np.diagonal(done.bias_covariance, axis1=1, axis2=2))
        columns |= {f"bias_{axis}_ug": MICRO * done.bias[:, i] for i, axis in enumerate(AXES)}
        columns |= {f"u_bias_{axis}_ug": MICRO * bias_sd[:, i] for i, axis in enumerate(AXES)}
        columns["updated"] = done.updated.astype(np.float64)
    return pd.DataFrame(columns)
