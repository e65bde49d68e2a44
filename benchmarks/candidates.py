"""A fixed library of textbook candidate columns for the baselines, from a table of dwells (and its history of temperature).

Each nonlinear parameter has one usual value, as in any fixed library.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.signal import lfilter

Floats = NDArray[np.float64]
KNOWN = {
    "unit", "dwell", "slot", "time_s", "out_x", "out_y", "out_z", "sd_x", "sd_y", "sd_z", "force_x", "force_y",
    "force_z", "outer_deg", "inner_deg", "n", "duration_s", "unit_C", "chamber_C", "since_move_s",
    "since_power_s", "supply_V", "vibration_g", "out_unit",
}  # fmt: skip
SPAN_K = 5.0
LAG_S, WARM_UP_S, CREEP_S, PERIOD_G, KINK_C, KINK_K = 60.0, 600.0, 20.0, 0.2, 20.0, 5.0


@dataclass(frozen=True)
class Dwells:
    """One unit's dwells as arrays in order of time; angles in rad, force in g, θ in K from 25 °C."""

    table: pd.DataFrame
    history: pd.DataFrame | None

    def array(self, name: str) -> Floats:
        """A column as numbers."""
        return self.table[name].to_numpy(dtype=float)

    @cached_property
    def force(self) -> Floats:
        """Reference force, (n, 3)."""
        if "force_x" in self.table:
            return self.table[["force_x", "force_y", "force_z"]].to_numpy(dtype=float)
        outer, inner = np.radians(self.array("outer_deg")), np.radians(self.array("inner_deg"))
        return np.column_stack([np.sin(inner) * np.sin(outer), np.cos(inner) * np.sin(outer), np.cos(outer)])

    @cached_property
    def theta(self) -> Floats:
        """Temperature minus 25 °C, (n,)."""
        return self.array("unit_C") - 25.0

    @cached_property
    def course(self) -> tuple[Floats, Floats]:
        """Time and temperature between the dwells, at 10 s."""
        source = self.table if self.history is None else self.history
        seconds, warmth = source["time_s"].to_numpy(dtype=float), source["unit_C"].to_numpy(dtype=float)
        grid = np.arange(seconds[0], max(seconds[-1], seconds[0] + 10.0), 10.0)
        return grid, np.interp(grid, seconds, warmth)

    def at_dwells(self, series: Floats) -> Floats:
        """A time series interpolated at the dwells."""
        return np.interp(self.array("time_s"), self.course[0], series)

    @cached_property
    def lagged(self) -> Floats:
        """First-order lag of the temperature minus the temperature, (n,)."""
        warmth = self.course[1]
        keep = np.exp(-10.0 / LAG_S)
        late = lfilter([1.0 - keep], [1.0, -keep], warmth, zi=[warmth[0] * keep])[0]
        return self.at_dwells(late - warmth)

    @cached_property
    def step(self) -> Floats:
        """Change of the force at the move before each dwell, (n, 3)."""
        return np.diff(np.vstack([[0.0, 0.0, 1.0], self.force]), axis=0)


Columns = Callable[[Dwells, int], list[Floats]]


def _pair(axis: int) -> tuple[int, int]:
    return (axis + 1) % 3, (axis + 2) % 3


def _cross(d: Dwells, axis: int) -> list[Floats]:
    j, k = _pair(axis)
    return [d.force[:, axis] * d.force[:, j], d.force[:, axis] * d.force[:, k]]


def _across(d: Dwells, axis: int) -> list[Floats]:
    j, k = _pair(axis)
    return [d.force[:, j] ** 2, d.force[:, k] ** 2, d.force[:, j] * d.force[:, k]]


def _loop(d: Dwells, _axis: int) -> list[Floats]:
    warmth = d.course[1]
    middle, half = (warmth.max() + warmth.min()) / 2.0, max(float(np.ptp(warmth)) / 2.0, 1e-9)
    smooth = np.gradient(np.convolve(np.pad(warmth, 30, mode="edge"), np.ones(61) / 61.0, mode="valid"))
    side, last = np.empty(len(smooth)), 0.0
    for k, rate in enumerate(smooth):
        last = np.sign(rate) if abs(rate) > 2e-3 else last
        side[k] = last
    return [d.at_dwells(side * (1.0 - ((warmth - middle) / half) ** 2))]


def _field(d: Dwells, _axis: int) -> list[Floats]:
    """The two horizontal directions of the laboratory in the frame of the fixture."""
    outer, inner = np.radians(d.array("outer_deg")), np.radians(d.array("inner_deg"))
    zero = np.zeros_like(outer)
    across = [np.cos(inner), -np.sin(inner), zero]
    along = [np.sin(inner) * np.cos(outer), np.cos(inner) * np.cos(outer), -np.sin(outer)]
    return [*across, *along]


def _turned(change: Callable[[Floats, Floats], tuple[Floats, Floats]]) -> Columns:
    """Change of the force along an axis by small errors of the two angles."""

    def columns(d: Dwells, axis: int) -> list[Floats]:
        outer, inner = np.radians(d.array("outer_deg")), np.radians(d.array("inner_deg"))
        by_outer = [np.sin(inner) * np.cos(outer), np.cos(inner) * np.cos(outer), -np.sin(outer)][axis]
        by_inner = [np.cos(inner) * np.sin(outer), -np.sin(inner) * np.sin(outer), np.zeros_like(outer)][axis]
        first, second = change(outer, inner)
        return [by_outer * first, by_inner * second]

    return columns


def _level(d: Dwells, axis: int) -> list[Floats]:
    field = _field(d, axis)
    return [field[axis], field[3 + axis]]


def _skew(d: Dwells, axis: int) -> list[Floats]:
    outer, inner = np.radians(d.array("outer_deg")), np.radians(d.array("inner_deg"))
    return [[-np.cos(inner) * np.cos(outer), np.sin(inner) * np.cos(outer), np.zeros_like(outer)][axis]]


def _harmonics(d: Dwells, axis: int) -> list[Floats]:
    outer, inner = np.radians(d.array("outer_deg")), np.radians(d.array("inner_deg"))
    parts = []
    for n in (1, 2):
        for wave in (np.sin, np.cos):
            parts += [_turned(lambda _o, i, w=wave, m=n: (w(m * outer), w(m * i)))(d, axis)[k] for k in (0, 1)]
    del inner
    return parts


def _sides(angle: Floats) -> Floats:
    return np.sign(np.round(np.diff(np.concatenate([[0.0], angle])), 4))


FORMS: dict[str, Columns] = {
    "second_order": lambda d, i: [d.force[:, i] ** 2],
    "scale_asymmetry": lambda d, i: [np.abs(d.force[:, i])],
    "fourth_order": lambda d, i: [d.force[:, i] ** 4],
    "third_order": lambda d, i: [d.force[:, i] ** 3],
    "odd_quadratic": lambda d, i: [d.force[:, i] * np.abs(d.force[:, i])],
    "bias_asymmetry": lambda d, i: [np.sign(np.round(d.force[:, i], 4))],
    "fifth_order": lambda d, i: [d.force[:, i] ** 5],
    "cross_coupling": _cross,
    "cross_axis_quadratic": _across,
    "adc_nonlinearity": lambda d, i: [f(2.0 * np.pi * d.force[:, i] / PERIOD_G) for f in (np.sin, np.cos)],
    "bias_temperature_quadratic": lambda d, _i: [d.theta**2],
    "bias_temperature_cubic": lambda d, _i: [d.theta**3],
    "scale_temperature_quadratic": lambda d, i: [d.theta**2 * d.force[:, i]],
    "misalignment_temperature": lambda d, i: [d.theta * d.force[:, k] for k in _pair(i)],
    "second_order_temperature": lambda d, i: [d.theta * d.force[:, i] ** 2],
    "thermal_rate": lambda d, _i: [d.at_dwells(np.gradient(d.course[1], 10.0))],
    "thermal_lag": lambda d, _i: [d.lagged],
    "thermal_hysteresis": _loop,
    "thermal_kink": lambda d, _i: [KINK_K * np.logaddexp(0.0, (d.theta + 25.0 - KINK_C) / KINK_K)],
    "warm_up": lambda d, _i: [np.exp(-d.array("since_power_s") / WARM_UP_S)],
    "aging_linear": lambda d, _i: [d.array("time_s") / 3600.0],
    "scale_aging": lambda d, i: [d.array("time_s") / 3600.0 * d.force[:, i]],
    "aging_log": lambda d, _i: [np.log1p(d.array("since_power_s") / WARM_UP_S)],
    "step_change": lambda d, _i: [(d.array("time_s") > np.median(d.array("time_s"))).astype(float)],
    "creep_after_move": lambda d, i: [d.step[:, i] * np.exp(-d.array("since_move_s") / CREEP_S)],
    "pose_hysteresis": lambda d, i: [np.tanh(d.step[:, i] / 0.05)],
    "vibration_rectification": lambda d, _i: [d.array("vibration_g") ** 2],
    "supply_sensitivity": lambda d, i: [
        (d.array("supply_V") - 3.3) * c for c in (np.ones(len(d.force)), d.force[:, i])
    ],
}
THERMAL_FORMS: dict[str, Columns] = {
    "bias_temperature": lambda d, _i: [d.theta],
    "scale_temperature": lambda d, i: [d.theta * d.force[:, i]],
}
STATION_FORMS: dict[str, Columns] = {
    "magnetic": _field,
    "level_error": _level,
    "outer_encoder_offset": lambda d, i: _turned(lambda o, n: (np.ones_like(o), np.zeros_like(n)))(d, i)[:1],
    "axis_nonorthogonality": _skew,
    "encoder_harmonic": _harmonics,
    "backlash": _turned(lambda o, n: (_sides(o), _sides(n))),
}


@dataclass(frozen=True)
class Library:
    """Outputs of the lot in µg and columns of the candidates, by unit and axis."""

    dwells: list[Dwells]
    per_g: float
    thermal: bool
    names: list[str]
    covariates: dict[str, tuple[float, float]]
    cache: dict[tuple[str, int, int], Floats] = field(default_factory=dict)

    @property
    def units(self) -> int:
        """Number of units in the lot."""
        return len(self.dwells)

    @cached_property
    def output(self) -> list[Floats]:
        """Outputs of each unit, (n, 3), µg; fresh runs have the same reference."""
        return [1e6 * d.table[["out_x", "out_y", "out_z"]].to_numpy(dtype=float) / self.per_g for d in self.dwells]

    def base(self, unit: int, axis: int) -> Floats:
        """Columns of the starting model, (n, p)."""
        d = self.dwells[unit]
        columns = [np.ones(len(d.force)), *d.force.T]
        if self.thermal:
            columns += [d.theta, d.theta * d.force[:, axis]]
        return np.column_stack(columns)

    def columns(self, name: str, unit: int, axis: int) -> Floats:
        """Columns of a candidate, (n, p)."""
        key = (name, unit, axis)
        if key not in self.cache:
            d = self.dwells[unit]
            if name.startswith("covariate:"):
                centre, span = self.covariates[name]
                parts = [(d.array(name.partition(":")[2]) - centre) / span]
            else:
                parts = (FORMS | THERMAL_FORMS | STATION_FORMS)[name](d, axis)
            self.cache[key] = np.column_stack(parts)
        return self.cache[key]

    def scope(self, name: str) -> str:
        """`station` or `sensor`, by the kind of a candidate."""
        return "station" if name in STATION_FORMS and name != "magnetic" else "sensor"

    def pure_error(self) -> tuple[float, float]:
        """Variance of repeated poses within a soak about their means, µg², and its degrees of freedom."""
        total, dof = 0.0, 0
        for d, output in zip(self.dwells, self.output, strict=True):
            keys = pd.DataFrame(np.round(d.force, 3) + 0.0).assign(soak=np.round(d.theta / 3.0))
            groups = pd.DataFrame(output).groupby([keys[c] for c in keys.columns])
            total += float((groups.var().mul(groups.size() - 1, axis=0)).sum().sum())
            dof += 3 * int((groups.size() - 1).sum())
        white = float(np.mean([(1e6 * d.array("sd_x") / self.per_g) ** 2 / d.array("n") for d in self.dwells]))
        return (total / dof, float(dof)) if dof >= 10 else (white, 1e6)


def library(
    dwells: pd.DataFrame, history: pd.DataFrame | None = None, like: Library | None = None, *, bare: bool = False
) -> Library:
    """The library of a lot; `like` gives a fresh run the scales of another.

    `bare` moves temperature from the starting model to the candidates.
    """
    units = [part.sort_values("dwell").reset_index(drop=True) for _, part in dwells.groupby("unit", sort=True)]
    courses = [None if history is None else history[history["unit"] == part["unit"].iloc[0]] for part in units]
    lots = [Dwells(part, course) for part, course in zip(units, courses, strict=True)]
    if like is not None:
        return Library(lots, like.per_g, like.thermal, like.names, like.covariates)
    slopes = [
        np.linalg.lstsq(np.column_stack([np.ones(len(d.force)), d.force]), d.array("out_x"), rcond=None)[0][1]
        for d in lots
    ]
    thermal = max(float(np.ptp(d.theta)) for d in lots) > SPAN_K
    extra = [name for name in dwells.columns if name not in KNOWN and pd.api.types.is_numeric_dtype(dwells[name])]
    scales = {f"covariate:{name}": (float(dwells[name].mean()), float(dwells[name].std()) or 1.0) for name in extra}
    names = [*FORMS, *(THERMAL_FORMS if thermal and bare else ()), *scales]
    if "outer_deg" in dwells:
        names += list(STATION_FORMS)
    return Library(lots, float(np.median(slopes)), thermal and not bare, names, scales)
