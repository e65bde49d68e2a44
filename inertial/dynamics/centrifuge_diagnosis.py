"""Diagnosis of a centrifuge test: whether its polynomial is adequate, missing effects, and next measurements."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from inertial.arrays import Array
from inertial.dynamics.centrifuge import radii_as_observed
from inertial.dynamics.centrifuge_effects import EFFECTS, Spins
from inertial.dynamics.missing_effects import FOLDS, BadPoint, DiagnosisInG, Judged, judge, judge_points
from inertial.errors import NotIdentified

DEFAULT = ("second_order", "third_order")


@dataclass(frozen=True)
class SpinFit:
    """Bias, scale and the effects of a model: values and errors (2 + effects + radii,) in that order; residuals (n,) in g.

    The last values are the errors of several radii in m, where their uncertainty is stated; else there are none.
    """

    effects: tuple[str, ...]
    value: Array
    error: Array
    residuals: Array
    chi_square: float
    dof: int
    covariance: Array = field(repr=False)

    def of(self, name: str) -> tuple[float, float]:
        """Coefficient of an effect and its standard uncertainty."""
        k = 2 + self.effects.index(name)
        return float(self.value[k]), float(self.error[k])


def fit_spins(points: Spins, output: Array, error: Array, effects: Sequence[str]) -> SpinFit:
    """Weighted least squares of bias, scale and effects; effects with one column share it (least norm).

    Several radii have errors of their own, each an unknown and, by its stated uncertainty, an observation of 0.

    Parameters
    ----------
    output, error : (n,), indicated acceleration and its standard uncertainty, g

    Raises
    ------
    NotIdentified
        There are fewer points than coefficients.
    """
    if len(output) < 2 + len(effects):
        raise NotIdentified(f"centrifuge: {len(output)} points for {2 + len(effects)} coefficients; add speeds")
    rows = _rows(points, effects)
    known = radii_as_observed(len(_uncertain_radii(points)), rows.shape[1], points.radius_error_m)
    weighted = np.vstack([rows / error[:, None], known])
    size = np.linalg.norm(weighted, axis=0)
    design, target = weighted / size, np.append(output / error, np.zeros(len(known)))
    inverse = np.linalg.pinv(design.T @ design, rcond=1e-12)
    value = inverse @ (design.T @ target) / size
    residuals = output - rows @ value
    rank = int(np.linalg.matrix_rank(design, tol=1e-8))
    spread = np.sqrt(np.maximum(np.diag(inverse), 0.0)) / size
    return SpinFit(
        tuple(effects),
        value,
        spread,
        residuals,
        float(np.sum((target - weighted @ value) ** 2)),
        len(target) - rank,
        inverse / np.outer(size, size),
    )


def diagnose_spins(
    points: Spins, output: Array, error: Array, effects: Sequence[str] = DEFAULT
) -> DiagnosisInG[SpinFit]:
    """The verdict on bias, scale and ``effects``, with the classes of effects that make the model adequate."""
    judged, _ = judge_points(len(output), lambda rows: _judged(points.picked(rows), output[rows], error[rows], effects))
    again = tuple(f"measure {points.acceleration[k]:+.4g} g again: it departs alone" for k in judged.alone)
    return DiagnosisInG.of(judged, EFFECTS, again)


def _judged(points: Spins, output: Array, error: Array, effects: Sequence[str]) -> Judged[SpinFit]:
    """The verdict on a model on all of the points."""
    seen = [name for name, effect in EFFECTS.items() if effect.seen(points)]
    names = [name for name in effects if name in seen]

    def without_worst(fit: SpinFit) -> tuple[SpinFit, int]:
        worst = int(np.argmax(np.abs(fit.residuals / error)))
        rest = np.arange(len(output)) != worst
        return fit_spins(points.picked(rest), output[rest], error[rest], fit.effects), worst

    return judge(
        fit_spins(points, output, error, names),
        names,
        seen,
        lambda more, _: fit_spins(points, output, error, more),
        lambda fit: _left_out(points, output, error, fit.effects),
        remedy="add speeds, or measure the other mounting too",
        bad_point=BadPoint(without_worst),
    )


def _rows(points: Spins, effects: Sequence[str]) -> Array:
    terms = [EFFECTS[name].column(points) for name in effects]
    radii = [np.where(points.radius_m == r, points.acceleration / r, 0.0) for r in _uncertain_radii(points)]
    return np.column_stack([np.ones_like(points.acceleration), points.acceleration, *terms, *radii])


def _uncertain_radii(points: Spins) -> list[float]:
    """The radii whose errors are unknowns: those of several; the error of a single one is in the scale."""
    radii = np.unique(points.radius_m).tolist()
    return radii if len(radii) > 1 and points.radius_error_m > 0.0 else []


def _left_out(points: Spins, output: Array, error: Array, effects: Sequence[str]) -> float:
    """Rms residual of left-out points (every fifth in turn) over its uncertainty, that of the fit included."""
    n = len(output)
    if n * (FOLDS - 1) // FOLDS < 4 + len(effects):
        return float("nan")
    total = 0.0
    for fold in range(FOLDS):
        out = np.arange(n) % FOLDS == fold
        fit = fit_spins(points.picked(~out), output[~out], error[~out], effects)
        rows = _rows(points, effects)[out]
        spread = error[out] ** 2 + np.einsum("ij,jk,ik->i", rows, fit.covariance, rows)
        total += float(np.sum((output[out] - rows @ fit.value) ** 2 / spread))
    return float(np.sqrt(total / n))
