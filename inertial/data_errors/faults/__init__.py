"""Data faults, one kind per file, which must be corrected before effects are diagnosed; every file of the package is used."""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from inertial.data_errors.faults.fault import Fault, Look, missing_dwells
from inertial.data_errors.readings import Readings


@cache
def looks() -> tuple[Look, ...]:
    """Every test of this package, in order of priority."""
    modules = (import_module(f"{__name__}.{info.name}") for info in iter_modules(__path__))
    return tuple(sorted((m.LOOK for m in modules if hasattr(m, "LOOK")), key=lambda look: look.order))


def looks_in_one_pose() -> tuple[Look, ...]:
    """The tests for a record in one pose, in their order."""
    ordered = [(look.order_in_one_pose, look) for look in looks() if look.order_in_one_pose is not None]
    return tuple(look for _, look in sorted(ordered, key=lambda each: each[0]))


def names_of_missing() -> frozenset[str]:
    """Names of the faults of a unit without dwells that other units have."""
    return frozenset(name for look in looks() if look.of_missing for name in look.names)


def find_faults(readings: Readings) -> list[Fault]:
    """Data faults of a lot, at most one per unit, by the first test that finds one; units without a fault can be diagnosed."""
    faults: dict[int, Fault] = {}
    for look in looks() if readings.turned else looks_in_one_pose():
        for fault in look.find(readings):
            faults.setdefault(fault.unit, fault)
    return [faults[u] for u in sorted(faults)]


__all__ = ["Fault", "find_faults", "missing_dwells"]
