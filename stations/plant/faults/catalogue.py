"""The kinds of faults that the modules of this folder add, and the fault that an order describes."""

import pkgutil
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import import_module
from types import MappingProxyType

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.fault import FaultOrder
from stations.plant import faults
from stations.plant.faults.base import KINDS, UNIT, Fault, Kind

TIMES = ("at_s", "for_s")  # keys of every order: start and duration


@cache
def kinds() -> Mapping[str, Kind]:
    """Every kind by its name, in order of the names."""
    for module in pkgutil.iter_modules(faults.__path__):
        import_module(f"{faults.__name__}.{module.name}")
    return MappingProxyType(dict(sorted(KINDS.items())))


def fault_rows() -> list[dict[str, str]]:
    """The kinds for people: name, the targets that it is given for, its figures with defaults, and what happens."""
    return [
        {
            "fault": name,
            "target": " or ".join("serial=SN" if target == UNIT else f"device={target}" for target in kind.targets),
            "keys": ":".join(f"{key}={value:g}" for key, value in kind.figures.items()),
            "meaning": kind.meaning.replace("``", ""),
        }
        for name, kind in kinds().items()
    ]


def build_fault(order: FaultOrder, serials: Sequence[str]) -> Fault:
    """The fault that an order describes, for a lot of these serial numbers.

    Raises RecipeInvalid: the kind, a figure or the unit does not exist, or the kind needs another target
    """
    known = kinds()
    if order.kind not in known:
        raise RecipeInvalid(f"fault: no kind '{order.kind}'; {did_you_mean(order.kind, known)}", key="faults")
    kind = known[order.kind]
    for name in order.figures:
        if name not in kind.figures:
            close = did_you_mean(name, [*kind.figures, *TIMES])
            raise RecipeInvalid(f"fault {order.kind}: no figure '{name}'; {close}", key="faults")
    _check_target(order, kind, serials)
    return Fault(order, kind, {**kind.figures, **order.figures})


def _check_target(order: FaultOrder, kind: Kind, serials: Sequence[str]) -> None:
    target = UNIT if order.serial else order.device
    if target not in (kind.targets or ("",)):
        allowed = (
            ", ".join("serial=…" if target == UNIT else f"device={target}" for target in kind.targets) or "neither"
        )
        raise RecipeInvalid(
            f"fault {order.kind}: serial '{order.serial}', device '{order.device}'; {allowed} is needed; correct the fault",
            key="faults",
        )
    if order.serial and order.serial not in serials:
        raise RecipeInvalid(
            f"fault {order.kind}: no unit '{order.serial}'; {did_you_mean(order.serial, serials)}", key="faults"
        )
