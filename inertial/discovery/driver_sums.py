"""All lots of an archive in one stack, and the sums of their scores and information by the levels of a driver."""

import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from inertial.arrays import NORMAL_MEDIAN, Array, Places, over
from inertial.discovery.evidence import SLOPE, SLOT, UNIT, ScoredLot


@dataclass
class LotStack:
    """Scores of the n units of some lots, one lot after the other.

    by_lot : (lots, n), sums units over each lot · lot : (n,), index of the lot of each unit
    score, own : (n, h), as in a lot · information : (lots, h), of the sums over the units
    """

    lots: Sequence[ScoredLot]
    by_lot: csr_array
    lot: Places
    score: Array
    own: Array
    information: Array

    @classmethod
    def of(cls, lots: Sequence[ScoredLot]) -> "LotStack":
        """The stack of some lots."""
        lot = np.repeat(np.arange(len(lots)), [len(each.units) for each in lots])
        by_lot = csr_array((np.ones(lot.size), (lot, np.arange(lot.size))), shape=(len(lots), lot.size))
        score, own = np.concatenate([each.score for each in lots]), np.concatenate([each.own for each in lots])
        return cls(lots, by_lot, lot, score, own, np.array([each.information for each in lots]))

    def part(self, part: slice) -> "LotStack":
        """Some of the lots."""
        chosen = np.isin(self.lot, np.arange(len(self.lots))[part])
        return LotStack.of(self.lots[part]).with_score(self.score[chosen])

    def with_score(self, score: Array) -> "LotStack":
        """The same lots with other scores; what does not depend on these is shared, as an archive has many lots."""
        other = copy(self)
        other.score = score
        return other

    @cached_property
    def share(self) -> Array:
        """Share (n, h) of each unit in the information of its lot."""
        return self.own / np.maximum(self.by_lot @ self.own, 1e-300)[self.lot]

    @property
    def sums(self) -> Array:
        """Scores (lots, h) summed over the units; zero where a lot has no information."""
        return np.where(self.information > 0.0, self.by_lot @ self.score, 0.0)

    @property
    def left(self) -> Array:
        """Scores (n, h) of the units about the mean of their lot."""
        return self.score - self.share * (self.by_lot @ self.score)[self.lot]

    @cached_property
    def station(self) -> Places:
        """Index (lots,) of the station of each lot, in the order of their first lots."""
        number = {name: at for at, name in enumerate(dict.fromkeys(lot.station for lot in self.lots))}
        return np.array([number[lot.station] for lot in self.lots])

    def labels(self, driver: str) -> list[str]:
        """Label of each unit by a driver; empty where it is unknown or a number."""
        return [label for lot in self.lots for label in lot.labels(driver) or ("",) * len(lot.units)]

    def numbers(self, driver: str) -> Array | None:
        """Number (n,) of each unit by a driver, nan where it is unknown; None if no lot has one."""
        each = [lot.number(driver) for lot in self.lots]
        if all(numbers is None for numbers in each):
            return None
        nothing = (np.full(len(lot.units), np.nan) for lot in self.lots)
        return np.concatenate([no if of is None else of for of, no in zip(each, nothing, strict=True)])

    def about_lots(self, of_units: Array, here: Places | slice = slice(None)) -> tuple[Array, Array]:
        """Sizes (n, p) of hypotheses ``here`` about the mean of their lot, by information, and these means (lots, p)."""
        means = self.by_lot @ (of_units * self.share[:, here])
        return of_units - means[self.lot], means

    def predicted(
        self, sizes: tuple[Array, Array], inside: Array, between: Array, here: Places | slice = slice(None)
    ) -> tuple[Array, Array]:
        """Scores (n, h) about the mean of a lot, and their sums (lots, h), that sizes of hypotheses ``here`` give.

        Parameters
        ----------
        sizes : as of :meth:`about_lots` · inside, between : (p, h), correlations within lots, and in their sums
        """
        root, roots = np.sqrt(self.own), np.sqrt(np.maximum(self.information, 0.0))
        about, of_lots = sizes
        return root * ((about * root[:, here]) @ inside), roots * ((of_lots * roots[:, here]) @ between)


class DriverSums:
    """Sums of a driver by level, in units of the noise of the lots; the level of a number is its slope.

    labels : names of the g levels · units : (g,), number of units of each
    score, information : (g, h), from differences within lots, and from the means of lots
    inside_only : whether the driver is judged only by differences within lots
    mixed : whether most information comes from differences within lots, so that the columns' products within lots apply
    noise : variance over the stated one of the means of lots and of units within lots, by which scores are divided
    about, spread : origin from which a number is counted, and the rms of the numbers over the units; 0 and 1 for labels

    Parameters
    ----------
    left : (n, h), scores of the units about the mean of their lot
    means : (lots, h), mean size of the lots of the station of each
    seen : number of lots of each unit; one alone tells nothing
    """

    def __init__(
        self,
        driver: str,
        stack: LotStack,
        left: Array,
        noise: tuple[float, float],
        means: Array,
        seen: Mapping[str, int],
    ) -> None:
        self.driver, self.noise, self.about, self.spread = driver, noise, 0.0, 1.0
        self.inside_only = driver in {SLOT, UNIT}
        numbers, sums, of_lot, middle = stack.numbers(driver), stack.sums, stack.lot, None
        if numbers is None:
            names = dict.fromkeys(stack.labels(driver))
            self.labels = [name for name in names if name and (driver != UNIT or seen[name] > 1)]
            weights = self.weights(stack)
            self.units = np.asarray(weights.sum(axis=0), dtype=np.float64)
        else:
            middle = np.asarray(stack.by_lot @ numbers) / np.bincount(of_lot)
            known = np.isfinite(middle)
            self.labels, self.units = [SLOPE] * bool(known.any()), np.array([np.count_nonzero(known[of_lot])])
            self.about = float(middle[known].mean()) if self.labels else 0.0
            weights = csr_array(np.where(known[of_lot], numbers - self.about, 0.0)[:, None])
            squares = float((weights**2).sum())
            self.spread = float(np.sqrt(squares / self.units[0])) if squares > 0.0 else 1.0
            sums = sums - stack.information * means  # what the lots of a station have in common is no slope
        g = len(self.labels)
        entries = weights.tocoo()
        unit, level = entries.coords
        cells, cell = np.unique(of_lot[unit] * max(g, 1) + level, return_inverse=True)
        lots, levels = np.divmod(cells, max(g, 1))
        by_cell = csr_array((entries.data, (cell, unit)), shape=(cells.size, of_lot.size))
        by_level = csr_array((np.ones(cells.size), (levels, np.arange(cells.size))), shape=(g, cells.size))
        between, within = noise
        share = by_cell @ stack.share
        inside = (by_cell.power(2) @ stack.own - share * (by_cell @ stack.own)) / within
        common = np.zeros_like(inside)
        self.score = weights.T @ left / within
        if not self.inside_only:
            centre = share if middle is None else (middle[lots] - self.about)[:, None]
            common = centre**2 * stack.information[lots] / between
            self.score += by_level @ (centre * sums[lots]) / between
        self.mixed = float(inside.sum()) > float(common.sum())
        # within lots a level differs from the mean of the lot; about the mean of all levels, to which its share w of the
        # units contributes, that is 1 − w of what it differs
        part = self.units / max(float(self.units.sum()), 1.0)
        self.information = by_level @ (inside + common)
        if g > 1:
            self.information += (part / (1.0 - part))[:, None] * (by_level @ inside)

    @property
    def centred(self) -> Array:
        """Scores (g, h) of levels about the mean over all levels: what they have in common is of the driver "mean"."""
        if len(self.labels) < 2:
            return self.score
        return self.score - self.information * over(self.score.sum(axis=0), self.information.sum(axis=0))

    def weights(self, stack: LotStack) -> csr_array:
        """Weight of each level in each unit of some lots, (n, g): 1 or 0, or a number about its origin."""
        numbers = stack.numbers(self.driver)
        if numbers is not None:
            return csr_array(np.where(np.isfinite(numbers), numbers - self.about, 0.0)[:, None])
        place = {label: at for at, label in enumerate(self.labels)}
        found = [(unit, place[label]) for unit, label in enumerate(stack.labels(self.driver)) if label in place]
        at = np.array(found, dtype=np.intp).reshape(-1, 2).T
        return csr_array((np.ones(at.shape[1]), (at[0], at[1])), shape=(stack.lot.size, len(self.labels)))

    def predicted_sizes(self, stack: LotStack) -> Array:
        """Sizes (n, h) that the sums predict for the units of some lots."""
        return self.weights(stack) @ over(self.centred, self.information)


def gathered(stack: LotStack, drivers: Sequence[str], compared: Sequence[ScoredLot] = ()) -> dict[str, DriverSums]:
    """Sums of drivers over lots, from differences between and within lots together, by driver.

    compared : other lots that the sums are compared with: a unit counts that is in one of these and in one of those
    """
    by_station = csr_array(np.eye(int(stack.station.max(initial=-1)) + 1)[stack.station]).T
    means = over(by_station @ stack.sums, by_station @ stack.information)[stack.station]
    left = stack.left
    noise = _noise(stack, left, means)
    seen = Counter(unit for lot in (*stack.lots, *compared) for unit in lot.units)
    out = {name: DriverSums(name, stack, left, noise, means, seen) for name in drivers}
    return {name: sums for name, sums in out.items() if sums.labels}


def _noise(stack: LotStack, left: Array, means: Array) -> tuple[float, float]:
    """Variance over the stated one, of lots about their station's mean and of units within lots; medians over all.

    What is not measured has infinite noise: units of lots that have one.
    """
    info = np.where(stack.information > 0.0, stack.information, np.nan)
    between = (stack.sums - stack.information * means) ** 2 / info
    free = stack.own * (1.0 - stack.share)
    within = stack.by_lot @ (left**2 / np.where(free > 0.0, free, np.nan)) / np.bincount(stack.lot)[:, None]
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # an effect that no lot shows is nan for all of them
        many = np.nanmedian(np.clip(between, 0.0, np.nanquantile(between, 0.99)), axis=0) / NORMAL_MEDIAN**2
        few = np.nanmedian(within, axis=0)
        of_units = float(np.nanmedian(few[few > 0.0]))
        return float(np.nanmedian(many[many > 0.0])), of_units if np.isfinite(of_units) else np.inf
