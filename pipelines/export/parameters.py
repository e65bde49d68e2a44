"""Parameters of autopilots: an offset in m/s² and a scale per axis at 25 °C, applied as (a − offset)·scale."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipelines.export.comments import comment
from schemas.errors import WrongUse
from schemas.units import STANDARD_GRAVITY_M_S2

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.export.polynomials import UnitCalibration


def parameters(
    units: Sequence[UnitCalibration], run: str, nominal: float | None, names: tuple[str, str], between: str
) -> str:
    """Lines of parameters for every unit, with comments on the terms that the format omits.

    Parameters
    ----------
    nominal : output per g that the driver of the autopilot assumes
    names : of the offset and of the scale, with a placeholder for the axis
    between : text between name and value

    Raises
    ------
    WrongUse
        The nominal output is not positive.
    """
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
            f"# unit {c.unit}, run {run}, at 25 °C; assumed output of the driver for 1 g: {nominal:g} {c.out_unit}",
            f"# {comment(c.certified)}",
            (
                f"# not in these parameters: misalignment up to {coupling:.2g} mrad, "
                f"temperature terms from {low:.0f} to {high:.0f} °C"
            ),
        ]
        for i, axis in enumerate("XYZ"):
            offset = STANDARD_GRAVITY_M_S2 * c.bias[0, i] / nominal
            scale = nominal / c.response[0, i, i]
            lines.append(f"{names[0].format(axis=axis)}{between}{offset:.6f}")
            lines.append(f"{names[1].format(axis=axis)}{between}{scale:.6f}")
    return "\n".join(lines) + "\n"
