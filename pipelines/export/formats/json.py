"""JSON: every unit with its polynomials, outcome, grade and certificate; nothing is left out."""

import json
from collections.abc import Sequence

from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from schemas.units import AXES

SUFFIX = ".json"
FEWER_AXES = True
CORRECTION = "a = inverse(sum response[k] θ^k) · (output − sum bias[k] θ^k), θ = T − 25 °C, a in g"
OF_FEWER_AXES = (
    "of each axis: output = sum bias[k] θ^k + sum response[k] θ^k · a, θ = T − 25 °C, a (x, y, z) in g; the force across an axis "
    "without an output is not measured"
)
COMPLETE = True  # effects that have no polynomial are named in it


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> str:
    """The document as text, with a line end."""
    document = {
        "run": run,
        "correction": CORRECTION if len(units[0].axes) == len(AXES) else OF_FEWER_AXES,
        "units": [
            {
                **({} if len(c.axes) == len(AXES) else {"axes": list(c.letters)}),
                "unit": c.unit, "outcome": c.outcome, "grade": c.grade, "out_unit": c.out_unit,
                "temperatures_C": list(c.temperatures), "bias": c.bias.tolist(), "response": c.response.tolist(),
                "not_included": list(c.left_out),
                "certificate": None if c.certificate is None else c.certificate.statement(),
            }
            for c in units
        ],
    }  # fmt: skip
    return json.dumps(document, ensure_ascii=False, indent=1) + "\n"
