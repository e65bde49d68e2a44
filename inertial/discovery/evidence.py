"""Evidence over the lots of an archive, valid at any time: a supermartingale (e-process) for every effect and driver.

Each lot gives each hypothesis a number x that, given all earlier lots, is symmetric about zero under the null hypothesis. Then
exp(λS − λ²V/2) with S = Σx and V = Σx² is a supermartingale for any λ (de la Peña 1999; de la Peña, Klass, Lai 2004), and the
probability that its mean over some λ ever exceeds m/α is at most α/m (Ville). Nothing is assumed about the size of the noise.
The hypotheses are every column on every axis and, in addition, each effect with all its columns: their increments add, because
the scores of a lot are jointly symmetric.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.special import chdtrc, stdtr

from inertial.arrays import NORMAL_MEDIAN, Array, Flags, Places, over
from inertial.discovery.running_sums import BOUND, FIRST, Levels, Scale, Sums
from inertial.discovery.station_wander import WALK_FROM, Innovation, Level, Wander

SHRUNK = 4.0
"""Prior information, in typical lots, that shrinks the predicted size of a level towards zero."""

MEAN, DATE, STATION, SLOT, UNIT = "mean", "date", "station", "slot", "unit"
INSIDE = ", inside lots"
"""Suffix of the name of a driver that is judged by differences within a lot, in which common errors cancel."""

SHARED: float = float(np.log(300.0))
"""Log odds from which on a mean is common to the stations, not an error that differs between their references."""

_SHARED_ON_AXES, _SHARED_ON_ONE = 0.005, 0.1
"""Limits of the probability that references differing at random between stations agree as well, on all axes of a column together
and on the axis alone; four stations reach the odds above on one axis with 0.6 %."""

SLOPE, ALL = "slope", "all"
"""Labels of the sums of a number that differs by axis: for its slope, and for the information of all units."""


@dataclass(frozen=True)
class ScoredLot:
    """Scores of a lot in the order of an archive's h hypotheses.

    score : (units, h), errors of the station eliminated · own : (units, h), information before the elimination
    information : (h,), of the sums over the units, errors of the station eliminated
    levels : driver → label of each unit, "" if unknown · numbers : driver → (units,), nan if unknown
    slopes : driver → (units, h), numbers that differ by axis, judged within the lot only
    day : days since an epoch
    """

    run: str
    station: str
    day: float
    units: tuple[str, ...]
    score: Array
    own: Array
    information: Array
    levels: Mapping[str, tuple[str, ...]] = field(default_factory=dict[str, tuple[str, ...]])
    numbers: Mapping[str, Array] = field(default_factory=dict[str, Array])
    slopes: Mapping[str, Array] = field(default_factory=dict[str, Array])

    def labels(self, driver: str) -> tuple[str, ...]:
        """Label of each unit by a driver; none for a driver that this lot does not know or that is a number."""
        always = {MEAN: (ALL,) * len(self.units), STATION: (self.station,) * len(self.units), UNIT: self.units}
        return always[driver] if driver in always else self.levels.get(driver, ())

    def number(self, driver: str) -> Array | None:
        """Number of each unit, (units,), by a driver; None for labels."""
        return np.full(len(self.units), self.day) if driver == DATE else self.numbers.get(driver)

    @cached_property
    def total(self) -> Array:
        """Information summed over the units, (h,), before elimination of the station's errors; never zero."""
        return np.maximum(self.own.sum(axis=0), 1e-300)

    @cached_property
    def inside(self) -> tuple[Array, Array]:
        """Scores of the units about the lot's mean, and their information, (units, h) each."""
        return self.score - self.own * self.score.sum(axis=0) / self.total, self.own * (1.0 - self.own / self.total)

    def averaged(self, of_units: Array) -> Array:
        """Mean (h,) of sizes (units, h) over the units, weighted by their information."""
        return (of_units * self.own).sum(axis=0) / self.total


class Evidence:
    """The evidence of an archive after some lots.

    Parameters
    ----------
    count : number of hypotheses, h = axes × columns of effects
    earlier : function of unit and n: summed scores and information (h,) of the unit within the first n lots; None if unmeasured;
        without it units are not judged
    columns : (k,), index of the effect of each column; None: no effects with several columns
    """

    def __init__(
        self,
        count: int,
        earlier: Callable[[str, int], tuple[Array, Array] | None] | None = None,
        columns: Places | None = None,
    ) -> None:
        self.count, self.lots, self._taken = count, 0, 0
        self.axes = 1 if columns is None or not columns.size else count // columns.size
        self.effects = None if columns is None else np.tile(columns, self.axes)
        self.drivers: dict[str, Sums] = {}
        self.levels: dict[str, Levels] = {}
        self.wander = Wander(count)
        self.score, self.information = np.zeros(count), np.zeros(count)
        self.earlier = earlier
        self._held: list[ScoredLot] = []
        self._scales: dict[str, Scale] = {}
        self._numbers: dict[str, tuple[float, float, float]] = {}  # count, mean, sum of squares

    def add(self, lot: ScoredLot) -> None:
        """Add the next lot, in order of arrival."""
        self.lots += 1
        if self.lots <= FIRST:
            self._held.append(lot)
            if self.lots == FIRST:
                self._begin()
            return
        self._add(lot)

    @property
    def size(self) -> int:
        """Number of hypotheses, with those of effects with all their columns at the end."""
        return self.count + (0 if self.effects is None else int(self.effects.max(initial=-1)) + 1)

    @property
    def guarded(self) -> Flags:
        """Whether the stations wander in each hypothesis (h,): a value constant within a lot may then be station wander."""
        return self.wander.gained > WALK_FROM

    @property
    def noise(self) -> tuple[Array, Array]:
        """Standard deviations (h,) over the stated ones, of lots about their stations and of units within lots."""
        return self._scales["between"].rms, self._scales["inside"].rms

    def shared_by_stations(self) -> Flags:
        """Whether each mean (h,) is common to the stations, not an error that differs between them.

        Stations scattered about a common mean are compared with stations scattered about zero: log odds k/2·ln(1 + mean²/s²) for
        k stations, where s is their scatter, or the noise if that is larger. Odds of three hundred to one on the axis suffice, or
        Student's t of the stations over all axes of a column (Fisher's combination).
        """
        ratio, p = self._agreement, self.alike_by_chance()
        odds = 0.5 * len(self.wander.stations) * np.log1p(ratio)
        fisher = -2.0 * np.log(np.maximum(p, 1e-300)).reshape(self.axes, -1).sum(axis=0)
        on_axes = np.tile(chdtrc(2.0 * self.axes, fisher) < _SHARED_ON_AXES, self.axes)
        return (odds > SHARED) | (on_axes & (p < _SHARED_ON_ONE))

    def alike_by_chance(self) -> Array:
        """Probability (h,) that references that differ at random between k stations agree as well, by Student's t."""
        freedoms = max(len(self.wander.stations) - 1, 1)
        return 2.0 * stdtr(freedoms, -np.sqrt(freedoms * self._agreement))

    @property
    def _agreement(self) -> Array:
        """Square of the mean of the stations over their variance, or that of the noise if larger, (h,).

        Zero with fewer than two stations, or where one has not measured it.
        """
        if len(self.wander.stations) < 2:
            return np.zeros(self.count)
        table = self.levels[STATION]
        seen, size = table.information > 0.0, over(table.score, table.information)
        noise = self._scales["between"].rms ** 2 * np.mean(1.0 / np.where(seen, table.information, 1.0), axis=0)
        return np.where(seen.all(axis=0), size.mean(axis=0) ** 2 / np.maximum(size.var(axis=0), noise), 0.0)

    def _begin(self) -> None:
        """Initialise the scales from medians of the first lots, then add these lots in their order."""
        info = np.array([lot.information for lot in self._held])
        there = (info > 0.0).any(axis=0)
        z = np.array([over(lot.score.sum(axis=0), np.sqrt(lot.information)) for lot in self._held])
        z = np.where((info > 0.0) | ~there, z, np.nan)
        centre = np.nanmedian(z, axis=0)
        spread = np.nanmedian(np.abs(z - centre), axis=0) / NORMAL_MEDIAN
        about_zero = np.where(there, np.hypot(spread, centre), 1.0)
        self._scales = {
            "between": Scale(np.where(spread > 0.0, spread, 1.0)),
            "mean": Scale(np.where(about_zero > 0.0, about_zero, 1.0)),
            "inside": Scale(np.ones(self.count)),
        }
        self.information = np.mean(info, axis=0)
        self.score = self.information * over(centre, np.sqrt(self.information))
        held, self._held = self._held, []
        for lot in held:
            self._add(lot)

    def _sums(self, name: str, *, two_sided: bool) -> Sums:
        return self.drivers.setdefault(name, Sums.of(self.count, two_sided=two_sided, effects=self.effects))

    def _add(self, lot: ScoredLot) -> None:
        total, info = lot.score.sum(axis=0), lot.information
        size = over(total, info)
        between = self._scales["between"]
        found = self.wander.innovation(lot.station, size, info, between.rms)
        self._sums(MEAN, two_sided=True).add(self._scales["mean"].standardised(over(total, np.sqrt(info))))
        self._stations(lot, size)
        self._between(lot, found)
        self._inside(lot)
        self.wander.update(found)
        between.add(between.bounded(found.value))
        self.score += self._limited(size, info)[1]
        self.information += info
        self._taken += 1

    @property
    def _typical(self) -> Array:
        """Information (h,) of a typical lot."""
        return self.information / (self._taken + 1)

    def _centre(self) -> Array:
        return self.score / np.maximum(self.information, 1e-300)

    def _limited(self, size: Array, information: Array) -> tuple[Array, Array]:
        """Bounded deviation of a lot from the mean, and its score with it, so that a bad lot has limited influence, (h,) each."""
        centre, root = self._centre(), np.sqrt(information)
        left = self._scales["between"].bounded((size - centre) * root)
        return left, centre * information + left * root

    def _stations(self, lot: ScoredLot, size: Array) -> None:
        """Add evidence of permanent differences between stations: each lot against its station's earlier lots."""
        table = self.levels.setdefault(STATION, Levels(self.count))
        prior, rms = SHRUNK * self._typical, self._scales["between"].rms
        (of_station,), (behind,) = table.predicted((lot.station,), prior)
        predicted = of_station - self._centre() * over(behind, behind + prior)
        left, score = self._limited(size, lot.information)
        x = left / rms * np.clip(predicted * np.sqrt(lot.information) / rms, -BOUND, BOUND)
        self._sums(STATION, two_sided=False).add(x)
        table.add((lot.station,), score[None], lot.information[None])

    def _between(self, lot: ScoredLot, found: Innovation) -> None:
        """Add evidence of drivers that may be constant within a lot, by the innovations of the station's filter.

        A level is predicted by lots of other stations, if there are any, so that the wander of a station does not count.
        """
        rms, by_unit, ratio, prior = found.rms, lot.own, lot.information / lot.total, SHRUNK * self._typical
        raw = np.abs(found.value)
        part = np.where(raw > BOUND * rms, over(BOUND * rms, raw), 1.0)
        for name, labels in lot.levels.items():
            if name in {SLOT, UNIT} or not any(labels):
                continue
            here = self.levels.setdefault(f"{name} at {lot.station}", Levels(self.count))
            table = self.levels.setdefault(name, Levels(self.count))
            elsewhere = here if len(self.wander.stations) > 1 else None
            each, behind = table.predicted(labels, prior, elsewhere)
            prediction, told = lot.averaged(each), lot.averaged(behind) >= prior
            value, left = self.wander.beside_driver(name, prediction, found, told)
            self._add_between(name, value, left / rms, two_sided=False)
            score = (lot.score - by_unit * ratio * self._centre()) * part
            for each_table in (table, here):
                each_table.add(labels, score, by_unit * ratio)
        for name, numbers in {DATE: np.array([lot.day]), **lot.numbers}.items():
            known = numbers[np.isfinite(numbers)]
            standardised = self._standardised(name, float(known.mean())) if known.size else None
            if standardised is None:
                continue
            prediction = np.full(self.count, standardised)
            value, left = self.wander.beside_driver(name, prediction, found, found.known)
            self._add_between(name, value, left / np.sqrt(np.maximum(self._typical, 1e-300)), two_sided=True)

    def _add_between(self, name: str, value: Array, predicted: Array, *, two_sided: bool) -> None:
        """Add the agreement of an innovation with a driver's prediction, (h,) each, to the sums of the driver."""
        scale = self._scales["between"]
        x = scale.bounded(value) / scale.rms * np.clip(predicted, -BOUND, BOUND)
        self._sums(name, two_sided=two_sided).add(x)

    def _standardised(self, name: str, value: float) -> float | None:
        """A lot's value of a driver less the mean of earlier ones, over their standard deviation; None for the first three."""
        n, mean, squares = self._numbers.get(name, (0.0, 0.0, 0.0))
        spread = np.sqrt(squares / n) if n else 0.0
        step = value - mean
        self._numbers[name] = n + 1.0, mean + step / (n + 1.0), squares + step * (value - mean - step / (n + 1.0))
        return float(np.clip(step / spread, -BOUND, BOUND)) if n > 2.0 and spread > 0.0 else None

    def _inside(self, lot: ScoredLot) -> None:
        """Add evidence of drivers that differ between the units of a lot, by differences within it."""
        by_unit = lot.own
        free, information = lot.inside
        root = np.sqrt(information)
        scale, typical = self._scales["inside"], self._typical
        limit = BOUND * scale.rms * root
        left = np.clip(free, -limit, limit)
        units = {} if self.earlier is None else {UNIT: lot.units}
        for name, labels in {**lot.levels, **units}.items():
            if not any(labels):
                continue
            inside = name if name in {SLOT, UNIT} else name + INSIDE
            if name == UNIT:
                predicted = self._of_units(labels)
            else:
                table = self.levels.setdefault(inside, Levels(self.count))
                predicted = table.predicted(labels, SHRUNK / len(labels) * typical)[0]
            if len(set(labels)) > 1:
                self._add_inside(inside, lot, predicted - lot.averaged(predicted), left, two_sided=False)
            if name != UNIT:
                alike = np.array([by_unit[[other == label for other in labels]].sum(axis=0) for label in labels])
                self.levels[inside].add(labels, left, by_unit * (1.0 - alike / lot.total))
        for name, numbers in {
            **{name: of_units[:, None] for name, of_units in lot.numbers.items()},
            **lot.slopes,
        }.items():
            if np.isfinite(numbers).all() and np.ptp(numbers, axis=0).any():
                about = numbers - lot.averaged(numbers)
                self._add_inside(name + INSIDE, lot, about, left, two_sided=True)
                # for the estimate of the slope
                sums = np.stack([(left * about).sum(axis=0), np.zeros(self.count)])
                squares = np.stack([(by_unit * about**2).sum(axis=0), by_unit.sum(axis=0)])
                self.levels.setdefault(name + INSIDE, Levels(self.count)).add((SLOPE, ALL), sums, squares)
        scale.add(np.sqrt(np.mean(over(left, root) ** 2, axis=0)))

    def _add_inside(self, name: str, lot: ScoredLot, about: Array, left: Array, *, two_sided: bool) -> None:
        """Add the agreement of scores ``left`` with predicted sizes about their mean, (units, h) each, to a driver's sums."""
        size = np.sqrt((lot.own * about**2).sum(axis=0))
        scale = self._scales["inside"]
        x = scale.bounded(over((left * about).sum(axis=0), size)) / scale.rms
        self._sums(name, two_sided=two_sided).add(x if two_sided else x * np.minimum(size / scale.rms, BOUND))

    def _of_units(self, units: tuple[str, ...]) -> Array:
        """Sizes (units, h) of the units in their earlier lots; zero for a unit measured for the first time."""
        before = (None if self.earlier is None else self.earlier(unit, self._taken) for unit in units)
        return np.array([np.zeros(self.count) if of_unit is None else over(*of_unit) for of_unit in before])


_KINDS = {kind.__name__: kind for kind in (Evidence, Sums, Levels, Scale, Wander, Level)}
"""Classes of which the state of an evidence consists."""


def stored(value: Any, arrays: list[Any]) -> Any:
    """A state as what JSON holds, for :func:`restored`; its arrays are appended to ``arrays``."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": len(arrays) - 1}
    if isinstance(value, dict):
        return {"items": {name: stored(part, arrays) for name, part in value.items()}}
    if type(value).__name__ in _KINDS:
        parts = {name: part for name, part in vars(value).items() if not callable(part)}
        return {"kind": type(value).__name__, **stored(parts, arrays)}
    return value


def restored(plain: Any, arrays: Sequence[Any]) -> Any:
    """The state of :func:`stored`; the function ``earlier`` of an evidence of units is to be set again."""
    if not isinstance(plain, dict):
        return plain
    if "array" in plain:
        return arrays[plain["array"]]
    items = {name: restored(part, arrays) for name, part in plain["items"].items()}
    if "kind" not in plain:
        return items
    made = object.__new__(_KINDS[plain["kind"]])
    vars(made).update(items)
    return made
