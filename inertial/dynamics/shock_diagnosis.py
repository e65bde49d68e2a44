"""Diagnosis of a shock comparison, the unit's waveform against the reference's: adequacy and missing effects."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from inertial.counts import degrees_of_freedom
from inertial.dynamics import goodness
from inertial.dynamics.missing_effects import breakers_of, missing_classes
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.transfer_diagnosis import FEWEST_DOF
from inertial.errors import NotIdentified

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from inertial.dynamics.transfer_diagnosis import EffectClass
    from inertial.dynamics.transfer_effects.base import Parameter

Array = NDArray[np.float64]
DEFAULT = ("delay",)
FOLDS = 5
PARTS = ("before the pulse", "the pulse", "after the pulse")

_KEPT = 200
"""Largest number of waveforms that a design keeps."""


@dataclass(frozen=True)
class Waves:
    """The waveforms of one shock on a common time base, without the baseline before the pulse.

    reference, unit : (n,), g · error : (n,), standard uncertainty of the difference, g
    """

    reference: Array
    unit: Array
    error: Array


@dataclass(frozen=True)
class ShockRecord:
    """Shocks of one unit: rate of the waveforms, Hz, duration of the pulse, s, and time from the first sample to it, s."""

    rate_hz: float
    duration_s: float
    before_s: float
    shocks: tuple[Waves, ...]


@dataclass(frozen=True)
class ShockFit:
    """A fitted comparison.

    sensitivity, sensitivity_error : unit over reference · coefficients : value and standard uncertainty by effect (added effects)
    parameters : value and standard uncertainty by name, errors in the unit of the value
    residuals : of each shock, (n,), g
    """

    effects: tuple[str, ...]
    sensitivity: float
    sensitivity_error: float
    coefficients: Mapping[str, tuple[float, float]]
    parameters: Mapping[str, tuple[float, float]]
    residuals: tuple[Array, ...]
    chi_square: float
    dof: int


@dataclass(frozen=True)
class ShockDiagnosis:
    """The verdict on a shock comparison; see :class:`inertial.dynamics.centrifuge_diagnosis.SpinDiagnosis` for the fields.

    where : the part of the record with the largest share of χ², and the share
    error_percent, extended_percent : rms residual, of the peak
    """

    adequate: bool | None
    reason: str
    fit: ShockFit
    extended: ShockFit
    classes: tuple[EffectClass, ...]
    unexplained: bool
    where: tuple[str, float]
    error_percent: float
    extended_percent: float
    left_out: tuple[float, float]
    next_steps: tuple[str, ...]


def fit_shock(record: ShockRecord, effects: Sequence[str], rows: Sequence[NDArray[np.bool_]] | None = None) -> ShockFit:
    """Least squares of sensitivity and effects over all shocks; nonlinear parameters from several starts.

    Parameters
    ----------
    rows : of each shock, the samples that count; all where None

    Raises
    ------
    NotIdentified
        There are fewer samples than parameters.
    """
    duration = record.duration_s
    parameters = [(name, p) for name in effects for p in EFFECTS[name].parameters(duration)]
    used = [np.ones(len(one.unit), dtype=bool) for one in record.shocks] if rows is None else list(rows)
    count = sum(int(one.sum()) for one in used)
    if count < len(effects) + len(parameters) + 2:
        msg = f"shock: {count} samples for {len(effects) + len(parameters) + 1} parameters; record faster"
        raise NotIdentified(msg)
    whole = np.concatenate(used)
    target = np.concatenate([one.unit / one.error for one in record.shocks])[whole]
    model = Design(record, effects, parameters)

    def design(x: Array) -> Array:
        return model.at(x)[whole]

    def solved(x: Array) -> tuple[Array, Array]:
        columns = design(x)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        c = np.linalg.lstsq(columns / size, target, rcond=1e-12)[0] / size
        return c, columns @ c - target

    x = _search(parameters, lambda y: solved(y)[1])
    c, left = solved(x)
    errors = _errors(design, x, c)
    added = [name for name in effects if EFFECTS[name].added(record.shocks[0].reference, record.rate_hz) is not None]
    values = _values(parameters, x)
    log = np.array([p.log for _, p in parameters], dtype=bool)
    spread = np.where(log, values * errors[len(c) :], errors[len(c) :]) if parameters else np.zeros(0)
    return ShockFit(
        tuple(effects),
        float(c[0]),
        float(errors[0]),
        {name: (float(c[k + 1]), float(errors[k + 1])) for k, name in enumerate(added)},
        {p.name: (float(v), float(u)) for (_, p), v, u in zip(parameters, values, spread, strict=True)},
        tuple(_residuals(record, model.at(x), c)),
        float(left @ left),
        count - len(c) - len(x),
    )


def diagnose_shock(record: ShockRecord, effects: Sequence[str] = DEFAULT) -> ShockDiagnosis:
    """The verdict on a comparison with ``effects``, with the classes of effects that make it adequate."""
    base = fit_shock(record, effects)
    if base.dof < FEWEST_DOF:
        reason = f"{degrees_of_freedom(base.dof)}, at least {FEWEST_DOF} are needed; record faster"
        return _verdict(record, base, base, None, reason, ())
    if goodness.adequate(base):
        return _verdict(record, base, base, True, "", ())
    classes, best = missing_classes(base, list(effects), list(EFFECTS), lambda names: fit_shock(record, names))
    return _verdict(record, base, best, False, "", classes)


def predicted(record: ShockRecord, fit: ShockFit) -> float:
    """Rms residual of shocks that were not fitted, in % of the peak: sensitivity and effects applied to the reference."""
    parameters = [(name, p) for name in fit.effects for p in EFFECTS[name].parameters(record.duration_s)]
    x = np.array([np.log(fit.parameters[p.name][0]) if p.log else fit.parameters[p.name][0] for _, p in parameters])
    c = np.array([fit.sensitivity, *(value for value, _ in fit.coefficients.values())])
    left = _residuals(record, Design(record, fit.effects, parameters).at(x), c)
    return _percent(record, left)


class Design:
    """Weighted design of all samples of all shocks, for values of the nonlinear parameters.

    A waveform passes the effects in their order: a change of one parameter changes it only from the effect of that parameter on,
    and what is before it is kept.
    """

    def __init__(
        self, record: ShockRecord, effects: Sequence[str], parameters: Sequence[tuple[str, Parameter]]
    ) -> None:
        self.record, self.effects, self.parameters = record, tuple(effects), tuple(parameters)
        self._own = [np.array([of == name for of, _ in self.parameters], dtype=bool) for name in self.effects]
        extra = [[EFFECTS[name].added(one.reference, record.rate_hz) for name in self.effects] for one in record.shocks]
        self._added = [[column for column in each if column is not None] for each in extra]
        self._waves: dict[tuple[object, ...], Array] = {}

    def at(self, x: Array) -> Array:
        """The design (n of all shocks, 1 + added effects)."""
        values, parts = _values(self.parameters, x), list[Array]()
        if len(self._waves) > _KEPT:
            self._waves.clear()
        for place, (one, added) in enumerate(zip(self.record.shocks, self._added, strict=True)):
            wave = self._passed(place, one.reference, values)
            parts.append(np.column_stack([wave, *added]) / one.error[:, None])
        return np.vstack(parts)

    def _passed(self, place: int, wave: Array, values: Array) -> Array:
        """The waveform of a shock's reference after all effects."""
        key: tuple[object, ...] = (place,)
        for name, own in zip(self.effects, self._own, strict=True):
            mine = values[own] if len(values) else values
            key = (*key, name, *mine.tolist())
            if key not in self._waves:
                self._waves[key] = EFFECTS[name].changed(wave, self.record.rate_hz, mine)
            wave = self._waves[key]
        return wave


def _residuals(record: ShockRecord, design: Array, c: Array) -> list[Array]:
    """Residuals of all samples of every shock, g."""
    left, at = list[Array](), 0
    fitted = design @ c
    for one in record.shocks:
        n = len(one.unit)
        left.append(one.unit - fitted[at : at + n] * one.error)
        at += n
    return left


def _values(parameters: Sequence[tuple[str, Parameter]], x: Array) -> Array:
    log = np.array([p.log for _, p in parameters], dtype=bool)
    return np.where(log, np.exp(np.where(log, x, 0.0)), x) if len(x) else x


def _search(parameters: Sequence[tuple[str, Parameter]], residual: Callable[[Array], Array]) -> Array:
    """The nonlinear parameters of the best fit; an empty array where there are none."""
    if not parameters:
        return np.zeros(0)
    scaled = [[float(np.log(v)) if p.log else v for v in p.starts] for _, p in parameters]
    low = np.array([np.log(p.low) if p.log else p.low for _, p in parameters])
    high = np.array([np.log(p.high) if p.log else p.high for _, p in parameters])
    starts = [np.clip(np.array(one), low, high) for one in product(*scaled)]
    best = sorted(starts, key=lambda x: float(np.sum(residual(x) ** 2)))[:2]
    scale = np.where([p.log for _, p in parameters], 1.0, high - low)
    done = [
        least_squares(residual, x, bounds=(low, high), x_scale=scale, max_nfev=60, xtol=1e-9, ftol=1e-9) for x in best
    ]
    return np.asarray(min(done, key=lambda one: one.cost).x)


def _errors(design: Callable[[Array], Array], x: Array, c: Array) -> Array:
    """Standard uncertainties of the linear coefficients and then of the nonlinear parameters, from the whole Jacobian."""
    rows = design(x)
    slopes: list[Array] = []
    for k in range(len(x)):
        step = np.zeros(len(x))
        step[k] = 1e-5 * max(1.0, abs(x[k])) if abs(x[k]) > 1e-2 else 1e-7
        slopes.append((design(x + step) - design(x - step)) @ c / (2.0 * step[k]))
    jacobian = np.column_stack([rows, *slopes])
    size = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    return np.sqrt(np.maximum(np.diag(np.linalg.pinv((jacobian / size).T @ (jacobian / size))), 0.0)) / size


def _verdict(
    record: ShockRecord,
    base: ShockFit,
    best: ShockFit,
    adequate: bool | None,  # noqa: FBT001 - a verdict, not a switch
    reason: str,
    classes: tuple[EffectClass, ...],
) -> ShockDiagnosis:
    left = _left_out(record, base.effects), (_left_out(record, best.effects) if classes else np.nan)
    return ShockDiagnosis(
        adequate,
        reason,
        base,
        best,
        classes,
        adequate is False and not goodness.adequate(best),
        _where(record, base),
        _percent(record, list(base.residuals)),
        _percent(record, list(best.residuals)),
        (left[0], left[1] if classes else left[0]),
        breakers_of(classes, EFFECTS),
    )


def _percent(record: ShockRecord, left: Sequence[Array]) -> float:
    squares = [
        np.mean(one**2) / np.max(np.abs(shock.unit)) ** 2 for one, shock in zip(left, record.shocks, strict=True)
    ]
    return float(100.0 * np.sqrt(np.mean(squares)))


def _where(record: ShockRecord, fit: ShockFit) -> tuple[str, float]:
    total = np.zeros(3)
    for one, left in zip(record.shocks, fit.residuals, strict=True):
        time = np.arange(len(left)) / record.rate_hz
        square = (left / one.error) ** 2
        end = record.before_s + record.duration_s
        total += [
            square[time < record.before_s].sum(),
            square[(time >= record.before_s) & (time < end)].sum(),
            square[time >= end].sum(),
        ]
    k = int(np.argmax(total))
    return PARTS[k], float(total[k] / max(total.sum(), 1e-300))


def _left_out(record: ShockRecord, effects: Sequence[str]) -> float:
    """Rms weighted residual of samples that were not fitted, every fifth left out in turn."""
    total, count = 0.0, 0
    for fold in range(FOLDS):
        out = [np.arange(len(one.unit)) % FOLDS == fold for one in record.shocks]
        fit = fit_shock(record, effects, [~one for one in out])
        for one, left, rows in zip(record.shocks, fit.residuals, out, strict=True):
            total += float(np.sum((left[rows] / one.error[rows]) ** 2))
            count += int(rows.sum())
    return float(np.sqrt(total / count))
