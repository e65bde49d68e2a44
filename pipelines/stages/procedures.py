"""The procedures of a recipe: points of every unit, the figures that limits may name, and the findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics.wander import IdentifiedNoise
from inertial.errors import InertialError
from pipelines.procedures import PROCEDURES, parts_of, steps_of
from pipelines.procedures.base import Evaluated, Part
from pipelines.procedures.figures import FigureValue, Outcome
from pipelines.procedures.recorded import (
    Device,
    ProcedureRecord,
    figure_table,
    finding_table,
    gathered_points,
    nominal_device,
    point_table,
    procedure_record,
)
from pipelines.tables.calibration import read_calibration
from schemas.recipe import Recipe


def procedures(
    recipe: Recipe,
    samples: Callable[[set[int]], Iterator[pd.DataFrame]],
    readings: pd.DataFrame,
    verdicts: pd.DataFrame,
    coefficients: pd.DataFrame,
    covariance: pd.DataFrame,
    noise: pd.DataFrame | None = None,
) -> dict[str, pd.DataFrame]:
    """Tables ``procedure_points``, ``procedure_figures`` and ``procedure_findings``; without rows where the recipe has no list.

    Parameters
    ----------
    samples : gives the samples of some records, by their numbers
    noise : terms of the static record of the run
    """
    if not recipe.procedures:
        return {
            "procedure_points": gathered_points([]),
            "procedure_figures": figure_table([]),
            "procedure_findings": finding_table([]),
        }
    device = replace(_device(readings, coefficients, covariance), noise=identified_noise(noise))
    accepted = verdicts.loc[~verdicts["refused"], "unit"].tolist()
    points: list[tuple[int, str, pd.DataFrame]] = []
    figures: list[dict[str, Any]] = []
    findings: list[dict[str, Any]] = []
    steps = steps_of(recipe)
    for number, part in enumerate(parts_of(recipe)):
        procedure = PROCEDURES[part.kind]
        if not isinstance(procedure, Evaluated):
            continue  # its records are those of the stages reduce, fit, verify and noise
        own = [(record, step) for record, (of, step) in enumerate(steps) if of == number and step.kind == "procedure"]
        if not own:
            continue
        records = (
            procedure_record(record, step, samples({record}), _answered(readings, record, accepted), recipe.sensor_axes)
            for record, step in own
        )
        table, outcome = analysed(procedure, part, records, device, accepted)
        points.append((number, part.kind, table))
        units = {spec.name: spec.unit for spec in procedure.figures}
        for unit, values in outcome.figures.items():
            figures += [_figure_row(number, part.kind, unit, one, units[one.figure]) for one in values]
        findings += [
            {"unit": one.unit, "procedure": part.kind, "number": number, "subject": one.subject, "text": one.text}
            for one in outcome.findings
        ]
    return {
        "procedure_points": gathered_points(points),
        "procedure_figures": figure_table(figures),
        "procedure_findings": finding_table(findings),
    }


def analysed(
    procedure: Evaluated, part: Part, records: Any, device: Device, units: list[str]
) -> tuple[pd.DataFrame, Outcome]:
    """Points, figures and findings; a unit for which a declared figure is missing gets it as not determined, with the reason.

    Parameters
    ----------
    records : of the procedure, in order; each is read once
    """
    try:
        kept: list[ProcedureRecord] = list(records)
        table = procedure.reduce(part, kept, device)
        outcome = procedure.evaluate(part, table, device)
        why = "its records give no value"
    except InertialError as problem:
        table, outcome, why = point_table([]), Outcome({}), str(problem)
    whole: dict[str, list[FigureValue]] = {}
    for unit in units:
        values = list(outcome.figures.get(unit, []))
        there = {one.figure for one in values}
        missing = [spec for spec in procedure.figures if spec.name not in there]
        values += [FigureValue.not_determined(spec.name, "*", why) for spec in missing]
        whole[unit] = [one if np.isfinite(one.value) else replace(one, identified=False) for one in values]
    return table, Outcome(whole, outcome.findings)


def _answered(readings: pd.DataFrame, record: int, accepted: list[str]) -> pd.DataFrame:
    """Readings of a record of the accepted units that answered."""
    own = readings[(readings["record"] == record) & (readings["status"] == "ok")]
    return own[own["unit"].isin(accepted)]


def _device(readings: pd.DataFrame, coefficients: pd.DataFrame, covariance: pd.DataFrame) -> Device:
    """The units with the scale of their calibration, where the recipe has one."""
    device = nominal_device(readings)
    if coefficients.empty:
        return device
    calibration = read_calibration(coefficients, covariance)
    scale = np.abs(np.diagonal(calibration.response, axis1=-2, axis2=-1))
    errors = calibration.standard_error("scale") if "scale" in calibration.effects else None
    return replace(
        device,
        scale=dict(zip(calibration.units, scale, strict=True)),
        scale_error={
            unit: (errors[k, :, 0] / scale[k] if errors is not None else np.zeros(3))
            for k, unit in enumerate(calibration.units)
        },
    )


def identified_noise(terms: pd.DataFrame | None) -> dict[tuple[str, str], IdentifiedNoise]:
    """Bias instability and random walk of the static record, by unit and axis."""
    if terms is None:
        return {}
    of: dict[tuple[str, str], dict[str, tuple[float, float, float]]] = {}
    for row in terms[terms["term"].isin(["B", "K"])].to_dict("records"):
        ends = float(row["value"]), float(row["low"]), float(row["high"])
        of.setdefault((str(row["unit"]), str(row["axis"])), {})[str(row["term"])] = ends
    return {key: IdentifiedNoise(one["B"], one["K"]) for key, one in of.items()}


def _figure_row(number: int, procedure: str, unit: str, one: FigureValue, unit_text: str) -> dict[str, Any]:
    return {
        "unit": unit,
        "procedure": procedure,
        "number": number,
        "figure": one.figure,
        "axis": one.axis,
        "value": one.value,
        "uncertainty": one.uncertainty,
        "low": one.low,
        "high": one.high,
        "identified": one.identified,
        "unit_text": unit_text,
        "note": one.note,
        "dof": one.dof,
        "removed": one.removed,
    }
