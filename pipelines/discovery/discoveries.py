"""Discoveries of the evidence of an archive: named effects of the devices, errors of the references, and the unexplained."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inertial.arrays import Array, Places, over
from inertial.counts import number_of
from inertial.decisions import CLASS_WIDTH
from inertial.discovery.driver_sums import DriverSums, LotStack, gathered
from inertial.discovery.evidence import ALL, DATE, INSIDE, MEAN, SLOPE, SLOT, STATION, UNIT, ScoredLot
from inertial.discovery.level_fit import WIDE, LevelFit
from inertial.discovery.naming import Name, Unnamed
from inertial.discovery.pose_shape import SHAPE, map_of
from inertial.discovery.running_sums import growth_of
from inertial.frames import angles_from_force
from pipelines.discovery.documents import DiscoveredLevel, DiscoveryRow, Scope, UnexplainedRow
from pipelines.discovery.evidence_state import ALPHA, Alarm, Evidences
from pipelines.discovery.lot_source import OWN_TEMPCO, SEASON, DiscoveryArchive
from pipelines.discovery.score_store import AXES
from schemas.units import MICRO

LATER = 20  # smallest number of lots after an alarm that can confirm it
MOST_NAMED = 3000  # largest number of lots used for naming, evenly spread over a larger archive
_CONFIRMED = 2.05  # standard errors above zero (two-sided 4 %), as for a fresh run
_SHOWN_LEVELS = 40
_MUCH = 0.25  # of the size on the axis with the largest one, from which on another axis is told
_PROPORTIONAL = (
    "it is proportional to each unit's own temperature coefficient: the temperature readings are wrong in some soaks"
)
_BY_DRIVER: dict[str, tuple[Scope, str]] = {
    STATION: ("station", "it differs between stations for units of the same kind, permanently or by slow wander"),
    SLOT: ("station", "it stays with the slot of the fixture while the units change"),
    UNIT: ("sensor", "the same unit shows it again in later lots, compared with the other units of each lot"),
}
"""Scope of a discovery that follows from its driver alone, and the reason."""
_NEXT: dict[str, str] = {
    STATION: "measure the same units on two of these stations, and check their references",
    SLOT: "exchange units between slots, or check the fixture at this slot",
    "sensor_or_station": "measure some units again, turned by 180° in their seats, and on another station: "
    "an effect that stays with the units is of the sensors",
}
_IN_MODEL = "add the effect to the model of the next lots: 'tumbleline extend', then 'tumbleline discover --model'"
"""The next action by driver or scope, a measurement; else a change of the model."""


@dataclass(frozen=True)
class Discovery:
    """A named effect with its first alarm, its drivers, contributions (n,) of the lots, and confirmation (factor, error)."""

    name: Name
    since: Alarm
    drivers: tuple[str, ...]
    carried: Array
    confirmed: tuple[float, float] | None


class Discoveries:
    """What the alarms of the evidence of one kind of device show."""

    def __init__(self, source: DiscoveryArchive, state: Evidences) -> None:
        self.source, self.state = source, state
        alarms = state.judged(held=False)
        size = state.sensor.size
        self._of_station = [alarm for alarm in alarms if alarm.index >= size]
        # effects proportional to a unit's own temperature coefficient, the strongest first
        of_thermometer = (alarm for alarm in alarms if plain(alarm.driver) == OWN_TEMPCO)
        self._of_thermometer = sorted(of_thermometer, key=lambda alarm: -self._log_e(alarm))
        self._of_sensor = [a for a in alarms if a.index < size and plain(a.driver) != OWN_TEMPCO]

    def rows(self) -> tuple[list[DiscoveryRow], list[UnexplainedRow]]:
        """The discoveries, and what no effect explains: where nothing is named, every driver with an alarm."""
        rows = [self._named_row(discovery) for discovery in self.named]
        strongest: dict[str, Alarm] = {}
        # columns of one table are nearly collinear: that which explains most represents its driver
        for alarm in sorted(self._of_station, key=self._explained, reverse=True):
            strongest.setdefault(alarm.driver, alarm)
        rows += [self._station_row(alarm) for alarm in sorted(strongest.values(), key=lambda alarm: alarm.lots)]
        rows += [self._thermometer_row()] if self._of_thermometer else []
        unexplained = {unnamed.driver: self._map_row(unnamed) for unnamed in self._names[1]}
        for alarm in [] if rows else sorted(self._of_sensor, key=self._log_e, reverse=True):
            effect, _, axis = self.state.hypotheses[alarm.index]
            unexplained.setdefault(plain(alarm.driver), self._unexplained_row(plain(alarm.driver), axis, effect))
        return rows, list(unexplained.values())

    @cached_property
    def named(self) -> list[Discovery]:
        """Named effects with an alarm, in the order of their first alarm."""
        out: list[Discovery] = []
        for name in self._names[0]:
            # an effect may first raise an alarm as a function of pose
            known = {*name.effects, SHAPE}
            alarms = [
                a for a in self._of_sensor if plain(a.driver) in name.drivers and self.state.effect_of(a) in known
            ]
            if not alarms:
                continue
            since = min(alarms, key=lambda a: (a.lots, -a.log_e))
            raised = {plain(a.driver) for a in alarms}
            drivers = tuple(driver for driver in name.drivers if driver in raised)
            out.append(Discovery(name, since, drivers, *self._carried(name, since)))
        return sorted(out, key=lambda discovery: discovery.since.lots)

    @cached_property
    def _names(self) -> tuple[list[Name], list[Unnamed]]:
        """Named effects, and dependences on pose that no effect explains."""
        if not self._of_sensor:
            return [], []
        alarms = [(alarm.driver, self.state.effect_of(alarm)) for alarm in self._of_sensor]
        needed = max(self.state.least_needed(alarm.driver) for alarm in self._of_sensor)
        return self.source.pool.names(self._lots, alarms, needed)

    def some(self, most: int) -> list[tuple[ScoredLot, ScoredLot]]:
        """At most ``most`` lots, of the sensors and of the station, evenly spread over the order of arrival."""
        return [*self.source.lots(self.state.order[k] for k in self._spread(most))]

    @cached_property
    def _both(self) -> list[tuple[ScoredLot, ScoredLot]]:
        return self.some(MOST_NAMED)

    @cached_property
    def _lots(self) -> list[ScoredLot]:
        """The lots used for naming."""
        return [sensor for sensor, _ in self._both]

    @cached_property
    def _of_stations(self) -> LotStack:
        """The same lots with the sums of the station's columns."""
        return LotStack.of([station for _, station in self._both])

    @cached_property
    def _station_sums(self) -> dict[str, DriverSums]:
        """Sums of the station's columns, common and by station; those of the evidence are bounded."""
        return gathered(self._of_stations, [MEAN, STATION])

    def _spread(self, most: int) -> Places:
        count = len(self.state.order)
        return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))

    def _log_e(self, alarm: Alarm) -> float:
        """Logarithm of the evidence of an alarm's hypothesis now."""
        return float(self.state.log_e(alarm.driver)[alarm.index])

    def _carried(self, name: Name, since: Alarm) -> tuple[Array, tuple[float, float] | None]:
        """Contributions (n,) of the lots to a name, and its confirmation by lots after the alarm: factor, standard error."""
        driver, effect, pool = name.drivers[0], name.effects[0], self.source.pool
        carried = pool.carried(self._lots, driver, effect)
        first = int(np.searchsorted(self._spread(MOST_NAMED), since.lots))
        if len(self._lots) - first < LATER or first < LATER:
            return carried, None
        factor, error, able = pool.confirmed(self._lots[:first], self._lots[first:], driver, effect)
        return carried, (factor, error) if able >= LATER else None

    def _row(
        self,
        since: Alarm,
        effects: Sequence[str],
        drivers: Sequence[str],
        size: tuple[float, float, float],
        scope: tuple[Scope, str],
        log_e: float,
    ) -> DiscoveryRow:
        """The row of a discovery; its id is given when it is compared with those of earlier nights.

        since : first alarm · effects, drivers : best first · size : rms and ends of its 95 % interval, g
        scope : and its reason
        """
        floor = float(np.median([self.source.store.heads[run]["floor"] for run in self.state.order]))
        return {
            "id": "",
            "since": self._day_of(since),
            "lots_then": since.lots,
            "effects": list(effects),
            "recommended": effects[0],
            "axes": [],
            "driver": drivers[0],
            "drivers": list(drivers),
            "kind": "mean" if drivers[0] == MEAN else "levels",
            "size_ug": MICRO * size[0],
            "interval_ug": [MICRO * end for end in size[1:]],
            "size_floors": size[0] / floor if floor > 0.0 else None,
            "log_e": round(log_e, 2),
            "scope": scope[0],
            "because": scope[1],
            "levels": [],
            "carried_by": {"lots_for": None, "log_e_without_largest_2_percent": None},
            "confirmed": None,
            "next": _NEXT.get(scope[0]) or _NEXT.get(drivers[0], _IN_MODEL),
        }

    def _named_row(self, found: Discovery) -> DiscoveryRow:
        name, state, pool = found.name, self.state, self.source.pool
        effect, sizes = name.effects[0], name.by_axis
        of_thermometer = {state.effect_of(alarm) for alarm in self._of_thermometer} & set(name.effects)
        scope = ("thermometer", _PROPORTIONAL) if of_thermometer else self._scope(found)
        here = [*pool.everywhere(effect), state.sensor.count + pool.effects.index(effect)]
        by = [driver for driver in state.sensor.drivers if plain(driver) in found.drivers]
        log_e = max(float(state.log_e(driver)[here].max()) for driver in by)
        row = self._row(found.since, name.effects, found.drivers, name.size(), scope, log_e)
        row["axes"] = [a for a, size in zip("xyz", sizes, strict=True) if size > _MUCH * max(sizes)]
        row["kind"] = "slope" if row["kind"] != "mean" and name.labels == (SLOPE,) else row["kind"]
        row["levels"] = _levels_of(name)
        row["carried_by"] = {
            "lots_for": float(np.mean(found.carried > 0.0)),
            "log_e_without_largest_2_percent": round(_without_largest(found.carried), 2),
        }
        if found.confirmed is not None:
            factor, error = found.confirmed
            row["confirmed"] = bool(factor > _CONFIRMED * error)
            row["confirmed_factor"] = [round(factor, 3), round(error, 3)]
        return row

    def _station_row(self, alarm: Alarm) -> DiscoveryRow:
        """The row of an error of the station, which changes the force for all units of a lot."""
        effect, column, _ = self.state.hypotheses[alarm.index]
        at = alarm.index - self.state.sensor.size
        here = [k for k, (name, _) in enumerate(self.state.of_station) if name == effect]
        unit, largest, alone = self._sizes_of_station(here), here.index(at), np.eye(len(here))
        fits = {
            by: LevelFit(self._of_stations, sums, np.array(here), 1, (alone, alone, alone, alone))
            for by, sums in self._station_sums.items()
        }
        square, deviation = fits[_of_reference(alarm.driver)].mean_square(np.diag(unit**2))
        size, low, high = np.sqrt(np.maximum(square + WIDE * deviation * np.array([0.0, -1.0, 1.0]), 0.0)).tolist()
        common, by_station = self._station_sums[MEAN], self._station_sums[STATION]
        of_mean = over(common.score, common.information)[:, here] * (len(by_station.labels) > 1)
        sizes = (unit * (of_mean + fits[STATION].sizes))[:, largest]
        errors = unit[largest] * np.sqrt(np.mean(fits[STATION].errors[..., largest] ** 2, axis=0))
        drops = sorted(
            (self._explained(a), self.state.effect_of(a)) for a in self._of_station if a.driver == alarm.driver
        )
        effects = dict.fromkeys(name for drop, name in reversed(drops) if drop > drops[-1][0] - CLASS_WIDTH)
        because = f"the force is changed equally for all units of a lot (column {column + 1} of {effect})"
        row = self._row(alarm, [*effects], [alarm.driver], (size, low, high), ("station", because), self._log_e(alarm))
        row["kind"] = "slope" if alarm.driver == DATE else row["kind"]
        row["levels"] = [
            {"level": label, "size_ug": MICRO * value, "u_ug": MICRO * error, "units": 0, "axis": ""}
            for label, value, error in zip(by_station.labels, sizes.tolist(), errors.tolist(), strict=True)
        ]
        row["next"] = "check the station's references (level, encoders, fixture), see 'tumbleline audit'"
        return row

    def _explained(self, alarm: Alarm) -> float:
        """Reduction of the chi-square of all lots by a column of the station, common to all stations or about their mean."""
        sums, at = self._station_sums[_of_reference(alarm.driver)], alarm.index - self.state.sensor.size
        return float(over(sums.centred[:, at] ** 2, sums.information[:, at]).sum())

    def _sizes_of_station(self, columns: Sequence[int]) -> Array:
        """Rms over the dwells, g, of columns (p,) of the station with coefficient one, of what the model of a lot leaves of them.

        Their information per unit and axis, beside that of functions of the pose, whose size is known.
        """
        here = self.source.pool.everywhere(SHAPE)
        own = np.mean([sensor.own[:, here].mean(axis=0) for sensor in self._lots], axis=0)
        units = np.array([[len(sensor.units)] for sensor in self._lots])
        of_station = np.mean(self._of_stations.information[:, columns] / (AXES * units), axis=0)
        return np.sqrt(of_station / np.median(over(own, self.source.pool.size[here] ** 2)))

    def _thermometer_row(self) -> DiscoveryRow:
        """The row of an error of the thermometer, which every unit shows by its temperature coefficient."""
        alarms, pool = self._of_thermometer, self.source.pool
        effects = list(dict.fromkeys(self.state.effect_of(alarm) for alarm in alarms))
        sums = self.state.sensor.levels[OWN_TEMPCO + INSIDE]
        (score, information), (_, total) = sums.of(SLOPE), sums.of(ALL)
        # rms over the units, of the coefficient and of its error by the scatter within lots
        spread = np.sqrt(over(information, total)) * pool.size
        size = over(score, information) * spread
        error = np.where(information > 0.0, self.state.sensor.noise[1], 0.0) * over(spread, np.sqrt(information))
        first = pool.everywhere(effects[0]).reshape(AXES, -1)[:, 0]
        rms, wide = (float(np.sqrt(np.mean(values[first] ** 2))) for values in (size, error))
        ends = rms, max(rms - 2.0 * wide, 0.0), rms + 2.0 * wide
        since = min(alarms, key=lambda alarm: alarm.lots)
        row = self._row(since, effects, [OWN_TEMPCO], ends, ("thermometer", _PROPORTIONAL), self._log_e(alarms[0]))
        sizes = np.abs(size[first])
        row["axes"] = [a for a, of_axis in zip("xyz", sizes, strict=True) if of_axis > _MUCH * sizes.max()]
        row["kind"] = "slope"
        row["next"] = "compare the thermometer with a reference in every soak, and wait longer before the first dwell"
        return row

    def _scope(self, found: Discovery) -> tuple[Scope, str]:
        """Scope of a discovery (sensor, station, or either), and its reason."""
        driver, stations = found.drivers[0], len(self.state.sensor.wander.stations)
        if driver in _BY_DRIVER:
            return _BY_DRIVER[driver]
        if any(a.driver == driver + INSIDE for a in self._of_sensor):
            return "sensor", "units of one lot differ by it; errors of the station are common to a lot and cancel"
        if stations > 1 and driver not in {MEAN, DATE, SEASON}:
            return "sensor", "lots of other stations predict it, which excludes wander of a single station"
        here = self.source.pool.everywhere(found.name.effects[0])
        # an error of one reference is in several columns and axes at once, so that they are no further evidence
        by_chance = self.state.sensor.alike_by_chance()[here].min() * here.size * len(self.source.pool.effects)
        if driver == MEAN and by_chance < ALPHA:
            return "sensor", f"{stations} stations agree better than references that differ at random between them"
        return "sensor_or_station", f"the references of {number_of(stations, 'station')} may be the cause"

    def _unexplained_row(self, driver: str, axis: str, nearest: str) -> UnexplainedRow:
        """The row of a difference by a driver that no effect explains, without a map."""
        alarms = [a for a in self._of_sensor if plain(a.driver) == driver]
        since = min(alarms, key=lambda a: a.lots)
        return {
            "id": "",
            "since": self._day_of(since),
            "lots_then": since.lots,
            "driver": driver,
            "level": "",
            "axes": [axis] if axis else list("xyz"),
            "map": [],
            "log_e": round(max(map(self._log_e, alarms)), 2),
            "nearest": nearest,
        }

    def _map_row(self, unnamed: Unnamed) -> UnexplainedRow:
        """The row of an unexplained dependence with a map over the poses of the newest lot, on the most significant axis."""
        force = self.source.poses(self.state.order[-1])
        maps = [map_of(force, *fit) for fit in zip(unnamed.size, unnamed.covariance, strict=True)]
        best = int(np.argmax([np.sum(value**2) / np.sum(error**2) for value, error in maps]))
        row = self._unexplained_row(unnamed.driver, "xyz"[best], self._nearest(unnamed.driver))
        row["level"] = unnamed.level
        angles = np.degrees(np.column_stack(angles_from_force(force)))
        row["map"] = np.column_stack([angles, MICRO * np.column_stack(maps[best])]).tolist()
        return row

    def _nearest(self, driver: str) -> str:
        """The effect of the catalogue with the largest evidence by a driver."""
        sensor = self.state.sensor
        log_e = np.max([sums.log_e for name, sums in sensor.drivers.items() if plain(name) == driver], axis=0)
        effects = [hypothesis.effect for hypothesis in self.state.hypotheses[: sensor.size]]
        return effects[int(np.argmax(np.where(np.array(effects) == SHAPE, -np.inf, log_e)))]

    def _day_of(self, alarm: Alarm) -> str:
        """The day of the lot that raised an alarm."""
        return self.source.day_of(self.state.order[min(alarm.lots, len(self.state.order)) - 1])


def plain(driver: str) -> str:
    """The name of a driver without the suffix of judgement within lots."""
    return driver.removesuffix(INSIDE)


def _of_reference(driver: str) -> str:
    """The driver by which the sizes of an error of the references are told: of a date, the station."""
    return MEAN if driver == MEAN else STATION


def _levels_of(name: Name) -> list[DiscoveredLevel]:
    """The levels on the axis with the largest differences, in order of size."""
    axis = int(np.argmax(name.by_axis))
    order = np.argsort(-np.abs(name.sizes[:, axis]))[:_SHOWN_LEVELS]
    return [
        {
            "level": name.labels[at],
            "size_ug": MICRO * float(name.sizes[at, axis]),
            "u_ug": MICRO * float(name.errors[at, axis]),
            "units": int(name.weights[at]),
            "axis": "xyz"[axis],
        }
        for at in order
        if np.isfinite(name.errors[at, axis])
    ]


def _without_largest(carried: Array) -> float:
    """Log evidence of the lots' contributions without the largest two per cent."""
    rest = np.sort(carried)[: max(1, int(0.98 * carried.size))]
    return float(growth_of(rest)[-1])
