"""The figures of merit of a calibrated unit, which limits apply to: each is one module of this package and is found here.

Nothing else names a figure: limits files, tables, the report and the reference read :data:`FIGURES`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import NamedTuple

from inertial.uncertainty.deviation_law import DeviationLaw
from pipelines.procedures import FIGURES as PROCEDURE_FIGURES
from pipelines.stages.figures.base import FigureKind, LotCoefficients, UnitTables

__all__ = [
    "FIGURES",
    "UNITS",
    "Figure",
    "FigureKind",
    "IncompleteFigure",
    "LotCoefficients",
    "UnitTables",
    "figures_of",
]

SHARED = "base"


class IncompleteFigure(Exception):
    """A module without a figure, or with a name or order that another figure has: its author must correct it."""


class Figure(NamedTuple):
    """Value and standard uncertainty of one figure of one unit, in the figure's unit.

    why_not : why there is no value, where there is none; the value is then infinite and passes no limit
    dof, removed : degrees of freedom of a standard deviation, nan of other figures, and the known part that was taken out of it
    shared : part of the uncertainty that the units of a lot have in common
    median : of a value that is a 95 % bound of an error, the median of that error
    """

    name: str
    unit: str
    value: float
    uncertainty: float
    why_not: str = ""
    dof: float = float("nan")
    shared: float = 0.0
    median: float = float("nan")
    removed: float = 0.0

    @property
    def law(self) -> DeviationLaw | None:
        """The law of a standard deviation; None of other figures, which are normal."""
        return DeviationLaw(self.value, self.dof, self.removed) if self.dof > 0.0 else None


def find_figures(package: str, path: Iterable[str]) -> dict[str, FigureKind]:
    """The figures that the modules of a package define, by name in the order of tables.

    Raises
    ------
    IncompleteFigure
        A module has no FIGURE, or two figures have one name or one order.
    """
    kinds: list[FigureKind] = []
    for info in iter_modules(path):
        if info.name == SHARED:
            continue
        kind = getattr(import_module(f"{package}.{info.name}"), "FIGURE", None)
        if not isinstance(kind, FigureKind):
            raise IncompleteFigure(f"{package}.{info.name}: no FIGURE, one is needed; define FIGURE = FigureKind(…)")
        kinds.append(kind)
    for attribute in ("name", "order"):
        value, count = Counter(getattr(kind, attribute) for kind in kinds).most_common(1)[0]
        if count > 1:
            raise IncompleteFigure(
                f"{package}: {count} figures have the {attribute} {value}; choose another {attribute}"
            )
    return {kind.name: kind for kind in sorted(kinds, key=lambda kind: kind.order)}


FIGURES: Mapping[str, FigureKind] = find_figures(__name__, __path__)
UNITS: Mapping[str, str] = {
    **{name: kind.unit for name, kind in FIGURES.items()},
    **{name: one.unit for name, one in PROCEDURE_FIGURES.items()},
}
"""The unit of each figure, of the calibration or of a procedure, against which limits files are checked."""


def figures_of(tables: UnitTables) -> Iterator[Figure]:
    """Every figure that the tables of one unit yield, in the order of the table ``figures``."""
    for kind in FIGURES.values():
        value = kind.value(tables)
        if value is not None:
            yield Figure(kind.name, kind.unit, *value)
