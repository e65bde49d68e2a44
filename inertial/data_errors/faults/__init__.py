"""Data faults, which must be corrected before effects are diagnosed: each test is a function of a module of this package.

The modules are found here, and in them every :class:`Look`. The first test that finds a fault decides for a unit.
"""

from collections.abc import Iterable
from importlib import import_module
from pkgutil import iter_modules

from inertial.data_errors.faults.fault import Fault, Look
from inertial.data_errors.faults.records import missing_dwells
from inertial.data_errors.readings import Readings

BASE = "fault"
"""The module that says what a fault and a test are."""


class IncompleteFault(Exception):
    """A module without a test, or two tests at one place of the order: its author must correct it."""


def find_looks(package: str, path: Iterable[str]) -> tuple[Look, ...]:
    """The tests that the modules of a package define, in order.

    Raises
    ------
    IncompleteFault
        A module has no test, a test has no description, or two have the same place; all that is missing is listed.
    """
    missing: list[str] = []
    by_order: dict[int, Look] = {}
    for info in iter_modules(path):
        module = import_module(f"{package}.{info.name}")
        looks = [one for one in vars(module).values() if isinstance(one, Look)]
        if not looks and info.name != BASE:
            missing.append(f"{info.name}: no test, a function with @look(order) is needed")
        for one in looks:
            name = f"{info.name}.{one.find.__name__}"
            if not one.find.__doc__:
                missing.append(f"{name}: no description, one line is needed")
            if by_order.setdefault(one.order, one) is not one:
                missing.append(
                    f"{name}: order {one.order} is that of {by_order[one.order].find.__name__}, another is needed"
                )
    if missing:
        raise IncompleteFault(f"{package}: {'; '.join(missing)}")
    return tuple(by_order[order] for order in sorted(by_order))


LOOKS = find_looks(__name__, __path__)


def find_faults(readings: Readings) -> list[Fault]:
    """Data faults of a lot, at most one kind per unit; a unit without one can be diagnosed."""
    faults: dict[int, Fault] = {}
    for look in LOOKS:
        if readings.turned or look.in_one_pose:
            for fault in look.find(readings):
                faults.setdefault(fault.unit, fault)
    return [faults[u] for u in sorted(faults)]


__all__ = ["Fault", "find_faults", "missing_dwells"]
