"""Long archives of scored lots, night by night.

Without anything hidden they come from a bank whose signs are drawn again, and errors of references are added to the scores. What
is hidden is physics in lots of their own, each made and scored; its size is in floors of noise: rms of what an ordinary
calibration leaves of it, over the noise of a dwell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from benchmarks.discovery.lots import Lots, World
from inertial.discovery.evidence import Evidence, ScoredLot
from inertial.discovery.scores import LotScores, Products
from pipelines.discovery.evidence_state import Alarm, Evidences, numbered

Array = NDArray[np.float64]
UNITS, A_NIGHT = 8, 20


@dataclass(frozen=True)
class Hidden:
    """An effect, its driver and its size in floors; ``driver`` empty: nothing."""

    effect: str = "third_order"
    driver: str = ""
    size: float = 0.0


@dataclass(frozen=True)
class Setting:
    """Stations and their errors outside the columns of the station.

    wander : floors, of a cubic at each station · over : lots of it · bad : share of lots with twenty times the noise
    again : share of units that come a second time
    """

    stations: int = 4
    wander: float = 0.0
    over: float = 100.0
    bad: float = 0.0
    again: float = 0.0


@dataclass
class Result:
    """An archive's evidence, the number of lots at the first alarm of each driver, and the effects of all alarms.

    hidden : what was hidden in the units of each lot, (units, 3), floors
    """

    evidence: Evidence
    lots: list[ScoredLot] = field(default_factory=list[ScoredLot])
    hidden: list[Array] = field(default_factory=list[Array])
    first: dict[str, int] = field(default_factory=dict[str, int])
    alarms: set[tuple[str, str]] = field(default_factory=set[tuple[str, str]])


def earlier_in(order: Sequence[ScoredLot]) -> Callable[[str, int], tuple[Array, Array] | None]:
    """Score and information (h,) of a unit in the first n lots of an order that grows; None if it was in none."""
    index: dict[str, list[int]] = {}
    known = 0

    def earlier(unit: str, taken: int) -> tuple[Array, Array] | None:
        nonlocal known
        for number in range(known, len(order)):
            for serial in order[number].units:
                index.setdefault(serial, []).append(number)
        known = len(order)
        of_unit = [np.stack(order[k].inside)[:, order[k].units.index(unit)] for k in index.get(unit, []) if k < taken]
        return (*np.sum(of_unit, axis=0),) if of_unit else None

    return earlier


class ArchiveMaker:
    """Archives from one bank."""

    def __init__(self, lots: Sequence[LotScores], world: World) -> None:
        self.bank, self._world = lots, world
        self.products = Products.mean([scores.products for scores in lots])
        self.floor = float(np.mean([scores.floor for scores in lots]))

    def archive(
        self,
        seed: int,
        count: int,
        hidden: Hidden,
        setting: Setting,
        *,
        keep: bool = False,
        until: str = "",
    ) -> Result:
        """An archive night by night, to its end or until a driver has been found."""
        rng = np.random.default_rng([seed, 4111])
        columns, before = self.products.columns, list[ScoredLot]()
        result = Result(Evidence(3 * len(columns), earlier_in(before), numbered(columns)))
        state, own = _State(rng, setting.stations), Lots(self._world, seed)
        for number in range(count):
            lot, size = self._lot(rng, state, own, number, count, hidden, setting)
            result.evidence.add(lot)
            before.append(lot)
            if keep:
                result.lots.append(lot)
                result.hidden.append(size)
            if number % A_NIGHT == A_NIGHT - 1 and number >= 29:
                for name, effect in self._alarmed(result.evidence):
                    result.alarms.add((name, effect))
                    result.first.setdefault(name, number + 1)
                if until and any(name.split(",")[0] == until for name in result.first):
                    break
        return result

    def state_of(self, evidence: Evidence) -> Evidences:
        """The evidence as the product has it: all drivers are of the first night."""
        generations = dict.fromkeys(evidence.drivers, 0)
        return Evidences(self.products.columns, (), evidence, Evidence(0), generations=generations)

    def _alarmed(self, evidence: Evidence) -> Iterator[tuple[str, str]]:
        """Drivers and effects with an alarm that is not held, as the product decides."""
        state = self.state_of(evidence)
        for name, sums in evidence.drivers.items():
            for place in map(int, np.flatnonzero(sums.log_e >= state.needed(name))):
                alarm = Alarm(name, place, 0, 0, 0.0)
                if not state.held(alarm):
                    yield name, state.effect_of(alarm)

    def _lot(
        self,
        rng: np.random.Generator,
        state: _State,
        own: Lots,
        number: int,
        count: int,
        hidden: Hidden,
        setting: Setting,
    ) -> tuple[ScoredLot, Array]:
        """The next lot, and what is hidden in its units, (units, 3), floors."""
        station = int(rng.integers(setting.stations))
        wafers = rng.integers(0, 12, UNITS) + 12 * (number // 200)
        radius = rng.uniform(0.0, 1.0, UNITS)
        firmware = int(number >= count // 2)
        size = state.sizes(hidden.driver, station, wafers, radius, firmware) * hidden.size
        if hidden.driver:
            one = own.scored(hidden.effect, size)
            score = one.score
        else:
            one = self.bank[int(rng.integers(len(self.bank)))]
            score = rng.choice([-1.0, 1.0]) * one.score
        if setting.bad and rng.random() < setting.bad:
            score = 20.0 * score
        if setting.wander:
            walked = np.tile(setting.wander * state.walked(station, setting.over), (UNITS, 1))
            score = score + self._change(one, "third_order", walked)
        units = state.units(rng, number, setting.again)
        levels = {
            "slot": tuple(map(str, range(UNITS))),
            "wafer": tuple(f"W{w}" for w in wafers),
            "batch": (f"B{number // 50}",) * UNITS,
            "firmware": (str(firmware),) * UNITS,
            "operator": (f"o{rng.integers(4)}",) * UNITS,
            "supplier": tuple(f"s{k}" for k in rng.integers(0, 3, UNITS)),
            "season": (f"month {(number // A_NIGHT // 30) % 12}",) * UNITS,
        }
        lot = ScoredLot(
            f"{number}",
            f"s{station}",
            number / A_NIGHT,
            units,
            score,
            one.own,
            one.information,
            levels,
            {"radius": radius},
            {"own temperature coefficient": np.repeat(one.tempco, len(self.products.columns), axis=1)},
        )
        return lot, size

    def _change(self, one: LotScores, effect: str, size: Array) -> Array:
        """What coefficients (units, 3), in floors, add to the scores of a lot."""
        columns = self.products.columns
        k = next(at for at, (name, _) in enumerate(columns) if name == effect)
        here = np.arange(3) * len(columns) + k
        coefficient = size * self.floor / np.maximum(self.products.size[here], 1e-300)
        mean = coefficient.mean(axis=0)
        inside = np.einsum("ak,ua->uak", one.products.inside[:, :, k], coefficient - mean)
        return inside.reshape(UNITS, -1) + one.products.lot[:, here] @ mean / UNITS


class _State:
    """What stays from lot to lot: sizes of levels, wander of stations, units that come again."""

    def __init__(self, rng: np.random.Generator, stations: int) -> None:
        self._rng = np.random.default_rng(rng.integers(2**63))
        fixed = rng.standard_normal(3)
        self._fixed = fixed / np.sqrt(np.mean(fixed**2))
        self._stations, self._slots = (_of_levels(rng.standard_normal((count, 3))) for count in (stations, UNITS))
        self._wafers: dict[int, Array] = {}
        self._walk = rng.standard_normal((stations, 3))
        self._seen: list[str] = []

    def sizes(self, driver: str, station: int, wafers: NDArray[np.int64], radius: Array, firmware: int) -> Array:
        """Coefficients (units, 3) of rms one."""
        alike = {"mean": self._fixed, "station": self._stations[station], "firmware": firmware * self._fixed}
        if driver in alike:
            return np.tile(alike[driver], (UNITS, 1))
        if driver == "wafer":
            return np.array([self._wafers.setdefault(int(w), self._rng.standard_normal(3)) for w in wafers])
        differ = {"slot": self._slots, "radius": self._fixed * (radius[:, None] - 0.5) * np.sqrt(12.0)}
        return differ.get(driver, np.zeros((UNITS, 3)))

    def walked(self, station: int, over: float) -> Array:
        """The next value (3,) of a station's wander."""
        kept = np.exp(-1.0 / over)
        self._walk[station] = kept * self._walk[station] + np.sqrt(1.0 - kept**2) * self._rng.standard_normal(3)
        return self._walk[station].copy()

    def units(self, rng: np.random.Generator, number: int, again: float) -> tuple[str, ...]:
        """Serials of a lot, some of which were measured before."""
        out: list[str] = []
        for k in range(UNITS):
            old = self._seen[int(rng.integers(len(self._seen)))] if self._seen and rng.random() < again else ""
            out.append(old if old and old not in out else f"{number}-{k}")
        self._seen = [*self._seen, *out][-4000:]
        return tuple(out)


def _of_levels(drawn: Array) -> Array:
    """Sizes (levels, 3) of rms one about their mean; of one level as they are."""
    about = drawn - drawn.mean(axis=0)
    return about / np.sqrt(np.mean(about**2)) if len(drawn) > 1 else drawn
