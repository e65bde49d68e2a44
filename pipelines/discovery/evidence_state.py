"""The evidence of a kind of device after some evaluations (nights), its alarms, and the file that stores it."""

import io
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from inertial.arrays import Array, Places
from inertial.discovery.evidence import MEAN, STATION, Evidence
from inertial.discovery.running_sums import FIRST
from pipelines.archive import derived, files
from pipelines.archive.store import Place
from pipelines.discovery.lot_source import AXES, Column, DiscoveryArchive

ALPHA = 0.05
"""Probability of any false discovery over the complete life of an archive."""

STATION_DRIVERS = {MEAN, STATION, "date"}
"""Drivers of the station's own columns."""

_MOST_COLUMNS = 5
"""Largest number of columns of an effect that is also judged by all its columns together. A bad lot shifts the predictions of all
columns a little: summed over the 63 of any function of pose, that caused false discoveries in 6 of 47 archives in which one lot
in a hundred had twenty times the noise."""

_LAYOUT = 2  # version of the state file


@dataclass(frozen=True)
class Alarm:
    """Evidence beyond the threshold: driver, index of the hypothesis, first night, number of lots then, log evidence then.

    index : axes × columns of the sensor, then its effects with all columns, then columns of the station
    """

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

    device: str
    columns: tuple[Column, ...]
    of_station: tuple[Column, ...]
    sensor: Evidence
    station: Evidence
    order: list[str] = field(default_factory=list[str])
    taken_out: list[str] = field(default_factory=list[str])
    generations: dict[str, int] = field(default_factory=dict[str, int])
    alarms: list[Alarm] = field(default_factory=list[Alarm])
    night: int = 0

    def unknown(self, alarms: Iterable[Alarm]) -> list[Alarm]:
        """The alarms for hypotheses without an earlier alarm."""
        known = {(alarm.driver, alarm.index) for alarm in self.alarms}
        return [alarm for alarm in alarms if (alarm.driver, alarm.index) not in known]

    def needed(self, driver: str, *, of_station: bool = False) -> Array:
        """Threshold of the log evidence of each hypothesis of a driver, (hypotheses,).

        The drivers of a generation share its error probability equally, and so do the effects of a driver: half of an effect's
        share is for all its columns together, half for its single columns and axes. An effect of many columns, as any function
        of pose, gets no larger share than one with a single column, and is not judged by all its columns together.
        """
        generation = self.generations.get(driver, 0)
        drivers = (Counter(self.generations.values())[generation] or 1) + (
            len(STATION_DRIVERS) if generation == 0 else 0
        )
        share = ALPHA * 0.5 ** (generation + 1) / drivers
        if of_station:
            return np.full(len(self.of_station), np.log(len(self.of_station) / share))
        of_column = numbered(self.columns)
        columns = np.bincount(of_column)
        effect_share = np.where(columns > _MOST_COLUMNS, 0.0, 0.5)
        shares = np.concatenate([np.tile(((1.0 - effect_share) / (AXES * columns))[of_column], AXES), effect_share])
        return np.where(
            shares > 0.0, np.log(columns.size / share) - np.log(np.where(shares > 0.0, shares, 1.0)), np.inf
        )

    @property
    def least_needed(self) -> float:
        """The smallest threshold of the mean's hypotheses."""
        return float(self.needed(MEAN).min(initial=np.inf))


def numbered(columns: Sequence[Column]) -> Places:
    """Index of the effect of each column, (k,)."""
    number = {effect: at for at, effect in enumerate(dict.fromkeys(effect for effect, _ in columns))}
    return np.array([number[effect] for effect, _ in columns], dtype=np.intp)


def below(parts: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    """The parts whose names begin with a prefix, without it."""
    return {name.removeprefix(prefix): value for name, value in parts.items() if name.startswith(prefix)}


def hypothesis(state: Evidences, index: int) -> tuple[str, int, str]:
    """Effect, column and axis of a hypothesis; axis "" for the station, column -1 and axis "" for all columns of an effect."""
    if index >= state.sensor.size:
        effect, column = state.of_station[index - state.sensor.size]
        return effect, column, ""
    if index >= state.sensor.count:
        return list(dict.fromkeys(name for name, _ in state.columns))[index - state.sensor.count], -1, ""
    axis, at = divmod(index, len(state.columns))
    effect, column = state.columns[at]
    return effect, column, "xyz"[axis]


def state_bytes(state: Evidences) -> bytes:
    """The state as the content of a file."""
    about = {
        "columns": np.array([f"{name} {column}" for name, column in state.columns], dtype=np.str_),
        "of_station": np.array([f"{name} {column}" for name, column in state.of_station], dtype=np.str_),
        "order": np.array(state.order, dtype=np.str_),
        "taken_out": np.array(state.taken_out, dtype=np.str_),
        "drivers": np.array(list(state.generations), dtype=np.str_),
        "generations": np.array(list(state.generations.values()), dtype=np.int64),
        "alarm_drivers": np.array([a.driver for a in state.alarms], dtype=np.str_),
        "alarms": np.array([(a.index, a.night, a.lots, a.log_e) for a in state.alarms], dtype=float).reshape(-1, 4),
        "night": np.array(state.night),
        "layout": np.array(_LAYOUT),
    }
    parts = {f"about/{name}": value for name, value in about.items()}
    for kind, evidence in (("sensor", state.sensor), ("station", state.station)):
        parts |= {f"{kind}/{name}": value for name, value in evidence.arrays().items()}
    buffer = io.BytesIO()
    # names of drivers and stations may contain any character: they are stored as a list, and the arrays are numbered
    numbered = {str(number): value for number, value in enumerate(parts.values())}
    np.savez(buffer, allow_pickle=False, names=np.array(list(parts)), **numbered)
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
        parts = {str(name): loaded[str(n)] for n, name in enumerate(loaded["names"])}
    about = below(parts, "about/")
    sensor, station = source.columns
    if "layout" not in about or about["layout"] != _LAYOUT:
        return None
    if [f"{name} {column}" for name, column in (*sensor, *station)] != [*about["columns"], *about["of_station"]]:
        return None
    if any(str(run) not in source.store.rows for run in about["order"]):
        return None
    order = [str(run) for run in about["order"]]
    return Evidences(
        device=source.device,
        columns=sensor,
        of_station=station,
        sensor=Evidence.restored(AXES * len(sensor), below(parts, "sensor/"), source.earlier(order), numbered(sensor)),
        station=Evidence.restored(len(station), below(parts, "station/"), lambda _, __: None),
        order=order,
        taken_out=[str(run) for run in about["taken_out"]],
        generations={str(name): int(n) for name, n in zip(about["drivers"], about["generations"], strict=True)},
        alarms=[
            Alarm(str(driver), int(index), int(night), int(lots), float(log_e))
            for driver, (index, night, lots, log_e) in zip(about["alarm_drivers"], about["alarms"], strict=True)
        ],
        night=int(about["night"]),
    )
