"""ArduPilot: parameters INS_ACCOFFS and INS_ACCSCAL."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.export.parameters import parameters

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pipelines.export.polynomials import UnitCalibration


NAME = "ardupilot"


def write(units: Sequence[UnitCalibration], run: str, nominal: float | None) -> str:
    """The parameters of every unit as text."""
    return parameters(units, run, nominal, ("INS_ACCOFFS_{axis}", "INS_ACCSCAL_{axis}"), ",")
