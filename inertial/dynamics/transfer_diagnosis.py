"""Whether a model of a transfer function is good enough, where it fails, which effects are missing, what to measure next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.counts import degrees_of_freedom
from inertial.distributions import chi2_tail
from inertial.dynamics import goodness
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points, TransferFit, best_of_exchange, fit_transfer

Array = NDArray[np.float64]
ADDED_P = 1e-3
"""Largest p-value of an added effect of a model that is not adequate, times the number of candidates."""
CLASS_WIDTH = 9.0
"""Effects whose fits differ by less than this in χ² (with a parameter's price) are not separated: three standard deviations."""
MOST_ADDED = 3
FOLDS = 5
FEWEST_DOF = 6


@dataclass(frozen=True)
class EffectClass:
    """Effects that these points do not separate, the best first; ``chi_square`` and ``dof`` of the best one's fit."""

    effects: tuple[str, ...]
    p_value: float
    chi_square: float
    dof: int


@dataclass(frozen=True)
class Failure:
    """A part of the frequency range where the model fails: its share of χ², and whether in magnitude or in phase."""

    low_hz: float
    high_hz: float
    part: str
    share: float


@dataclass(frozen=True)
class TransferDiagnosis:
    """The verdict on a model of a transfer function.

    adequate : None where it cannot be judged, with ``reason``
    fit : of the judged model; extended : with the recommended effects; the same where none is
    error_percent, extended_percent : rms of the relative complex residual
    left_out : rms weighted residual of left-out points before and after; near 1 for a right model
    """

    adequate: bool | None
    reason: str
    fit: TransferFit
    extended: TransferFit
    where: tuple[Failure, ...]
    classes: tuple[EffectClass, ...]
    unexplained: bool
    error_percent: float
    extended_percent: float
    left_out: tuple[float, float]
    next_hz: tuple[float, ...]

    @property
    def recommended(self) -> tuple[str, ...]:
        """One effect per class, the best of it."""
        return tuple(one.effects[0] for one in self.classes)


def diagnose_transfer(
    points: Points, effects: Sequence[str] = ("second_order", "delay"), *, highest_hz: float | None = None
) -> TransferDiagnosis:
    """The verdict on a model, with the classes of effects that would mend it.

    Parameters
    ----------
    effects : of the model to judge
    highest_hz : to which the exciter reaches, for the next frequencies; the points' highest where None
    """
    base = fit_transfer(points, effects)
    if base.dof < FEWEST_DOF:
        reason = f"{degrees_of_freedom(base.dof)}, at least {FEWEST_DOF} are needed; sweep more frequencies"
        return _verdict(points, base, base, None, reason, (), unexplained=False, highest=highest_hz)
    if goodness.adequate(base):
        return _verdict(points, base, base, True, "", (), unexplained=False, highest=highest_hz)
    classes: list[EffectClass] = []
    best, current = base, list(effects)
    while len(classes) < MOST_ADDED and goodness.adequate(best) is False:
        next_class = _next_class(points, best, current)
        if next_class is None:
            break
        one, best = next_class
        classes.append(one)
        current.append(one.effects[0])
    unexplained = goodness.adequate(best) is False
    return _verdict(points, base, best, False, "", tuple(classes), unexplained=unexplained, highest=highest_hz)


def _next_class(points: Points, best: TransferFit, current: Sequence[str]) -> tuple[EffectClass, TransferFit] | None:
    """The effects that reduce the residual most, and the fit with the best of them; None where none is significant."""
    candidates = [name for name, one in EFFECTS.items() if name not in current and one.seen(points.conditions)]
    known = {p.name: float(v) for p, v in zip(best.parameters, best.values, strict=True)}
    fits: dict[str, TransferFit] = {}
    for name in candidates:
        fits[name] = fit_transfer(points, [*current, name], known)
        if name in {
            "two_pole",
            "second_order",
        }:  # mass and low-pass exchanged are another minimum, which breeds further effects
            fits[name] = best_of_exchange(points, fits[name])[0]
    price = np.log(len(best.residual))

    def score(fit: TransferFit) -> float:
        return fit.chi_square + price * len(fit.parameters)

    def p_value(fit: TransferFit) -> float:
        gain = max(0.0, best.chi_square - fit.chi_square)
        return float(min(1.0, len(candidates) * chi2_tail(gain, len(fit.parameters) - len(best.parameters))))

    real = sorted((name for name in fits if p_value(fits[name]) < ADDED_P), key=lambda name: score(fits[name]))
    if not real:
        return None
    top = fits[real[0]]
    scale = max(1.0, top.chi_square / max(top.dof, 1))  # what another effect still leaves blurs the comparison
    same = tuple(name for name in real if score(fits[name]) - score(top) < CLASS_WIDTH * scale)
    return EffectClass(same, p_value(top), top.chi_square, top.dof), top


def _verdict(
    points: Points,
    base: TransferFit,
    extended: TransferFit,
    adequate: bool | None,  # noqa: FBT001 - a verdict, not a switch
    reason: str,
    classes: tuple[EffectClass, ...],
    *,
    unexplained: bool,
    highest: float | None,
) -> TransferDiagnosis:
    left = (_left_out(points, base.effects), _left_out(points, extended.effects) if classes else np.nan)
    return TransferDiagnosis(
        adequate,
        reason,
        base,
        extended,
        _where(points, base) if adequate is False else (),
        classes,
        unexplained,
        _error(points, base),
        _error(points, extended),
        (left[0], left[1] if classes else left[0]),
        _next_frequencies(points, base, classes, highest or float(points.conditions.frequency.max())),
    )


def _error(points: Points, fit: TransferFit) -> float:
    ratio = points.value / fit.response(points.conditions) - 1.0
    return float(100.0 * np.sqrt(np.mean(np.abs(ratio) ** 2)))


def _where(points: Points, fit: TransferFit) -> tuple[Failure, ...]:
    """Thirds of the points in order of frequency, magnitude and phase apart, that carry more than a fair share of χ²."""
    n = len(points.value)
    order = np.argsort(points.conditions.frequency)
    squares = {"magnitude": fit.residual[:n] ** 2, "phase": fit.residual[n:] ** 2}
    total = float(sum(one.sum() for one in squares.values()))
    failures: list[Failure] = []
    for part, one in squares.items():
        for rows in np.array_split(order, 3):
            f = points.conditions.frequency[rows]
            failures.append(Failure(float(f.min()), float(f.max()), part, float(one[rows].sum()) / total))
    return tuple(sorted((one for one in failures if one.share > 1.0 / 6.0), key=lambda one: -one.share))


def _left_out(points: Points, effects: Sequence[str]) -> float:
    """Rms weighted residual of points that a fit has not seen, every fifth left out in turn."""
    n = len(points.value)
    if 2 * n * (FOLDS - 1) // FOLDS < 3 * len(effects) + 4 or n < 2 * FOLDS:
        return float("nan")
    place = np.argsort(np.argsort(points.conditions.frequency))
    squares = 0.0
    whole = fit_transfer(points, effects)
    near = {p.name: float(v) for p, v in zip(whole.parameters, whole.values, strict=True)}
    for fold in range(FOLDS):
        out = place % FOLDS == fold
        seen, unseen = points.picked(~out), points.picked(out)
        if not all(EFFECTS[name].seen(seen.conditions) for name in effects):
            continue
        ratio = unseen.value / fit_transfer(seen, effects, near).response(unseen.conditions)
        squares += float(np.sum((np.log(np.abs(ratio)) / unseen.magnitude_error) ** 2))
        squares += float(np.sum((np.angle(ratio) / unseen.phase_error) ** 2))
    return float(np.sqrt(squares / (2 * n)))


def _next_frequencies(
    points: Points, base: TransferFit, classes: Sequence[EffectClass], highest: float
) -> tuple[float, ...]:
    """Frequencies at which the effects of a class differ most, or where an unidentified parameter shows; Hz, at most three."""
    c = points.conditions
    low, top = float(c.frequency.min()), float(c.frequency.max())
    grid = np.geomspace(low, max(highest, top), 200)
    plan = Conditions(
        grid,
        np.full(200, np.median(c.level)),
        np.full(200, np.median(c.temperature)),
        np.full(200, np.median(c.record_s)),
    )
    rivals = next((one.effects for one in classes if len(one.effects) > 1), ())
    if rivals:
        chosen = [name for one in classes for name in one.effects[:1] if one.effects[0] != rivals[0]]
        models = [fit_transfer(points, [*base.effects, *chosen, name]) for name in rivals[:3]]
        models = [one for one in models if all(EFFECTS[name].parameters(plan) for name in one.effects)]
        values = np.stack([np.log(np.maximum(np.abs(one.response(plan)), 1e-300)) for one in models])
        spread = np.ptp(values, axis=0)
        best = int(np.argmax(spread))
        return (float(grid[best]),) if spread[best] > 0.0 else ()
    loose = [p.name for p in base.parameters if p.log and not base.identified(p.name)]
    if loose and highest > top:
        return tuple(float(f) for f in np.geomspace(1.25 * top, highest, 3) if f <= highest)
    return ()
