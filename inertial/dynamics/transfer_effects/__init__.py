"""Effects on a transfer function: each module of this package is one effect and is found here."""

from __future__ import annotations

from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules
from typing import TYPE_CHECKING

from inertial.dynamics.transfer_effects.base import Conditions, Parameter, TransferEffect

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["EFFECTS", "Conditions", "IncompleteEffect", "Parameter", "TransferEffect"]


class IncompleteEffect(Exception):
    """A module without exactly one effect of its own name: its author repairs the module."""


def _find() -> dict[str, TransferEffect]:
    found: dict[str, TransferEffect] = {}
    for info in iter_modules(__path__):
        if info.name == "base":
            continue
        content = vars(import_module(f"{__name__}.{info.name}")).values()
        own = [
            one for one in content if isinstance(one, type) and issubclass(one, TransferEffect) and not isabstract(one)
        ]
        if len(own) != 1 or own[0].id != info.name:
            raise IncompleteEffect(f"{__name__}.{info.name}: one effect with id '{info.name}' is needed; define it")
        found[info.name] = own[0]()
    return found


EFFECTS: Mapping[str, TransferEffect] = _find()
