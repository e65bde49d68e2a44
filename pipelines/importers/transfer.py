"""A transfer function of another system: points from a CSV, judged as those of a sweep."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from inertial.dynamics.transfer_diagnosis import diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS, Conditions
from inertial.dynamics.transfer_model import Points
from inertial.errors import InertialError
from pipelines.importers import files
from pipelines.importers.documents import TransferFailure, TransferImport, TransferParameter
from pipelines.importers.keep import keep_tables, lot_of_import
from pipelines.importers.values import finite_column
from pipelines.procedures import procedure_tables
from pipelines.procedures.figures import Finding, Outcome
from pipelines.procedures.transfer_figures import bandwidth_of, diagnosis_text
from schemas.errors import DataRejected, WrongUse, did_you_mean

NEEDED = ("frequency_hz", "magnitude", "phase_deg", "magnitude_uncertainty_percent", "phase_uncertainty_deg")
OPTIONAL = {"level_g": 1.0, "temperature_C": np.nan, "record_s": np.nan, "pressure_hPa": np.nan}
FEWEST = 8


def transfer_points(table: pd.DataFrame, name: str) -> Points:
    """The points of a table with the columns of :data:`NEEDED`, each with its unit in its name.

    Raises
    ------
    DataRejected
        A column is missing, a value is not a finite number, or there are fewer than eight points.
    """
    missing = [one for one in NEEDED if one not in table.columns]
    if missing:
        found = ", ".join(map(str, table.columns)) or "none"
        raise DataRejected(
            f"{name}: column {', '.join(missing)} is missing, found {found}; a transfer function needs its units in the "
            "names of its columns; rename them"
        )
    columns: dict[str, Any] = {one: np.full(len(table), usual) for one, usual in OPTIONAL.items()}
    given = [one for one in (*NEEDED, *OPTIONAL) if one in table.columns]
    columns |= {one: finite_column(table, one, name, "correct the row") for one in given}
    for one in ("frequency_hz", "magnitude", "magnitude_uncertainty_percent", "phase_uncertainty_deg", "pressure_hPa"):
        if one in given and not np.all(columns[one] > 0.0):
            row = int(np.flatnonzero(columns[one] <= 0.0)[0]) + 1
            raise DataRejected(f"{name}: row {row}, column {one}: a value above 0 is needed; correct the row")
    if len(table) < FEWEST:
        raise DataRejected(f"{name}: {len(table)} points, at least {FEWEST} are needed; measure more frequencies")
    conditions = Conditions(columns["frequency_hz"], *(columns[one] for one in OPTIONAL))
    value = columns["magnitude"] * np.exp(1j * np.radians(columns["phase_deg"]))
    error = 1e-2 * columns["magnitude_uncertainty_percent"], np.radians(columns["phase_uncertainty_deg"])
    return Points(conditions, value, *error)


def import_transfer(
    path: Path, unit: str, effects: Sequence[str] = ("second_order", "delay"), archive: str | None = None
) -> TransferImport:
    """The diagnosis of a transfer function in a file; points, findings and source are stored as a run of the archive.

    Raises
    ------
    WrongUse
        An effect is unknown.
    DataRejected
        The file, or its points, cannot be judged.
    """
    for name in effects:
        if name not in EFFECTS:
            raise WrongUse(f"import: no effect '{name}' of transfer functions; {did_you_mean(name, EFFECTS)}")
    table, source = files.read(path)
    points = transfer_points(table, path.name)
    try:
        diagnosis = diagnose_transfer(points, effects)
    except InertialError as problem:
        raise DataRejected(f"{path.name}: {problem}") from None
    fit = diagnosis.extended
    bandwidth = bandwidth_of(fit, fit.values, float(points.conditions.frequency.max()))
    parameters: dict[str, TransferParameter] = {}
    for name, unit_of in ((p.name, p.unit) for p in fit.parameters):
        p = diagnosis.parameter(name)
        parameters[name] = {
            "value": p.value, "uncertainty": p.uncertainty, "low": p.low, "high": p.high, "unit": unit_of,
            "identified": p.identified,
        }  # fmt: skip
    text = diagnosis_text(diagnosis)
    stated = {"procedure": "sweep", "effects": list(effects), "unit": unit}
    about = {"name": f"transfer function of {unit}", "source": source.as_dict(), "lot": lot_of_import([unit])}
    tables = _tables(points, unit, text)
    run = keep_tables("import of a transfer function", source.sha256, stated, about, tables, archive)
    return {
        "run": run.id,
        "unit": unit,
        "points": len(points.value),
        "adequate": diagnosis.adequate,
        "reason": diagnosis.reason,
        "model": list(diagnosis.fit.effects),
        "p_value": diagnosis.fit.p_value,
        "error_percent": diagnosis.error_percent,
        "extended_percent": diagnosis.extended_percent,
        "left_out": list(diagnosis.left_out),
        "where": [TransferFailure(**asdict(one)) for one in diagnosis.where],
        "classes": [{"effects": list(one.effects), "p_value": one.p_value} for one in diagnosis.classes],
        "recommended": list(diagnosis.recommended),
        "unexplained": diagnosis.unexplained,
        "alone_hz": list(diagnosis.alone_hz),
        "sensitivity": fit.sensitivity,
        "bandwidth_hz": bandwidth,
        "parameters": parameters,
        "next_hz": list(diagnosis.next_hz),
        "text": [f"{subject}: {one}" for subject, one in text],
    }


def _tables(points: Points, unit: str, text: Sequence[tuple[str, str]]) -> dict[str, pd.DataFrame]:
    """Points and findings for the archive."""
    size, c = np.abs(points.value), points.conditions
    rows = pd.DataFrame(
        {
            "unit": unit, "axis": "z", "series": "response", "point": np.arange(len(size)), "setting": c.frequency, "value": size,
            "uncertainty": size * points.magnitude_error, "phase_deg": np.degrees(np.angle(points.value)),
            "phase_uncertainty_deg": np.degrees(points.phase_error), "level_g": c.level, "temperature_C": c.temperature,
            "record_s": c.record_s, "pressure_hPa": c.pressure,
        }
    )  # fmt: skip
    tables = procedure_tables([(0, "sweep", rows, Outcome({}, [Finding(unit, *one) for one in text]))])
    return {name: tables[name] for name in ("procedure_points", "procedure_findings")}
