"""The kinds of faults: every class in a module of this folder, found by themselves."""

from __future__ import annotations

import pkgutil
from dataclasses import fields
from functools import cache
from importlib import import_module
from types import MappingProxyType
from typing import TYPE_CHECKING

from schemas.errors import RecipeInvalid, did_you_mean
from stations.plant import faults
from stations.plant.faults.base import UNIT, Fault

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from schemas.fault import FaultOrder


@cache
def kinds() -> Mapping[str, type[Fault]]:
    """Every kind by its name, in order of the names."""
    found: dict[str, type[Fault]] = {}
    for module in pkgutil.iter_modules(faults.__path__):
        content = vars(import_module(f"{faults.__name__}.{module.name}")).values()
        found |= {one.kind: one for one in content if isinstance(one, type) and issubclass(one, Fault) and one.kind}
    return MappingProxyType(dict(sorted(found.items())))


def figures(kind: type[Fault]) -> dict[str, float]:
    """The figures of a kind with their usual values."""
    return {f.name: float(f.default) for f in fields(kind) if f.init and isinstance(f.default, int | float)}


def trouble_of(fault: FaultOrder, serials: Sequence[str]) -> Fault:
    """The trouble that a fault makes; a kind, figure or unit that is not there is refused, and one that means nobody."""
    known = kinds()
    if fault.kind not in known:
        raise RecipeInvalid(f"fault: no kind '{fault.kind}'; {did_you_mean(fault.kind, known)}", key="faults")
    kind = known[fault.kind]
    for name in fault.figures:
        if name not in figures(kind):
            close = did_you_mean(name, figures(kind)) if figures(kind) else "it has none"
            raise RecipeInvalid(f"fault {fault.kind}: no figure '{name}'; {close}", key="faults")
    _refuse_nobody(fault, kind, serials)
    made = kind(**fault.figures)
    made.fault = fault
    return made


def _refuse_nobody(fault: FaultOrder, kind: type[Fault], serials: Sequence[str]) -> None:
    meant = UNIT if fault.serial else fault.device
    if meant not in (kind.about or ("",)):
        wanted = ", ".join("serial=…" if one == UNIT else f"device={one}" for one in kind.about) or "neither"
        raise RecipeInvalid(
            f"fault {fault.kind}: serial '{fault.serial}', device '{fault.device}'; {wanted} is needed; correct the fault",
            key="faults",
        )
    if fault.serial and fault.serial not in serials:
        raise RecipeInvalid(
            f"fault {fault.kind}: no unit '{fault.serial}'; {did_you_mean(fault.serial, serials)}", key="faults"
        )
