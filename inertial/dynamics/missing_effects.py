"""Effects that a model lacks: forward selection in classes of effects that the data do not separate."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from inertial.distributions import chi2_tail
from inertial.dynamics.goodness import Fitted, adequate
from inertial.dynamics.transfer_diagnosis import ADDED_P, CLASS_WIDTH, MOST_ADDED, EffectClass

AnyFit = TypeVar("AnyFit", bound=Fitted)


class Separated(Protocol):
    """An effect with the measurement that separates it from others."""

    breaker: ClassVar[str]


def breakers_of(classes: Sequence[EffectClass], effects: Mapping[str, Separated]) -> tuple[str, ...]:
    """The measurements that separate the first two members of each class of several effects."""
    open_classes = [one for one in classes if len(one.effects) > 1]
    return tuple(dict.fromkeys(effects[name].breaker for one in open_classes for name in one.effects[:2]))


def missing_classes(
    base: AnyFit, effects: Sequence[str], candidates: Sequence[str], fit_of: Callable[[list[str]], AnyFit]
) -> tuple[tuple[EffectClass, ...], AnyFit]:
    """Classes of effects that make a model adequate, one after the other, and the fit with the best of each.

    An effect is named only where the model is inadequate and the effect improves it with a p-value below 10⁻³, times the
    number of candidates.

    Parameters
    ----------
    base : fit of the judged model with ``effects``
    candidates : ids of all effects that the data can show
    fit_of : the fit of a model with some effects
    """
    classes: list[EffectClass] = []
    best, current = base, list(effects)
    while len(classes) < MOST_ADDED and not adequate(best):
        left = [name for name in candidates if name not in current]
        next_class = _next_class(best, current, left, fit_of)
        if next_class is None:
            break
        one, best = next_class
        classes.append(one)
        current.append(one.effects[0])
    return tuple(classes), best


def _next_class(
    best: AnyFit, current: list[str], candidates: list[str], fit_of: Callable[[list[str]], AnyFit]
) -> tuple[EffectClass, AnyFit] | None:
    fits = {name: fit_of([*current, name]) for name in candidates}
    price = float(np.log(max(best.dof, 2)))

    def score(fit: Fitted) -> float:
        return fit.chi_square - price * fit.dof

    def added_p(fit: Fitted) -> float:
        gain, parameters = max(0.0, best.chi_square - fit.chi_square), max(1, best.dof - fit.dof)
        return float(min(1.0, len(candidates) * chi2_tail(gain, parameters)))

    real = sorted((name for name in fits if added_p(fits[name]) < ADDED_P), key=lambda name: score(fits[name]))
    if not real:
        return None
    top = fits[real[0]]
    width = CLASS_WIDTH * max(1.0, top.chi_square / max(top.dof, 1))  # further missing effects blur the comparison
    same = tuple(name for name in real if score(fits[name]) - score(top) < width)
    return EffectClass(same, added_p(top), top.chi_square, top.dof), top
