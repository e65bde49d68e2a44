"""Diagnosis of a rotation: whether the model is adequate, missing effects, and next measurements."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inertial.dynamics.missing_effects import Judged, breakers_of, judge
from inertial.dynamics.rotation import RotationData, RotationFit
from inertial.dynamics.rotation_effects import EFFECTS

DEFAULT = ("second_order", "third_order")


@dataclass(frozen=True)
class RotationDiagnosis(Judged[RotationFit]):
    """The verdict on a model of a rotation.

    error_g, extended_g : rms residual
    next_steps : the measurements that separate the effects of the classes
    """

    error_g: float
    extended_g: float
    next_steps: tuple[str, ...]


def diagnose_rotation(data: RotationData, effects: Sequence[str] = DEFAULT) -> RotationDiagnosis:
    """The verdict on bias, matrix, delay, place and ``effects``, with the classes of effects that make the model adequate."""
    model = data.model
    seen = [name for name in EFFECTS if model.seen(name)]
    names = [name for name in effects if name in seen]
    judged = judge(
        model.fit(names),
        names,
        seen,
        lambda more, _: model.fit(more),
        lambda fit: model.left_out(fit.effects),
        remedy="turn another plane too",
    )
    before, after = (float(np.sqrt(np.mean(fit.residuals**2))) for fit in (judged.fit, judged.extended))
    steps = breakers_of(judged.classes, EFFECTS)
    return RotationDiagnosis(**vars(judged), error_g=before, extended_g=after, next_steps=steps)
