"""Residuals of a model before and after the missing effects are added, arranged for pictures."""

from dataclasses import dataclass, replace

import numpy as np

from inertial.arrays import Array, Index
from inertial.criticism.diagnosis import Diagnosis
from inertial.criticism.drivers import drivers_of
from inertial.effects import StationEffect
from inertial.estimation.alternative import Handling
from inertial.estimation.comparison import fitted_residuals
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.planning.drivers import drivers_of as quantities_of
from inertial.quantities import RECORDED, axis_labels, shown_factor
from pipelines.report.smooth_curve import band
from schemas.units import MICRO

ALWAYS = ("unit_C", "time_s", "temperature_rate", "since_move_s")
STILL = {"unit_C": 1.0, "temperature_rate": 0.1, "since_move_s": 0.5}
"""Ranges below which a driver gets no picture, unless the residual follows it."""

_MOST = 7
_ALIKE = 0.995
_SOAK_APART = 1.0


@dataclass(frozen=True)
class LotResiduals:
    """Residuals of a lot in µg, (units, axes, n); NaN where a dwell is missing.

    axes : "x", "y", "z", or "norm" alone
    shown : index of the unit whose residuals fall most, or are largest if nothing was added
    """

    units: tuple[str, ...]
    axes: tuple[str, ...]
    before: Array
    after: Array
    shown: int

    @property
    def unit(self) -> str:
        """The unit that is shown."""
        return self.units[self.shown]

    @property
    def models(self) -> list[tuple[str, Array]]:
        """Residuals by model: before, and after where effects were added."""
        both = [("before", self.before), ("after", self.after)]
        return both[:1] if self.after is self.before else both


@dataclass(frozen=True)
class DriverValues:
    """A driver's values (units, n), or (units, n, 3) where each axis has values, with a label for people.

    period : of a swing that the residual follows, in the unit of the values; None of another curve
    """

    name: str
    label: str
    values: Array
    period: float | None = None


def lot_residuals(diagnosis: Diagnosis, units: tuple[str, ...]) -> LotResiduals:
    """Residuals before and after, of the dwells that are fitted."""
    before = residuals_of_model(diagnosis.base, len(units))
    after = before if not added(diagnosis) else residuals_of_model(diagnosis.final, len(units))
    sizes = np.nanmean(before**2, axis=(1, 2))
    fallen = sizes - np.nanmean(after**2, axis=(1, 2)) if added(diagnosis) else sizes
    return LotResiduals(units, axes_of(diagnosis.problem), before, after, int(np.argmax(fallen)))


def axes_of(problem: Problem) -> tuple[str, ...]:
    """The axes of a lot's residuals."""
    return ("norm",) if problem.lot.radial else tuple("xyz"[axis] for axis in problem.axes)


def residuals_of_model(model: Model, units: int) -> Array:
    """The residuals of a model, µg, (units, axes, n)."""
    shape = (units, len(axes_of(model.problem)), model.problem.n)
    return MICRO * fitted_residuals(model).reshape(shape)


def added(diagnosis: Diagnosis) -> list[str]:
    """Ids of the effects that the diagnosis added."""
    held = {t.effect.id for t in diagnosis.base.terms}
    return [t.effect.id for t in diagnosis.final.terms if t.effect.id not in held]


FORCE_LABEL = "specific force along the axis / g"
LABELS = axis_labels() | {"approach": "change of force at the move before / g"}


def recorded_quantities(problem: Problem) -> list[DriverValues]:
    """The quantities recorded with the dwells of a lot, in the units of display."""
    state = problem.lot.state
    quantities: list[DriverValues] = []
    for driver in drivers_of(problem):
        recorded = driver.values
        if recorded is not None:
            values = state.force_step if driver.name == "approach" else recorded
            label = LABELS.get(driver.name, driver.name)
            quantities.append(DriverValues(driver.name, label, values * shown_factor(driver.name)))
    return quantities


def drivers_shown(diagnosis: Diagnosis) -> list[DriverValues]:
    """Drivers with a picture: those of the added effects, those that the residual follows, then usual drivers if they vary."""
    known = {quantity.name: quantity for quantity in recorded_quantities(diagnosis.problem)}
    forces, named = quantities_of_added(diagnosis)
    unknown = diagnosis.unexplained
    first = [] if unknown is None else [unknown.driver]
    if unknown is not None and unknown.period is not None and unknown.driver in known:
        period = unknown.period * shown_factor(unknown.driver)
        known[unknown.driver] = replace(known[unknown.driver], period=period)
    names = [*first, *named, *(p.driver for p in diagnosis.where[:5])]
    drivers = list(forces)
    for name in dict.fromkeys([*names, *ALWAYS]):
        series = known.get(name)
        if series is None or any(_alike(series.values, other.values) for other in drivers):
            continue
        if name in names or float(np.ptp(series.values)) >= STILL.get(name, 0.0) * shown_factor(name):
            drivers.append(series)
    return drivers[:_MOST]


def quantities_of_added(diagnosis: Diagnosis) -> tuple[list[DriverValues], list[str]]:
    """The force, or the angles of the table, where an added effect depends on them; and names of its other quantities.

    An effect of a device is seen over the force along its axis, an effect of the station over the angles.
    """
    problem = diagnosis.problem
    state = problem.lot.state
    new = {*added(diagnosis)}
    effects = [t.effect for t in diagnosis.final.terms if t.effect.id in new and not isinstance(t.effect, Handling)]
    drivers = [(effect, quantities_of(state, effect)) for effect in effects]
    series: list[DriverValues] = []
    of_angles = state.outer is not None and state.inner is not None
    if of_angles and any(isinstance(effect, StationEffect) and "force" in names for effect, names in drivers):
        for name, values in (("outer_deg", state.outer), ("inner_deg", state.inner)):
            if values is not None and float(np.ptp(values)) > 0.0:
                degrees = np.broadcast_to(np.degrees(values), (problem.lot.output.shape[0], problem.n))
                series.append(DriverValues(name, LABELS.get(name, name), degrees))
    if not problem.lot.radial and any(
        not isinstance(effect, StationEffect) and "force" in names for effect, names in drivers
    ):
        along = np.broadcast_to(
            state.force[..., problem.axes], (problem.lot.output.shape[0], problem.n, len(problem.axes))
        )
        series.append(DriverValues("force", FORCE_LABEL, along))
    columns = {row.attribute: row.column for row in RECORDED}
    return series, [columns[name] for _, names in drivers for name in sorted(names) if name in columns]


def _alike(driver: Array, other: Array) -> bool:
    """Whether two drivers are equivalent, as elapsed time and time since power-on often are."""
    if driver.shape != other.shape:
        return False
    return bool(abs(np.corrcoef(driver.ravel(), other.ravel())[0, 1]) > _ALIKE)


def bands_without_zero(left: LotResiduals, drivers: list[DriverValues]) -> list[str]:
    """The drivers, with their axes, whose band after the added effects lies beside zero somewhere."""
    labels: list[str] = []
    for series in drivers:
        values = series.values[left.shown]
        axes: list[str] = []
        for column, axis in enumerate(left.axes):
            x = values[:, column] if values.ndim > 1 else values
            _, low, high = band(x, left.after[left.shown, column], series.period)
            if bool(np.any(low > 0.0) or np.any(high < 0.0)):
                axes.append(axis)
        if axes:
            labels.append(f"{series.label} ({', '.join(axes)})")
    return labels


def direction(temperature: Array) -> Index:
    """Whether each dwell was reached heating (1), cooling (−1) or neither (0), (n,), from temperatures (n,) in °C."""
    out = np.zeros(temperature.size, dtype=np.int64)
    held = temperature[0]
    for k in range(1, temperature.size):
        step = temperature[k] - held
        moved = abs(step) > _SOAK_APART
        out[k] = int(np.sign(step)) if moved else out[k - 1]
        held = temperature[k] if moved else held
    return out
