"""What a recipe will make a lot go through, as states of the science: for checks and budgets before any chamber time is spent."""

from collections.abc import Collection, Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inertial.design import of_axes
from inertial.fits.linear import fit_lot
from inertial.frames import force_from_angles
from inertial.quantities import BY_COLUMN, LEFT_ALONE, Quantity
from inertial.state import History, State
from pipelines.schedule.steps import steps
from pipelines.schedule.timing import Activity, schedule, temperatures
from pipelines.tables.dwell_table import HISTORY_POINTS
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station
from schemas.units import STANDARD_GRAVITY_M_S2
from stations.profile_files import recorded_columns

Array = NDArray[np.float64]


def planned_state(
    recipe: Recipe,
    station: StationConfig | None = None,
    *,
    history: bool = False,
    recorded: Iterable[str] | None = None,
) -> State:
    """The dwells of the fit in order of measurement, at the times at which a station gets to them.

    Quantities that the plan does not set (supply, vibration, what the station's reader records besides) wander a little, as they
    do on a station, so that effects of theirs are not refused.

    station : the built-in simulated station where None
    history : whether the temperatures between the dwells go along, as a station records them
    recorded : columns that are recorded besides; those of the station's reader where None
    """
    config = station or load_station()
    activities = schedule(steps(recipe), config, recipe)
    return state_of(activities, config, recipe, history=history, recorded=recorded)


def state_of(
    stretches: Sequence[Activity],
    station: StationConfig,
    recipe: Recipe,
    *,
    history: bool = False,
    recorded: Iterable[str] | None = None,
    kinds: Collection[str] = ("dwell",),
) -> State:
    """The dwells of the fit, or of other kinds, among what a station does, see :func:`planned_state`."""
    dwells = [s for s in stretches if s.kind in kinds]
    outer, inner = np.radians([(s.step.pose.outer_deg, s.step.pose.inner_deg) for s in dwells]).T
    time = np.array([s.start + 0.5 * s.seconds for s in dwells])
    settled = np.array([s.step.settled for s in dwells])
    chamber, unit = np.array(
        [(0.5 * (s.begin.air + s.end.air), 0.5 * (s.begin.device + s.end.device)) for s in dwells]
    ).T
    chamber, unit = (
        np.where(settled, [s.step.temperature for s in dwells], on_the_way) for on_the_way in (chamber, unit)
    )
    waits = np.array([recipe.settle_s if s.step.wait_s is None else s.step.wait_s for s in dwells])
    wander = np.random.default_rng(0).normal(size=(len(LEFT_ALONE), time.size))
    left: dict[str, Any] = {row.attribute: row.about(w) for row, w in zip(reversed(LEFT_ALONE), wander, strict=True)}
    gravity = recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
    return State(
        force=gravity * force_from_angles(outer, inner),
        time=time,
        temperature=unit,
        chamber=chamber,
        since_power=_since_power(stretches, time),
        power_off=off if (off := np.array([s.step.off_s for s in dwells])).any() else None,
        since_move=(waits + 0.5 * recipe.dwell_s) * (1.0 + 0.01 * wander[0]),
        outer=outer,
        inner=inner,
        slot=np.zeros(()),
        covariates=_recorded(recorded_columns(station.devices.reader) if recorded is None else recorded, time.size),
        history=_history(stretches, station) if history else None,
        axes=tuple(range(recipe.sensor_axes)),
        **left,
    )


def settled_state(
    force: Array, time: Array, temperature: Array, angles: Array, since_move_s: float, axes: tuple[int, ...]
) -> State:
    """Dwells of a device that was switched on at time zero and has settled to every temperature: what a search of plans looks at.

    force : (n, 3), g; time : (n,), s; temperature : (n,), °C, of the device and of the air
    angles : (n, 2), rad, outer and inner; since_move_s : s, time at rest before every dwell
    axes : those with an output
    """
    return State(
        force=force,
        time=time,
        temperature=temperature,
        chamber=temperature,
        since_power=time,
        since_move=np.full(time.size, since_move_s),
        outer=angles[:, 0],
        inner=angles[:, 1],
        axes=axes,
    )


def _recorded(columns: Iterable[str], count: int) -> dict[str, Array]:
    """Recorded columns that no command sets; each varies independently about its usual value."""
    rng = np.random.default_rng(1)
    known = {
        column: BY_COLUMN.get(column, Quantity(column, "", "", column, usual=1.0, spread=0.1)) for column in columns
    }
    return {column: row.about(rng.standard_normal(count)) for column, row in known.items()}


def _since_power(stretches: Sequence[Activity], time: Array) -> Array:
    """Seconds since the devices were last switched on, at some times: a move with the power off before it ends that pause."""
    on = np.array([0.0, *(s.start + s.step.off_s for s in stretches if s.kind == "move" and s.step.off_s > 0.0)])
    return time - on[np.searchsorted(on, time, side="right") - 1]


def _history(stretches: Sequence[Activity], station: StationConfig) -> History:
    """Temperatures of a device between the dwells; at the dwells it is where the recipe wants it."""
    time, _, device = np.array(temperatures(stretches, station)).T
    grid = np.linspace(time[0], time[-1], min(HISTORY_POINTS, time.size))
    return History(grid, np.interp(grid, time, device))


def refuse_unidentified(recipe: Recipe, recorded: Iterable[str] = ()) -> None:
    """Refuse a model that the planned poses and temperatures cannot determine.

    recorded : columns that are recorded beside every dwell, besides those that every station records

    Raises NotIdentified: with the coefficients that cannot be separated.
    Raises MissingInput: the model depends on a column that is not recorded.
    """
    state = planned_state(recipe, recorded=recorded)
    fit_lot(recipe.effects, state, of_axes(state.force, state.axes, -1).copy())


class Planned(NamedTuple):
    """States of the dwells of the fit and of the verification; soak and temperature of each dwell of the fit."""

    fit: State
    verification: State | None
    soak: NDArray[np.int64]
    target_C: Array


def planned_dwells(recipe: Recipe, station: StationConfig, activities: list[Activity] | None = None) -> Planned:
    """The dwells that a recipe plans on a station."""
    planned = schedule(steps(recipe), station, recipe) if activities is None else activities
    dwells = [activity for activity in planned if activity.kind == "dwell"]
    checks = [activity for activity in planned if activity.kind == "verification"]
    verification = state_of(planned, station, recipe, kinds=("verification",)) if checks else None
    soak, target = (np.array([getattr(activity.step, name) for activity in dwells]) for name in ("soak", "temperature"))
    return Planned(state_of(planned, station, recipe), verification, soak, target)
