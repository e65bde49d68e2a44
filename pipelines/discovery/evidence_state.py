"""The evidence of a kind of device after some evaluations (nights): its hypotheses, thresholds, alarms, and its file."""

import io
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from inertial.arrays import Array, Places, over
from inertial.discovery.evidence import INSIDE, MEAN, SLOT, STATION, UNIT, Evidence, restored, stored
from inertial.discovery.running_sums import FIRST
from inertial.discovery.scores import Column
from inertial.discovery.station_wander import WALK_FROM
from pipelines.archive import derived, files
from pipelines.archive.store import Place
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.score_store import AXES

ALPHA = 0.05
"""Probability of any false discovery over the complete life of an archive."""

STATION_DRIVERS = {MEAN, STATION, "date"}
"""Drivers of the station's own columns."""

_MOST_COLUMNS = 5
"""Largest number of columns of an effect that is also judged by all its columns together. A bad lot shifts the predictions of all
columns a little: summed over the 63 of any function of pose, that caused false discoveries in 6 of 47 archives in which one lot
in a hundred had twenty times the noise."""

_MOST_HELD = 0.2
"""Largest part of an effect's evidence by all its columns that columns and axes which would be held may contribute."""

_LAYOUT = 4  # version of the state file


class Hypothesis(NamedTuple):
    """What is judged: a column on an axis; column -1 and axis "": all columns of an effect; axis "": a column of the station."""

    effect: str
    column: int
    axis: str

    def __str__(self) -> str:
        if self.column < 0:
            return self.effect
        return f"{self.effect}.{self.column}" + (f".{self.axis}" if self.axis else "")


@dataclass(frozen=True)
class Alarm:
    """Evidence beyond the threshold: driver, index of the hypothesis, first night, number of lots then, log evidence then."""

    driver: str
    index: int
    night: int
    lots: int
    log_e: float


@dataclass
class Evidences:
    """Evidence of a kind of device after some nights.

    columns : columns of the sensor, in the order of the hypotheses of one axis · of_station : columns of the station
    sensor, station : evidence · order : runs in the order of arrival · taken_out : runs that no longer count
    generations : index of the night that added each driver; later ones share a smaller error probability
    """

    columns: tuple[Column, ...]
    of_station: tuple[Column, ...]
    sensor: Evidence
    station: Evidence
    order: list[str] = field(default_factory=list[str])
    taken_out: list[str] = field(default_factory=list[str])
    generations: dict[str, int] = field(default_factory=dict[str, int])
    alarms: list[Alarm] = field(default_factory=list[Alarm])
    night: int = 0

    @classmethod
    def fresh(cls, source: DiscoveryArchive) -> "Evidences":
        """Evidence without a lot."""
        sensor, station = source.columns
        order: list[str] = []
        made = Evidence(AXES * len(sensor), source.earlier(order), numbered(sensor))
        return cls(sensor, station, made, Evidence(len(station)), order)

    @cached_property
    def hypotheses(self) -> list[Hypothesis]:
        """Axes × columns of the sensor, then its effects with all columns, then columns of the station."""
        single = [Hypothesis(effect, column, axis) for axis in "xyz" for effect, column in self.columns]
        complete = [Hypothesis(effect, -1, "") for effect in dict.fromkeys(effect for effect, _ in self.columns)]
        return [*single, *complete, *(Hypothesis(effect, column, "") for effect, column in self.of_station)]

    def effect_of(self, alarm: Alarm) -> str:
        """Id of the effect of an alarm."""
        return self.hypotheses[alarm.index].effect

    def log_e(self, driver: str) -> Array:
        """Logarithm of the evidence of every hypothesis by a driver, -inf where it does not judge."""
        of_station = self.station.drivers.get(driver) if driver in STATION_DRIVERS else None
        parts = (self.sensor, self.sensor.drivers.get(driver)), (self.station, of_station)
        return np.concatenate([np.full(of.size, -np.inf) if sums is None else sums.log_e for of, sums in parts])

    def needed(self, driver: str) -> Array:
        """Threshold of the log evidence of each hypothesis by a driver.

        The drivers of a generation share its error probability equally, and so do the effects of a driver: half of an effect's
        share is for all its columns together, half for its single columns and axes. An effect of many columns, as any function
        of pose, gets no larger share than one with a single column, and is not judged by all its columns together.
        """
        generation = self.generations.get(driver, 0)
        drivers = (Counter(self.generations.values())[generation] or 1) + (
            len(STATION_DRIVERS) if generation == 0 else 0
        )
        share = ALPHA * 0.5 ** (generation + 1) / drivers
        of_column, count = numbered(self.columns), len(self.of_station)
        columns = np.bincount(of_column)
        effect_share = np.where(columns > _MOST_COLUMNS, 0.0, 0.5)
        shares = np.concatenate([np.tile(((1.0 - effect_share) / (AXES * columns))[of_column], AXES), effect_share])
        of_sensor = np.where(
            shares > 0.0, np.log(columns.size / share) - np.log(np.where(shares > 0.0, shares, 1.0)), np.inf
        )
        return np.append(
            of_sensor, np.full(count, np.log(max(count, 1) / share) if driver in STATION_DRIVERS else np.inf)
        )

    def least_needed(self, driver: str = MEAN) -> float:
        """The smallest threshold of a driver's hypotheses of the sensor."""
        return float(self.needed(driver)[: self.sensor.size].min(initial=np.inf))

    def unknown(self, alarms: Iterable[Alarm]) -> list[Alarm]:
        """The alarms for hypotheses without an earlier alarm."""
        known = {(alarm.driver, alarm.index) for alarm in self.alarms}
        return [alarm for alarm in alarms if (alarm.driver, alarm.index) not in known]

    def raised(self) -> list[Alarm]:
        """Hypotheses beyond the threshold, without an earlier alarm."""
        out: list[Alarm] = []
        for driver in self.sensor.drivers | self.station.drivers:
            log_e = self.log_e(driver)
            beyond = np.flatnonzero(log_e >= self.needed(driver)).tolist()
            out += [Alarm(driver, at, self.night, len(self.order), float(log_e[at])) for at in beyond]
        return self.unknown(sorted(out, key=lambda alarm: alarm.index >= self.sensor.size))

    def judged(self, *, held: bool) -> list[Alarm]:
        """Alarms that are discoveries, or those that are held back; without those that no present evidence supports."""
        judged = (a for a in self.alarms if a.driver in self.sensor.drivers or a.driver in self.station.drivers)
        return [alarm for alarm in judged if self.held(alarm) is held]

    def held(self, alarm: Alarm) -> bool:
        """Whether a station may cause an alarm: its driver is constant in a lot, and the effect wanders or differs by station."""
        sensor, wander = self.sensor, self.sensor.wander
        if alarm.index >= sensor.size or alarm.driver.endswith(INSIDE) or alarm.driver in {SLOT, UNIT, STATION}:
            return False  # judged within lots, or explicitly attributed to the station
        if alarm.driver == MEAN:
            of_station = ~sensor.shared_by_stations() | sensor.guarded
        else:
            walk = wander.gained if len(wander.stations) < 2 else wander.gained_beside(alarm.driver)
            of_station = walk > WALK_FROM
        if alarm.index < sensor.count or sensor.effects is None:
            return bool(of_station[alarm.index])
        of_effect, sums = sensor.effects == alarm.index - sensor.count, sensor.drivers[alarm.driver]
        carried = of_effect * over(sums.s[: sensor.count] ** 2, sums.v[: sensor.count])
        return float(carried[of_station].sum()) > _MOST_HELD * float(carried.sum())


def numbered(columns: Sequence[Column]) -> Places:
    """Index of the effect of each column, (k,)."""
    number = {effect: at for at, effect in enumerate(dict.fromkeys(effect for effect, _ in columns))}
    return np.array([number[effect] for effect, _ in columns], dtype=np.intp)


def state_bytes(state: Evidences) -> bytes:
    """The state as the content of a file."""
    arrays = list[Any]()
    known = ("sensor", "station", "order", "taken_out", "generations", "night")
    about = {
        "layout": _LAYOUT,
        "columns": [state.columns, state.of_station],
        "alarms": [astuple(alarm) for alarm in state.alarms],
        "state": {name: stored(getattr(state, name), arrays) for name in known},
    }
    buffer = io.BytesIO()
    parts = {str(number): value for number, value in enumerate(arrays)}
    np.savez(buffer, allow_pickle=False, about=np.frombuffer(json.dumps(about).encode(), dtype=np.uint8), **parts)
    return buffer.getvalue()


def stored_state(source: DiscoveryArchive, folder: Place, nights: Sequence[Mapping[str, Any]]) -> Evidences | None:
    """The stored state; None if it does not match the last night, its layout, or the present hypotheses."""
    path = folder / "state"
    if not nights or not path.is_file():
        return None
    data, standing = derived.unframed(path)
    if standing == derived.EDITED:
        derived.warn_of_edits(path)
    if standing != derived.SOUND or files.hash_of(data) != nights[-1]["state"] or nights[-1]["lots"] < FIRST:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as loaded:
        about = json.loads(loaded["about"].tobytes()) if "about" in loaded else {}
        if about.get("layout") != _LAYOUT or about["columns"] != json.loads(json.dumps(source.columns)):
            return None
        arrays = [loaded[str(number)] for number in range(len(loaded.files) - 1)]
    alarms = [Alarm(*alarm) for alarm in about["alarms"]]
    parts = {name: restored(part, arrays) for name, part in about["state"].items()}
    state = Evidences(*source.columns, **parts, alarms=alarms)
    if any(run not in source.store.heads for run in state.order):
        return None
    state.sensor.earlier = source.earlier(state.order)
    return state
