"""Diagnosis of a shock comparison, the unit's waveform against the reference's: adequacy and missing effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.counts import degrees_of_freedom
from inertial.dynamics import goodness
from inertial.dynamics.missing_effects import breakers_of, missing_classes
from inertial.dynamics.shock_effects import EFFECTS
from inertial.dynamics.shock_fit import ShockFit, ShockRecord, fit_shock, residual_percent
from inertial.dynamics.transfer_diagnosis import FEWEST_DOF, EffectClass

DEFAULT = ("delay",)
FOLDS = 5
PARTS = ("before the pulse", "the pulse", "after the pulse")


@dataclass(frozen=True)
class ShockDiagnosis:
    """The verdict on a shock comparison; see :class:`inertial.dynamics.centrifuge_diagnosis.SpinDiagnosis` for the fields.

    where : the part of the record with the largest share of χ², and the share
    error_percent, extended_percent : rms residual, of the peak
    """

    adequate: bool | None
    reason: str
    fit: ShockFit
    extended: ShockFit
    classes: tuple[EffectClass, ...]
    unexplained: bool
    where: tuple[str, float]
    error_percent: float
    extended_percent: float
    left_out: tuple[float, float]
    next_steps: tuple[str, ...]


def diagnose_shock(record: ShockRecord, effects: Sequence[str] = DEFAULT) -> ShockDiagnosis:
    """The verdict on a comparison with ``effects``, with the classes of effects that make it adequate."""
    base = fit_shock(record, effects)
    if base.dof < FEWEST_DOF:
        reason = f"{degrees_of_freedom(base.dof)}, at least {FEWEST_DOF} are needed; record faster"
        return _verdict(record, base, base, None, reason, ())
    if goodness.adequate(base):
        return _verdict(record, base, base, True, "", ())
    classes, best = missing_classes(base, list(effects), list(EFFECTS), lambda names: fit_shock(record, names))
    return _verdict(record, base, best, False, "", classes)


def _verdict(
    record: ShockRecord,
    base: ShockFit,
    best: ShockFit,
    adequate: bool | None,  # noqa: FBT001 - a verdict, not a switch
    reason: str,
    classes: tuple[EffectClass, ...],
) -> ShockDiagnosis:
    left = _left_out(record, base.effects), (_left_out(record, best.effects) if classes else np.nan)
    return ShockDiagnosis(
        adequate,
        reason,
        base,
        best,
        classes,
        adequate is False and not goodness.adequate(best),
        _where(record, base),
        residual_percent(record, list(base.residuals)),
        residual_percent(record, list(best.residuals)),
        (left[0], left[1] if classes else left[0]),
        breakers_of(classes, EFFECTS),
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
