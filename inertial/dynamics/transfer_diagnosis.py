"""Whether a model of a transfer function is good enough, where it fails, which effects are missing, what to measure next."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inertial.dynamics.missing_effects import CLASS_WIDTH, FOLDS, BadPoint, EffectClass, Judged, judge, judge_points
from inertial.dynamics.transfer_effects import EFFECTS
from inertial.dynamics.transfer_model import (
    A_FEW,
    IDENTIFIED_SHARE,
    Points,
    TransferFit,
    best_of_exchange,
    fit_transfer,
)

SEPARATED = 10.0
"""Uncertainties of a point by which rival models must differ at a frequency that is proposed: several of their errors as well."""


REACH, HALVINGS = 3.84, 8
"""Increase of χ² that ends a 95 % interval; steps by which its end is found, to 3 % of the range of a corner."""


@dataclass(frozen=True)
class Failure:
    """A part of the frequency range where the model fails: its share of χ², and whether in magnitude or in phase."""

    low_hz: float
    high_hz: float
    part: str
    share: float


@dataclass(frozen=True)
class StatedParameter:
    """A parameter over all models that the points do not exclude.

    low, high : 95 % interval that holds in each of them; NaN for an end beyond what the fit searches, which the points leave open
    uncertainty : standard, so that twice of it reaches the farther end; NaN if an end is open
    identified : whether it is known well enough to be stated; rival : the model that leaves it open, where one does
    """

    value: float
    uncertainty: float
    low: float
    high: float
    identified: bool
    rival: TransferFit | None = None


@dataclass(frozen=True)
class TransferDiagnosis(Judged[TransferFit]):
    """The verdict on a model of a transfer function.

    alone_hz : frequencies of the points that depart alone
    where : parts of the frequency range with more than their share of χ²; empty for an adequate model
    error_percent, extended_percent : rms of the relative complex residual
    rivals : models that describe the points as well as ``extended``: another effect of a class, a filter that every device has,
        sprung mass and low-pass exchanged
    next_hz : the frequencies to measure next; highest_hz : of the points
    """

    alone_hz: tuple[float, ...]
    where: tuple[Failure, ...]
    error_percent: float
    extended_percent: float
    rivals: tuple[TransferFit, ...]
    next_hz: tuple[float, ...]
    highest_hz: float

    def parameter(self, name: str) -> StatedParameter:
        """A parameter of the extended model, as far as every model that the points do not exclude agrees."""
        value, error, low, high = self.extended.of(name)
        known, rival = self.extended.identified(name), None
        for rival_fit in self.rivals:
            if not rival_fit.has(name):
                continue
            _, _, low_here, high_here = rival_fit.of(name)
            if low_here < low or high_here > high:
                low, high = min(low, low_here), max(high, high_here)
                rival = rival_fit
        reach = max(high - value, value - low) / 1.96
        # beyond the points a frequency, and what else its effect has, is an extrapolation by the form of the model
        known = known and all(self._reached(frequency) for frequency in self.extended.frequencies_of(name))
        if rival is not None and self.extended.logarithmic(name):
            known = known and reach < IDENTIFIED_SHARE * value
        stated = StatedParameter(value, max(error, reach), low, high, known, rival)
        searched = next(p for p in self.extended.parameters if p.name == name)
        if known or not searched.log or (low >= searched.low and high <= searched.high):
            return stated
        nothing = float("nan")
        low, high = low if low >= searched.low else nothing, high if high <= searched.high else nothing
        return replace(stated, uncertainty=nothing, low=low, high=high)

    def _reached(self, name: str) -> bool:
        """Whether the points reach a frequency in every model that they do not exclude."""
        return all(fit.of(name)[3] < self.highest_hz for fit in (self.extended, *self.rivals) if fit.has(name))


def diagnose_transfer(
    points: Points, effects: Sequence[str] = ("second_order", "delay"), *, highest_hz: float | None = None
) -> TransferDiagnosis:
    """The verdict on a model, with the classes of effects that would mend it.

    Parameters
    ----------
    effects : of the model to judge
    highest_hz : to which the exciter reaches, for the next frequencies; the points' highest where None
    """
    judged, sound = judge_points(len(points.value), lambda sound: _judged(points.picked(sound), effects))
    rest, alone = points.picked(sound), tuple(sorted(points.conditions.frequency[~sound].tolist()))
    top = float(points.conditions.frequency.max())
    open_end = judged.adequate is None or judged.unexplained
    rivals = () if open_end else _rivals(rest, judged.extended, judged.classes)
    return TransferDiagnosis(
        **vars(judged),
        alone_hz=alone,
        where=_where(points, judged.fit) if judged.adequate is False else (),
        error_percent=_error(points, judged.fit),
        extended_percent=_error(rest, judged.extended),
        rivals=rivals,
        next_hz=alone or _next_frequencies(rest, judged.extended, rivals, highest_hz or top),
        highest_hz=top,
    )


def _judged(points: Points, effects: Sequence[str]) -> Judged[TransferFit]:
    """The verdict on a model on all of the points."""

    def extended_fit(names: list[str], best: TransferFit) -> TransferFit:
        fit = fit_transfer(points, names, best.known)
        # mass and low-pass exchanged are another minimum, which breeds further effects
        return best_of_exchange(points, fit)[0] if names[-1] in {"two_pole", "second_order"} else fit

    def without_worst(fit: TransferFit) -> tuple[TransferFit, int]:
        n = len(points.value)
        worst = int(np.argmax(fit.residual[:n] ** 2 + fit.residual[n:] ** 2))
        return fit_transfer(
            points.picked(np.arange(n) != worst), fit.effects, fit.known, only_near=True, steps=A_FEW
        ), worst

    located = [
        name for name, kind in EFFECTS.items() if any(p.unit == "Hz" for p in kind.parameters(points.conditions))
    ]
    base = best_of_exchange(points, fit_transfer(points, effects))[0]
    return judge(
        base,
        effects,
        [name for name, effect in EFFECTS.items() if effect.seen(points.conditions)],
        extended_fit,
        lambda fit: _left_out(points, fit),
        remedy="sweep more frequencies",
        residuals=len(base.residual),
        bad_point=BadPoint(without_worst, located),
    )


def _rivals(points: Points, extended: TransferFit, classes: Sequence[EffectClass]) -> tuple[TransferFit, ...]:
    """Models other than the extended one that the points do not exclude.

    A model that describes the points is not the only one: up to 1 kHz a sprung mass of 2.5 kHz with a low-pass of 1.6 kHz looks
    like one of 1.5 kHz with a delay.
    """
    chosen = [effect_class.effects[0] for effect_class in classes]
    models = [
        [other if name == effect_class.effects[0] else name for name in extended.effects]
        for effect_class in classes
        for other in effect_class.effects[1:]
        if other not in chosen
    ]
    models += [
        [*extended.effects, name]
        for name, effect in EFFECTS.items()
        if effect.in_every_device
        and name not in extended.effects
        and 2 * len(points.value) > 3 * len(extended.parameters) + 8
    ]
    price = max(1.0, extended.chi_square / max(extended.dof, 1))
    fits = [fit_transfer(points, effects, extended.known, only_near=True) for effects in models]
    fits = [_farthest(points, fit, extended.chi_square, REACH * price) for fit in fits]
    for fit in (extended, *fits):
        other = best_of_exchange(points, fit)[1] if "second_order" in fit.effects else None
        if other is not None:
            fits.append(other)
    return tuple(fit for fit in fits if fit.chi_square < extended.chi_square + CLASS_WIDTH * price)


def _farthest(points: Points, fit: TransferFit, without: float, reach: float) -> TransferFit:
    """Of a model with a filter that may as well be absent, the fit with the nearest corner that the points do not exclude.

    What such a filter does to the other parameters grows with its delay, and ends where χ² has risen: a covariance at a corner
    far away does not tell it. A fit whose filter the points determine is left as it is.

    Parameters
    ----------
    without : χ² without the filter; reach : increase of it that ends the interval
    """
    last = fit.parameters[-1]
    if not EFFECTS[fit.effects[-1]].in_every_device or fit.chi_square < without - reach:
        return fit
    away, near = (last.high, last.low) if last.unit == "Hz" else (last.low, last.high)
    best = fit
    for _ in range(HALVINGS):
        middle = float(np.sqrt(away * near))
        held = fit_transfer(
            points, fit.effects, fit.known | {last.name: middle}, only_near=True, steps=A_FEW, held=last.name
        )
        if held.chi_square < without + reach:
            away, best = middle, held
        else:
            near = middle
    return best


def _error(points: Points, fit: TransferFit) -> float:
    ratio = points.value / fit.response(points.conditions) - 1.0
    return float(100.0 * np.sqrt(np.mean(np.abs(ratio) ** 2)))


def _where(points: Points, fit: TransferFit) -> tuple[Failure, ...]:
    """Thirds of the points in order of frequency, magnitude and phase apart, that carry more than a fair share of χ²."""
    n = len(points.value)
    order = np.argsort(points.conditions.frequency)
    squares = {"magnitude": fit.residual[:n] ** 2, "phase": fit.residual[n:] ** 2}
    total = float(sum(of_part.sum() for of_part in squares.values()))
    failures: list[Failure] = []
    for part, squares_of_part in squares.items():
        for rows in np.array_split(order, 3):
            f = points.conditions.frequency[rows]
            failures.append(Failure(float(f.min()), float(f.max()), part, float(squares_of_part[rows].sum()) / total))
    return tuple(
        sorted((failure for failure in failures if failure.share > 1.0 / 6.0), key=lambda failure: -failure.share)
    )


def _left_out(points: Points, fit: TransferFit) -> float:
    """Root of the mean predictive deviance of points that a fit has not seen, every fifth left out in turn.

    A narrow mode cannot be predicted at its peak by the other points, but on its skirts: each deviation counts over its own
    uncertainty and that of the prediction, and a vague prediction pays by its logarithm.
    """
    n = len(points.value)
    if 2 * n * (FOLDS - 1) // FOLDS < 3 * len(fit.effects) + 4 or n < 2 * FOLDS:
        return float("nan")
    rank = np.argsort(np.argsort(points.conditions.frequency))
    deviance = 0.0
    for fold in range(FOLDS):
        out = rank % FOLDS == fold
        seen, unseen = points.picked(~out), points.picked(out)
        if not all(EFFECTS[name].seen(seen.conditions) for name in fit.effects):
            continue
        predicted, *vague = fit_transfer(seen, fit.effects, fit.known, only_near=True, steps=A_FEW).predicted(
            unseen.conditions
        )
        ratio = unseen.value / predicted
        for off, error, vagueness in zip(
            (np.log(np.abs(ratio)), np.angle(ratio)), (unseen.magnitude_error, unseen.phase_error), vague, strict=True
        ):
            wider = 1.0 + (vagueness / error) ** 2
            deviance += float(np.sum((off / error) ** 2 / wider + np.log(wider)))
    return float(np.sqrt(deviance / (2 * n)))


def _next_frequencies(
    points: Points, extended: TransferFit, rivals: Sequence[TransferFit], highest: float
) -> tuple[float, ...]:
    """Frequencies at which rival models differ most, or where an unidentified parameter shows; Hz, at most three."""
    c = points.conditions
    low, top = float(c.frequency.min()), float(c.frequency.max())
    grid = np.geomspace(low, max(highest, top), 200)
    plan = c.along(grid)
    models = [fit for fit in (extended, *rivals) if all(EFFECTS[name].parameters(plan) for name in fit.effects)]
    values = np.stack([np.log(np.maximum(np.abs(model.response(plan)), 1e-300)) for model in models])
    spread = np.ptp(values, axis=0)
    error = float(np.median(points.magnitude_error))
    if spread.max() > SEPARATED * error:
        first = int(np.argmax(spread > SEPARATED * error))
        best = int(np.argmax(spread))
        return tuple(dict.fromkeys((float(grid[first]), float(grid[best]))))
    loose = [p for p in extended.parameters if p.log and not extended.identified(p.name)]
    loose += [p for p in extended.parameters if p.unit == "Hz" and extended.of(p.name)[3] >= top]
    if loose and highest > top:
        return tuple(float(f) for f in np.geomspace(1.25 * top, highest, 3) if f <= highest)
    return ()
