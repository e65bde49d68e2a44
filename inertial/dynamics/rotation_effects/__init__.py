"""Effects on the output of a turned device over the angle: each module of this package is one and is found here."""

from collections.abc import Mapping

from inertial.dynamics.effect_modules import effects_of
from inertial.dynamics.rotation_effects.base import RotationEffect

__all__ = ["EFFECTS", "RotationEffect"]

EFFECTS: Mapping[str, RotationEffect] = effects_of(__name__, __path__, RotationEffect)
