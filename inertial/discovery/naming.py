"""Which effect, and which driver, an alarm of an archive stands for: all lots at once, after the evidence has raised it.

Every driver's sums say for each effect by how much it lowers the misfit of all lots, D; with k coefficients its score is
D − k(1 + ln(D/k)), as for a variance that is estimated. Effects within 15 of the best are one class. The best is taken out of all
sums by the products of the columns, and what is left is looked at again: at last for any function of the pose.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import block_diag

from inertial import effects as effects_catalogue
from inertial.arrays import Array, Places
from inertial.decisions import CLASS_WIDTH
from inertial.discovery.driver_sums import INSIDE_ONLY, DriverSums, about_common, gathered, shrinkage, weights_of
from inertial.discovery.evidence import INSIDE, MEAN, ScoredLot
from inertial.discovery.pose_shape import SHAPE
from inertial.discovery.station_wander import over

_MOST = 6
"""Largest number of names of one night."""

_TURNS = 5  # of a fit of columns, and of levels, that share lots

_INEXACT = 0.02
"""Part of a score that is not known: products of columns are means over lots, effects are at the middle of their range."""

_SEEN = 1e-3  # share of its information that a column keeps beside another one, below which the two are one column

_OF_POSE = 0.5
"""Part of a name's score that a function of the pose loses with it where the name is one: all of a static effect's, and next to
nothing of an effect of temperature or time."""

_ALIKE = 0.8  # cosine from which on columns are taken for each other where one of them is known to a few per cent

_REMAINDER = 0.03
"""Part of a named effect's score that its column, taken at the middle of its parameters' range, can leave."""


@dataclass(frozen=True)
class Name:
    """An effect that an archive holds, with its driver.

    effects, drivers : classes, best first · sizes : (levels, axes), rms in a dwell, g; errors : their standard errors
    labels, weights : of the levels · score : of the best
    """

    effects: tuple[str, ...]
    drivers: tuple[str, ...]
    labels: tuple[str, ...]
    weights: Array
    sizes: Array
    errors: Array
    score: float


@dataclass(frozen=True)
class Unnamed:
    """A function of the pose that differs by a driver and that no named effect is.

    level : of the driver that departs most, "" where it has none · size : (axes, p), of the free functions, g
    covariance : (axes, p, p) · score : of all levels
    """

    driver: str
    level: str
    size: Array
    covariance: Array
    score: float


class Pool:
    """All lots of an archive, gathered for some drivers.

    Parameters
    ----------
    columns : (k,) effect and number of its column; hypotheses are axes × columns
    size : (h,), rms in a dwell of a coefficient of one, g
    lot : (h, h), correlations of the columns' information in sums of lots · inside : (m, k, k), the same inside a lot
    """

    def __init__(self, columns: Sequence[tuple[str, int]], size: Array, lot: Array, inside: Array) -> None:
        self.columns, self.size = tuple(columns), size
        self.lot, self.inside = _correlation(lot), _correlation(inside)
        self.axes = len(inside)

    def names(
        self, lots: Sequence[ScoredLot], alarms: Iterable[tuple[str, str]], needed: float
    ) -> tuple[list[Name], list[Unnamed]]:
        """The names of what the lots hold, and what has none, the strongest first.

        Parameters
        ----------
        alarms : pairs of driver and effect with an alarm
        needed : score from which on something is named
        """
        alarmed = {(name.removesuffix(INSIDE), effect) for name, effect in alarms}
        drivers = list(dict.fromkeys(name for name, _ in sorted(alarmed)))
        found, every = list[Name](), lots
        of_pose: list[dict[str, float]] = []  # before each name, and after the last
        while True:
            sums = gathered(lots, drivers)
            scores = {name: self.scores(name, of) for name, of in sums.items()}
            again = self._again(lots, list(sums))
            of_pose.append({name: of.get(SHAPE, 0.0) for name, of in scores.items()})
            pairs = [
                (score, name, effect)
                for name, of in scores.items()
                for effect, score in of.items()
                if effect != SHAPE
                and score > needed
                and again[name][effect] > np.sqrt(2.0 * needed)
                # what other names leave over is named only where it had an alarm itself, and stands out
                and (not found or ((name, effect) in alarmed and score > needed + CLASS_WIDTH))
            ]
            name = next((named for named in self._in_order(pairs, sums, scores) if not self._told(found, named)), None)
            if name is None or len(found) == _MOST:
                break
            found.append(name)
            lots = self._fitted_out(lots, name.drivers[0], name.effects[0])
        imitations = _imitations(found, of_pose, needed)
        genuine = [name for at, name in enumerate(found) if at not in imitations]
        if len(genuine) < len(found):
            lots = every
            for name in genuine:
                lots = self._fitted_out(lots, name.drivers[0], name.effects[0])
        return genuine, self._unnamed(lots, genuine, drivers, needed)

    def _unnamed(
        self, lots: Sequence[ScoredLot], names: Sequence[Name], drivers: Sequence[str], needed: float
    ) -> list[Unnamed]:
        """Functions of the pose that differ by a driver in lots without what is named."""
        out: list[Unnamed] = []
        least = max([needed, *(_REMAINDER * name.score for name in names)])
        while SHAPE in self.effects and len(out) < _MOST:
            sums = gathered(lots, drivers)
            again = self._again(lots, list(sums))
            scores = {driver: self.scores(driver, of)[SHAPE] for driver, of in sums.items()}
            left = [driver for driver in scores if again[driver][SHAPE] > np.sqrt(2.0 * needed)]
            best = max(left, key=lambda driver: scores[driver], default=None)
            if best is None or scores[best] <= least or best in {unnamed.driver for unnamed in out}:
                break
            out.append(self._shape(best, sums[best], scores[best]))
            least = max(least, _REMAINDER * scores[best])
            lots = self._fitted_out(lots, best, SHAPE)
        return out

    def _shape(self, driver: str, sums: DriverSums, score: float) -> Unnamed:
        """The function of the pose of the level that departs most."""
        size, products = self._fitted(driver, SHAPE, sums)
        z = size / np.sqrt(np.maximum(np.diagonal(products, axis1=2, axis2=3), 1e-300))
        level = int(np.argmax(np.sum(z**2, axis=(0, 2))))
        label = sums.labels[level] if len(sums.labels) > 1 else ""
        return Unnamed(driver, label, size[:, level], products[:, level], score)

    def _fitted(self, driver: str, effect: str, sums: DriverSums) -> tuple[Array, Array]:
        """Sizes (axes, levels, p) of a driver's levels, the columns of an effect together, and their covariances."""
        here, centred = self._everywhere(effect), about_common(driver, sums)
        inner = self._inner(sums, effect)
        root = np.sqrt(np.maximum(sums.information[:, here], 0.0))
        scale = over(np.ones_like(root), root)
        sizes = scale * (over(centred[:, here], root) @ inner)
        covariance = (scale[:, :, None] * inner * scale[:, None, :]).reshape(
            len(root), self.axes, -1, self.axes, here.size // self.axes
        )
        covariances = np.stack([covariance[:, axis, :, axis] for axis in range(self.axes)])
        return np.moveaxis(sizes.reshape(len(root), self.axes, -1), 1, 0), covariances

    def _in_order(
        self,
        pairs: Sequence[tuple[float, str, str]],
        sums: Mapping[str, DriverSums],
        scores: Mapping[str, Mapping[str, float]],
    ) -> Iterator[Name]:
        """Pairs of score, driver and effect as names, the best first."""
        for top, best, effect in sorted(pairs, reverse=True):
            # what differs by a level is not zero on average either: the driver says more
            same = (n for score, n, other in pairs if other == effect and n != MEAN and score > top - CLASS_WIDTH)
            driver = next(same, best)
            yield self._name(driver, sums[driver], effect, scores)

    def _told(self, found: Sequence[Name], new: Name) -> bool:
        """Whether an effect is named with this driver, or is what is left of one whose column is known to a few per cent."""
        effect, driver = new.effects[0], new.drivers[0]
        for name in found:
            little = new.score < _REMAINDER * name.score
            cosines = self.lot[np.ix_(self._everywhere(effect), self._everywhere(name.effects[0]))]
            alike = set(new.effects) & set(name.effects) or np.abs(cosines).max() > _ALIKE
            if (alike and (little or driver in {MEAN, name.drivers[0]})) or (little and driver == name.drivers[0]):
                return True
        return False

    def _fitted_out(self, lots: Sequence[ScoredLot], driver: str, effect: str) -> Sequence[ScoredLot]:
        """The lots without an effect of a driver: columns of the effect, and levels that share lots, are fitted in turns."""
        for _ in range(_TURNS):
            sums = gathered(lots, [driver])
            if driver not in sums or self.scores(driver, sums[driver])[effect] < 1.0:
                break
            sizes = self._sizes(driver, effect, sums[driver])
            lots = [self.without(lot, driver, effect, sums[driver], sizes) for lot in lots]
        return lots

    def _sizes(self, driver: str, effect: str, sums: DriverSums) -> Array:
        """Sizes (axes, levels, p) of a driver's levels, drawn to zero by what is noise of them."""
        size, covariance = self._fitted(driver, effect, sums)
        if len(sums.labels) > 1:
            known = np.diagonal(covariance, axis1=2, axis2=3)
            size = np.stack([of * shrinkage(of, over(np.ones_like(c), c)) for of, c in zip(size, known, strict=True)])
        return size

    def _again(self, lots: Sequence[ScoredLot], drivers: Sequence[str]) -> dict[str, dict[str, float]]:
        """By how many standard deviations one half of the lots predicts the other, for every driver and effect.

        It is scaled by itself, lot by lot: an effect whose noise is larger than stated, as of slow ones, is not named for it.
        """
        total = {name: np.zeros((2, len(self.effects))) for name in drivers}
        for name, x in self._crossed(lots, drivers):
            total[name] += np.stack([x, x**2])
        return {
            name: dict(zip(self.effects, s / np.sqrt(np.maximum(v, 1e-300)), strict=True))
            for name, (s, v) in total.items()
        }

    def _crossed(self, lots: Sequence[ScoredLot], drivers: Sequence[str]) -> Iterator[tuple[str, Array]]:
        """For each lot and driver, what the lot shows times what the other half of the lots predicts of it, (effects,)."""
        halves = gathered(lots[0::2], drivers), gathered(lots[1::2], drivers)
        for number, lot in enumerate(lots):
            for name, sums in halves[1 - number % 2].items():
                yield name, self._of_effects(self._predicted(lot, name, sums))

    def carried(self, lots: Sequence[ScoredLot], driver: str, effect: str) -> Array:
        """Contribution (n,) of each lot to the evidence of an effect by a driver."""
        index = self.effects.index(effect)
        return np.array([x[index] for _, x in self._crossed(lots, [driver])])

    def confirmed(
        self, before: Sequence[ScoredLot], after: Sequence[ScoredLot], driver: str, effect: str
    ) -> tuple[float, float, int]:
        """How much of what earlier lots predict later ones show, with its standard error, and the lots that can show it.

        It is one where the effect is confirmed; lots with levels that were not there before show nothing.
        """
        index, sums = self.effects.index(effect), gathered(before, [driver])
        if driver not in sums:
            return float("nan"), float("inf"), 0
        shown, expected = np.zeros((2, len(after)))
        for number, lot in enumerate(after):
            shown[number] = self._of_effects(self._predicted(lot, driver, sums[driver]))[index]
            expected[number] = self._of_effects(self._expected(lot, driver, sums[driver]))[index]
        able, total = int(np.count_nonzero(expected > 0.0)), float(expected.sum())
        if not able or total <= 0.0:
            return float("nan"), float("inf"), 0
        factor = float(shown.sum()) / total
        return factor, float(np.sqrt(np.sum((shown - factor * expected) ** 2))) / total, able

    def _expected(self, lot: ScoredLot, driver: str, sums: DriverSums) -> Array:
        """What :meth:`_predicted` is on average if the prediction holds, (h,)."""
        of_units = _of_units(lot, driver, sums)
        common = lot.averaged(of_units)
        inside = ((of_units - common) ** 2 * lot.own).sum(axis=0)
        return inside if driver in INSIDE_ONLY else inside + common**2 * lot.information

    @cached_property
    def effects(self) -> list[str]:
        """Ids of the effects, in the order of their columns."""
        return list(dict.fromkeys(effect for effect, _ in self.columns))

    @cached_property
    def _sum_over(self) -> Array:
        """(h, effects): which axes and columns belong to an effect."""
        belongs = np.array([[name == effect for effect in self.effects] for name, _ in self.columns], dtype=np.float64)
        return np.tile(belongs, (self.axes, 1))

    def _of_effects(self, x: Array) -> Array:
        return x @ self._sum_over

    def _predicted(self, lot: ScoredLot, driver: str, sums: DriverSums) -> Array:
        """Product (h,) of what a lot shows and what other lots predict of it."""
        of_units = _of_units(lot, driver, sums)
        return ((lot.inside[0] if driver in INSIDE_ONLY else lot.score) * of_units).sum(axis=0)

    def without(self, lot: ScoredLot, driver: str, effect: str, sums: DriverSums, sizes: Array) -> ScoredLot:
        """A lot without sizes (axes, levels, p) of an effect: algebra on its sums, no dwell is read again."""
        at, count, units = self.places(effect), len(self.columns), len(lot.units)
        weights = weights_of(lot, driver, sums)
        if not weights.any():
            return lot
        score = lot.score.copy()
        root, everywhere = np.sqrt(np.maximum(lot.information, 0.0)), self._everywhere(effect)
        in_common: list[Array] = []
        for axis in range(self.axes):
            here, every = axis * count + at, axis * count + np.arange(count)
            of_units = weights @ sizes[axis]  # (units, p)
            unit_roots = np.sqrt(np.maximum(lot.own[:, every], 0.0))
            total = np.maximum(lot.own[:, here].sum(axis=0), 1e-300)
            in_common.append((of_units * lot.own[:, here]).sum(axis=0) / total)
            score[:, every] -= unit_roots * (((of_units - in_common[-1]) * unit_roots[:, at]) @ self.inside[axis][at])
        # errors of the station, which are free, join the axes
        score -= root * ((np.concatenate(in_common) * root[everywhere]) @ self.lot[everywhere]) / units
        return replace(lot, score=score)

    def with_effect(self, lot: ScoredLot, effect: str) -> ScoredLot:
        """A lot whose model has an effect more, with coefficients of every unit and axis: U_j − I_jk U_k / I_kk, on its sums."""
        at, count = self.places(effect), len(self.columns)
        sums, share = lot.score.sum(axis=0), lot.own / lot.total
        left, by_unit, information = lot.inside[0].copy(), lot.own.copy(), lot.information.copy()
        for axis in range(self.axes):
            every = axis * count + np.arange(count)
            left[:, every], by_unit[:, every] = _beside(left[:, every], by_unit[:, every], self.inside[axis], at)
        of_sums = _beside(sums[None], information[None], self.lot, self._everywhere(effect))
        sums, information = (part[0] for part in of_sums)
        score = np.where(by_unit > 0.0, left + share * sums, 0.0)
        return replace(lot, score=score, own=by_unit, information=information)

    def places(self, effect: str) -> Places:
        """Columns of an effect, (p,)."""
        return np.array([k for k, (name, _) in enumerate(self.columns) if name == effect], dtype=np.intp)

    def _everywhere(self, effect: str) -> Places:
        """Hypotheses of an effect, (axes·p,), axis by axis."""
        return (np.arange(self.axes)[:, None] * len(self.columns) + self.places(effect)).reshape(-1)

    def _inner(self, sums: DriverSums, effect: str) -> Array:
        """Inverse of the correlations of an effect's hypotheses, (axes·p, axes·p), for a driver.

        Combinations that errors of the station, or rounding of the stored sums, leave nothing of do not count: of a large effect
        they would explain three times what there is.
        """
        at, here = self.places(effect), self._everywhere(effect)
        if sums.mixed:
            among = np.asarray(block_diag(*self.inside[:, at[:, None], at]), dtype=np.float64)
        else:
            among = self.lot[np.ix_(here, here)]
        return np.linalg.pinv(among, rcond=_SEEN, hermitian=True).astype(np.float64)

    def scores(self, name: str, sums: DriverSums) -> dict[str, float]:
        """Score of every effect for a driver."""
        out: dict[str, float] = {}
        for effect in self.effects:
            drop, rank = self._drop(name, sums, effect)
            k = float(np.sum(rank) - (np.count_nonzero(rank) if name in INSIDE_ONLY else 0))
            out[effect] = max(drop - k * (1.0 + np.log(drop / k)), 0.0) if k > 0.0 and drop > k else 0.0
        return out

    def _drop(self, name: str, sums: DriverSums, effect: str) -> tuple[float, Array]:
        """Fall of the misfit by an effect's columns, and the number of coefficients of each hypothesis."""
        here = self._everywhere(effect)
        info = sums.information[:, here]
        z = over(about_common(name, sums)[:, here], np.sqrt(np.maximum(info, 0.0)))
        return float(np.einsum("gp,pq,gq->", z, self._inner(sums, effect), z)), (info > 0.0).sum(axis=0)

    def _rank(self, effect: str, behind: float, top: float) -> tuple[bool, int, int, float]:
        """Order in a class: of those that inexact columns do not tell apart the simplest is first."""
        simplicity = effects_catalogue.get(effect).simplicity
        return behind > _INEXACT * top, len(self.places(effect)), simplicity, behind

    def _name(self, driver: str, sums: DriverSums, effect: str, scores: Mapping[str, Mapping[str, float]]) -> Name:
        count, top = len(self.columns), scores[driver][effect]
        width = max(CLASS_WIDTH, _INEXACT * top)
        effects = [rival for rival, score in scores[driver].items() if score > top - width and rival != SHAPE]
        drivers = [name for name, of in scores.items() if of[effect] > top - CLASS_WIDTH]
        effects.sort(key=lambda rival: self._rank(rival, top - scores[driver][rival], top))
        drivers.sort(key=lambda other: (other != driver, -scores[other][effect]))
        here = np.arange(self.axes) * count + self.places(effects[0])[0]
        info = sums.information[:, here]
        sizes = over(about_common(driver, sums)[:, here], info) * self.size[here]
        errors = (
            np.where(info > 0.0, over(np.ones_like(info), np.sqrt(np.maximum(info, 0.0))), np.inf) * self.size[here]
        )
        weights = np.array(list(sums.units.values()), dtype=np.float64)
        return Name(tuple(effects), tuple(drivers), tuple(sums.levels), weights, sizes, errors, top)


def _imitations(names: Sequence[Name], of_pose: Sequence[Mapping[str, float]], needed: float) -> set[int]:
    """Names that are parts of a function of the pose which no effect is: together they explain less than it does alone.

    Parameters
    ----------
    of_pose : for each name, and after the last, score of such a function by each driver
    """
    out: set[int] = set()
    for driver in {name.drivers[0] for name in names}:
        before = [scores.get(driver, 0.0) for scores in of_pose]
        of_driver = [at for at, name in enumerate(names) if name.drivers[0] == driver]
        parts = [at for at in of_driver if before[at] - before[at + 1] > _OF_POSE * names[at].score]
        explained = sum(names[at].score for at in parts)
        if parts and before[-1] > max(needed, _REMAINDER * explained):
            out |= set(parts) if before[parts[0]] > explained * (1.0 + _INEXACT) + CLASS_WIDTH else set()
    return out


def _beside(values: Array, information: Array, products: Array, at: Places) -> tuple[Array, Array]:
    """Scores and information (n, h) beside the columns ``at``, whose coefficients are free, by correlations (h, h)."""
    inner = np.linalg.pinv(products[np.ix_(at, at)], rcond=1e-6, hermitian=True)
    root = np.sqrt(np.maximum(information, 0.0))
    values = values - root * (over(values, root)[:, at] @ inner @ products[at])
    covered = np.einsum("jp,pq,qj->j", products[:, at], inner, products[at])
    information = information * np.where(covered > 1.0 - _SEEN, 0.0, np.clip(1.0 - covered, 0.0, 1.0))
    values[:, at], information[:, at] = 0.0, 0.0
    return values, information


def _of_units(lot: ScoredLot, driver: str, sums: DriverSums) -> Array:
    """Sizes (units, h) that the sums of a driver predict for the units of a lot."""
    return weights_of(lot, driver, sums) @ over(about_common(driver, sums), sums.information)


def _correlation(products: Array) -> Array:
    """Products (..., k, k) over the roots of their diagonals; zero where nothing is seen."""
    root = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 0.0))
    return over(products, root[..., :, None] * root[..., None, :])
