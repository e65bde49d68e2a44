"""The evidence of an archive, night by night: which lots came in, what is beyond chance since then, kept in a ledger.

``discovery/<device>/nights/<number>.json`` is never rewritten: a run whose calibration is revoked later is taken out from that
night on, and the entry says so. ``discovery/<device>/state`` is a derived cache of the sums; without it they are made again from
the scores.
"""

from __future__ import annotations

import io
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inertial.discovery.evidence import GUARDED, INSIDE, MEAN, SLOT, STATION, UNIT, Evidence, ScoredLot
from pipelines.archive import Archive, derived, files
from pipelines.archive.locks import alone
from pipelines.archive.store import Place
from pipelines.certificates.ledger import Ledger
from pipelines.discovery.attributes import Attributes, as_numbers, known_attributes
from pipelines.discovery.score_store import FOLDER, ScoreStore
from pipelines.discovery.scored_run import ScoredRun
from pipelines.parallel import Distributor
from schemas.errors import WrongUse, did_you_mean

Array = NDArray[np.float64]
Column = tuple[str, int]

ALPHA = 0.05
"""Probability that an archive without anything hidden ever shows a discovery, over its whole life."""

AXES = 3
SEASON, OPERATOR = "season", "operator"
_STATION_DRIVERS = {MEAN, STATION, "date"}


@dataclass(frozen=True)
class Alarm:
    """Evidence beyond the threshold: driver, place of the hypothesis, night of the first time."""

    driver: str
    place: int
    night: int
    lots: int
    log_e: float


@dataclass
class Evidences:
    """Evidence of a kind of device after some nights.

    columns : of the sensor, in the order of the hypotheses of one axis · of_station : of the station
    sensor, station : evidence · order : runs in the order of arrival · taken_out : runs that no longer count
    generations : when each driver came in: later ones have less of the probability of an error
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

    def needed(self, driver: str, *, of_station: bool = False) -> float:
        """Logarithm of the evidence from which on a hypothesis of a driver counts."""
        generation = self.generations.get(driver, 0)
        drivers = Counter(self.generations.values())[generation] or 1
        hypotheses = drivers * AXES * len(self.columns) + (
            len(_STATION_DRIVERS) * len(self.of_station) if of_station or generation == 0 else 0
        )
        return float(np.log(hypotheses / (ALPHA * 0.5 ** (generation + 1))))


class DiscoveryArchive:
    """What the discovery of an archive works on.

    Parameters
    ----------
    device : kind of device; that of most runs if empty
    change : what is done to every lot before it is judged
    """

    def __init__(
        self, archive: Archive, device: str = "", change: Callable[[ScoredLot], ScoredLot] = lambda lot: lot
    ) -> None:
        archive.refuse_none()
        self.archive, self.store, self._change = archive, ScoreStore(archive), change
        self._device = device

    def with_change(self, change: Callable[[ScoredLot], ScoredLot]) -> DiscoveryArchive:
        """The same archive with other lots."""
        other = DiscoveryArchive(self.archive, self.device, change)
        other.store = self.store
        return other

    @cached_property
    def infos(self) -> list[Any]:
        """Finished or complete runs that are no re-run, in the order of their start."""
        return [info for info in self.archive.runs() if not info.rerun_of and {"reduce", "import"} & set(info.stages)]

    @cached_property
    def device(self) -> str:
        """The kind of device that is judged: the one asked for, else that of most runs."""
        counts = Counter(info.device for info in self.infos)
        if self._device:
            wanted = next((one for one in counts if one.lower() == self._device.lower()), None)
            if wanted is None:
                raise WrongUse(
                    f"discover: --device '{self._device}' has no run in {self.archive.root}; {did_you_mean(self._device, counts)}"
                )
            return wanted
        if not counts:
            raise WrongUse(
                f"discover: {self.archive.root} has no run with dwells, thirty at least are needed; see 'tumbleline demo "
                "--archive'"
            )
        return counts.most_common(1)[0][0]

    @property
    def other_devices(self) -> dict[str, int]:
        """Runs of other kinds of devices, which are never pooled with it."""
        counts = Counter(info.device for info in self.infos)
        return {one: count for one, count in counts.items() if one != self.device}

    def score(self, workers: int, distribute: Distributor | None = None) -> int:
        """Score what is new; the number of runs."""
        with alone(self.archive.root / FOLDER, wait=True):
            return self.store.add([info.id for info in self.infos], workers, distribute)

    @cached_property
    def attributes(self) -> Attributes:
        """What is known of units and runs."""
        return known_attributes(self.archive)

    @cached_property
    def revoked(self) -> set[str]:
        """Runs of which a calibration was revoked."""
        return {one.run for one in Ledger(self.archive).all() if one.state == "revoked"}

    def pooled(self) -> list[str]:
        """Runs of the device that have scores, in the order of arrival."""
        heads = ((run, self.store.head(run)) for run in self.store.place)
        return [run for run, head in heads if head["device"] == self.device and not head["left_out"]]

    def left_out(self) -> list[tuple[str, str]]:
        """Runs of the device that are not pooled, with the reason."""
        heads = ((run, self.store.head(run)) for run in self.store.place)
        return [
            (run, str(head["left_out"])) for run, head in heads if head["device"] == self.device and head["left_out"]
        ]

    @cached_property
    def columns(self) -> tuple[tuple[Column, ...], tuple[Column, ...]]:
        """Columns of the sensor and of the station that any run of the archive has."""
        sensor = dict.fromkeys(one for products in self.store.products() for one in products.columns)
        station = dict.fromkeys(one for products in self.store.products() for one in products.of_station)
        return tuple(sensor), tuple(station)

    def lots(self, runs: Iterable[str]) -> Iterable[tuple[ScoredLot, ScoredLot]]:
        """Each run as a lot of its sensors, and of its station."""
        for run in runs:
            scored = self.store.run(run)
            yield self.lot_of(scored), self._of_station(scored)

    def lot_of(self, run: ScoredRun) -> ScoredLot:
        """A run as a lot, in the order of the archive's hypotheses."""
        if run.score is None or run.own is None or run.information is None:
            raise LookupError(run.run)
        place = {column: at for at, column in enumerate(self.columns[0])}
        at = np.array([place[column] for column in run.columns])
        k, own_k = len(self.columns[0]), len(run.columns)
        here = (np.arange(AXES)[:, None] * k + at).reshape(-1)

        def spread(values: Array) -> Array:
            out = np.zeros((*values.shape[:-1], AXES * k))
            out[..., here] = values.reshape(*values.shape[:-1], AXES * own_k)
            return out

        levels, numbers = self._drivers(run)
        lot = ScoredLot(
            run=run.run,
            station=run.station,
            day=_day(run.when),
            units=run.units,
            score=spread(run.score),
            own=spread(run.own),
            information=spread(run.information),
            levels=levels,
            numbers=numbers,
        )
        return self._change(lot)

    def _of_station(self, run: ScoredRun) -> ScoredLot:
        place = {column: at for at, column in enumerate(self.columns[1])}
        both = np.zeros((2, len(place)))
        if run.station_scores is not None:
            both[:, [place[column] for column in run.of_station]] = run.station_scores
        score, information = both
        return ScoredLot(run.run, run.station, _day(run.when), ("",), score[None], information[None], information)

    def _drivers(self, run: ScoredRun) -> tuple[dict[str, tuple[str, ...]], dict[str, Array]]:
        levels: dict[str, tuple[str, ...]] = {SLOT: run.slots} if any(run.slots) else {}
        if run.who:
            levels[OPERATOR] = (run.who,) * len(run.units)
        levels[SEASON] = (f"month {int(run.when[5:7])}",) * len(run.units)
        numbers: dict[str, Array] = {}
        for name, known in self._quantities.items():
            values = tuple(self.attributes.of(unit, run.run, name) for unit in run.units)
            if not any(values):
                continue
            if known is None:
                levels[name] = values
            else:
                numbers[name] = np.array([known.get(value, np.nan) for value in values])
        return levels, numbers

    @cached_property
    def _quantities(self) -> dict[str, dict[str, float] | None]:
        """For each attribute that is a driver its numbers; None for labels."""
        out: dict[str, dict[str, float] | None] = {}
        for name in self.attributes.names():
            if name in {MEAN, STATION, SLOT, UNIT, "date"}:
                continue
            every = (of.values() for of in (self.attributes.serial, self.attributes.run))
            out[name] = as_numbers([one.get(name, "") for values in every for one in values])
        return out

    def earlier(self, order: Sequence[str]) -> Callable[[str, int], tuple[Array, Array] | None]:
        """What earlier measurements of a unit say, inside their lots.

        Parameters
        ----------
        order : the lots of the evidence, which grows while they are added
        """
        index: dict[str, list[tuple[int, str]]] = {}
        known = 0

        def of(unit: str, taken: int) -> tuple[Array, Array] | None:
            nonlocal known
            for number in range(known, len(order)):
                file, row = self.store.place[order[number]]
                for one in self.store.files[file].rows[row]["units"]:
                    index.setdefault(one, []).append((number, order[number]))
            known = len(order)
            before = [run for number, run in index.get(unit, ()) if number < taken]
            found = [inside_of(self.lot_of(self.store.run(run)), unit) for run in before]
            if not found:
                return None
            return np.sum([score for score, _ in found], axis=0), np.sum([own for _, own in found], axis=0)

        return of

    def folder(self) -> Place:
        """Where the evidence of the device is kept."""
        return self.archive.root / FOLDER / re.sub(r"[^A-Za-z0-9._-]", "_", self.device)


def inside_of(lot: ScoredLot, unit: str) -> tuple[Array, Array]:
    """Score and information (h,) of a unit about the mean of its lot."""
    place = lot.units.index(unit)
    total = np.maximum(lot.own.sum(axis=0), 1e-300)
    own = lot.own[place]
    return lot.score[place] - own * lot.score.sum(axis=0) / total, own * (1.0 - own / total)


def _day(when: str) -> float:
    return datetime.fromisoformat(when).timestamp() / 86400.0


def fresh(source: DiscoveryArchive) -> Evidences:
    """Evidence without a lot."""
    sensor, station = source.columns
    order: list[str] = []
    made = Evidence(AXES * len(sensor), source.earlier(order))
    return Evidences(source.device, sensor, station, made, Evidence(len(station)), order)


def grown(source: DiscoveryArchive, state: Evidences, runs: Sequence[str]) -> Evidences:
    """Evidence with further lots as one night."""
    state.night += 1
    for sensor, station in source.lots(runs):
        state.sensor.add(sensor)
        state.station.add(station)
        state.order.append(sensor.run)
    generation = 1 + max(state.generations.values(), default=-1)
    for driver in state.sensor.drivers:
        state.generations.setdefault(driver, generation)
    known = {(alarm.driver, alarm.place) for alarm in state.alarms}
    state.alarms += [one for one in _beyond(state) if (one.driver, one.place) not in known]
    return state


def grown_by_days(source: DiscoveryArchive, state: Evidences, runs: Sequence[str]) -> Evidences:
    """Evidence with further lots, a night for each day on which they were measured: years are caught up in one go."""
    days = groupby(runs, key=lambda run: str(source.store.head(run)["when"])[:10])
    for _, of_day in days:
        state = grown(source, state, list(of_day))
    return state


def _beyond(state: Evidences) -> list[Alarm]:
    """Hypotheses beyond the threshold; those of the station have places after those of the sensor."""
    out: list[Alarm] = []
    for evidence, of_station in ((state.sensor, False), (state.station, True)):
        for driver, sums in evidence.drivers.items():
            if of_station and driver not in _STATION_DRIVERS:
                continue
            log_e = sums.log_e
            for place in np.flatnonzero(log_e >= state.needed(driver)):
                at = int(place) + (state.sensor.count if of_station else 0)
                out.append(Alarm(driver, at, state.night, len(state.order), float(log_e[place])))
    return out


def held(state: Evidences, alarm: Alarm) -> bool:
    """Whether an alarm may be the station's own: the same for a whole lot, of an effect that wanders or differs with stations."""
    if alarm.place >= state.sensor.count or alarm.driver.endswith(INSIDE) or alarm.driver in {SLOT, UNIT}:
        return False
    if alarm.driver == MEAN:
        shared = bool(state.sensor.shared_by_stations()[alarm.place])
        return not shared or bool(state.sensor.guarded[alarm.place])
    if alarm.driver == STATION:
        return False  # for good or by wander: stations differ
    wander = state.sensor.wander
    walk = wander.gained if len(wander.stations) < 2 else wander.gained_beside(alarm.driver)
    return bool(walk[alarm.place] > GUARDED)


def brought_up(source: DiscoveryArchive) -> Evidences:
    """The evidence of the archive with everything that came in since the last night."""
    folder = source.folder()
    with alone(folder, wait=True):
        nights = _nights(folder)
        state = _stored(source, folder, nights)
        if state is None:
            state = _replayed(source, nights)
        gone = [run for run in state.order if run in source.revoked]
        if gone:
            kept = [run for run in state.order if run not in source.revoked]
            alarms, out, night = state.alarms, [*state.taken_out, *gone], state.night
            state = grown_by_days(source, fresh(source), kept)
            state.taken_out, state.night = out, night
            state.alarms = [
                *alarms,
                *(a for a in state.alarms if (a.driver, a.place) not in {(b.driver, b.place) for b in alarms}),
            ]
        there = {*state.order, *state.taken_out}
        new = [run for run in source.pooled() if run not in there and run not in source.revoked]
        if new or gone:
            before = state.night
            state = grown_by_days(source, state, new)
            _write(folder, state, before, new, gone, nights)
        return state


def _nights(folder: Place) -> list[dict[str, Any]]:
    """The ledger's entries in order."""
    top = folder / "nights"
    places = sorted(top.iterdir(), key=lambda one: one.name) if top.is_dir() else []
    return [files.read_json(place) for place in places if place.name.endswith(".json")]


def _replayed(source: DiscoveryArchive, nights: Sequence[Mapping[str, Any]]) -> Evidences:
    """The evidence as the ledger says that it grew; lots whose scores are gone are not in it any more."""
    state = fresh(source)
    out = {run for night in nights for run in night["taken_out"]}
    for night in nights:
        runs = [run for run in night["runs"] if run in source.store.place and run not in out]
        state = grown_by_days(source, state, runs)
    state.taken_out = [run for night in nights for run in night["taken_out"]]
    return state


def _write(
    folder: Place,
    state: Evidences,
    before: int,
    new: Sequence[str],
    gone: Sequence[str],
    nights: Sequence[Mapping[str, Any]],
) -> None:
    """The entry of a night, which is never written again, and the state as a cache."""
    data = _state_bytes(state)
    entry = {
        "night": state.night,
        "when": datetime.now(UTC).isoformat(timespec="seconds"),
        "runs": list(new),
        "taken_out": list(gone),
        "lots": len(state.order),
        "hypotheses": len(state.sensor.drivers) * state.sensor.count + len(_STATION_DRIVERS) * state.station.count,
        "alarms": [
            {"driver": a.driver, "column": _text_of(state, a.place), "lots": a.lots, "log_e": round(a.log_e, 2)}
            for a in state.alarms
            if a.night > before
        ],
        "largest": {name: round(float(sums.log_e.max()), 2) for name, sums in state.sensor.drivers.items()},
        "state": files.hash_of(data),
        "previous": files.hash_of(files.json_bytes(nights[-1])) if nights else "",
    }
    files.publish_first(folder / "nights" / f"{len(nights) + 1:06d}.json", files.json_bytes(entry))
    files.publish(folder / "state", derived.framed(data))


def _text_of(state: Evidences, place: int) -> str:
    effect, column, axis = hypothesis(state, place)
    return f"{effect}.{column}" + (f".{axis}" if axis else "")


def hypothesis(state: Evidences, place: int) -> tuple[str, int, str]:
    """Effect, column and axis of a hypothesis; no axis for one of the station."""
    if place >= state.sensor.count:
        effect, column = state.of_station[place - state.sensor.count]
        return effect, column, ""
    axis, at = divmod(place, len(state.columns))
    effect, column = state.columns[at]
    return effect, column, "xyz"[axis]


def _state_bytes(state: Evidences) -> bytes:
    about = {
        "columns": np.array([f"{name} {column}" for name, column in state.columns], dtype=np.str_),
        "of_station": np.array([f"{name} {column}" for name, column in state.of_station], dtype=np.str_),
        "order": np.array(state.order, dtype=np.str_),
        "taken_out": np.array(state.taken_out, dtype=np.str_),
        "drivers": np.array(list(state.generations), dtype=np.str_),
        "generations": np.array(list(state.generations.values()), dtype=np.int64),
        "alarm_drivers": np.array([a.driver for a in state.alarms], dtype=np.str_),
        "alarms": np.array([(a.place, a.night, a.lots, a.log_e) for a in state.alarms], dtype=np.float64).reshape(
            -1, 4
        ),
        "night": np.array(state.night),
    }
    parts = {f"about/{name}": value for name, value in about.items()}
    for kind, evidence in (("sensor", state.sensor), ("station", state.station)):
        parts |= {f"{kind}/{name}": value for name, value in evidence.arrays().items()}
    buffer = io.BytesIO()
    # names of drivers and stations are anything: they stand in a list, and the arrays have numbers
    np.savez(
        buffer, allow_pickle=False, names=np.array(list(parts)), **{str(n): v for n, v in enumerate(parts.values())}
    )
    return buffer.getvalue()


def _stored(source: DiscoveryArchive, folder: Place, nights: Sequence[Mapping[str, Any]]) -> Evidences | None:
    """The state on disk; None where it is not that of the last night, or of other hypotheses."""
    place = folder / "state"
    if not nights or not place.is_file():
        return None
    data, standing = derived.unframed(place)
    if standing == derived.EDITED:
        derived.warn_of_edits(place)
    if standing != derived.SOUND or files.hash_of(data) != nights[-1]["state"] or nights[-1]["lots"] < 31:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as loaded:
        parts = {str(name): loaded[str(n)] for n, name in enumerate(loaded["names"])}
    about = {name.removeprefix("about/"): value for name, value in parts.items() if name.startswith("about/")}
    sensor, station = source.columns
    if [f"{name} {column}" for name, column in (*sensor, *station)] != [*about["columns"], *about["of_station"]]:
        return None
    if any(str(run) not in source.store.place for run in about["order"]):
        return None
    order = [str(run) for run in about["order"]]
    of = {
        kind: {n.removeprefix(f"{kind}/"): v for n, v in parts.items() if n.startswith(f"{kind}/")}
        for kind in ("sensor", "station")
    }
    return Evidences(
        device=source.device,
        columns=sensor,
        of_station=station,
        sensor=Evidence.restored(AXES * len(sensor), of["sensor"], source.earlier(order)),
        station=Evidence.restored(len(station), of["station"], lambda _, __: None),
        order=order,
        taken_out=[str(run) for run in about["taken_out"]],
        generations={str(name): int(n) for name, n in zip(about["drivers"], about["generations"], strict=True)},
        alarms=[
            Alarm(str(driver), int(place), int(night), int(lots), float(log_e))
            for driver, (place, night, lots, log_e) in zip(about["alarm_drivers"], about["alarms"], strict=True)
        ],
        night=int(about["night"]),
    )
