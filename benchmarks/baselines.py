"""Standard methods for comparison: forward selection, STLSQ and lasso over a fixed library of candidate columns.

The columns are textbook forms; neither the effects of the product nor the hidden physics is used. Every baseline pools the
units of the lot: a candidate is added for all units and axes together, with separate coefficients for each.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from candidates import Library, library
from numpy.typing import NDArray
from pysindy import STLSQ
from scipy.stats import f as f_distribution
from sklearn.linear_model import LassoCV

from benchmarks.truth import Run

Floats = NDArray[np.float64]
ALPHA = 0.01
MOST_EFFECTS = 6


@dataclass(frozen=True)
class Fit:
    """A pooled least-squares fit: sum of squares in µg², parameters."""

    chi2: float
    parameters: int


def _library(run: Run) -> Library:
    """The candidates for the run, with the starting model and the temperature history of its specification."""
    spec = run.sealed.spec
    return library(run.dwells, run.history if spec.history else None, bare=spec.base is not None)


def _pooled(data: Library, names: list[str]) -> Fit:
    """Least-squares fit with the named candidates for every unit and axis of the lot."""
    chi2, parameters = 0.0, 0
    for unit in range(data.units):
        for axis in range(3):
            columns = np.column_stack([data.base(unit, axis), *(data.columns(name, unit, axis) for name in names)])
            coefficients, _, rank, _ = np.linalg.lstsq(columns, data.output[unit][:, axis], rcond=1e-9)
            chi2 += float(np.sum((data.output[unit][:, axis] - columns @ coefficients) ** 2))
            parameters += int(rank)
    return Fit(chi2, parameters)


def _forward(data: Library, judge: Callable[[Fit, Fit, int], float]) -> list[str]:
    """Names added one by one while `judge` of (before, after, remaining candidates) is positive; the largest value first."""
    chosen: list[str] = []
    now = _pooled(data, chosen)
    while len(chosen) < MOST_EFFECTS:
        left = [name for name in data.names if name not in chosen]
        fits = {name: _pooled(data, [*chosen, name]) for name in left}
        scores = {name: judge(now, fit, len(left)) for name, fit in fits.items() if fit.parameters > now.parameters}
        if not scores or max(scores.values()) <= 0.0:
            break
        best = max(scores, key=scores.__getitem__)
        chosen.append(best)
        now = fits[best]
    return chosen


def bic(run: Run) -> tuple[dict[str, Any], float | None]:
    """Pooled forward selection; the noise is unknown and BIC decides."""
    data = _library(run)
    count = sum(output.size for output in data.output)

    def gain(before: Fit, after: Fit, _left: int) -> float:
        return count * np.log(before.chi2 / after.chi2) - (after.parameters - before.parameters) * np.log(count)

    return _answer(data, run, _forward(data, gain))


def bonferroni(run: Run) -> tuple[dict[str, Any], float | None]:
    """Pooled forward selection by F against pure error of repeated poses, Bonferroni at 1 % over the candidates."""
    data = _library(run)
    variance, dof = data.pure_error()

    def gain(before: Fit, after: Fit, left: int) -> float:
        more = after.parameters - before.parameters
        ratio = (before.chi2 - after.chi2) / more / variance
        return -np.log(max(float(f_distribution.sf(ratio, more, dof)), 1e-300)) + np.log(ALPHA / left)

    return _answer(data, run, _forward(data, gain))


def _sparse(run: Run, choose: Callable[[Floats, Floats, Library], Floats]) -> tuple[dict[str, Any], float | None]:
    """A baseline that fits each axis of each unit sparsely, and names the candidates that most of them keep."""
    data = _library(run)
    votes: dict[str, float] = dict.fromkeys(data.names, 0.0)
    for unit in range(data.units):
        for axis in range(3):
            block, target, names = _axis(data, unit, axis)
            kept = np.abs(choose(block, target, data)) > 0.0
            for name in {names[k] for k in np.flatnonzero(kept)}:
                votes[name] += 1.0 / (3 * data.units)
    return _answer(
        data, run, [name for name, share in sorted(votes.items(), key=lambda v: -v[1]) if share > 0.5][:MOST_EFFECTS]
    )


def _axis(data: Library, unit: int, axis: int) -> tuple[Floats, Floats, list[str]]:
    """Candidate columns and output of one unit and axis without the starting model, and the name of each column."""
    basis = np.linalg.qr(data.base(unit, axis))[0]
    parts = {name: data.columns(name, unit, axis) for name in data.names}
    block = np.column_stack(list(parts.values()))
    names = [name for name, part in parts.items() for _ in range(part.shape[1])]
    whole = np.sqrt(np.mean(block**2, axis=0))
    block = block - basis @ (basis.T @ block)
    scale = np.sqrt(np.mean(block**2, axis=0))
    scale[scale <= 1e-6 * whole + 1e-300] = np.inf
    target = data.output[unit][:, axis]
    return block / scale, target - basis @ (basis.T @ target), names


def stlsq(run: Run) -> tuple[dict[str, Any], float | None]:
    """Sequentially thresholded least squares of pysindy, threshold one standard error of the pure error per dwell."""

    def choose(block: Floats, target: Floats, data: Library) -> Floats:
        threshold = float(np.sqrt(data.pure_error()[0]))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fitted = STLSQ(threshold=threshold, alpha=1e-3, max_iter=30).fit(block, target[:, None])
        return np.asarray(fitted.coef_)[0]

    return _sparse(run, choose)


def lasso(run: Run) -> tuple[dict[str, Any], float | None]:
    """Lasso with five-fold cross-validation of scikit-learn."""

    def choose(block: Floats, target: Floats, _data: Library) -> Floats:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fitted = LassoCV(cv=5, alphas=30, max_iter=3000, fit_intercept=False).fit(block, target)
        return np.asarray(fitted.coef_)

    return _sparse(run, choose)


def _fresh_rms(data: Library, run: Run, names: list[str]) -> float:
    """RMS error of the fresh run with the coefficients of this run, µg."""
    fresh = library(run.fresh, run.fresh_history if run.sealed.spec.history else None, like=data)
    squares = []
    for unit in range(data.units):
        for axis in range(3):
            both = [
                np.column_stack([d.base(unit, axis), *(d.columns(name, unit, axis) for name in names)])
                for d in (data, fresh)
            ]
            coefficients = np.linalg.lstsq(both[0], data.output[unit][:, axis], rcond=1e-9)[0]
            squares.append((fresh.output[unit][:, axis] - both[1] @ coefficients) ** 2)
    return float(np.sqrt(np.mean(np.concatenate(squares))))


def _answer(data: Library, run: Run, names: list[str]) -> tuple[dict[str, Any], float | None]:
    """A document with the scored keys; baselines have no classes, no faults and no list of effects that are not visible."""
    document: Mapping[str, Any] = {
        "adequate": not names,
        "blocked_by": [],
        "classes": [{"effects": [name], "scope": data.scope(name)} for name in names],
        "recommended": names,
        "unexplained": None,
        "unseen": [],
    }
    return dict(document), None if run.sealed.faults else _fresh_rms(data, run, names)


BASELINES = {"bic": bic, "bonferroni": bonferroni, "stlsq": stlsq, "lasso": lasso}
