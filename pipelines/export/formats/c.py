"""C: a header with the coefficients of every unit and the function that applies them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from pipelines.export.comments import comment
from pipelines.export.polynomials import ORDER

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.export.polynomials import UnitCalibration


NAME = "c"

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


def write(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    """The header as text."""
    del nominal
    parts = [C_HEAD.format(run=run, out_unit=units[0].out_unit, order=ORDER)]
    for c in units:
        symbol = re.sub(r"\W", "_", c.unit)
        low, high = c.temperatures
        parts.append(
            f"\n/* {c.unit}: {comment(c.certified)} */\n"
            f"static const tumbleline_calibration tumbleline_{symbol} = {{\n"
            f'    "{c.unit}", {low:.2f}, {high:.2f},\n    {_braces(c.bias)},\n    {_braces(c.response)}\n}};\n'
        )
    return "".join(parts) + C_TAIL


def _braces(values: Any) -> str:
    if np.ndim(values) == 0:
        return repr(float(values))
    return "{" + ", ".join(_braces(value) for value in values) + "}"
