"""Handling errors, the alternatives to effects, one per file; every file of the package is used."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from inertial.estimation.alternative import Handling


@cache
def alternatives() -> tuple[Handling, ...]:
    """Every alternative of this package, by its id."""
    by_id: dict[str, Handling] = {}
    for module in iter_modules(__path__):
        for thing in vars(import_module(f"{__name__}.{module.name}")).values():
            if isinstance(thing, type) and issubclass(thing, Handling) and hasattr(thing, "id"):
                by_id[thing.id] = thing()
    return tuple(by_id[name] for name in sorted(by_id))


def named(name: str) -> Handling | None:
    """The alternative of an id; None where there is none."""
    return next((a for a in alternatives() if a.id == name), None)
