"""A transfer function of another system: points from a CSV, judged as those of a sweep."""

from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pandas as pd

from inertial.dynamics.missing_effects import adequate
from inertial.dynamics.transfer_diagnosis import diagnose_transfer
from inertial.dynamics.transfer_effects import EFFECTS
from inertial.dynamics.transfer_model import Points, fit_transfer
from inertial.errors import InertialError
from pipelines.importers import files
from pipelines.importers.documents import TransferFailure, TransferImport, TransferParameter
from pipelines.importers.keep import keep_tables, lot_of_import
from pipelines.importers.transfer_columns import PointsLayout, output_of, transfer_points
from pipelines.procedures import procedure_tables
from pipelines.procedures.figures import Finding, Outcome
from pipelines.procedures.transfer_figures import bandwidth_of, diagnosis_text, model_texts
from schemas.errors import DataRejected, WrongUse, did_you_mean


def import_transfer(
    path: Path,
    unit: str,
    effects: Sequence[str] = ("second_order", "delay"),
    archive: str | None = None,
    layout: PointsLayout | None = None,
    device: str = "",
) -> TransferImport:
    """The diagnosis of a transfer function in a file; points, findings and source are stored as a run of the archive.

    Parameters
    ----------
    layout : what the user states of its columns

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
    content, source = files.read_content(path)
    layout = layout or PointsLayout()
    points, recognised = transfer_points(content, path.name, layout)
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
            "identified": p.identified and not diagnosis.unexplained,
        }  # fmt: skip
    text = [
        *([("columns", recognised)] if recognised else []),
        *diagnosis_text(diagnosis),
        *model_texts(diagnosis, points, output_of(content, layout)),
    ]
    if diagnosis.adequate is False and adequate(fit_transfer(_as_radians(points), effects)):
        text.append(("phase", "taken as radians the same points agree with the model; add --unit-of phase=rad"))
    stated = {"procedure": "sweep", "effects": list(effects), "unit": unit}
    stated |= {name: dict(value) for name, value in vars(layout).items() if value}
    stated |= {"device": device} if device else {}
    about = {
        "name": f"transfer function of {unit}",
        "source": source.as_dict(),
        "lot": lot_of_import([unit], device=device),
    }
    tables = _tables(points, unit, text)
    run = keep_tables("import of a transfer function", source.sha256, stated, about, tables, archive)
    return {
        "run": run.id,
        "unit": unit,
        "device": device or None,
        "points": len(points.value),
        "adequate": diagnosis.adequate,
        "reason": diagnosis.reason,
        "model": list(diagnosis.fit.effects),
        "p_value": diagnosis.fit.p_value,
        "error_percent": diagnosis.error_percent,
        "extended_percent": diagnosis.extended_percent,
        "left_out": list(diagnosis.left_out),
        "where": [TransferFailure(**asdict(failure)) for failure in diagnosis.where],
        "classes": [{"effects": list(missed.effects), "p_value": missed.p_value} for missed in diagnosis.classes],
        "recommended": list(diagnosis.recommended),
        "unexplained": diagnosis.unexplained,
        "alone_hz": list(diagnosis.alone_hz),
        "sensitivity": fit.sensitivity,
        "bandwidth_hz": bandwidth,
        "parameters": parameters,
        "next_hz": list(diagnosis.next_hz),
        "text": [f"{subject}: {sentence}" for subject, sentence in text],
    }


def _as_radians(points: Points) -> Points:
    """The points of phases that were radians where degrees were read."""
    angle = np.degrees(np.angle(points.value))
    turned = np.asarray(np.abs(points.value) * np.exp(1j * angle), dtype=np.complex128)
    return replace(points, value=turned, phase_error=np.degrees(points.phase_error))


def _tables(points: Points, unit: str, text: Sequence[tuple[str, str]]) -> dict[str, pd.DataFrame]:
    size, c = np.abs(points.value), points.conditions
    rows = pd.DataFrame(
        {
            "unit": unit, "axis": "z", "series": "response", "point": np.arange(len(size)), "setting": c.frequency, "value": size,
            "uncertainty": size * points.magnitude_error, "phase_deg": np.degrees(np.angle(points.value)),
            "phase_uncertainty_deg": np.degrees(points.phase_error), "level_g": c.level, "temperature_C": c.temperature,
            "record_s": c.record_s, "pressure_hPa": c.pressure,
        }
    )  # fmt: skip
    tables = procedure_tables([(0, "sweep", rows, Outcome({}, [Finding(unit, *finding) for finding in text]))])
    return {name: tables[name] for name in ("procedure_points", "procedure_findings")}
