"""A figure of merit, the tables of one unit that it is computed from, and shared formulas."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from inertial.arrays import Array
from inertial.distributions import normal_tail
from inertial.state import ALL_AXES
from inertial.uncertainty.degrees import DeviationLaw
from pipelines.tables.calibration import Calibration
from pipelines.tables.frames import UnitRows
from schemas.recipe import Recipe


class Value(NamedTuple):
    """Value and standard uncertainty of a figure of one unit, in the figure's unit.

    why_not : why there is no value, where there is none; the value is then infinite and passes no limit
    dof, removed : degrees of freedom of a standard deviation, nan of other figures, and the known part that was taken out of it
    shared : part of the uncertainty that the units of a lot have in common, that of the references
    median : of a value that is a 95 % bound of an error, the median of that error
    """

    value: float
    uncertainty: float
    why_not: str = ""
    dof: float = float("nan")
    shared: float = 0.0
    median: float = float("nan")
    removed: float = 0.0

    @property
    def law(self) -> DeviationLaw | None:
        """The law of a standard deviation; None of other figures, which are normal."""
        return DeviationLaw(self.value, self.dof, self.removed) if self.dof > 0.0 else None

    def reach(self, guard: float) -> float:
        """Magnitude with the guard band: the value that is compared with a limit."""
        if guard > 0.0 and self.dof > 0.0:
            return DeviationLaw(self.value, self.dof).quantile(1.0 - float(normal_tail(guard)))
        return abs(self.value) + guard * self.uncertainty


class LotCoefficients:
    """Coefficients of a calibrated lot; those of an effect are read from the calibration once for all units.

    Parameters
    ----------
    zero_g : nominal output at 0 g, output unit.
    stated : covariance of the coefficients by the uncertainty budget, (units, 3p, 3p); None: noise only.
    """

    def __init__(self, calibration: Calibration, zero_g: float, stated: Array | None = None) -> None:
        self.zero_g = zero_g
        self.stated = stated
        self._calibration = calibration
        self._scale = np.abs(calibration.scale)[..., None]
        self._known: dict[str, tuple[Array, Array]] = {}
        self._noise: dict[str, Array] = {}

    def of(self, unit: int) -> "UnitCoefficients":
        """The coefficients of the unit with this index in the lot."""
        return UnitCoefficients(self, unit)

    def effect(self, effect: str, unit: int) -> tuple[Array, Array, Array]:
        """Coefficients (3, columns) and standard errors (3, columns) of an effect, and the scale (3, 1) in output per g."""
        if effect not in self._known:
            self._known[effect] = self._calibration.value(effect), self._with_budget().standard_error(effect)
        values, errors = self._known[effect]
        return values[unit], errors[unit], self._scale[unit]

    def shared(self, effect: str, unit: int) -> Array:
        """Standard errors (3, columns) of an effect by the references alone, output unit; zero where nothing is stated."""
        if self.stated is None:
            return np.zeros_like(self.effect(effect, unit)[1])
        if effect not in self._noise:
            self._noise[effect] = self._calibration.standard_error(effect)
        total, noise = self.effect(effect, unit)[1], self._noise[effect][unit]
        return np.sqrt(np.maximum(total**2 - noise**2, 0.0))

    def _with_budget(self) -> Calibration:
        """The calibration with the budget's covariance of each axis added to that of the noise."""
        if self.stated is None:
            return self._calibration
        p = self._calibration.covariance.shape[-1]
        blocks = np.stack(
            [self.stated[:, a * p : (a + 1) * p, a * p : (a + 1) * p] for a in range(len(self._calibration.axes))],
            axis=1,
        )
        return replace(self._calibration, covariance=self._calibration.covariance + blocks)

    def angle(self, unit: int, first: int, second: int) -> tuple[float, float] | None:
        """Deviation from 90° of the angle between two axes and its standard uncertainty, rad; None without misalignment."""
        if len(self._calibration.axes) < len(ALL_AXES):
            return None  # a device with fewer axes has no three angles between them
        names, p = self._calibration.names, self._calibration.covariance.shape[-1]
        columns = []
        for axis, other in ((first, second), (second, first)):
            turns = [k for k, (effect, _) in enumerate(names[axis]) if effect == "misalignment"]
            if not turns:
                return None
            columns.append((axis, turns[(other - axis - 1) % 3]))
        scale = np.abs(np.diagonal(self._calibration.response[unit]))
        value = sum(self._calibration.coefficients[unit, axis, k] / scale[axis] for axis, k in columns)
        variance = sum(self._calibration.covariance[unit, axis, k, k] / scale[axis] ** 2 for axis, k in columns)
        if self.stated is not None:
            weights = np.zeros(3 * p)
            for axis, k in columns:
                weights[axis * p + k] = 1.0 / scale[axis]
            variance += weights @ self.stated[unit] @ weights
        return float(value), float(np.sqrt(variance))


class UnitCoefficients(NamedTuple):
    """The coefficients of one unit of a lot."""

    lot: LotCoefficients
    unit: int

    def nearest(self, effect: str, factor: float, guard: float, *, nominal: float = 0.0) -> Value | None:
        """The coefficient of an effect that comes nearest to a limit, times a factor; None where the model lacks the effect.

        Parameters
        ----------
        factor : the figure's unit per g.
        guard : width of the guard band in standard uncertainties.
        nominal : subtracted from every coefficient first, output unit.
        """
        coefficients, errors, scale = self.lot.effect(effect, self.unit)
        values = (factor * (coefficients - nominal) / scale).ravel()
        if not values.size:
            return None
        spread = (factor * errors / scale).ravel()
        worst = int(np.argmax(np.abs(values) + guard * spread))
        shared = (factor * self.lot.shared(effect, self.unit) / scale).ravel()[worst]
        return Value(float(values[worst]), float(spread[worst]), shared=abs(float(shared)))


class BudgetRow(NamedTuple):
    """A quantity of the uncertainty budget of one unit: its value, and its standard uncertainty of both types and in all."""

    value: float
    u_a: float
    u_b: float
    u: float


class UnitTables(NamedTuple):
    """The rows of one unit in the tables that figures are computed from, and its coefficients.

    guard : width of the guard band in standard uncertainties, zero under simple acceptance; of several axes, poses or
        coefficients the one that comes nearest to a limit with it is judged
    budget : quantities of the uncertainty budget; empty: noise only
    full_scale : largest excursion of the output from 0 g, output unit; nan where it is not known
    """

    residuals: UnitRows
    verification: UnitRows
    verification_poses: UnitRows
    noise: UnitRows
    coefficients: UnitCoefficients
    guard: float
    budget: Mapping[tuple[str, str], BudgetRow] = MappingProxyType({})
    full_scale: float = float("nan")

    def stated_u(self, quantity: str, axis: str) -> float:
        """Standard uncertainty of a quantity by the budget, besides noise; zero where nothing is stated."""
        row = self.budget.get((quantity, axis))
        return 0.0 if row is None else row.u_b


def nothing(recipe: Recipe) -> str:
    """No requirement: every recipe yields the figure."""
    return ""


def effect_in_model(effect: str) -> Callable[[Recipe], str]:
    """The requirement of figures of one effect's coefficients."""
    return lambda recipe: "" if effect in recipe.effects else f"effect {effect} in the model"


@dataclass(frozen=True)
class FigureKind:
    """A figure of merit: the modules of this package define theirs as FIGURES.

    Parameters
    ----------
    name : key in limits files and tables; ends in the unit of the figure where there is a unit.
    unit : unit of the value, "1" for a ratio.
    meaning : of the value, a sentence of the reference.
    label : heading in the report.
    order : the figures are listed by it, ascending.
    value : the figure of a unit, None where its tables do not yield one.
    missing : what a recipe lacks to yield the figure, empty where it lacks nothing.
    """

    name: str
    unit: str
    meaning: str
    label: str
    order: int
    value: Callable[[UnitTables], Value | None]
    missing: Callable[[Recipe], str] = nothing
