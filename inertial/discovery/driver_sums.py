"""Sums of scores and information of a driver over all lots, by level, and the weight of each level in each unit."""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from inertial.arrays import NORMAL_MEDIAN, Array, over
from inertial.discovery.evidence import MEAN, SLOPE, SLOT, STATION, UNIT, ScoredLot
from inertial.discovery.running_sums import Levels

INSIDE_ONLY = {SLOT, UNIT}
"""Drivers that are judged only by differences within a lot."""


class DriverSums(Levels):
    """Sums of a driver by level, in units of the noise of the lots; the level of a number is its slope.

    units : number of units of each level · about : origin from which a number is counted
    inside, between : information from differences within lots, and from the means of lots
    """

    def __init__(self, count: int, about: float) -> None:
        super().__init__(count)
        self.units, self.about, self.inside, self.between = Counter[str](), about, 0.0, 0.0

    @property
    def labels(self) -> list[str]:
        """Names of the g levels."""
        return list(self.place)

    @property
    def mixed(self) -> bool:
        """Whether most information comes from differences within lots, so that the columns' products within lots apply."""
        return self.inside > self.between

    def add_units(self, label: str, score: Array, information: Array, units: int) -> None:
        """Add scores and information (h,) of some units to a level."""
        self.add((label,), score[None], information[None])
        self.units[label] += units


def gathered(lots: Sequence[ScoredLot], drivers: Sequence[str]) -> dict[str, DriverSums]:
    """Sums of drivers over lots, from differences between and within lots together, by driver."""
    means = _station_means(lots)
    noise, within = _noise(lots, means)
    out = {name: DriverSums(lots[0].information.size, _mean_number(lots, name)) for name in drivers}
    seen = Counter(unit for lot in lots for unit in lot.units) if UNIT in out else Counter[str]()
    for lot in lots:
        _gather(lot, out, means[lot.station], (noise, within), seen)
    return {name: sums for name, sums in out.items() if sums.labels}


def _mean_number(lots: Sequence[ScoredLot], name: str) -> float:
    """Mean of a numerical driver over the lots that have it; zero if none has."""
    values = [float(numbers.mean()) for lot in lots if (numbers := lot.number(name)) is not None]
    return float(np.nanmean(values)) if values else 0.0


def shrinkage(size: Array, information: Array) -> Array:
    """Factors (p,) for shrinking the sizes (levels, p) towards zero: the share of their variance that is not noise."""
    noise = over(np.ones_like(information), information).sum(axis=0)
    return np.clip(1.0 - noise / np.maximum((size**2).sum(axis=0), 1e-300), 0.0, 1.0)


def weights_of(lot: ScoredLot, driver: str, sums: DriverSums) -> Array:
    """Weight of each level in each unit, (units, levels): 1 or 0, or a numerical driver's value about its origin."""
    numbers = lot.number(driver)
    if numbers is not None:
        return np.where(np.isfinite(numbers), numbers - sums.about, 0.0)[:, None]
    out = np.zeros((len(lot.units), len(sums.labels)))
    for unit, label in enumerate(lot.labels(driver)):
        if label in sums.place:
            out[unit, sums.place[label]] = 1.0
    return out


def about_common(driver: str, sums: DriverSums) -> Array:
    """Scores (g, h) of levels; for a driver judged within lots only, about the mean over all levels."""
    if driver not in INSIDE_ONLY or len(sums.labels) < 2:
        return sums.score
    return sums.score - sums.information * over(sums.score.sum(axis=0), sums.information.sum(axis=0))


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


def _gather(
    lot: ScoredLot,
    out: Mapping[str, DriverSums],
    mean: Array,
    scale: tuple[float, float],
    seen: Mapping[str, int],
) -> None:
    """Add a lot to the sums of drivers; ``scale``: as of :func:`_noise`, ``seen``: lots of each unit, which must be several."""
    noise, within = scale
    by_unit, total, info, left = lot.own, lot.total, lot.information, lot.inside[0]
    sums = np.where(info > 0.0, lot.score.sum(axis=0), 0.0)
    units = len(lot.units)
    for name, of in out.items():
        labels, numbers = lot.labels(name), lot.number(name)
        if numbers is not None:
            _gather_number(of, numbers - of.about, (lot, left, mean, noise, within))
        elif name in {MEAN, STATION}:
            of.add_units(labels[0], sums / noise, info / noise, units)
        else:
            for label in dict.fromkeys(labels):
                here = np.array([other == label for other in labels])
                of_level = by_unit[here].sum(axis=0)
                score = left[here].sum(axis=0) / within
                information = of_level * (1.0 - of_level / total) / within
                of.inside += float(information.sum())
                if name not in INSIDE_ONLY:  # add the information of the lot's mean
                    share = of_level / total
                    score = score + share * sums / noise
                    common = share**2 * info / noise
                    information = information + common
                    of.between += float(common.sum())
                if label and (name != UNIT or seen[label] > 1):
                    of.add_units(label, score, information, int(here.sum()))


def _gather_number(of: DriverSums, numbers: Array, parts: tuple[ScoredLot, Array, Array, float, float]) -> None:
    """Add a lot to the regression on a number, (units,) about its origin; parts: lot, scores in it, station mean, noise."""
    lot, left, mean, noise, within = parts
    if not np.isfinite(numbers).all():
        return
    by_unit, centre = lot.own, float(numbers.mean())
    about = numbers[:, None] - lot.averaged(numbers[:, None])
    score = (about * left).sum(axis=0) / within + centre * (lot.score.sum(axis=0) - lot.information * mean) / noise
    inside, between = (about**2 * by_unit).sum(axis=0) / within, centre**2 * lot.information / noise
    of.inside, of.between = of.inside + float(inside.sum()), of.between + float(between.sum())
    of.add_units(SLOPE, score, inside + between, len(lot.units))
