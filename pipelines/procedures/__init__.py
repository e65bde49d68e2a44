"""Test procedures: each module of this package is one procedure and is found here.

A recipe lists the procedures of a lot in order, as tables ``[[procedures]]`` with the key ``kind``. Nothing else names a
procedure: recipes, capture, the stage ``procedures``, limits, the report and the reference read :data:`PROCEDURES`.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules
from typing import Any, TypeVar

import numpy as np
import pandas as pd
from pydantic import ValidationError

from pipelines.procedures.base import (
    Evaluated,
    FigureSpec,
    InG,
    NominalScale,
    OnEquipment,
    Part,
    Procedure,
    SetsEquipment,
)
from pipelines.procedures.compared import OF_RECORDS
from pipelines.procedures.figures import Outcome
from pipelines.procedures.recorded import ProcedureStep
from pipelines.tables.frames import empty_table
from schemas.comparison import TERMS
from schemas.errors import RecipeInvalid, close_matches, did_you_mean
from schemas.recipe import Recipe
from schemas.station import StationConfig
from schemas.toml_files import explain
from schemas.units import AXES


class IncompleteProcedure(Exception):
    """A module without a procedure, or with a figure that another has: its author must correct it."""


def find_procedures(package: str, path: Any) -> dict[str, Procedure]:
    """The procedures that the modules of a package define, by name in the order of the reference.

    Raises
    ------
    IncompleteProcedure
        A module has no PROCEDURE, a procedure declares what it cannot do, or two procedures declare the same figure.
    """
    procedures: dict[str, Procedure] = {}
    for info in iter_modules(path):
        module = import_module(f"{package}.{info.name}")
        procedure = getattr(module, "PROCEDURE", None)
        classes = (
            kind for kind in vars(module).values() if isinstance(kind, type) and kind.__module__ == module.__name__
        )
        if procedure is None and not any(issubclass(kind, Procedure) and not isabstract(kind) for kind in classes):
            continue  # a part that procedures share
        if not isinstance(procedure, Procedure):
            raise IncompleteProcedure(f"{package}.{info.name}: no PROCEDURE, one is needed; define PROCEDURE = …")
        _refuse_half(f"{package}.{info.name}", procedure)
        procedures[info.name] = procedure
    figures = [figure.name for procedure in procedures.values() for figure in procedure.figures]
    twice = sorted({name for name in figures if figures.count(name) > 1})
    if twice:
        raise IncompleteProcedure(f"{package}: figure {', '.join(twice)} is declared twice; rename one")
    return dict(sorted(procedures.items(), key=lambda named: (named[1].order, named[0])))


def _refuse_half(module: str, procedure: Procedure) -> None:
    """Refuse a procedure that declares what it cannot do; abstract methods that are missing are refused by Python."""
    on_station = isinstance(procedure, OnEquipment | SetsEquipment)
    if procedure.roles and not on_station:
        raise IncompleteProcedure(
            f"{module}: roles {', '.join(procedure.roles)}, OnEquipment or SetsEquipment is needed; "
            "inherit one, or leave out the roles"
        )
    if on_station and not procedure.roles:
        raise IncompleteProcedure(f"{module}: no roles, the equipment of its steps is needed; declare roles = (…,)")
    if isinstance(procedure, Evaluated) != bool(procedure.figures):
        what = (
            "no figures, one is needed for Evaluated"
            if not procedure.figures
            else "figures, Evaluated is needed for them"
        )
        raise IncompleteProcedure(f"{module}: {what}; declare both, or neither")
    if isinstance(procedure, InG) and not issubclass(procedure.part, NominalScale):
        raise IncompleteProcedure(
            f"{module}: part {procedure.part.__name__}, a NominalScale is needed for InG; inherit it"
        )


PROCEDURES: Mapping[str, Procedure] = find_procedures(__name__, __path__)
FIGURES: Mapping[str, FigureSpec] = {f.name: f for procedure in PROCEDURES.values() for f in procedure.figures}
"""Every figure that limits may name because a procedure determines it."""


def parts_of(recipe: Recipe) -> list[Part]:
    """The parts of a recipe's list of procedures, checked.

    Raises
    ------
    RecipeInvalid
        A procedure is not known, or a key of its part is invalid.
    """
    parts: list[Part] = []
    for number, content in enumerate(recipe.procedures, start=1):
        where = f"recipe: procedures, number {number}"
        kind = str(content.get("kind", ""))
        if kind not in PROCEDURES:
            text = f"{where}: kind '{kind}'; {did_you_mean(kind, PROCEDURES)}"
            raise RecipeInvalid(text, key="kind", close=close_matches(kind, PROCEDURES))
        try:
            part = PROCEDURES[kind].part.model_validate(content)
            _refuse_missing_axes(where, part, PROCEDURES[kind], AXES[: recipe.sensor_axes])
            parts.append(part)
        except ValidationError as problem:
            raise explain(problem, f"{where} ({kind})", PROCEDURES[kind].part) from None
    return parts


def _refuse_missing_axes(where: str, part: Part, procedure: Procedure, letters: Sequence[str]) -> None:
    """Refuse a procedure of an axis that the device does not have."""
    missing = procedure.missing_axes(part, letters)
    if missing:
        raise RecipeInvalid(
            f"{where} ({part.kind}): it measures axis {', '.join(missing)}, the device has {', '.join(letters)} (sensor_axes); "
            "name another axis, or leave the procedure out",
            key="sensor_axes",
        )


Ability = TypeVar("Ability", bound=Procedure)


def procedure_of(recipe: Recipe, number: int | None, ability: type[Ability]) -> Ability:
    """The procedure of a step, by its number in the recipe's list, with the ability that the step asks for.

    Raises
    ------
    IncompleteProcedure
        The procedure plans such a step but does not have the ability.
    """
    kind = recipe.procedures[number or 0]["kind"]
    procedure = PROCEDURES[kind]
    if not isinstance(procedure, ability):
        raise IncompleteProcedure(f"procedure {kind}: it plans steps for {ability.__name__}; inherit it in its module")
    return procedure


def steps_of(recipe: Recipe) -> list[tuple[int, ProcedureStep]]:
    """Every step of a recipe's procedures in order, each with the number of its procedure in the list, from 0."""
    return [
        (number, step)
        for number, part in enumerate(parts_of(recipe))
        for step in PROCEDURES[part.kind].steps(part, recipe)
    ]


def roles_of(recipe: Recipe) -> tuple[str, ...]:
    """The roles that a recipe's procedures need of a station, besides table, chamber and reader."""
    return tuple(dict.fromkeys(role for part in parts_of(recipe) for role in PROCEDURES[part.kind].roles_for(part)))


def figures_of_recipe(recipe: Recipe) -> dict[str, FigureSpec]:
    """The figures that a recipe's procedures determine."""
    return {f.name: f for part in parts_of(recipe) for f in PROCEDURES[part.kind].figures}


def refuse_unusable(recipe: Recipe, station: StationConfig) -> None:
    """Refuse procedures that the station cannot perform, before anything moves.

    Raises
    ------
    RecipeInvalid
        The station lacks a role, a level is beyond it, or the list contradicts the recipe's other keys.
    """
    parts = parts_of(recipe)
    if parts and recipe.static_record_s > 0.0 and all(part.kind != "static_record" for part in parts):
        raise RecipeInvalid(
            f"recipe: static_record_s is {recipe.static_record_s:g} s and 'procedures' lists no static_record, both are needed "
            "for the record; add the procedure, or set static_record_s = 0",
            key="procedures",
        )
    for number, part in enumerate(parts, start=1):
        procedure = PROCEDURES[part.kind]
        missing = next((role for role in procedure.roles_for(part) if role not in station.fitted()), None)
        if missing is not None:
            raise RecipeInvalid(
                f"recipe: procedures, number {number} ({part.kind}): station {station.name} has no {missing}, one is needed; add "
                f"[equipment.{missing}] to the station's file, or measure on another station",
                key="procedures",
            )
        procedure.check(part, recipe, station)


EMPTY: dict[str, dict[str, str]] = {
    "procedure_points": {
        "texts": "unit procedure axis series", "numbers": "setting value uncertainty", "integers": "number point",
    },
    "procedure_figures": {
        "texts": "unit procedure figure axis unit_text note", "numbers": "value uncertainty low high dof removed",
        "integers": "number", "flags": "identified",
    },
    "procedure_findings": {"texts": "unit procedure subject text", "integers": "number"},
    "procedure_results": {
        "texts": "unit procedure role quantity axis unit_text", "integers": "number point",
        "numbers": " ".join(("setting value dof", *(f"u_{name}" for name in OF_RECORDS), *(f"c_{name}" for name in TERMS))),
    },
    "procedure_curves": {
        "texts": "unit procedure axis model verdict reason name", "integers": "number row column",
        "numbers": "value p_value low_hz high_hz",
    },
}  # fmt: skip
"""Columns of the tables of the stage by their types, for tables without rows."""


def procedure_tables(results: Sequence[tuple[int, str, pd.DataFrame, Outcome]]) -> dict[str, pd.DataFrame]:
    """The tables of the stage ``procedures`` from the number, name, points, figures and findings of each procedure."""
    points = [rows.assign(number=number, procedure=name) for number, name, rows, _ in results if len(rows)]
    figures = [
        {
            "unit": unit, "procedure": name, "number": number, "figure": value.figure, "axis": value.axis, "value": value.value,
            "uncertainty": value.uncertainty, "low": value.low, "high": value.high,
            "identified": bool(value.identified and np.isfinite(value.value)),
            "unit_text": FIGURES[value.figure].unit, "note": value.note, "dof": value.dof, "removed": value.removed,
        }
        for number, name, _, outcome in results for unit, values in outcome.figures.items() for value in values
    ]  # fmt: skip
    findings = [
        {"unit": finding.unit, "procedure": name, "number": number, "subject": finding.subject, "text": finding.text}
        for number, name, _, outcome in results
        for finding in outcome.findings
    ]
    compared = [
        {"unit": unit, "procedure": name, "number": number, "role": PROCEDURES[name].roles[0], **result.row()}
        for number, name, _, outcome in results for unit, values in outcome.results.items() for result in values
    ]  # fmt: skip
    curves = [
        {"unit": unit, "procedure": name, "number": number, **row}
        for number, name, _, outcome in results
        for unit, judged in outcome.curves.items() for curve in judged for row in curve.rows()
    ]  # fmt: skip
    made = (
        pd.concat(points, ignore_index=True) if points else points, pd.DataFrame(figures), pd.DataFrame(findings),
        pd.DataFrame(compared), pd.DataFrame(curves),
    )  # fmt: skip
    return {
        name: rows if isinstance(rows, pd.DataFrame) and len(rows) else empty_table(**columns)
        for (name, columns), rows in zip(EMPTY.items(), made, strict=True)
    }
