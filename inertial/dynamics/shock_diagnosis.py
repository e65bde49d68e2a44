"""Diagnosis of a shock comparison, the unit's waveform against the reference's: adequacy and missing effects."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.dynamics.missing_effects import FOLDS, Judged, breakers_of, judge
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.shock_fit import ShockFit, ShockRecord, fit_shock, residual_percent

DEFAULT = ("delay",)
PARTS = ("before the pulse", "the pulse", "after the pulse")


@dataclass(frozen=True)
class ShockDiagnosis(Judged[ShockFit]):
    """The verdict on a shock comparison.

    where : the part of the record with the largest share of χ², and the share
    error_percent, extended_percent : rms residual, of the peak
    next_steps : the measurements that separate the effects of the classes
    """

    where: tuple[str, float]
    error_percent: float
    extended_percent: float
    next_steps: tuple[str, ...]


def diagnose_shock(record: ShockRecord, effects: Sequence[str] = DEFAULT) -> ShockDiagnosis:
    """The verdict on a comparison with ``effects``, with the classes of effects that make it adequate."""
    judged = judge(
        fit_shock(record, effects),
        effects,
        list(EFFECTS),
        lambda more, _: fit_shock(record, more),
        lambda fit: _left_out(record, fit.effects),
        remedy="record faster",
    )
    return ShockDiagnosis(
        **vars(judged),
        where=_where(record, judged.fit),
        error_percent=residual_percent(record, judged.fit.residuals),
        extended_percent=residual_percent(record, judged.extended.residuals),
        next_steps=breakers_of(judged.classes, EFFECTS),
    )


def _where(record: ShockRecord, fit: ShockFit) -> tuple[str, float]:
    total = np.zeros(3)
    for one, left in zip(record.shocks, fit.residuals, strict=True):
        time = np.arange(len(left)) / record.rate_hz
        square = (left / one.error) ** 2
        end = record.before_s + record.duration_s
        total += [
            square[time < record.before_s].sum(),
            square[(time >= record.before_s) & (time < end)].sum(),
            square[time >= end].sum(),
        ]
    k = int(np.argmax(total))
    return PARTS[k], float(total[k] / max(total.sum(), 1e-300))


def _left_out(record: ShockRecord, effects: Sequence[str]) -> float:
    """Rms weighted residual of samples that were not fitted, every fifth left out in turn."""
    total, count = 0.0, 0
    for fold in range(FOLDS):
        out = [np.arange(len(one.unit)) % FOLDS == fold for one in record.shocks]
        fit = fit_shock(record, effects, [~one for one in out])
        for one, left, rows in zip(record.shocks, fit.residuals, out, strict=True):
            total += float(np.sum((left[rows] / one.error[rows]) ** 2))
            count += int(rows.sum())
    return float(np.sqrt(total / count))
