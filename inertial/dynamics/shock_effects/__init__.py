"""Effects on a shock comparison: each module of this package is one and is found here."""

from collections.abc import Mapping

from inertial.dynamics.effect_modules import effects_of
from inertial.dynamics.shock_effects.base import ShockEffect

__all__ = ["EFFECTS", "ShockEffect"]

EFFECTS: Mapping[str, ShockEffect] = effects_of(__name__, __path__, ShockEffect)
