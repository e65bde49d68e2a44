"""Diagnosis of a rotation: whether the model is adequate, missing effects, and next measurements."""

from collections.abc import Sequence

from inertial.dynamics.missing_effects import DiagnosisInG, judge
from inertial.dynamics.rotation import RotationData, RotationFit
from inertial.dynamics.rotation_effects import EFFECTS

DEFAULT = ("second_order", "third_order")


def diagnose_rotation(data: RotationData, effects: Sequence[str] = DEFAULT) -> DiagnosisInG[RotationFit]:
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
    return DiagnosisInG.of(judged, EFFECTS)
