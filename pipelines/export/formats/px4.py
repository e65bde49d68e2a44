"""PX4: parameters CAL_ACC0, separated by tabs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.export.parameters import parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.export.polynomials import UnitCalibration


NAME = "px4"


def write(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    """The parameters of every unit as text."""
    return parameters(units, run, nominal, ("CAL_ACC0_{axis}OFF", "CAL_ACC0_{axis}SCALE"), "\t")
