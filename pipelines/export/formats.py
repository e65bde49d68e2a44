"""The texts: JSON, CSV, a C header, and parameters for ArduPilot and PX4."""

from __future__ import annotations

import csv
import io
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.export.polynomials import ORDER
from schemas.errors import WrongUse
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pipelines.export.polynomials import UnitCalibration


C_HEAD = """\
/* Accelerometer calibration, run {run}.
 * specific force in g = inverse(K(t)) * (output - b(t)), t = temperature - 25 degrees Celsius,
 * b(t) = sum of bias[k] * t^k, K(t) = sum of response[k] * t^k; output in {out_unit}. */
#ifndef TUMBLELINE_CALIBRATION_H
#define TUMBLELINE_CALIBRATION_H

typedef struct {{
    const char *unit;
    double low_C, high_C; /* temperatures that were measured */
    double bias[{order}][3];
    double response[{order}][3][3];
}} tumbleline_calibration;
"""

C_TAIL = """
/* Writes the specific force in g to force[3]; returns 0, or -1 where the response cannot be inverted. */
static inline int tumbleline_correct(const tumbleline_calibration *c, const double output[3], double temperature_C,
                                     double force[3])
{
    double t = temperature_C - 25.0, power = 1.0, k[3][3] = {{0}}, d[3];
    for (int i = 0; i < 3; i++) d[i] = output[i];
    for (int n = 0; n < ORDER; n++, power *= t)
        for (int i = 0; i < 3; i++) {
            d[i] -= c->bias[n][i] * power;
            for (int j = 0; j < 3; j++) k[i][j] += c->response[n][i][j] * power;
        }
    double m[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[j][i] = k[(i + 1) % 3][(j + 1) % 3] * k[(i + 2) % 3][(j + 2) % 3]
                    - k[(i + 1) % 3][(j + 2) % 3] * k[(i + 2) % 3][(j + 1) % 3];
    double det = k[0][0] * m[0][0] + k[0][1] * m[1][0] + k[0][2] * m[2][0];
    if (det == 0.0) return -1;
    for (int i = 0; i < 3; i++) force[i] = (m[i][0] * d[0] + m[i][1] * d[1] + m[i][2] * d[2]) / det;
    return 0;
}

#endif
""".replace("ORDER", str(ORDER))


def export_text(name: str, units: Sequence[UnitCalibration], run: str, nominal: float | None = None) -> str:
    """The calibrations in one of :data:`FORMATS`.

    Parameters
    ----------
    nominal : output per g that the autopilot's driver assumes; only for parameters.
    """
    if name != "json":
        _refuse_left_out(name, units)
    return FORMATS[name](units, run, nominal)


def _refuse_left_out(name: str, units: Sequence[UnitCalibration]) -> None:
    left = units[0].left_out
    if left:
        raise WrongUse(
            f"export: effect {', '.join(left)} has no place in format {name}, which knows bias, scale, misalignment and "
            "their temperature; export json, or fit a model without it"
        )


def _json(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    del nominal
    document = {
        "run": run,
        "correction": "a = inverse(sum response[k] θ^k) · (output − sum bias[k] θ^k), θ = T − 25 °C, a in g",
        "units": [
            {
                "unit": c.unit, "outcome": c.outcome, "grade": c.grade, "out_unit": c.out_unit,
                "temperatures_C": list(c.temperatures), "bias": c.bias.tolist(), "response": c.response.tolist(),
                "not_included": list(c.left_out),
                "certificate": None if c.certificate is None else c.certificate.document(),
            }
            for c in units
        ],
    }  # fmt: skip
    return json.dumps(document, ensure_ascii=False, indent=1) + "\n"


def _csv(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    del run, nominal
    sink = io.StringIO()
    writer = csv.writer(sink, lineterminator="\n")
    writer.writerow(["unit", "quantity", "power_of_theta", "row", "column", "value", "unit_text", "certificate"])
    for c in units:
        said = c.certified
        for k in range(ORDER):
            per = "" if k == 0 else f"/K^{k}"
            for i, row in enumerate(AXES):
                writer.writerow([c.unit, "bias", k, row, "", repr(float(c.bias[k, i])), c.out_unit + per, said])
            for i, row in enumerate(AXES):
                for j, column in enumerate(AXES):
                    value = repr(float(c.response[k, i, j]))
                    writer.writerow([c.unit, "response", k, row, column, value, f"{c.out_unit}/g{per}", said])
    return sink.getvalue()


def _c(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    del nominal
    parts = [C_HEAD.format(run=run, out_unit=units[0].out_unit, order=ORDER)]
    for c in units:
        symbol = re.sub(r"\W", "_", c.unit)
        low, high = c.temperatures
        parts.append(
            f"\n/* {c.unit}: {_comment(c.certified)} */\n"
            f"static const tumbleline_calibration tumbleline_{symbol} = {{\n"
            f'    "{c.unit}", {low:.2f}, {high:.2f},\n    {_braces(c.bias)},\n    {_braces(c.response)}\n}};\n'
        )
    return "".join(parts) + C_TAIL


def _comment(text: str) -> str:
    """Text that ends no comment of C and no line."""
    return " ".join(text.replace("*/", "* /").split())


def _braces(values: Any) -> str:
    if np.ndim(values) == 0:
        return repr(float(values))
    return "{" + ", ".join(_braces(value) for value in values) + "}"


def _ardupilot(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    """INS_ACCOFFS (m/s²) and INS_ACCSCAL at 25 °C, applied as (a − offset)·scale."""
    return _parameters(units, run, nominal, ("INS_ACCOFFS_{axis}", "INS_ACCSCAL_{axis}"), ",")


def _px4(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    """CAL_ACC0 offsets (m/s²) and scales at 25 °C, applied as (a − offset)·scale."""
    return _parameters(units, run, nominal, ("CAL_ACC0_{axis}OFF", "CAL_ACC0_{axis}SCALE"), "\t")


def _parameters(
    units: Sequence[UnitCalibration], run: str, nominal: float | None, names: tuple[str, str], between: str
) -> str:
    if nominal is None or nominal <= 0.0:
        raise WrongUse(
            f"export: nominal scale {nominal}, a positive output per g is needed for autopilot parameters (their driver "
            "divides by it); give it with --nominal"
        )
    lines: list[str] = []
    for c in units:
        across = c.response[0] - np.diag(np.diag(c.response[0]))
        coupling = 1e3 * float(np.max(np.abs(across))) / nominal
        low, high = c.temperatures
        lines += [
            f"# unit {c.unit}, run {run}, at 25 °C; the driver is assumed to give {nominal:g} {c.out_unit} as 1 g",
            f"# {_comment(c.certified)}",
            (
                f"# left out, as these parameters have no place for it: misalignment to {coupling:.2g} mrad, "
                f"temperature terms from {low:.0f} to {high:.0f} °C"
            ),
        ]
        for i, axis in enumerate("XYZ"):
            offset = STANDARD_GRAVITY_M_S2 * c.bias[0, i] / nominal
            scale = nominal / c.response[0, i, i]
            lines.append(f"{names[0].format(axis=axis)}{between}{offset:.6f}")
            lines.append(f"{names[1].format(axis=axis)}{between}{scale:.6f}")
    return "\n".join(lines) + "\n"


FORMATS: dict[str, Callable[[Sequence[UnitCalibration], str, float | None], str]] = {
    "json": _json,
    "csv": _csv,
    "c": _c,
    "ardupilot": _ardupilot,
    "px4": _px4,
}
