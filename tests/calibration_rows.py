"""Calibrations of an audit from rows of unit, station and day."""

from collections.abc import Sequence

import numpy as np

from pipelines.audit.calibrations import Calibrations
from pipelines.audit.parameters import NAMES


def calibrations(
    rows: Sequence[tuple[str, str, float]], values: np.ndarray | None = None, *, errors: float = 0.01, **more: object
) -> Calibrations:
    """In the audit's order; ``more`` : device, slot, outcome or run of all rows or of each, a station on a day else."""
    unit, station, day = (np.array(column, dtype=object) for column in zip(*rows, strict=True))
    content = np.zeros((len(rows), len(NAMES))) if values is None else values
    usual = {"device": "ADXL355", "slot": 0, "outcome": "pass", "run": [f"{row[1]}-{row[2]:.3f}" for row in rows]}
    own = {name: np.broadcast_to(np.array(one, dtype=object), unit.shape) for name, one in (usual | more).items()}
    days, slot, u = day.astype(float), own["slot"].astype(np.int64), np.full(content.shape, errors)
    made = Calibrations(own["run"], unit, own["device"], station, slot, own["outcome"], days, content, u)
    return made.chosen(np.lexsort((days, own["device"].astype(str), unit.astype(str))))
