"""Whether a model of a transfer function is good enough, where it fails, which effects are missing, what to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inertial.dynamics.missing_effects import FOLDS, EffectClass, Judged, judge
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points, TransferFit, best_of_exchange, fit_transfer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Failure:
    """A part of the frequency range where the model fails: its share of χ², and whether in magnitude or in phase."""

    low_hz: float
    high_hz: float
    part: str
    share: float


@dataclass(frozen=True)
class TransferDiagnosis(Judged[TransferFit]):
    """The verdict on a model of a transfer function.

    where : parts of the frequency range with more than their share of χ²; empty for an adequate model
    error_percent, extended_percent : rms of the relative complex residual
    next_hz : the frequencies to measure next
    """

    where: tuple[Failure, ...]
    error_percent: float
    extended_percent: float
    next_hz: tuple[float, ...]


def diagnose_transfer(
    points: Points, effects: Sequence[str] = ("second_order", "delay"), *, highest_hz: float | None = None
) -> TransferDiagnosis:
    """The verdict on a model, with the classes of effects that would mend it.

    Parameters
    ----------
    effects : of the model to judge
    highest_hz : to which the exciter reaches, for the next frequencies; the points' highest where None
    """

    def extended_fit(names: list[str], best: TransferFit) -> TransferFit:
        known = {p.name: float(v) for p, v in zip(best.parameters, best.values, strict=True)}
        fit = fit_transfer(points, names, known)
        # mass and low-pass exchanged are another minimum, which breeds further effects
        return best_of_exchange(points, fit)[0] if names[-1] in {"two_pole", "second_order"} else fit

    base = fit_transfer(points, effects)
    judged = judge(
        base,
        effects,
        [name for name, one in EFFECTS.items() if one.seen(points.conditions)],
        extended_fit,
        lambda fit: _left_out(points, fit.effects),
        remedy="sweep more frequencies",
        residuals=len(base.residual),
    )
    highest = highest_hz or float(points.conditions.frequency.max())
    return TransferDiagnosis(
        **vars(judged),
        where=_where(points, base) if judged.adequate is False else (),
        error_percent=_error(points, base),
        extended_percent=_error(points, judged.extended),
        next_hz=_next_frequencies(points, base, judged.classes, highest),
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
