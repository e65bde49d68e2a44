"""The figures of merit of a calibrated unit, which limits apply to: the modules of this package define them.

Nothing else names a figure: limits files, tables, the report and the reference read :data:`FIGURES`.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from importlib import import_module
from pkgutil import iter_modules
from typing import NamedTuple

from pipelines.procedures import FIGURES as PROCEDURE_FIGURES
from pipelines.stages.figures.base import FigureKind, UnitTables, Value

SHARED = "base"


class IncompleteFigure(Exception):
    """A module without figures, or with a name or order that another figure has: its author must correct it."""


class Figure(NamedTuple):
    """One figure of one unit."""

    name: str
    unit: str
    of: Value


def find_figures(package: str, path: Iterable[str]) -> dict[str, FigureKind]:
    """The figures that the modules of a package define, by name in the order of tables.

    Raises
    ------
    IncompleteFigure
        A module has no FIGURES, or two figures have one name or one order.
    """
    kinds: list[FigureKind] = []
    for info in iter_modules(path):
        if info.name == SHARED:
            continue
        defined = getattr(import_module(f"{package}.{info.name}"), "FIGURES", ())
        if not defined or not all(isinstance(kind, FigureKind) for kind in defined):
            raise IncompleteFigure(
                f"{package}.{info.name}: no FIGURES, one is needed; define FIGURES = (FigureKind(…),)"
            )
        kinds += defined
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
    **{name: figure.unit for name, figure in PROCEDURE_FIGURES.items()},
}
"""The unit of each figure, of the calibration or of a procedure, against which limits files are checked."""

SPELT = str.maketrans({"µ": "u", "²": "2", "³": "3", "/": "_", "√": "rt"})


def figure_label(name: str) -> str:
    """The label of a figure; for figures of procedures and of other versions, its key in words, without the unit."""
    if name in FIGURES:
        return FIGURES[name].label
    unit = UNITS.get(name, "").replace("%", "percent").translate(SPELT)
    words = name[: -len(unit) - 1] if name.lower().endswith(f"_{unit}".lower()) else name
    return words.replace("_", " ")


def plain_reason(text: str) -> str:
    """One reason, or several divided by ``; ``, in which a figure has its label instead of its id."""
    return "; ".join(_plain(part) for part in text.split("; "))


def _plain(part: str) -> str:
    begin = re.match(r"\w+", part)
    if begin is None or begin.group() not in UNITS:
        return part
    label, rest = figure_label(begin.group()), part[begin.end() :]
    return f"{label[:1].upper()}{label[1:]}{'' if rest.startswith(':') else ':'}{rest}"


def figures_of(tables: UnitTables) -> Iterator[Figure]:
    """Every figure that the tables of one unit yield, in the order of the table ``figures``."""
    for kind in FIGURES.values():
        value = kind.value(tables)
        if value is not None:
            yield Figure(kind.name, kind.unit, value)
