"""Records of a procedure read from tables of samples and readings."""

from __future__ import annotations

from collections.abc import Iterable

import pandas as pd

from pipelines.procedures.base import Array, Device, ProcedureRecord, ProcedureStep, UnitRecord
from schemas.units import AXES


def procedure_record(
    number: int, step: ProcedureStep, samples: Iterable[pd.DataFrame], readings: pd.DataFrame
) -> ProcedureRecord:
    """One record: samples by unit from its tables, one or several of a long record."""
    import numpy as np

    parts: dict[str, list[tuple[Array, Array]]] = {}
    for table in samples:
        output, time = table[list(AXES)].to_numpy(dtype=float), table["time_s"].to_numpy(dtype=float)
        for unit, rows in table.groupby("unit", sort=False).indices.items():
            parts.setdefault(str(unit), []).append((time[rows], output[rows]))
    joined = {
        unit: UnitRecord(np.concatenate([t for t, _ in own]), np.concatenate([o for _, o in own]))
        for unit, own in parts.items()
    }
    return ProcedureRecord(number, step, readings, joined)


def nominal_device(readings: pd.DataFrame) -> Device:
    """The units by their slots: a scale is known only from a calibration."""
    first = readings.iloc[0]
    return Device({}, {}, float(first["full_scale"]), str(first["out_unit"]))
