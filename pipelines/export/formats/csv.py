"""CSV: one row per number, for spreadsheets."""

import csv
import io
from collections.abc import Sequence

from pipelines.export.polynomials import ORDER, UnitCalibration
from pipelines.export.settings import ExportSettings
from schemas.units import AXES

SUFFIX = ".csv"
FEWER_AXES = True


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The table as text."""
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(["unit", "quantity", "power_of_theta", "row", "column", "value", "unit_text", "certificate"])
    for c in units:
        certified = c.certified
        for k in range(ORDER):
            per = "" if k == 0 else f"/K^{k}"
            for i, row in enumerate(c.letters):
                writer.writerow([c.unit, "bias", k, row, "", repr(float(c.bias[k, i])), c.out_unit + per, certified])
            for i, row in enumerate(c.letters):
                for j, column in enumerate(AXES):
                    value = repr(float(c.response[k, i, j]))
                    writer.writerow([c.unit, "response", k, row, column, value, f"{c.out_unit}/g{per}", certified])
    return sink.getvalue()
