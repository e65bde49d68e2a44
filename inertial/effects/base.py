"""What an effect is: design columns of a physical cause, with everything that fitting, planning and documents ask of it."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Literal

import numpy as np

from inertial.arrays import Array
from inertial.state import State

Scope = Literal["sensor", "station", "slot"]


@dataclass(frozen=True)
class Nonlinear:
    """A nonlinear parameter: profiled between its bounds, never fixed.

    low, high : bounds, in ``unit``
    scale : spacing of the starting grid
    points : size of the starting grid
    choices : for a discrete parameter, its values (bounds and points are then theirs)
    every : where ``choices`` are only some of its values, all of them in order; a search begins at the choices and ends at these
    of_run : whether it is the state in which a run began, and no property of the device; zero is at rest
    """

    name: str
    unit: str
    low: float
    high: float
    scale: Literal["log", "linear", "inverse"] = "log"
    points: int = 10
    choices: tuple[float, ...] = ()
    every: tuple[float, ...] = ()
    of_run: bool = False

    def between(self, value: float) -> Array:
        """All values between the neighbours of a value among the choices, in order; none where the choices are all."""
        known, every = np.array(self.choices), np.array(self.every)
        below, above = known[known < value], known[known > value]
        low, high = (float(v) for v in (max(below, default=-np.inf), min(above, default=np.inf)))
        return every[(every > low) & (every < high)]

    def grid(self) -> Array:
        """Starting values, (points,), in ``unit``; made once, and not to be written to."""
        return _grid(self)


@lru_cache(maxsize=256)
def _grid(of: Nonlinear) -> Array:
    if of.choices:
        made = np.array(of.choices)
    elif of.scale == "log":
        made = np.geomspace(of.low, of.high, of.points)
    elif of.scale == "inverse":
        made = 1.0 / np.linspace(1.0 / of.high, 1.0 / of.low, of.points)
    else:
        made = np.linspace(of.low, of.high, of.points)
    made.setflags(write=False)
    return made


MECHANISM, CONVERTER = 0.0, 1.0


def place(state: State) -> tuple[Nonlinear, ...]:
    """Where a threshold or limit acts, in the mechanism or in the electronics behind it; nothing where that is the same."""
    if state.output_run is None:
        return ()
    return (Nonlinear("place", "", MECHANISM, CONVERTER, choices=(MECHANISM, CONVERTER)),)


class Effect(ABC):
    """One physical cause of error. A subclass with an ``id`` in a module of this package is found by itself.

    id : public name in model files, on the command line and in JSON
    symbol : as in IEEE Std 1293 where it has one
    equation : the term for output axis i, for people
    coefficients : names of the coefficients of every axis, or of the station's parameters; empty where ``names`` makes them
    scope : "sensor" (coefficients per unit and axis), "station" (shared by all units of a run), "slot"
    source : where the term comes from
    typical_ug : range of plausible sizes at 1 g or over the usual range of its driver, µg
    per : per column, what the coefficient's unit is divided by, as text ("V", "g·h"), where that does not follow from how the
        column grows with force and temperature; empty where it does, or where the column has no unit
    hides_behind : effects that take its place under poor plans
    breaker : what to measure so that it shows
    simplicity : rank among effects that the data cannot tell apart; the lowest is recommended
    sharp : whether it answers to the force along the sensor's own axis so sharply that misalignment matters: a change of gain
        of some 1e-3 at a misalignment of some mrad, or a nonlinearity
    after : effects of lower order that are named first where they are called for as well
    memory : whether it depends on all that went before: its form is then the simplest of many
    vanishing : RMS of a column below which a plan does not excite it: products that only the angles' jitter keeps from zero
    primary : number of leading columns that stand for a simpler form of the effect; None where there is none
    """

    id: ClassVar[str]
    symbol: ClassVar[str]
    equation: ClassVar[str]
    coefficients: ClassVar[tuple[str, ...]] = ()
    scope: ClassVar[Scope] = "sensor"
    source: ClassVar[str]
    typical_ug: ClassVar[tuple[float, float]]
    per: ClassVar[tuple[str, ...]] = ()
    hides_behind: ClassVar[tuple[str, ...]] = ()
    breaker: ClassVar[str]
    simplicity: ClassVar[int] = 50
    after: ClassVar[tuple[str, ...]] = ()
    primary: ClassVar[int | None] = None
    sharp: ClassVar[bool] = False
    vanishing: ClassVar[float] = 0.0
    memory: ClassVar[bool] = False
    nonlinear: ClassVar[tuple[Nonlinear, ...]] = ()

    def parameters(self, state: State) -> tuple[Nonlinear, ...]:
        """Nonlinear parameters with bounds that suit this run (a step lies inside it, a kink inside its temperatures)."""
        return self.nonlinear

    def constants(self, state: State) -> Mapping[str, float]:
        """What the columns take from the run the model is fitted on (a centre, a range), kept with the coefficients."""
        return {}


class SensorEffect(Effect):
    """An effect inside the device: columns with coefficients of their own for every unit and axis.

    same_on_axes : whether the columns do not depend on the axis: they are made once for the three
    """

    same_on_axes: ClassVar[bool] = False

    @abstractmethod
    def columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        """Design columns of one output axis.

        Parameters
        ----------
        state : of one unit or a lot
        axis : 0, 1, 2
        **nonlinear : values of the nonlinear parameters and constants

        Returns
        -------
        (..., n, p), g per unit of the coefficient

        Raises
        ------
        MissingInput
            A quantity the effect depends on is not recorded.
        """

    def names(self, axis: int) -> tuple[str, ...]:
        """Names of the p coefficients of one axis."""
        return self.coefficients

    def names_at(self, axis: int, **nonlinear: float) -> tuple[str, ...]:
        """Names of the coefficients of one axis where constants of the run decide how many there are."""
        return self.names(axis)

    def start_columns(self, state: State, axis: int, **nonlinear: float) -> Array:
        """What the state of a memory before the first dwell would add, (..., n, k); k = 0 without memory."""
        return np.zeros((*state.time.shape, 0))


class StationEffect(Effect):
    """An effect of the station: changes the specific force itself, by parameters that all units of a run share."""

    scope: ClassVar[Scope] = "station"

    @abstractmethod
    def force_change(self, state: State, **nonlinear: float) -> Array:
        """True minus commanded specific force, (..., n, 3, q), g per unit of each of the q parameters."""

    def names(self) -> tuple[str, ...]:
        """Names of the q parameters."""
        return self.coefficients

    def start_change(self, state: State, **nonlinear: float) -> Array:
        """What the state of a memory before the first dwell would add to the force: (..., n, 3, k); k = 0 without memory."""
        return np.zeros((*state.force.shape, 0))


def excited(effect: "Effect", columns: Array) -> Array:
    """Columns (..., n, p) with those that the plan does not excite set to zero."""
    if effect.vanishing <= 0.0:
        return columns
    rms = np.sqrt(np.mean(columns**2, axis=tuple(range(columns.ndim - 1))))
    return np.where(rms < effect.vanishing, 0.0, columns)


AnyEffect = SensorEffect | StationEffect


def has_start(effect: AnyEffect) -> bool:
    """Whether an effect has columns for the state of its memory before the first dwell."""
    if isinstance(effect, SensorEffect):
        return type(effect).start_columns is not SensorEffect.start_columns
    return type(effect).start_change is not StationEffect.start_change


AXES = ("x", "y", "z")


def others(axis: int) -> tuple[int, int]:
    """The two other axes, in cyclic order."""
    return (axis + 1) % 3, (axis + 2) % 3


def stack(state: State, columns: Sequence[Array]) -> Array:
    """Columns of shape (..., n) as one array (..., n, p), broadcast against the state's force and one another."""
    shape = state.force.shape[:-1]
    if any(column.shape != shape for column in columns):
        shape = np.broadcast_shapes(shape, *(column.shape for column in columns))
    if len(columns) == 1:
        single = columns[0]
        return (single if single.shape == shape else np.broadcast_to(single, shape))[..., None]
    stacked = np.empty((*shape, len(columns)))
    for index, column in enumerate(columns):
        stacked[..., index] = column
    return stacked
