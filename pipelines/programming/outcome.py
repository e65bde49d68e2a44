"""Options of the programming, and the outcome of each unit."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from stations.devices.memory import Copy, UnitMemory

if TYPE_CHECKING:
    from pipelines.export.device_block import CoefficientBlock, Form
    from pipelines.export.polynomials import UnitCalibration


@dataclass(frozen=True)
class Choice:
    """Options of the programming.

    form : of the coefficients; with_offsets : also the offset registers of an ADXL355
    tolerance_ug : largest error of an axis in the two poses; it detects wrong coefficients and is not a statement of accuracy
    date : yyyymmdd
    """

    form: Form = "float32"
    with_offsets: bool = False
    tolerance_ug: float = 3000.0
    date: int = 0


@dataclass
class ProgrammingOutcome:
    """Outcome of a unit: ``proved``, or ``failed`` at a step for a reason.

    certificate : number of the certificate that the block contains; 0 without one
    """

    serial: str
    slot: int
    unit: UnitCalibration
    memory: UnitMemory
    certificate: int = 0
    outcome: str = "begun"
    step: str = ""
    reason: str = ""
    copy: Copy = "a"
    block: CoefficientBlock | None = None
    content: bytes = b""
    step_counts: int = 0
    poses: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])

    @property
    def open(self) -> bool:
        """Whether the unit has neither failed nor been verified."""
        return self.outcome == "begun"

    def document(self) -> dict[str, Any]:
        """The outcome for JSON."""
        block = self.block
        return {
            "unit": self.serial, "outcome": self.outcome, "step": self.step, "reason": self.reason, "copy": self.copy.upper(),
            "sequence": None if block is None else block.sequence, "form": None if block is None else block.form,
            "crc32": f"{zlib.crc32(self.content[:-4]):08X}", "bytes": len(self.content),
            "offsets": None if block is None else list(block.offsets), "poses": self.poses,
        }  # fmt: skip
