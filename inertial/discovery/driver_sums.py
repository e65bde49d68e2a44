"""Sums of scores and information of a driver over all lots, by level, and the weight of each level in each unit."""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array, over
from inertial.discovery.evidence import MEAN, SLOPE, SLOT, STATION, UNIT, ScoredLot
from inertial.discovery.running_sums import Levels


class DriverSums(Levels):
    """Sums of a driver by level, in units of the noise of the lots; the level of a number is its slope.

    units : number of units of each level · about : origin from which a number is counted
    inside_only : whether the driver is judged only by differences within lots
    inside, between : information from differences within lots, and from the means of lots
    noise : variance over the stated one of the means of lots and of units within lots, by which scores are divided
    spread : rms of the numbers over the units, about the origin; 1 for labels
    """

    def __init__(self, driver: str, lots: Sequence[ScoredLot], noise: tuple[float, float]) -> None:
        super().__init__(lots[0].information.size)
        self.driver, self.noise, self.units, self.inside, self.between = driver, noise, Counter[str](), 0.0, 0.0
        self.inside_only = driver in {SLOT, UNIT}
        means = [float(numbers.mean()) for lot in lots if (numbers := lot.number(driver)) is not None]
        self.about, self.spread = float(np.nanmean(means)) if means else 0.0, 1.0
        self._squares = np.zeros(2)  # of the numbers about the origin: their number and sum
        self._within = Levels(lots[0].information.size)

    @property
    def labels(self) -> list[str]:
        """Names of the g levels."""
        return list(self.place)

    @property
    def mixed(self) -> bool:
        """Whether most information comes from differences within lots, so that the columns' products within lots apply."""
        return self.inside > self.between

    @property
    def centred(self) -> Array:
        """Scores (g, h) of levels about the mean over all levels: what they have in common is of the driver "mean"."""
        if len(self.place) < 2:
            return self.score
        return self.score - self.information * over(self.score.sum(axis=0), self.information.sum(axis=0))

    def weights(self, lot: ScoredLot) -> Array:
        """Weight of each level in each unit of a lot, (units, levels): 1 or 0, or a number about its origin."""
        numbers = lot.number(self.driver)
        if numbers is not None:
            return np.where(np.isfinite(numbers), numbers - self.about, 0.0)[:, None]
        out = np.zeros((len(lot.units), len(self.labels)))
        for unit, label in enumerate(lot.labels(self.driver)):
            if label in self.place:
                out[unit, self.place[label]] = 1.0
        return out

    def predicted_sizes(self, lot: ScoredLot) -> Array:
        """Sizes (units, h) that the sums predict for the units of a lot."""
        return self.weights(lot) @ over(self.centred, self.information)

    def gather(self, lot: ScoredLot, mean: Array, seen: Mapping[str, int]) -> None:
        """Add a lot.

        Parameters
        ----------
        mean : (h,), mean size of the lots of its station · seen : number of lots of each unit; one alone tells nothing
        """
        between, within = self.noise
        by_unit, total, info, left = lot.own, lot.total, lot.information, lot.inside[0]
        sums, labels = np.where(info > 0.0, lot.score.sum(axis=0), 0.0), lot.labels(self.driver)
        numbers = lot.number(self.driver)
        if self.driver in {MEAN, STATION}:
            self._add_level(labels[0], sums / between, info / between, len(labels))
        elif numbers is None:
            for label in dict.fromkeys(labels):
                here = np.array([other == label for other in labels])
                of_level = by_unit[here].sum(axis=0)
                share = of_level / total
                score, information = left[here].sum(axis=0) / within, of_level * (1.0 - share) / within
                self.inside += float(information.sum())
                self._within.add((label,), score[None], information[None])
                if not self.inside_only:  # add the information of the lot's mean
                    common = share**2 * info / between
                    score, information = score + share * sums / between, information + common
                    self.between += float(common.sum())
                if self.driver != UNIT or seen[label] > 1:
                    self._add_level(label, score, information, int(here.sum()))
        elif np.isfinite(numbers).all():
            from_origin = (numbers - self.about)[:, None]
            about, centre = from_origin - lot.averaged(from_origin), float(from_origin.mean())
            score = (about * left).sum(axis=0) / within + centre * (lot.score.sum(axis=0) - info * mean) / between
            inside, common = (about**2 * by_unit).sum(axis=0) / within, centre**2 * info / between
            self.inside, self.between = self.inside + float(inside.sum()), self.between + float(common.sum())
            self._squares += len(numbers), float((from_origin**2).sum())
            self._add_level(SLOPE, score, inside + common, len(lot.units))

    def complete(self) -> None:
        """Conclude the sums after the last lot.

        Within lots a level differs from the mean of the lot; about the mean of all levels, to which its share w of the units
        contributes, that is 1 − w of what it differs.
        """
        units = sum(self.units.values())
        for label, at in self.place.items() if len(self.place) > 1 else ():
            share = self.units[label] / units
            self._sums[1, at] += self._within.of(label)[1] * share / (1.0 - share)
        count, squares = self._squares
        self.spread = float(np.sqrt(squares / count)) if squares > 0.0 else 1.0

    def _add_level(self, label: str, score: Array, information: Array, units: int) -> None:
        """Add scores and information (h,) of some units to a level."""
        if label:
            self.add((label,), score[None], information[None])
            self.units[label] += units


def gathered(
    lots: Sequence[ScoredLot], drivers: Sequence[str], compared: Sequence[ScoredLot] = ()
) -> dict[str, DriverSums]:
    """Sums of drivers over lots, from differences between and within lots together, by driver.

    compared : other lots that the sums are compared with: a unit counts that is in one of these and in one of those
    """
    means = _station_means(lots)
    noise = _noise(lots, means)
    out = {name: DriverSums(name, lots, noise) for name in drivers}
    seen = Counter(unit for lot in (*lots, *compared) for unit in lot.units) if UNIT in out else Counter[str]()
    for lot in lots:
        for sums in out.values():
            sums.gather(lot, means[lot.station], seen)
    for sums in out.values():
        sums.complete()
    return {name: sums for name, sums in out.items() if sums.labels}


def _station_means(lots: Sequence[ScoredLot]) -> dict[str, Array]:
    """Mean size (h,) over each station's lots, by station."""
    sums = dict[str, Array]()
    for lot in lots:
        of_lot = np.stack([np.where(lot.information > 0.0, lot.score.sum(axis=0), 0.0), lot.information])
        sums[lot.station] = sums.get(lot.station, np.zeros_like(of_lot)) + of_lot
    return {station: over(*of_station) for station, of_station in sums.items()}


def _noise(lots: Sequence[ScoredLot], means: Mapping[str, Array]) -> tuple[float, float]:
    """Variance over the stated one, of lots about their station's mean and of units within lots; medians over all."""
    between, within = list[Array](), list[Array]()
    for lot in lots:
        info = np.where(lot.information > 0.0, lot.information, np.nan)
        between.append((lot.score.sum(axis=0) - lot.information * means[lot.station]) ** 2 / info)
        left, free = lot.inside
        within.append(np.mean(left**2 / np.where(free > 0.0, free, np.nan), axis=0))
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # an effect that no lot shows is nan for all of them
        many = np.nanmedian(np.clip(np.array(between), 0.0, np.nanquantile(between, 0.99)), axis=0) / NORMAL_MEDIAN**2
        few = np.nanmedian(np.array(within), axis=0)
        return float(np.nanmedian(many[many > 0.0])), float(np.nanmedian(few[few > 0.0]))
