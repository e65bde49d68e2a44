"""Options of the programming, the outcome of each unit, and checks of its output: offset registers, coefficients in a pose."""

import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from inertial.arrays import Array
from pipelines.export.device_block import CoefficientBlock, Form, unpack
from pipelines.export.polynomials import UnitCalibration
from schemas.errors import StationRefused
from schemas.units import MICRO
from stations.devices.memory import Copy, UnitMemory

RESOLUTION_UG = 2.0
TEMPERATURE_SLACK_K = 2.0


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

    certificate : number of the certificate that the block contains; 0 without a certificate
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


def require_moved(device: ProgrammingOutcome, plain: Array, moved: Array, tolerance_ug: float) -> None:
    """Refuses a device whose output did not change by the value of its offset registers."""
    if device.block is None:
        return
    scale = float(np.mean(np.diag(device.unit.response[0])))
    expected = device.step_counts * np.array(device.block.offsets) / scale
    off = float(np.max(np.abs((moved - plain) / scale - expected))) * MICRO
    if not off <= tolerance_ug:
        raise StationRefused(
            f"{device.memory.name}: the output moved by {off:.0f} µg more or less than the offset registers add, "
            f"{tolerance_ug:g} µg is allowed; check range and alignment of the device"
        )


def require_in_pose(
    device: ProgrammingOutcome, pose: str, force: Array, output: Array, temperature: float, tolerance_ug: float
) -> None:
    """Refuses coefficients in the device that do not give the force, or do not agree with those of the archive.

    force, output : (3,), the known force of the pose, g, and the mean output under it · temperature : °C
    """
    held = unpack(device.memory.read(device.copy))
    if held is None:
        raise StationRefused(
            f"{device.memory.name}: copy {device.copy.upper()} is not valid any more; replace the device"
        )
    low, high = held.temperatures
    if not low - TEMPERATURE_SLACK_K <= temperature <= high + TEMPERATURE_SLACK_K:
        raise StationRefused(
            f"{device.memory.name}: {temperature:.1f} °C, {low:.1f} to {high:.1f} °C is needed to verify the coefficients; "
            "bring the chamber to such a temperature, and repeat the command"
        )
    corrected = held.correct(output[None], temperature)[0]
    archived = device.unit.correct((output - device.step_counts * np.array(held.offsets))[None], temperature)[0]
    error = MICRO * (corrected - force)
    apart = MICRO * float(np.max(np.abs(corrected - archived)))
    device.poses.append({
        "pose": pose, "temperature_C": temperature, "force_g": force.tolist(), "output": output.tolist(),
        "corrected_g": corrected.tolist(), "error_ug": error.tolist(), "magnitude_g": float(np.linalg.norm(corrected)),
        "from_archive_ug": apart,
    })  # fmt: skip
    if not float(np.max(np.abs(error))) <= tolerance_ug:
        raise StationRefused(
            f"{device.memory.name}: pose {pose}: the corrected output is {error[0]:.0f}, {error[1]:.0f}, {error[2]:.0f} µg from "
            f"the force, {tolerance_ug:g} µg is allowed; measure the unit again"
        )
    if not apart <= RESOLUTION_UG:
        raise StationRefused(
            f"{device.memory.name}: pose {pose}: the device's coefficients differ by {apart:.2f} µg from the archive's, "
            f"{RESOLUTION_UG:g} µg is allowed; use form float32"
        )


def write_offsets_again(device: ProgrammingOutcome) -> None:
    """Writes the offset registers again, which lose their value without power, as a host does at every start."""
    if device.block is None:
        return
    if any(device.memory.offsets()):
        raise StationRefused(f"{device.memory.name}: offset registers kept their value without power; check the device")
    device.memory.set_offsets(device.block.offsets)
