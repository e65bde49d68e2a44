"""Effects on the output over the acceleration of a centrifuge: each module of this package is one and is found here."""

from collections.abc import Mapping

from inertial.dynamics.centrifuge_effects.base import CentrifugeEffect, Spins
from inertial.dynamics.effect_modules import effects_of

__all__ = ["EFFECTS", "CentrifugeEffect", "Spins"]

EFFECTS: Mapping[str, CentrifugeEffect] = effects_of(__name__, __path__, CentrifugeEffect)
