"""A command, figure, panel, procedure or reader is one file, which is found; one that is half there is refused."""

from pathlib import Path

import pytest
from each import each
from made_package import made_package

from pipelines.cli import IncompleteCommand, find_commands
from pipelines.importers.readers import IncompleteReader, find_readers
from pipelines.procedures import IncompleteProcedure, find_procedures
from pipelines.procedures.base import Evaluated, FromWaveforms, OnEquipment, SetsEquipment
from pipelines.report.panel import IncompletePanel, panels
from pipelines.stages.figures import IncompleteFigure, find_figures

FIND = {
    "command": (lambda _, path: find_commands(Path(*path)), IncompleteCommand),
    "figure": (find_figures, IncompleteFigure),
    "panel": (lambda name, _: {one.__name__.rpartition(".")[2]: one for one in panels(name)}, IncompletePanel),
    "procedure": (find_procedures, IncompleteProcedure),
    "reader": (find_readers, IncompleteReader),
}
COMMAND = 'PART = "Results"\nORDER = {order}\nSUMMARY = "Do it."\n\n\ndef command(\n) -> None: ...\n'
PANEL = 'ORDER = {order}\nTITLE = "Own"\n\n\ndef render(report):\n    return "<p></p>"\n'
FIGURE = """
from pipelines.stages.figures.base import FigureKind, Value

FIGURES = (FigureKind("{name}", "µg", "Meaning.", "label", {order}, lambda tables: Value(1.0, 0.0)),)
"""
READER = """
NAME, TITLE, EXTRA, ORDER = "{name}", "Format", "", {order}
def recognised(data): return True
def read(name, data, group): return None
"""
PROCEDURE = """
from pipelines.procedures.base import *
class One({bases}):
    title, order, states, source = "One", 1, "s", "s"
    roles, part = {roles}, Part
    figures = ({figures})
    def steps(self, part, recipe): return []
    def reduce(self, *args): return None
    of_unit = chart = measure = reduce
PROCEDURE = One()
"""
PLAIN = {"bases": "Procedure", "roles": "()", "figures": ""}
TEXTS = {"command": COMMAND, "panel": PANEL, "figure": FIGURE, "reader": READER, "procedure": PROCEDURE}


def of(kind: str, name: str = "one", order: int = 20, **more: str) -> str:
    """The text of a module."""
    return TEXTS[kind].format(**PLAIN | {"name": name, "order": order} | more)


FOUND = [
    ("command", {"lambda_": of("command", order=30), "two": of("command"), "helpers": ""}, ["two", "lambda"]),
    ("figure", {"one": of("figure", order=30), "two": of("figure", "other")}, ["other", "one"]),
    ("panel", {"one": of("panel", order=30), "two": of("panel")}, ["two", "one"]),
    ("procedure", {"one": of("procedure"), "shared": "FEWEST = 3\n"}, ["one"]),
    ("reader", {"one": of("reader", order=30), "two": of("reader", "other")}, ["other", "one"]),
]


@each(FOUND)
def test_a_file_is_found_in_its_order(
    row: tuple[str, dict[str, str], list[str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, modules, names = row
    assert list(FIND[kind][0](*made_package(tmp_path, monkeypatch, **modules))) == names


def without(kind: str, old: str) -> dict[str, str]:
    """One module that lacks something."""
    return {"one": of(kind).replace(old, "less")}


HALF = [
    ("command", without("command", "PART"), r"one\.py: a command without PART"),
    ("command", without("command", "ORDER"), r"one\.py: a command without ORDER"),
    ("command", without("command", "SUMMARY"), r"one\.py: a command without SUMMARY"),
    ("command", without("command", "command"), r"one\.py: a command without a function 'command'"),
    ("command", {"one": of("command"), "two": of("command")}, r"two\.py: ORDER is 20, as in one\.py"),
    ("figure", without("figure", "FIGURES"), "no FIGURES, one is needed"),
    ("figure", {"one": of("figure", order=1), "two": of("figure", order=2)}, "2 figures have the name"),
    ("figure", {"one": of("figure"), "two": of("figure", "other")}, "2 figures have the order"),
    ("panel", without("panel", "ORDER"), "one: a panel without ORDER"),
    ("panel", without("panel", "TITLE"), "one: a panel without TITLE"),
    ("panel", without("panel", "render"), "one: a panel without render"),
    ("panel", {"one": of("panel"), "two": of("panel")}, "2 panels have the ORDER 20"),
    ("procedure", without("procedure", "PROCEDURE"), r"\.one: .*no PROCEDURE, one is needed"),
    ("procedure", {"one": of("procedure", roles="('exciter',)")}, r"\.one: .*OnEquipment or SetsEquipment is needed"),
    ("procedure", {"one": of("procedure", bases="OnEquipment")}, r"\.one: .*the equipment of its steps is needed"),
    ("procedure", {"one": of("procedure", bases="Evaluated")}, r"\.one: .*one is needed for Evaluated"),
    (
        "procedure",
        {"one": of("procedure", figures="FigureSpec('a', 's', 'm'),")},
        r"\.one: .*Evaluated is needed for them",
    ),
    ("procedure", {"one": of("procedure", bases="InG")}, r"\.one: .*a NominalScale is needed"),
    ("reader", {"half": "NAME, TITLE = 'half', 'Half'\n"}, "half: no EXTRA, ORDER, recognised, read"),
    ("reader", {"one": of("reader"), "two": of("reader", order=2)}, "two: NAME 'one' or ORDER 2"),
]


@each(HALF)
def test_one_that_is_half_there_is_refused_by_what_it_lacks(
    row: tuple[str, dict[str, str], str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kind, modules, message = row
    find, refusal = FIND[kind]
    with pytest.raises(refusal, match=message):
        find(*made_package(tmp_path, monkeypatch, **modules))


@each([Evaluated, OnEquipment, SetsEquipment, FromWaveforms])
def test_an_ability_of_a_procedure_has_methods_that_are_needed(ability: type) -> None:
    with pytest.raises(TypeError, match="abstract method"):
        type("Bare", (ability,), {"steps": lambda *_: []})()
