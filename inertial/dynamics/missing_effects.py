"""The verdict on the model of a dynamic test: whether it is adequate, and which effects are missing, in classes."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np

from inertial.arrays import Array, Flags
from inertial.counts import degrees_of_freedom
from inertial.distributions import chi2_tail
from inertial.dynamics.effect_modules import DynamicEffect
from inertial.probability import passes

ADEQUATE_P = 0.005
"""Below this probability of the residuals a model is not adequate."""
ADDED_P = 1e-3
"""Largest p-value of an added effect of a model that is not adequate, times the number of candidates."""
CLASS_WIDTH = 9.0
"""Effects whose fits differ by less than this in χ² (with a parameter's price) are not separated: three standard deviations."""
HELD_SHARE = 0.25
"""Share of the relative gain of the fitted points that those left out have, at least; about 1 where an effect is real."""
MOST_ADDED = 3
FEWEST_DOF = 6
FEWEST_TO_ONE_ALONE = 10
"""Points of a test to one that may depart alone; a scatter that more of them have is no fault of points."""
FOLDS = 5
"""Every so many points are left out in turn."""


class Fitted(Protocol):
    """A fit of a model, weighted by the uncertainties of its points."""

    @property
    def chi_square(self) -> float:
        """Sum of the squared weighted residuals."""
        ...

    @property
    def dof(self) -> int:
        """Degrees of freedom."""
        ...


@dataclass(frozen=True)
class NamedFit:
    """Coefficients by name, ``value`` (p,) with its covariance, and what they leave: residuals, χ² and degrees of freedom."""

    names: tuple[str, ...]
    value: Array
    covariance: Array
    residuals: Array
    chi_square: float
    dof: int

    def of(self, name: str) -> tuple[float, float]:
        """Value and standard uncertainty of a coefficient."""
        k = self.names.index(name)
        return float(self.value[k]), float(np.sqrt(self.covariance[k, k]))


def p_value(fit: Fitted) -> float:
    """Probability of a larger χ² where the model is right; nan without degrees of freedom."""
    return float(chi2_tail(fit.chi_square, fit.dof))


def adequate(fit: Fitted) -> bool | None:
    """Whether a model agrees with its points; None where no degree of freedom is left to judge it."""
    return passes(p_value(fit), ADEQUATE_P)


AnyFit = TypeVar("AnyFit", bound=Fitted)


@dataclass(frozen=True)
class EffectClass:
    """Effects that these points do not separate, the best first; ``chi_square`` and ``dof`` of the best one's fit."""

    effects: tuple[str, ...]
    p_value: float
    chi_square: float
    dof: int


@dataclass(frozen=True)
class Judged(Generic[AnyFit]):
    """The verdict on a model of a test.

    adequate : None where it cannot be judged, with ``reason``
    fit : of the judged model; extended : with one effect of each class, equal to ``fit`` where none is named
    classes : effects that make the model adequate, one class after the other
    alone : points that depart alone, where that is more likely than any effect; ``extended`` and ``classes`` are without them
    left_out : rms weighted residual of left-out points before and after; near 1 for a right model
    """

    adequate: bool | None
    reason: str
    fit: AnyFit
    extended: AnyFit
    classes: tuple[EffectClass, ...]
    alone: tuple[int, ...]
    left_out: tuple[float, float]

    @property
    def unexplained(self) -> bool:
        """Whether the model is not adequate with the named effects either, or points depart alone."""
        return self.adequate is False and (bool(self.alone) or not adequate(self.extended))

    @property
    def recommended(self) -> tuple[str, ...]:
        """One effect per class, the best of it."""
        return tuple(effect_class.effects[0] for effect_class in self.classes)


@dataclass(frozen=True)
class DiagnosisInG(Judged[AnyFit]):
    """The verdict on a model of outputs in g.

    error_g, extended_g : rms residual
    next_steps : points to be measured again, and the measurements that separate the effects of the classes
    """

    error_g: float
    extended_g: float
    next_steps: tuple[str, ...]

    @classmethod
    def of(cls, judged: Judged[Any], effects: Mapping[str, DynamicEffect], again: tuple[str, ...] = ()) -> Self:
        """The diagnosis of a verdict whose fits have residuals in g; ``again``: points to be measured again."""
        before, after = (float(np.sqrt(np.mean(fit.residuals**2))) for fit in (judged.fit, judged.extended))
        return cls(
            **vars(judged), error_g=before, extended_g=after, next_steps=again + breakers_of(judged.classes, effects)
        )


@dataclass(frozen=True)
class BadPoint(Generic[AnyFit]):
    """A point that departs alone, as a cause of a misfit.

    without : the fit of the same model without the point that departs most, and which that is
    located : effects that may sit at any point, as a mode does: beside a bad point their price includes this choice, too
    """

    without: Callable[[AnyFit], tuple[AnyFit, int]]
    located: Collection[str] = ()


def breakers_of(classes: Sequence[EffectClass], effects: Mapping[str, DynamicEffect]) -> tuple[str, ...]:
    """The measurements that separate the first two members of each class of several effects."""
    open_classes = [group for group in classes if len(group.effects) > 1]
    return tuple(dict.fromkeys(effects[name].breaker for group in open_classes for name in group.effects[:2]))


def judge(
    base: AnyFit,
    effects: Sequence[str],
    candidates: Sequence[str],
    extended_fit: Callable[[list[str], AnyFit], AnyFit],
    left_out: Callable[[AnyFit], float],
    *,
    remedy: str,
    residuals: int = 0,
    bad_point: BadPoint[AnyFit] | None = None,
) -> Judged[AnyFit]:
    """The verdict on a model, with the classes of effects that make it adequate.

    Parameters
    ----------
    base : fit of the judged model with ``effects``
    candidates : ids of all effects that the data can show
    extended_fit : the fit of a model with one effect more, from its effects and the fit without it
    left_out : rms weighted residual of points that a fit of this model has not seen
    remedy : what gives more degrees of freedom
    residuals : number of residuals, for the price of a parameter; the degrees of freedom of the smaller model where 0
    bad_point : how a point that departs alone contends with the effects; None where none is looked for
    """
    classes, best, reason, alone = list[EffectClass](), base, "", tuple[int, ...]()
    good = adequate(base) if base.dof >= FEWEST_DOF else None
    if good is None:
        reason = f"{degrees_of_freedom(base.dof)}, at least {FEWEST_DOF} are needed; {remedy}"
    current = list(effects)
    if good and bad_point:  # one value of many hardly moves their sum
        alone = _bad(bad_point, best, best, float(np.log(residuals or best.dof)))
    while good is False and len(classes) < MOST_ADDED and adequate(best) is False:
        left = {name: extended_fit([*current, name], best) for name in candidates if name not in current}
        price = float(np.log(residuals or max(best.dof, 2)))
        next_class = _best_class(best, left, price, left_out)
        if bad_point:
            name = next_class.effects[0] if next_class else ""
            alone = _bad(bad_point, best, left.get(name, best), price, sought=name in bad_point.located)
        if next_class is None or alone:
            break
        classes.append(next_class)
        current.append(next_class.effects[0])
        best = left[next_class.effects[0]]
    before = left_out(base)
    return Judged(good, reason, base, best, tuple(classes), alone, (before, left_out(best) if classes else before))


def judge_points(count: int, verdict_on: Callable[[Flags], Judged[AnyFit]]) -> tuple[Judged[AnyFit], Flags]:
    """The verdict on a model of points of which some may depart alone, and the points (n,) that do not.

    Parameters
    ----------
    count : of points
    verdict_on : the verdict on some of them, which names at most one that departs alone
    """
    sound = np.ones(count, dtype=bool)
    first = judged = verdict_on(sound)
    while judged.alone:
        sound[np.flatnonzero(sound)[list(judged.alone)]] = False
        if FEWEST_TO_ONE_ALONE * (count - sound.sum()) > count:  # no single points: all are worse than was stated
            return replace(first, alone=()), np.ones(count, dtype=bool)
        judged = verdict_on(sound)
    alone = tuple(np.flatnonzero(~sound).tolist())
    return replace(judged, adequate=first.adequate, fit=first.fit, alone=alone), sound


def _score(fit: Fitted, price: float) -> float:
    """χ² with the price of the parameters, up to a constant; a point that is left out pays as two of them."""
    return fit.chi_square - price * fit.dof


def _bad(
    bad_point: BadPoint[AnyFit], fit: AnyFit, rival: AnyFit, price: float, *, sought: bool = False
) -> tuple[int, ...]:
    """The point that departs alone, as a contender of the fit with the best effect; empty for none."""
    rest, worst = bad_point.without(fit)
    return (worst,) if _departs_alone(fit, rest, rival, price, sought=sought) else ()


def _departs_alone(fit: Fitted, rest: Fitted, rival: Fitted, price: float, *, sought: bool) -> bool:
    """Whether a point, the worst of all, departs by more than the scatter of the rest, and more likely than by an effect.

    ``rival``: fit with the best effect. The point is chosen among many; so is that of an effect which was ``sought`` among them.
    """
    values = fit.dof - rest.dof  # of the point
    if values <= 0:
        return False
    points = fit.dof / values
    choice = 2.0 * float(np.log(points))
    gain = (fit.chi_square - rest.chi_square) / max(1.0, rest.chi_square / max(rest.dof, 1))
    ahead = _score(rest, price) + choice < _score(rival, price) + choice * sought
    return bool(points * chi2_tail(gain, values) < ADDED_P) and ahead


def _best_class(
    best: AnyFit, fits: Mapping[str, AnyFit], price: float, left_out: Callable[[AnyFit], float]
) -> EffectClass | None:
    """The effects that reduce the residual of a fit most; None where none is significant.

    An effect is named only where it improves the model with a p-value below 10⁻³, times the number of candidates, over the
    scatter that it leaves, and where points that were left out gain by it as the fitted ones do: what only follows the fitted
    points, or their too small uncertainties, predicts no others.
    """

    def added_p(fit: Fitted) -> float:
        gain = max(0.0, best.chi_square - fit.chi_square) / max(1.0, fit.chi_square / max(fit.dof, 1))
        return float(min(1.0, len(fits) * chi2_tail(gain, max(1, best.dof - fit.dof))))

    def predicts(fit: AnyFit) -> bool:
        fitted, unseen = fit.chi_square / best.chi_square, (left_out(fit) / before) ** 2
        return not unseen > 1.0 - HELD_SHARE * (1.0 - fitted)  # nan: no points can be left out

    real = sorted((name for name in fits if added_p(fits[name]) < ADDED_P), key=lambda name: _score(fits[name], price))
    before = left_out(best) if real else float("nan")
    first = next((name for name in real if predicts(fits[name])), None)
    if first is None:
        return None
    top = fits[first]
    width = CLASS_WIDTH * max(1.0, top.chi_square / max(top.dof, 1))  # further missing effects blur the comparison
    others = (name for name in real if name != first and abs(_score(fits[name], price) - _score(top, price)) < width)
    return EffectClass((first, *others), added_p(top), top.chi_square, top.dof)
