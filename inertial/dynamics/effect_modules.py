"""Packages of effects in which every module defines one effect and is found by its file."""

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules
from typing import Any, ClassVar, TypeVar

AnyEffect = TypeVar("AnyEffect")


class DynamicEffect:
    """What every effect of a dynamic test states.

    equation, source : text for reports · breaker : measurement that separates it from other effects; its name is its module's
    """

    equation: ClassVar[str]
    source: ClassVar[str]
    breaker: ClassVar[str]


class IncompleteEffect(Exception):
    """A module without exactly one effect; its author must correct it."""


def effects_of(package: str, path: Iterable[str], base: type[AnyEffect]) -> dict[str, AnyEffect]:
    """One effect of each module of a package, by name.

    Raises
    ------
    IncompleteEffect
        A module does not define exactly one effect.
    """
    effects: dict[str, AnyEffect] = {}
    for info in iter_modules(list(path)):
        if info.name == "base":
            continue
        content = vars(import_module(f"{package}.{info.name}")).values()
        defined: list[Any] = [c for c in content if isinstance(c, type) and issubclass(c, base) and c is not base]
        if len(defined) != 1:
            raise IncompleteEffect(f"{package}.{info.name}: {len(defined)} effects, one is needed; define it alone")
        effects[info.name] = defined[0]()
    return effects
