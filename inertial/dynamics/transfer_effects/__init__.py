"""Effects on a transfer function: each module of this package is one effect and is found here."""

from collections.abc import Mapping

from inertial.dynamics.effect_modules import effects_of
from inertial.dynamics.transfer_effects.base import Conditions, Parameter, TransferEffect

__all__ = ["EFFECTS", "Conditions", "Parameter", "TransferEffect"]


EFFECTS: Mapping[str, TransferEffect] = effects_of(__name__, __path__, TransferEffect)
