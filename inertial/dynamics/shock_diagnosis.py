"""Shocks, the unit's waveforms against the reference's: the fit of a sensitivity and effects, adequacy, and missing effects."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from inertial.arrays import Array, Flags
from inertial.dynamics.missing_effects import FOLDS, Judged, breakers_of, judge
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.transfer_effects.base import Coordinates, Parameter
from inertial.errors import NotIdentified

DEFAULT = ("delay",)
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


def fit_shock(record: ShockRecord, effects: Sequence[str], rows: Sequence[Flags] | None = None) -> ShockFit:
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
    used = [np.ones(len(shock.unit), dtype=bool) for shock in record.shocks] if rows is None else list(rows)
    count = sum(int(rows.sum()) for rows in used)
    if count < len(effects) + len(parameters) + 2:
        raise NotIdentified(
            f"shock: {count} samples for {len(effects) + len(parameters) + 1} parameters; record faster"
        )
    counted = np.concatenate(used)
    target = np.concatenate([shock.unit / shock.error for shock in record.shocks])[counted]
    model = Design(record, effects, parameters)
    coordinates = model.coordinates

    def design(x: Array) -> Array:
        return model.at(x)[counted]

    def solved(x: Array) -> tuple[Array, Array]:
        columns = design(x)
        size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        c = np.linalg.lstsq(columns / size, target, rcond=1e-12)[0] / size
        return c, columns @ c - target

    x = _search([p for _, p in parameters], coordinates, lambda y: solved(y)[1])
    c, left = solved(x)
    errors = _errors(design, x, c)
    added = [name for name in effects if EFFECTS[name].added(record.shocks[0].reference, record.rate_hz) is not None]
    values = coordinates.values(x)
    spread = np.where(coordinates.log, values * errors[len(c) :], errors[len(c) :])
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


class Design:
    """Weighted design of all samples of all shocks, for values of the nonlinear parameters.

    A waveform passes the effects in their order: a change of one parameter changes it only from the effect of that parameter on,
    and what is before it is kept.
    """

    def __init__(
        self, record: ShockRecord, effects: Sequence[str], parameters: Sequence[tuple[str, Parameter]]
    ) -> None:
        self.record, self.effects = record, tuple(effects)
        self.coordinates = Coordinates([p for _, p in parameters])
        self._parameters_of = [np.array([of == name for of, _ in parameters], dtype=bool) for name in self.effects]
        extra = [
            [EFFECTS[name].added(shock.reference, record.rate_hz) for name in self.effects] for shock in record.shocks
        ]
        self._added = [[column for column in each if column is not None] for each in extra]
        self._waves: dict[tuple[object, ...], Array] = {}

    def at(self, x: Array) -> Array:
        """The design (n of all shocks, 1 + added effects)."""
        values, parts = self.coordinates.values(x), list[Array]()
        if len(self._waves) > _KEPT:
            self._waves.clear()
        for number, (shock, added) in enumerate(zip(self.record.shocks, self._added, strict=True)):
            wave = self._passed(number, shock.reference, values)
            parts.append(np.column_stack([wave, *added]) / shock.error[:, None])
        return np.vstack(parts)

    def _passed(self, number: int, wave: Array, values: Array) -> Array:
        """The waveform of a shock's reference after all effects."""
        key: tuple[object, ...] = (number,)
        for name, chosen in zip(self.effects, self._parameters_of, strict=True):
            of_effect = values[chosen]
            key = (*key, name, *of_effect.tolist())
            if key not in self._waves:
                self._waves[key] = EFFECTS[name].changed(wave, self.record.rate_hz, of_effect)
            wave = self._waves[key]
        return wave


def _residuals(record: ShockRecord, design: Array, c: Array) -> list[Array]:
    """Residuals of all samples of every shock, g."""
    left, at = list[Array](), 0
    fitted = design @ c
    for shock in record.shocks:
        n = len(shock.unit)
        left.append(shock.unit - fitted[at : at + n] * shock.error)
        at += n
    return left


def _search(parameters: Sequence[Parameter], coordinates: Coordinates, residual: Callable[[Array], Array]) -> Array:
    """The coordinates of the nonlinear parameters of the best fit; an empty array where there are none."""
    if not parameters:
        return np.zeros(0)
    low, high = coordinates.low, coordinates.high
    starts = [np.clip(coordinates.of(np.array(start)), low, high) for start in product(*(p.starts for p in parameters))]
    best = sorted(starts, key=lambda x: float(np.sum(residual(x) ** 2)))[:2]
    scale = np.where(coordinates.log, 1.0, high - low)
    done = [
        least_squares(residual, x, bounds=(low, high), x_scale=scale, max_nfev=60, xtol=1e-9, ftol=1e-9) for x in best
    ]
    return np.asarray(min(done, key=lambda fit: fit.cost).x)


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


def residual_percent(record: ShockRecord, left: Sequence[Array]) -> float:
    """Rms residual of the shocks, in % of the peak of each."""
    squares = [
        np.mean(series**2) / np.max(np.abs(shock.unit)) ** 2 for series, shock in zip(left, record.shocks, strict=True)
    ]
    return float(100.0 * np.sqrt(np.mean(squares)))


@dataclass(frozen=True)
class ShockDiagnosis(Judged[ShockFit]):
    """The verdict on a shock comparison.

    where : the part of the record with the largest share of χ², and the share
    error_percent, extended_percent : rms residual, of the peak
    next_steps : the measurements that separate the effects of the classes
    """

    where: tuple[str, float]
    error_percent: float
    extended_percent: float
    next_steps: tuple[str, ...]


def diagnose_shock(record: ShockRecord, effects: Sequence[str] = DEFAULT) -> ShockDiagnosis:
    """The verdict on a comparison with ``effects``, with the classes of effects that make it adequate."""
    judged = judge(
        fit_shock(record, effects),
        effects,
        list(EFFECTS),
        lambda more, _: fit_shock(record, more),
        lambda fit: _left_out(record, fit.effects),
        remedy="record faster",
    )
    return ShockDiagnosis(
        **vars(judged),
        where=_where(record, judged.fit),
        error_percent=residual_percent(record, judged.fit.residuals),
        extended_percent=residual_percent(record, judged.extended.residuals),
        next_steps=breakers_of(judged.classes, EFFECTS),
    )


def _where(record: ShockRecord, fit: ShockFit) -> tuple[str, float]:
    total = np.zeros(3)
    for shock, left in zip(record.shocks, fit.residuals, strict=True):
        time = np.arange(len(left)) / record.rate_hz
        square = (left / shock.error) ** 2
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
        out = [np.arange(len(shock.unit)) % FOLDS == fold for shock in record.shocks]
        fit = fit_shock(record, effects, [~rows for rows in out])
        for shock, left, rows in zip(record.shocks, fit.residuals, out, strict=True):
            total += float(np.sum((left[rows] / shock.error[rows]) ** 2))
            count += int(rows.sum())
    return float(np.sqrt(total / count))
