"""Findings of the evidence of an archive: named discoveries with size, scope and support, and evidence that is held back."""

from collections import Counter
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from inertial.arrays import Array
from inertial.counts import number_of
from inertial.discovery.evidence import DATE, INSIDE, MEAN, SLOT, STATION, UNIT, ScoredLot
from inertial.discovery.naming import Name, Unnamed
from inertial.discovery.pose_shape import SHAPE, angles_of, map_of
from inertial.discovery.running_sums import FIRST
from pipelines.discovery import documents
from pipelines.discovery.alarms import Alarms
from pipelines.discovery.documents import DiscoveryRow, DriverRow, HeldAlarm, ReachRow, UnexplainedRow
from pipelines.discovery.evidence_state import ALPHA, Alarm, hypothesis
from pipelines.discovery.figures_of_name import (
    Scope,
    by_axis,
    levels_of,
    next_of,
    plain,
    size_of,
    without_largest,
)
from pipelines.discovery.lot_source import AXES, OWN_TEMPCO, SEASON
from pipelines.discovery.nights import held
from pipelines.discovery.reference_rows import PROPORTIONAL, station_row, thermometer_row
from schemas.units import MICRO

LATER = 20  # smallest number of lots after an alarm that can confirm it
MOST_NAMED = 3000  # largest number of lots used for naming, evenly spread over a larger archive
_CONFIRMED = 2.05  # standard errors above zero (two-sided 4 %), as for a fresh run
_SOME = 50
_BY_DRIVER: dict[str, tuple[Scope, str]] = {
    STATION: ("station", "it differs between stations for units of the same kind, permanently or by slow wander"),
    SLOT: ("station", "it stays with the slot of the fixture while the units change"),
    UNIT: ("sensor", "the same unit shows it again in later lots, compared with the other units of each lot"),
}
"""Scope of a discovery that follows from its driver alone, and the reason."""


@dataclass(frozen=True)
class Discovery:
    """A named effect with its first alarm, its drivers, contributions (n,) of the lots, and confirmation (factor, error)."""

    name: Name
    since: Alarm
    drivers: tuple[str, ...]
    carried: Array
    confirmed: tuple[float, float] | None


class Findings(Alarms):
    """The findings of the evidence of one kind of device."""

    def _spread(self, most: int) -> NDArray[np.intp]:
        """Indices of at most ``most`` lots, evenly spread over the order of arrival."""
        count = len(self.state.order)
        return np.unique(np.linspace(0, max(count - 1, 0), min(count, most)).round().astype(np.intp))

    def _lots(self, most: int) -> list[ScoredLot]:
        return [sensor for sensor, _ in self.source.lots([self.state.order[k] for k in self._spread(most)])]

    @cached_property
    def some(self) -> list[ScoredLot]:
        """Fifty lots at most, evenly spread, for quantities that are similar in all lots."""
        return self._lots(_SOME)

    @cached_property
    def lots(self) -> list[ScoredLot]:
        """The lots used for naming."""
        return self._lots(MOST_NAMED)

    @cached_property
    def _of_sensor(self) -> list[Alarm]:
        """Open alarms of effects of the devices and of functions of pose, without those of the thermometer."""
        of_devices = (alarm for alarm in self.open_alarms if alarm.index < self.state.sensor.size)
        return [alarm for alarm in of_devices if plain(alarm.driver) != OWN_TEMPCO]

    @cached_property
    def _named(self) -> tuple[list[Name], list[Unnamed]]:
        """Named effects, and dependences on pose that no effect explains."""
        if not self._of_sensor:
            return [], []
        alarms = [(alarm.driver, self.effect_of(alarm)) for alarm in self._of_sensor]
        needed = max(float(self.state.needed(alarm.driver).min()) for alarm in self._of_sensor)
        return self.pool.names(self.lots, alarms, needed)

    @cached_property
    def discoveries(self) -> list[Discovery]:
        """Named effects with an alarm, in the order of their first alarm."""
        out: list[Discovery] = []
        for name in self._named[0]:
            # an effect may first raise an alarm as a function of pose
            known = {*name.effects, SHAPE}
            alarms = [a for a in self._of_sensor if plain(a.driver) in name.drivers and self.effect_of(a) in known]
            if not alarms:
                continue
            since = min(alarms, key=lambda a: (a.lots, -a.log_e))
            raised = {plain(a.driver) for a in alarms}
            drivers = tuple(driver for driver in name.drivers if driver in raised) or (name.drivers[0],)
            out.append(Discovery(name, since, drivers, *self._carried(name, since)))
        return sorted(out, key=lambda discovery: discovery.since.lots)

    def _indices(self, effect: str) -> NDArray[np.intp]:
        """Indices of the hypotheses of an effect on all axes, (3·columns,)."""
        k = len(self.state.columns)
        return np.concatenate([axis * k + self.pool.places(effect) for axis in range(AXES)])

    def _carried(self, name: Name, since: Alarm) -> tuple[Array, tuple[float, float] | None]:
        """Contributions (n,) of the lots to a name, and its confirmation by lots after the alarm: factor, standard error."""
        driver, effect = name.drivers[0], name.effects[0]
        carried = self.pool.carried(self.lots, driver, effect)
        first = int(np.searchsorted(self._spread(MOST_NAMED), since.lots))
        if len(self.lots) - first < LATER or first < LATER:
            return carried, None
        factor, error, able = self.pool.confirmed(self.lots[:first], self.lots[first:], driver, effect)
        return carried, (factor, error) if able >= LATER else None

    def document(
        self,
        before: tuple[list[DiscoveryRow], list[UnexplainedRow]] | None = None,
        *,
        looking_back: bool = False,
    ) -> documents.DiscoverDocument:
        """The findings as a document.

        Parameters
        ----------
        before : discoveries and unexplained dependences of an earlier night with the same alarms, to be reused
        """
        state, source = self.state, self.source
        heads = [source.store.head(run) for run in state.order]
        rows, unexplained = self._found() if before is None else before
        largest = max((source.store.head(run)["model"] for run in state.order[-1:]), default="")
        return {
            "pooled": {
                "lots": len(state.order),
                "units": sum(len(head["units"]) for head in heads),
                "left_out": [{"run": run, "reason": reason} for run, reason in source.left_out()],
                "from": min((head["when"][:10] for head in heads), default=None),
                "until": max((head["when"][:10] for head in heads), default=None),
            },
            "model": largest.split(",") if largest else [],
            "device": source.device,
            "error_control": {
                "alpha": ALPHA,
                "hypotheses": len(state.sensor.drivers) * state.sensor.size,
                "log_e_needed": round(state.least_needed, 2) if state.sensor.count else None,
                "valid": "every night",
            },
            "discoveries": rows,
            "held": self._held(),
            "unexplained": unexplained,
            "population": [],
            "reach": self.reach(),
            "unseen": self._unseen(),
            "drivers": self._drivers(),
            "warnings": self._warnings(),
            "compared": [],
            "new": [],
            "looking_back": looking_back,
        }

    def _found(self) -> tuple[list[DiscoveryRow], list[UnexplainedRow]]:
        rows = [self._row(discovery) for discovery in self.discoveries] + [
            station_row(self, alarm) for alarm in self._of_station
        ]
        rows += [thermometer_row(self)] if self.of_thermometer else []
        unexplained = self._unexplained(named=bool(rows))
        for number, row in enumerate((*rows, *unexplained), start=1):
            row["id"] = f"D{number}"
        return rows, unexplained

    def _row(self, found: Discovery) -> DiscoveryRow:
        name = found.name
        size, low, high = size_of(name)
        of_thermometer = {self.effect_of(alarm) for alarm in self.of_thermometer} & set(name.effects)
        scope, because = ("thermometer", PROPORTIONAL) if of_thermometer else self._scope(found)
        driver = found.drivers[0] if name.drivers[0] not in found.drivers else name.drivers[0]
        sums = [
            driver_sums for driver, driver_sums in self.state.sensor.drivers.items() if plain(driver) in found.drivers
        ]
        indices = [*self._indices(name.effects[0]), self.state.sensor.count + self.pool.effects.index(name.effects[0])]
        log_e = max(float(driver_sums.log_e[indices].max()) for driver_sums in sums)
        sizes = by_axis(name)
        row: DiscoveryRow = {
            "id": "",
            "since": self.day_of(found.since),
            "lots_then": found.since.lots,
            "effects": list(name.effects),
            "recommended": name.effects[0],
            "axes": [a for a, of_axis in zip("xyz", sizes, strict=True) if of_axis > 0.25 * max(sizes)],
            "driver": driver,
            "drivers": list(found.drivers),
            "kind": "mean" if driver == MEAN else "slope" if name.labels == ("slope",) else "levels",
            "size_ug": MICRO * size,
            "interval_ug": [MICRO * low, MICRO * high],
            "size_floors": self.floors(size),
            "log_e": round(log_e, 2),
            "scope": scope,
            "because": because,
            "levels": levels_of(name),
            "carried_by": {
                "lots_for": float(np.mean(found.carried > 0.0)),
                "log_e_without_largest_2_percent": round(without_largest(found.carried), 2),
            },
            "confirmed": None,
            "next": next_of(driver, scope),
        }
        if found.confirmed is not None:
            factor, error = found.confirmed
            row["confirmed"] = bool(factor > _CONFIRMED * error)
            row["confirmed_factor"] = [round(factor, 3), round(error, 3)]
        return row

    def _scope(self, found: Discovery) -> tuple[Scope, str]:
        """Scope of a discovery (sensor, station, or either), and its reason."""
        driver, stations = found.drivers[0], len(self.state.sensor.wander.stations)
        if driver in _BY_DRIVER:
            return _BY_DRIVER[driver]
        if any(a.driver.endswith(INSIDE) for a in self.open_alarms if plain(a.driver) == driver):
            return "sensor", "units of one lot differ by it; errors of the station are common to a lot and cancel"
        if stations < 2:
            return (
                "sensor_or_station",
                "with one station, permanent errors or wander of its references cannot be excluded",
            )
        if driver not in {MEAN, DATE, SEASON}:
            return "sensor", "lots of other stations predict it, which excludes wander of a single station"
        if self.state.sensor.shared_by_stations()[self._indices(found.name.effects[0])].any():
            return "sensor", f"all {stations} stations show it, and they differ by less than it"
        return "sensor_or_station", f"{stations} stations are too few to exclude permanent errors of their references"

    @cached_property
    def _of_station(self) -> list[Alarm]:
        """Alarms of the station's columns, the strongest of each driver."""
        best: dict[tuple[str, str], Alarm] = {}
        for alarm in self.open_alarms:
            if alarm.index >= self.state.sensor.size:
                key = self.effect_of(alarm), alarm.driver
                best[key] = max(best.get(key, alarm), alarm, key=lambda alarm: alarm.log_e)
        strongest: dict[str, Alarm] = {}
        # columns of one table are nearly collinear: the strongest represents its driver
        for alarm in sorted(best.values(), key=lambda alarm: -self.log_e(alarm)):
            strongest.setdefault(alarm.driver, alarm)
        return sorted(strongest.values(), key=lambda alarm: alarm.lots)

    def _held(self) -> list[HeldAlarm]:
        reason = "it is constant within each lot, and stations differ or wander in this effect"
        if len(self.state.sensor.wander.stations) < 2:
            reason = "with one station it may be an error of the station's references"
        rows: list[HeldAlarm] = []
        for alarm in self.state.alarms:
            if held(self.state, alarm):
                effect, _, axis = hypothesis(self.state, alarm.index)
                log_e = round(self.log_e(alarm), 2)
                rows.append({"effect": effect, "axis": axis, "driver": alarm.driver, "log_e": log_e, "reason": reason})
        return sorted(rows, key=lambda row: -row["log_e"])

    def _unexplained(self, *, named: bool) -> list[UnexplainedRow]:
        """Dependences on pose that no effect explains; and, where nothing is named, every driver with an alarm."""
        rows = {unnamed.driver: self._map_row(unnamed) for unnamed in self._named[1]}
        for alarm in [] if named else sorted(self._of_sensor, key=self.log_e, reverse=True):
            effect, _, axis = hypothesis(self.state, alarm.index)
            rows.setdefault(plain(alarm.driver), self._unnamed_row(plain(alarm.driver), axis, effect))
        return list(rows.values())

    def _unnamed_row(self, driver: str, axis: str, nearest: str) -> UnexplainedRow:
        """The row of a difference by a driver that no effect explains, without a map."""
        alarms = [a for a in self._of_sensor if plain(a.driver) == driver]
        since = min(alarms, key=lambda a: a.lots)
        return {
            "id": "",
            "since": self.day_of(since),
            "lots_then": since.lots,
            "driver": driver,
            "level": "",
            "axes": [axis] if axis else list("xyz"),
            "map": [],
            "log_e": round(max(map(self.log_e, alarms)), 2),
            "nearest": nearest,
        }

    def _map_row(self, unnamed: Unnamed) -> UnexplainedRow:
        """The row of an unexplained dependence with a map over the poses of the newest lot, on the most significant axis."""
        force = self.source.poses(self.state.order[-1])
        maps = [map_of(force, *fit) for fit in zip(unnamed.size, unnamed.covariance, strict=True)]
        best = int(np.argmax([np.sum(value**2) / np.sum(error**2) for value, error in maps]))
        row = self._unnamed_row(unnamed.driver, "xyz"[best], self._nearest(unnamed.driver))
        row["level"] = unnamed.level
        row["map"] = np.column_stack([angles_of(force), MICRO * np.column_stack(maps[best])]).tolist()
        return row

    def _nearest(self, driver: str) -> str:
        """The effect of the catalogue with the largest evidence by a driver."""
        log_e = np.max(
            [sums.log_e for name, sums in self.state.sensor.drivers.items() if plain(name) == driver], axis=0
        )
        places = [at for at in range(log_e.size) if hypothesis(self.state, at)[0] != SHAPE]
        return hypothesis(self.state, max(places, key=lambda at: float(log_e[at])))[0]

    def reach(self) -> list[ReachRow]:
        """The smallest size of each effect that this archive would have shown in 95 % of cases."""
        state, lots = self.state, len(self.state.order)
        if lots < FIRST:
            return []
        between, within = state.sensor.noise
        inside = np.mean([lot.own.sum(axis=0) for lot in self.some], axis=0) * lots
        times = np.sqrt(2.0 * (state.least_needed + 0.5 * np.log1p(0.03 * lots))) + stats.norm.ppf(0.95)
        rows: list[ReachRow] = []
        for driver, information, noise in ((MEAN, state.sensor.information, between), ("inside lots", inside, within)):
            seen = information > 0.0
            sizes = np.where(seen, times * noise / np.sqrt(np.where(seen, information, 1.0)) * self.pool.size, np.nan)
            for effect in self.pool.effects:
                of_effect = sizes[self._indices(effect)]
                visible = of_effect[np.isfinite(of_effect) & (of_effect > 0.0)]
                if visible.size:
                    smallest = MICRO * float(np.median(visible))
                    needed = max(FIRST, int(np.ceil(lots * smallest**2)))
                    rows.append({"effect": effect, "driver": driver, "smallest_ug": smallest, "lots_to_1_ug": needed})
        return rows

    def _unseen(self) -> list[documents.UntoldEffect]:
        information = self.state.sensor.information.reshape(AXES, -1)
        inside = sum((lot.own.sum(axis=0) for lot in self.some), np.zeros(self.state.sensor.count)).reshape(AXES, -1)
        if len(self.state.order) < FIRST:
            return []
        alone, nowhere = "errors of the station have the same columns", "no lot excites it"
        places = {effect: self.pool.places(effect) for effect in self.pool.effects}
        return [
            {"effect": effect, "reason": alone if inside[:, at].any() else nowhere}
            for effect, at in places.items()
            if not information[:, at].any()
        ]

    def _drivers(self) -> list[DriverRow]:
        judged = list(dict.fromkeys(map(plain, self.state.sensor.drivers)))
        rows: list[DriverRow] = [{"name": name, "status": "judged"} for name in judged]
        known = [values for by in (self.source.attributes.serial, self.source.attributes.run) for values in by.values()]
        for name in self.source.attributes.names():
            if name not in judged:
                levels = {value for values in known if (value := values.get(name))}
                status = "one level" if len(levels) < 2 else "no unit of a pooled lot has it"
                rows.append({"name": name, "status": status})
        return rows

    def _warnings(self) -> list[str]:
        out: list[str] = []
        lots = len(self.state.order)
        reasons = Counter(reason for _, reason in self.source.left_out())
        if not lots and reasons:
            counted = "; ".join(f"{reason} ({number_of(count, 'run')})" for reason, count in reasons.most_common())
            out.append(f"no lot can be used: {counted}")
        elif lots < FIRST:
            out.append(
                f"{number_of(lots, 'lot')}: a discovery needs at least {FIRST}, one that follows an attribute about 60"
            )
        for device, count in self.source.other_devices.items():
            out.append(
                f"{count} runs are of {device}, and are never pooled with {self.source.device}: --device {device}"
            )
        if self.state.taken_out:
            out.append(f"{len(self.state.taken_out)} runs were taken out because a calibration of them was revoked")
        if len(self.state.sensor.wander.stations) == 1 and lots:
            out.append(
                "one station: effects that are constant within a lot may be its wander; measure units on two stations"
            )
        return out
