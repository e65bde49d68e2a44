"""Identification of the effect and driver behind an alarm of an archive, from all lots together.

The sums of every driver give the reduction D of the chi-square of all lots by each effect; with k coefficients its score is
D − k(1 + ln(D/k)), the price of coefficients with estimated variance. Effects within 15 of the best form a class. The best effect
is subtracted from all sums by the products of the columns, and the remainder is searched again, finally for any function of pose.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.linalg import block_diag

from inertial import effects as effects_catalogue
from inertial.arrays import Array, Places, over
from inertial.decisions import CLASS_WIDTH
from inertial.discovery.driver_sums import DriverSums, LotStack, gathered
from inertial.discovery.evidence import INSIDE, MEAN, ScoredLot
from inertial.discovery.level_fit import WIDE, LevelFit
from inertial.discovery.pose_shape import SHAPE
from inertial.discovery.scores import Products, correlations_of, inverse_of
from inertial.estimation.penalty import price

_MOST = 6
"""Largest number of names of one evaluation."""

_ROUNDS = 3
"""Number of fits of the effects of each driver beside those of the others, where there are several names."""


_INEXACT = 0.02
"""Relative uncertainty of a score: products of columns are means over lots, parameters are at the middle of their range."""

_SEEN = 1e-3  # share of a column's information that remains beside another, below which the two are collinear

_OF_POSE = 0.5
"""Share of a name's score by which the score of a function of pose falls with it, from which on the name is a function of pose:
nearly one for a static effect, nearly zero for an effect of temperature or time."""

_ALIKE = 0.8  # cosine from which on the remainder of one column, known to a few per cent, may be taken for the other

_REMAINDER = 0.03
"""Share of a named effect's score that can remain, because products of columns are means over lots."""

_REMAINDER_OF_SHAPE = 0.25
"""The same where the effect has a time constant or a width, and its column is that of the middle of their range.

Of a creep of 25 s another effect explained 0.13 of its score in 1000 lots (`python -m benchmarks.discovery names --archives 36`).
A second effect of the same driver below half of the size of the first is named when the first is in the model in its own shape.
"""


Scores = dict[tuple[str, str], float]
"""Scores of pairs of driver and effect."""


@dataclass(frozen=True)
class Name:
    """An effect found in an archive, with its driver.

    effects, drivers : equivalent ids, best first · score : score of the best
    labels, weights : names of the levels, and their numbers of units
    sizes, errors : (levels, axes), g, rms per dwell and standard errors, by the scatter of the lots
    by_axis : (axes,), g, rms over the levels, corrected for noise
    square : mean square over levels and axes, g², less what noise adds, and its standard deviation
    """

    effects: tuple[str, ...]
    drivers: tuple[str, ...]
    score: float
    labels: tuple[str, ...] = ()
    weights: Array = field(default_factory=lambda: np.zeros(0))
    sizes: Array = field(default_factory=lambda: np.zeros((0, 3)))
    errors: Array = field(default_factory=lambda: np.zeros((0, 3)))
    by_axis: Array = field(default_factory=lambda: np.zeros(3))
    square: tuple[float, float] = (0.0, 0.0)

    def size(self) -> tuple[float, float, float]:
        """Rms size over levels and axes, and the ends of its 95 % interval, g."""
        mean, spread = self.square[0], WIDE * self.square[1]
        size, low, high = np.sqrt(np.maximum([mean, mean - spread, mean + spread], 0.0)).tolist()
        return size, low, high


@dataclass(frozen=True)
class Unnamed:
    """A dependence on pose that differs by a driver and that no named effect explains.

    level : level of the driver with the largest dependence, "" if it has none · size : (axes, p), g, of the free functions
    covariance : (axes, p, p), g², of the sizes
    """

    driver: str
    level: str
    size: Array
    covariance: Array


class Pool:
    """All lots of an archive, gathered for some drivers; hypotheses are axes × columns, effects in the order of columns."""

    def __init__(self, products: Products) -> None:
        self.columns, self.size, self.axes = products.columns, products.size, len(products.inside)
        self.lot = correlations_of(products.lot)
        self.inside = correlations_of(np.asarray(block_diag(*products.inside), dtype=np.float64))
        self.effects = list(dict.fromkeys(effect for effect, _ in self.columns))
        # indicator (h, effects), 1 where a hypothesis belongs to an effect
        belongs = np.array([[name == effect for effect in self.effects] for name, _ in self.columns], dtype=np.float64)
        self._sum_over = np.tile(belongs, (self.axes, 1))

    def names(
        self, lots: Sequence[ScoredLot], alarms: Iterable[tuple[str, str]], needed: float
    ) -> tuple[list[Name], list[Unnamed]]:
        """The effects found in the lots, and unexplained dependences on pose, the strongest first.

        Parameters
        ----------
        alarms : pairs of driver and effect with an alarm
        needed : smallest score of an effect that is named
        """
        alarmed = {(name.removesuffix(INSIDE), effect) for name, effect in alarms}
        drivers = list(dict.fromkeys(name for name, _ in sorted(alarmed)))
        found, stack = list[Name](), LotStack.of(lots)
        left = stack
        of_pose: list[Scores] = []  # scores of any function of pose by driver, before each name and after the last
        while True:
            _, scores, significant = self._judged(left, drivers, needed)
            of_pose.append({pair: score for pair, score in scores.items() if pair[1] == SHAPE})
            if found:
                # what the best of a class does not take away is another effect, with the same score by chance
                most = needed + max(CLASS_WIDTH, _INEXACT * found[-1].score)
                best, driver = found[-1].effects[0], found[-1].drivers[0]
                same = tuple(e for e in found[-1].effects if e == best or scores.get((driver, e), 0.0) <= most)
                found[-1] = replace(found[-1], effects=same)
            pairs = [
                (scores[pair], *pair)
                for pair in significant
                if pair[1] != SHAPE
                # a remainder of other names is named only if it had an alarm itself and a clearly higher score
                and (pair in alarmed and scores[pair] > needed + CLASS_WIDTH if found else self._raised(pair, alarmed))
            ]
            every_name = (self._name(driver, effect, scores) for _, driver, effect in sorted(pairs, reverse=True))
            name = next((name for name in every_name if not self._already_named(found, name)), None)
            if name is None or len(found) == _MOST:
                break
            left = self._subtracted(left, name.drivers[0], name.effects[0])
            found.append(name)
        imitations = _imitations(found, of_pose, needed)
        found = [name for at, name in enumerate(found) if at not in imitations]
        sized, left = self._sized(found, stack)
        return sized, self._unnamed(left, found, drivers, needed)

    def _unnamed(self, stack: LotStack, names: Sequence[Name], drivers: Sequence[str], needed: float) -> list[Unnamed]:
        """Dependences on pose that differ by a driver, in lots from which the named effects are subtracted."""
        out: list[Unnamed] = []
        least = max([needed, *(_REMAINDER * name.score for name in names)])
        while SHAPE in self.effects and len(out) < _MOST:
            sums, scores, significant = self._judged(stack, drivers, needed)
            best = max((pair for pair in significant if pair[1] == SHAPE), key=lambda pair: scores[pair], default=None)
            if best is None or scores[best] <= least or best[0] in {unnamed.driver for unnamed in out}:
                break
            out.append(self._shape(stack, sums[best[0]]))
            least = max(least, _REMAINDER * scores[best])
            stack = self._subtracted(stack, *best)
        return out

    def _judged(
        self, stack: LotStack, drivers: Sequence[str], needed: float
    ) -> tuple[dict[str, DriverSums], Scores, list[tuple[str, str]]]:
        """Sums by driver, scores of all pairs of driver and effect, and the pairs that halves of the lots predict, too.

        The significance, in standard deviations, with which they predict each other is normalised by the contributions of the
        lots themselves, so that noise larger than stated does not raise it.
        """
        sums = gathered(stack, drivers)
        scores = {(driver, effect): self.score(of, effect) for driver, of in sums.items() for effect in self.effects}
        least = np.sqrt(2.0 * needed)
        significant: list[tuple[str, str]] = []
        for driver, x in self._crossed(stack, list(sums)).items():
            z = x.sum(axis=0) / np.sqrt(np.maximum((x**2).sum(axis=0), 1e-300))
            above = (effect for effect, of_effect in zip(self.effects, z, strict=True) if of_effect > least)
            significant += [(driver, effect) for effect in above if scores[driver, effect] > needed]
        return sums, scores, significant

    def _shape(self, stack: LotStack, sums: DriverSums) -> Unnamed:
        """The dependence on pose of the level with the largest one."""
        fit = self._fit(stack, sums, SHAPE)
        z2 = over(fit.sizes**2, (fit.errors**2).mean(axis=0)).sum(axis=1)
        level = int(np.argmax(z2))
        errors = fit.errors[:, level].reshape(len(fit.errors), self.axes, -1)
        covariance = np.einsum("nap,naq->apq", errors, errors) / len(errors)
        label = sums.labels[level] if len(sums.labels) > 1 else ""
        return Unnamed(sums.driver, label, fit.sizes[level].reshape(self.axes, -1), covariance)

    def _fit(self, stack: LotStack, sums: DriverSums, *effects: str, stated: bool = False) -> LevelFit:
        """The sizes of effects by a driver, which has the sums over the lots."""
        here = self.everywhere(*effects)
        within, of_means = (products[np.ix_(here, here)] for products in (self.inside, self.lot))
        among = within, of_means, self._inner(sums, *effects), inverse_of(of_means, _SEEN)
        return LevelFit(stack, sums, here, self.axes, among, stated=stated)

    def _raised(self, pair: tuple[str, str], alarmed: Iterable[tuple[str, str]]) -> bool:
        """Whether an effect or one with similar columns, or any function of the pose, had an alarm by a driver."""
        driver, effect = pair
        return any(by == driver and (other == SHAPE or self._alike(effect, other)) for by, other in alarmed)

    def _alike(self, effect: str, other: str) -> bool:
        """Whether two effects are the same or have columns that are nearly proportional."""
        cosines = self.lot[np.ix_(self.everywhere(effect), self.everywhere(other))]
        return effect == other or bool(np.abs(cosines).max() > _ALIKE)

    def _already_named(self, found: Sequence[Name], new: Name) -> bool:
        """Whether a name repeats an earlier one, or is the remainder of one whose column is not exactly that of its effect."""
        effect, driver = new.effects[0], new.drivers[0]
        for name in found:
            inexact = effects_catalogue.get(name.effects[0]).nonlinear
            little = new.score < (_REMAINDER_OF_SHAPE if inexact else _REMAINDER) * name.score
            alike = set(new.effects) & set(name.effects) or self._alike(effect, name.effects[0])
            if (alike and (little or driver in {MEAN, name.drivers[0]})) or (little and driver == name.drivers[0]):
                return True
        return False

    def _subtracted(self, stack: LotStack, driver: str, effect: str) -> LotStack:
        """The lots with an effect of a driver subtracted, and with what all have of it in common."""
        for by in dict.fromkeys((driver, MEAN)):  # sizes are about the mean of levels, or of numbers
            stack, _ = self._taken(stack, by, effect)
        return stack

    def _taken(self, stack: LotStack, driver: str, *effects: str) -> tuple[LotStack, Array]:
        """The lots with effects of a driver subtracted, and the sizes (levels, axes·p) that were."""
        sums = gathered(stack, [driver])[driver]
        taken = self._fit(stack, sums, *effects, stated=True).shrunk
        return self._without(stack, sums, taken, *effects), taken

    def _with(self, stack: LotStack, driver: str, taken: Array, *effects: str) -> LotStack:
        """The lots with what was subtracted of effects, (levels, axes·p), added again."""
        return self._without(stack, gathered(stack, [driver])[driver], -taken, *effects)

    def _crossed(self, stack: LotStack, drivers: Sequence[str]) -> dict[str, Array]:
        """For each driver, the products of each lot's scores and their prediction by the other half, (lots, effects)."""
        out = {driver: np.zeros((len(stack.lots), len(self.effects))) for driver in drivers}
        halves = [stack.part(slice(first, None, 2)) for first in (0, 1)]
        for first, (half, other) in enumerate((halves, halves[::-1])):
            for driver, sums in gathered(other, drivers, half.lots).items():
                out[driver][first::2] = self._predicted(half, sums) @ self._sum_over
        return out

    def carried(self, lots: Sequence[ScoredLot], driver: str, effect: str) -> Array:
        """Contribution (n,) of each lot to the cross-validated evidence of an effect by a driver."""
        return self._crossed(LotStack.of(lots), [driver])[driver][:, self.effects.index(effect)]

    def confirmed(
        self, before: Sequence[ScoredLot], after: Sequence[ScoredLot], driver: str, effect: str
    ) -> tuple[float, float, int]:
        """Part of an effect predicted by earlier lots that later ones reproduce, its standard error, the number of lots used.

        The part is one if the effect is confirmed; lots with new levels of the driver are not used.
        """
        sums = gathered(LotStack.of(before), [driver], after).get(driver)
        if sums is None:
            return float("nan"), float("inf"), 0
        stack, of_effect = LotStack.of(after), self._sum_over[:, self.effects.index(effect)]
        shown, expected = (part(stack, sums) @ of_effect for part in (self._predicted, self._expected))
        able, total = int(np.count_nonzero(expected > 0.0)), float(expected.sum())
        if not able or total <= 0.0:
            return float("nan"), float("inf"), 0
        factor = float(shown.sum()) / total
        return factor, float(np.sqrt(np.sum((shown - factor * expected) ** 2))) / total, able

    def _predicted(self, stack: LotStack, sums: DriverSums) -> Array:
        """Product (lots, h) of the lots' scores and the sizes that other lots predict, summed over the units."""
        return stack.by_lot @ ((stack.left if sums.inside_only else stack.score) * sums.predicted_sizes(stack))

    def _expected(self, stack: LotStack, sums: DriverSums) -> Array:
        """Expected value of :meth:`_predicted` if the prediction is true, (lots, h)."""
        about, common = stack.about_lots(sums.predicted_sizes(stack))
        inside = stack.by_lot @ (about**2 * stack.own)
        return inside if sums.inside_only else inside + common**2 * stack.information

    def _without(self, stack: LotStack, sums: DriverSums, sizes: Array, *effects: str) -> LotStack:
        """The lots with effects of sizes (levels, axes·p) subtracted from their sums; no dwell is read again."""
        here = self.everywhere(*effects)
        moved = stack.about_lots(sums.weights(stack) @ sizes, here)
        # the free errors of the station couple the axes
        inside, of_lots = stack.predicted(moved, self.inside[here], self.lot[here], here)
        return stack.with_score(stack.score - inside - stack.share * of_lots[stack.lot])

    def with_effect(self, lot: ScoredLot, effect: str) -> ScoredLot:
        """A lot with an effect added to its model, with coefficients of every unit and axis: U_j − I_jk U_k / I_kk."""
        here, sums = self.everywhere(effect), lot.score.sum(axis=0)
        left, own = _eliminated(lot.inside[0], lot.own, self.inside, here)
        (sums,), (information,) = _eliminated(sums[None], lot.information[None], self.lot, here)
        score = np.where(own > 0.0, left + lot.own / lot.total * sums, 0.0)
        return replace(lot, score=score, own=own, information=information)

    def places(self, *effects: str) -> Places:
        """Indices of the columns of effects, (p,)."""
        return np.array([k for k, (name, _) in enumerate(self.columns) if name in effects], dtype=np.intp)

    def everywhere(self, *effects: str) -> Places:
        """Indices of the hypotheses of effects, (axes·p,), axis by axis."""
        return (np.arange(self.axes)[:, None] * len(self.columns) + self.places(*effects)).reshape(-1)

    def _inner(self, sums: DriverSums, *effects: str) -> Array:
        """Pseudo-inverse of the correlations of the hypotheses of effects, (axes·p, axes·p), for a driver.

        Combinations that vanish beside errors of the station, or by rounding of the stored sums, are excluded: otherwise a large
        effect would seem to explain three times the actual chi-square.
        """
        here = self.everywhere(*effects)
        return inverse_of((self.inside if sums.mixed else self.lot)[np.ix_(here, here)], _SEEN)

    def score(self, sums: DriverSums, effect: str) -> float:
        """Score of an effect for a driver: the reduction of chi-square by its columns less the price of their coefficients."""
        here = self.everywhere(effect)
        info = sums.information[:, here]
        z = over(sums.centred[:, here], np.sqrt(np.maximum(info, 0.0)))
        drop, rank = float(np.einsum("gp,pq,gq->", z, self._inner(sums, effect), z)), (info > 0.0).sum(axis=0)
        k = float(np.sum(rank) - (np.count_nonzero(rank) if len(sums.labels) > 1 else 0))
        return drop - price(drop, k)

    def _name(self, driver: str, effect: str, scores: Scores) -> Name:
        """An effect of a driver with those that are equivalent, without its sizes."""
        top = scores[driver, effect]

        def rank(rival: str) -> tuple[bool, int, int, float]:
            """Sort key in a class: among effects that inexact columns do not distinguish, the simplest is first."""
            behind = top - scores[driver, rival]
            simplicity = effects_catalogue.get(rival).simplicity
            return behind > _INEXACT * top, len(self.places(rival)), simplicity, behind

        least = top - max(CLASS_WIDTH, _INEXACT * top)
        effects = sorted((e for e in self.effects if scores[driver, e] > least and e != SHAPE), key=rank)
        # what all lots have in common is another statement than what differs
        alike = [name for name, of in scores if of == effect and (name == MEAN) == (driver == MEAN)]
        drivers = [name for name in alike if scores[name, effect] > top - CLASS_WIDTH]
        drivers.sort(key=lambda other: (other != driver, -scores[other, effect]))
        return Name(tuple(effects), tuple(drivers), top)

    def _sized(self, names: Sequence[Name], stack: LotStack) -> tuple[list[Name], LotStack]:
        """Names with their sizes, fitted together, and what they leave of the lots."""
        groups: dict[str, list[str]] = {}
        for name in names:
            for driver in dict.fromkeys((name.drivers[0], MEAN)):
                groups.setdefault(driver, []).append(name.effects[0])
        taken: dict[str, Array] = {}
        for _ in range(_ROUNDS if len(names) > 1 else 1):
            for driver, effects in groups.items():
                if driver in taken:
                    stack = self._with(stack, driver, taken[driver], *effects)
                stack, taken[driver] = self._taken(stack, driver, *effects)
        out: dict[tuple[str, str], Name] = {}
        for driver, effects in groups.items():
            of_driver = [name for name in names if name.drivers[0] == driver]
            if of_driver:
                alone = self._with(stack, driver, taken[driver], *effects)
                sums = gathered(alone, [driver])[driver]
                fit = self._fit(alone, sums, *effects)
                out |= {(driver, name.effects[0]): self._of_fit(name, sums, fit, effects) for name in of_driver}
        return [out[name.drivers[0], name.effects[0]] for name in names], stack

    def _of_fit(self, name: Name, sums: DriverSums, fit: LevelFit, effects: Sequence[str]) -> Name:
        """A name with its sizes: rms over the dwells of all its columns by level and axis; of a number, over the units, too.

        The sign is that of the column with the largest sum of squares; an error is infinite where no lot shows the axis.
        """
        here = self.everywhere(*effects)
        unit = sums.spread * self.size[here] * np.isin(here, self.everywhere(name.effects[0]))
        among, count = self.inside[np.ix_(here, here)], unit.size // self.axes
        of_axes = [unit * np.repeat(np.eye(self.axes)[axis], count) for axis in range(self.axes)]
        parts = [np.outer(part, part) * among for part in of_axes]
        squares = np.stack([np.einsum("gp,pq,gq->g", fit.sizes, part, fit.sizes) for part in parts], axis=1)
        noise = np.stack([np.einsum("ngp,pq,ngq->g", fit.errors, part, fit.errors) for part in parts], axis=1)
        errors = np.sqrt(np.maximum(noise / len(fit.errors), 0.0))
        columns = (fit.sizes * unit).reshape(-1, self.axes, count)
        largest = columns[..., int(np.argmax((columns**2).sum(axis=(0, 1))))]
        mean, deviation = fit.mean_square(np.sum(parts, axis=0))
        return replace(
            name,
            labels=tuple(sums.labels),
            weights=sums.units,
            sizes=np.copysign(np.sqrt(np.maximum(squares, 0.0)), largest),
            errors=np.where(errors > 0.0, errors, np.inf),
            by_axis=np.sqrt(np.maximum([fit.mean_square(part)[0] for part in parts], 0.0)),
            square=(mean / self.axes, deviation / self.axes),
        )


def _imitations(names: Sequence[Name], of_pose: Sequence[Scores], needed: float) -> set[int]:
    """Indices of names that are parts of a function of pose outside the catalogue: together they explain less than it does.

    Parameters
    ----------
    of_pose : score of any function of pose by driver, before each name and after the last
    """
    out: set[int] = set()
    for driver in {name.drivers[0] for name in names}:
        before = [scores.get((driver, SHAPE), 0.0) for scores in of_pose]
        of_driver = [at for at, name in enumerate(names) if name.drivers[0] == driver]
        parts = [at for at in of_driver if before[at] - before[at + 1] > _OF_POSE * names[at].score]
        explained = sum(names[at].score for at in parts)
        if parts and before[-1] > max(needed, _REMAINDER * explained):
            out |= set(parts) if before[parts[0]] > explained * (1.0 + _INEXACT) + CLASS_WIDTH else set()
    return out


def _eliminated(values: Array, information: Array, products: Array, at: Places) -> tuple[Array, Array]:
    """Scores and information (n, h) after elimination of the columns ``at``, by correlations (h, h)."""
    inner = inverse_of(products[np.ix_(at, at)], 1e-6)
    root = np.sqrt(np.maximum(information, 0.0))
    values = values - root * (over(values, root)[:, at] @ inner @ products[at])
    covered = np.einsum("jp,pq,qj->j", products[:, at], inner, products[at])
    information = information * np.where(covered > 1.0 - _SEEN, 0.0, np.clip(1.0 - covered, 0.0, 1.0))
    values[:, at], information[:, at] = 0.0, 0.0
    return values, information
