"""The kinds of faults: every class with a kind in a module of this folder."""

import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import fields
from functools import cache
from importlib import import_module
from types import MappingProxyType

from schemas.errors import RecipeInvalid, did_you_mean
from schemas.fault import FaultOrder
from stations.plant import faults
from stations.plant.faults.base import UNIT, Fault


@cache
def kinds() -> Mapping[str, type[Fault]]:
    """Every kind by its name, in order of the names."""
    by_name: dict[str, type[Fault]] = {}
    for module in pkgutil.iter_modules(faults.__path__):
        content = vars(import_module(f"{faults.__name__}.{module.name}")).values()
        by_name |= {one.kind: one for one in content if isinstance(one, type) and issubclass(one, Fault) and one.kind}
    return MappingProxyType(dict(sorted(by_name.items())))


def figures(kind: type[Fault]) -> dict[str, float]:
    """The figures of a kind with their defaults."""
    return {f.name: float(f.default) for f in fields(kind) if f.init and isinstance(f.default, int | float)}


def fault_rows() -> list[dict[str, str]]:
    """The kinds for people: name, the targets that it is given for, its figures with defaults, and what happens."""
    return [
        {
            "fault": name,
            "target": " or ".join("serial=SN" if one == UNIT else f"device={one}" for one in kind.targets),
            "keys": ":".join(f"{key}={value:g}" for key, value in figures(kind).items()),
            "meaning": (kind.__doc__ or "").partition("\n\n")[0].replace("\n", " ").replace("``", "").strip(),
        }
        for name, kind in kinds().items()
    ]


TIMES = ("at_s", "for_s")
"""Keys of every order: start and duration."""


def build_fault(order: FaultOrder, serials: Sequence[str]) -> Fault:
    """The fault that an order describes, for a lot of these serial numbers.

    Raises
    ------
    RecipeInvalid : the kind, a figure or the unit does not exist, or the kind needs another target
    """
    known = kinds()
    if order.kind not in known:
        raise RecipeInvalid(f"fault: no kind '{order.kind}'; {did_you_mean(order.kind, known)}", key="faults")
    kind = known[order.kind]
    for name in order.figures:
        if name not in figures(kind):
            close = did_you_mean(name, [*figures(kind), *TIMES])
            raise RecipeInvalid(f"fault {order.kind}: no figure '{name}'; {close}", key="faults")
    _check_target(order, kind, serials)
    fault = kind(**order.figures)
    fault.order = order
    return fault


def _check_target(order: FaultOrder, kind: type[Fault], serials: Sequence[str]) -> None:
    target = UNIT if order.serial else order.device
    if target not in (kind.targets or ("",)):
        allowed = ", ".join("serial=…" if one == UNIT else f"device={one}" for one in kind.targets) or "neither"
        raise RecipeInvalid(
            f"fault {order.kind}: serial '{order.serial}', device '{order.device}'; {allowed} is needed; correct the fault",
            key="faults",
        )
    if order.serial and order.serial not in serials:
        raise RecipeInvalid(
            f"fault {order.kind}: no unit '{order.serial}'; {did_you_mean(order.serial, serials)}", key="faults"
        )
