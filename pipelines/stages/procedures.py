"""The procedures of a recipe: points of every unit, the figures that limits may name, and the findings."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import numpy as np
import pandas as pd

from inertial.dynamics.wander import IdentifiedNoise
from inertial.errors import InertialError
from pipelines.procedures import PROCEDURES, parts_of, procedure_tables, steps_of
from pipelines.procedures.base import Evaluated, Part
from pipelines.procedures.figures import FigureValue, Outcome
from pipelines.procedures.recorded import Device, ProcedureRecord, nominal_device, point_table, procedure_record
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
    """Tables ``procedure_points``, ``procedure_figures`` and ``procedure_findings``; without rows for a recipe without a list.

    Parameters
    ----------
    samples : function from record numbers to the samples of these records
    noise : noise terms of the static record of the run
    """
    if not recipe.procedures:
        return procedure_tables([])
    device = replace(_device(readings, coefficients, covariance), noise=identified_noise(noise))
    accepted = verdicts.loc[~verdicts["refused"], "unit"].tolist()
    results: list[tuple[int, str, pd.DataFrame, Outcome]] = []
    steps = steps_of(recipe)
    for number, part in enumerate(parts_of(recipe)):
        procedure = PROCEDURES[part.kind]
        if not isinstance(procedure, Evaluated):
            continue  # the stages reduce, fit, verify and noise evaluate its records
        numbered = [
            (record, step) for record, (of, step) in enumerate(steps) if of == number and step.kind == "procedure"
        ]
        if not numbered:
            continue
        records = (
            procedure_record(record, step, samples({record}), _answered(readings, record, accepted), recipe.sensor_axes)
            for record, step in numbered
        )
        results.append((number, part.kind, *_analysed(procedure, part, records, device, accepted)))
    return procedure_tables(results)


def _analysed(
    procedure: Evaluated, part: Part, records: Iterable[ProcedureRecord], device: Device, units: list[str]
) -> tuple[pd.DataFrame, Outcome]:
    """Points, figures and findings; a declared figure that is missing for a unit is "not determined", with the reason.

    Parameters
    ----------
    records : of the procedure, in order; each is read once
    """
    try:
        table = procedure.reduce(part, list(records), device)
        outcome = procedure.evaluate(part, table, device)
        why = "its records give no value"
    except InertialError as problem:
        table, outcome, why = point_table([]), Outcome({}), str(problem)
    completed: dict[str, list[FigureValue]] = {}
    for unit in units:
        values = list(outcome.figures.get(unit, []))
        there = {value.figure for value in values}
        missing = [spec for spec in procedure.figures if spec.name not in there]
        completed[unit] = values + [FigureValue.not_determined(spec.name, "*", why) for spec in missing]
    return table, replace(outcome, figures=completed)


def _answered(readings: pd.DataFrame, record: int, accepted: list[str]) -> pd.DataFrame:
    """Readings of a record of the accepted units that answered."""
    answered = readings[(readings["record"] == record) & (readings["status"] == "ok")]
    return answered[answered["unit"].isin(accepted)]


def _device(readings: pd.DataFrame, coefficients: pd.DataFrame, covariance: pd.DataFrame) -> Device:
    """The units with the scale of their calibration, where the recipe calibrates them."""
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
    return {key: IdentifiedNoise(terms["B"], terms["K"]) for key, terms in of.items()}
