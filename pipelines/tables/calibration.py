"""Conversion of a fitted calibration to tables and back; fit writes the tables; verify, noise, grade and export read them."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from inertial import design, effects
from inertial.design import Values
from inertial.effects import SensorEffect, StationEffect
from inertial.fits.linear import LotFit, own_terms, response_matrix
from inertial.state import ALL_AXES, State
from pipelines.tables.frames import picked
from schemas.errors import DataRejected
from schemas.units import AXES

EVERY_AXIS = "*"
PROBE_T_C = 31.0


@dataclass(frozen=True)
class Calibration:
    """Coefficients of a lot.

    coefficients : (units, 3, p), output unit per unit of the column; covariance : (units, 3, p, p)
    nonlinear : values by effect id, one or one per axis; shared : (q,), parameters of the station
    """

    units: tuple[str, ...]
    effects: tuple[str, ...]
    coefficients: NDArray[np.float64]
    covariance: NDArray[np.float64]
    nonlinear: dict[str, dict[str, Any]]
    shared: NDArray[np.float64]
    axes: tuple[int, ...] = ALL_AXES

    @cached_property
    def names(self) -> tuple[tuple[tuple[str, str], ...], ...]:
        """Per axis, (effect id, coefficient) of the p columns."""
        return column_names(self.effects, self.nonlinear, self.axes)

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the axes with an output, in order."""
        return tuple(AXES[axis] for axis in self.axes)

    @cached_property
    def response(self) -> NDArray[np.float64]:
        """The matrix K of each unit, (units, 3, 3), output per g."""
        return response_matrix(self.coefficients, self.names, self.axes)

    @cached_property
    def scale(self) -> NDArray[np.float64]:
        """Response of each of the m axes to the force along itself, (units, m), output per g."""
        return own_terms(design.of_axes(self.response, self.axes, -2), self.axes)

    def value(self, effect: str) -> NDArray[np.float64]:
        """Coefficients of one effect, (units, 3, columns of the effect)."""
        return self._of(effect, self.coefficients)

    def standard_error(self, effect: str) -> NDArray[np.float64]:
        """Standard errors of one effect's coefficients, (units, 3, columns of the effect)."""
        return self._of(effect, np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1)))

    def _of(self, effect: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """The columns of one effect, of values (units, 3, p)."""
        by_axis = [[column for column, (name, _) in enumerate(names) if name == effect] for names in self.names]
        return np.stack([values[:, axis, columns] for axis, columns in enumerate(by_axis)], axis=1)


def column_names(
    model: Sequence[str], values: Values | None = None, axes: tuple[int, ...] = ALL_AXES
) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Per axis, (effect id, coefficient) of a model's columns; all possible columns without values."""
    sensor, _ = design.split(model)
    if values:
        return tuple(design.local_names(sensor, axis, values) for axis in axes)
    return _all_names(tuple(sensor), axes)


@lru_cache(maxsize=64)
def _all_names(sensor: tuple[SensorEffect, ...], axes: tuple[int, ...]) -> tuple[tuple[tuple[str, str], ...], ...]:
    """Per axis, all columns that effects may have; cached, since many lots share a model."""
    return tuple(design.local_names(sensor, axis) for axis in axes)


def coefficient_rows(
    units: Sequence[str],
    fit: LotFit,
    covariance: NDArray[np.float64],
    out_unit: str,
    nonlinear_error: Mapping[str, Mapping[str, float]],
) -> pd.DataFrame:
    """The long table of coefficients: one row per unit, axis and coefficient; values for all axes have axis ``*``."""
    errors = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    common = _common_rows(fit, nonlinear_error)
    texts = {effect.id: unit_texts(effect, out_unit) for effect in design.split(fit.effects)[0]}
    local = [(AXES[k], *row) for k, names in zip(fit.axes, fit.names, strict=True) for row in _with_units(names, texts)]
    axis, effect, name, text = zip(
        *local, *((row.axis, row.effect, row.name, row.unit_text) for row in common), strict=True
    )
    u, k = (index.ravel() for index in np.indices((len(units), len(axis))))
    return pd.DataFrame(
        {
            "unit": picked(units, u),
            "axis": picked(axis, k),
            "effect": picked(effect, k),
            "name": picked(name, k),
            "value": _beside(fit.coefficients, [row.value for row in common]),
            "standard_error": _beside(errors, [row.standard_error for row in common]),
            "unit_text": picked(text, k),
        }
    )


class _Row(NamedTuple):
    """A coefficient that all units share."""

    axis: str
    effect: str
    name: str
    value: float
    standard_error: float
    unit_text: str


def _with_units(names: Sequence[tuple[str, str]], texts: Mapping[str, Sequence[str]]) -> Iterator[tuple[str, str, str]]:
    """Effect, name and unit of every column of an axis."""
    for effect, columns in groupby(names, key=lambda pair: pair[0]):
        of_effect = [name for _, name in columns]
        yield from ((effect, name, text) for name, text in zip(of_effect, texts[effect][: len(of_effect)], strict=True))


def _beside(local: NDArray[np.float64], common: Sequence[float]) -> NDArray[np.float64]:
    """Values of every unit, (units, 3, p), followed by the shared values, in one row."""
    flat = local.reshape(len(local), -1)
    return np.concatenate([flat, np.broadcast_to(np.array(common), (len(local), len(common)))], axis=1).ravel()


def _common_rows(fit: LotFit, nonlinear_error: Mapping[str, Mapping[str, float]]) -> list[_Row]:
    """Parameters of the station, nonlinear parameters and constants: a single value for all axes, or a value for each axis."""
    errors = np.sqrt(np.diagonal(fit.shared_covariance)) if fit.shared.size else np.zeros(0)
    rows = [
        _Row(EVERY_AXIS, effect, name, float(fit.shared[q]), float(errors[q]), "rad")
        for q, (effect, name) in enumerate(fit.shared_names)
    ]
    for effect, values in fit.nonlinear.items():
        known = {parameter.name: parameter.unit for parameter in effects.get(effect).nonlinear}
        for name, value in values.items():
            error, text = nonlinear_error.get(effect, {}).get(name, 0.0), known.get(name, "")
            by_axis = zip(AXES, value, strict=True) if isinstance(value, tuple) else ((EVERY_AXIS, value),)
            rows += [_Row(axis, effect, name, float(number), float(error), text) for axis, number in by_axis]
    return rows


def covariance_rows(
    units: Sequence[str], covariance: NDArray[np.float64], letters: Sequence[str] = AXES
) -> pd.DataFrame:
    """The covariance (units, 3, p, p) as a long table of its lower triangles."""
    p = covariance.shape[-1]
    row, column = np.tril_indices(p)
    u, a, k = np.meshgrid(np.arange(len(units)), np.arange(len(letters)), np.arange(row.size), indexing="ij")
    return pd.DataFrame(
        {
            "unit": picked(units, u.ravel()),
            "axis": picked(letters, a.ravel()),
            "row": row[k.ravel()],
            "column": column[k.ravel()],
            "value": covariance[:, :, row, column].ravel(),
        }
    )


def read_calibration(coefficients: pd.DataFrame, covariance: pd.DataFrame) -> Calibration:
    """The calibration that :func:`coefficient_rows` and :func:`covariance_rows` wrote."""
    texts = {column: coefficients[column].to_numpy(dtype=object) for column in ("unit", "effect", "name")}
    units, model = (tuple(dict.fromkeys(texts[column].tolist())) for column in ("unit", "effect"))
    letters = coefficients["axis"].to_numpy(dtype=object)
    axes = tuple(axis for axis, letter in enumerate(AXES) if letter in letters)
    linear = {pair for axis in column_names(model) for pair in axis}
    pairs = zip(texts["effect"].tolist(), texts["name"].tolist(), strict=True)
    is_linear = np.array([pair in linear for pair in pairs], dtype=bool)
    common = np.flatnonzero((texts["unit"] == units[0]) & ~is_linear)
    shared, nonlinear = _read_shared(coefficients.iloc[common], model) if common.size else (np.zeros(0), {})
    p = len(column_names(model, nonlinear, axes)[0])
    local = coefficients["value"].to_numpy()[(letters != EVERY_AXIS) & is_linear]
    if len(local) != len(units) * len(axes) * p:
        raise DataRejected(
            f"coefficients: {len(local)} rows, the model needs {len(units) * len(axes) * p}; run the fit again"
        )
    matrix = np.zeros((len(units), len(axes), p, p))
    row, column = np.tril_indices(p)
    values = covariance["value"].to_numpy().reshape(len(units), len(axes), -1)
    matrix[:, :, row, column] = values
    matrix[:, :, column, row] = values
    return Calibration(units, model, local.reshape(len(units), len(axes), p), matrix, nonlinear, shared, axes)


def calibration_of(
    units: Sequence[str], fit: LotFit, coefficients: pd.DataFrame, covariance: pd.DataFrame
) -> Calibration:
    """The calibration of a fit, as :func:`read_calibration` reads it from the tables of the fit."""
    if fit.nonlinear or fit.shared.size:
        return read_calibration(coefficients, covariance)
    model = tuple(dict.fromkeys(effect for axis in fit.names for effect, _ in axis))
    values = np.array(fit.coefficients, dtype=np.float64, order="C")
    return Calibration(tuple(units), model, values, symmetric(fit.covariance), {}, np.zeros(0), fit.axes)


def symmetric(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric matrices (..., p, p) from the lower triangles of others, which is what tables hold."""
    row, column = np.tril_indices(matrix.shape[-1])
    out = np.empty(matrix.shape)
    out[..., row, column] = matrix[..., row, column]
    out[..., column, row] = matrix[..., row, column]
    return out


def _read_shared(common: pd.DataFrame, model: Sequence[str]) -> tuple[NDArray[np.float64], dict[str, dict[str, Any]]]:
    """Parameters of the station, and nonlinear parameters: a tuple where each axis has its own."""
    shared: list[float] = []
    nonlinear: dict[str, dict[str, Any]] = {}
    for name in model:
        effect = effects.get(name)
        station = effect.names() if isinstance(effect, StationEffect) else ()
        for row in common[common["effect"] == name].itertuples():
            value, parameters = float(row.value), nonlinear.setdefault(name, {})  # pyright: ignore[reportArgumentType]
            if row.name in station:
                shared.append(value)
            else:
                parameters[str(row.name)] = (
                    value if row.axis == EVERY_AXIS else (*parameters.get(str(row.name), ()), value)
                )
    return np.array(shared), {name: values for name, values in nonlinear.items() if values}


@lru_cache(maxsize=256)
def unit_texts(effect: SensorEffect, out_unit: str) -> tuple[str, ...]:
    """Units of an effect's coefficients, derived from the scaling of its columns with force and temperature.

    A column that doubles with the force is per g, one that doubles with θ is per K, and so on; a column that scales
    with neither has the output's unit per unit of the column.
    """
    force = np.array([[0.31, 0.52, 0.79], [0.44, -0.67, 0.59]])
    zeros = np.zeros(2)

    def columns(factor_force: float, factor_theta: float) -> NDArray[np.float64]:
        warm = np.full(2, 25.0 + factor_theta * (PROBE_T_C - 25.0))
        state = State(
            force=factor_force * force, time=zeros, temperature=warm, chamber=warm, since_power=zeros + 600.0,
            since_move=zeros + 2.0, supply=zeros + 3.3, vibration=zeros + 0.01, outer=zeros, inner=zeros + 0.1,
        )  # fmt: skip
        values = design.starting_values([effect], state)
        return effect.columns(state, 0, **values.get(effect.id, {}))

    if effect.per:
        return tuple(_per(out_unit, below) for below in effect.per)
    if effect.nonlinear or effect.id.startswith("covariate:"):
        return (out_unit,) * len(effect.names(0))
    base, *doubled = columns(1.0, 1.0)[0], columns(2.0, 1.0)[0], columns(1.0, 2.0)[0]
    degrees = [[_degree(*values) for values in zip(base, other, strict=True)] for other in doubled]
    return tuple(
        _per(
            out_unit, "·".join(name + _POWERS[degree] for name, degree in zip("gK", powers, strict=True) if degree > 0)
        )
        for powers in zip(*degrees, strict=True)
    )


def _degree(base: float, doubled: float) -> int:
    if base == 0.0 or doubled / base <= 0.0:
        return 0
    degree = np.log2(doubled / base)
    return round(degree) if abs(degree - round(degree)) < 1e-6 else 0


def _per(out_unit: str, below: str) -> str:
    if not below:
        return out_unit
    return f"{out_unit}/({below})" if "·" in below else f"{out_unit}/{below}"


_POWERS = ("", "", "²", "³", "⁴", "⁵", "⁶")
