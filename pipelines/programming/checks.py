"""Checks of a unit that was written, by its output: offset registers, and the coefficients in a known pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipelines.export.device_block import unpack
from pipelines.programming.outcome import ProgrammingOutcome
from schemas.errors import StationRefused
from schemas.units import MICRO

Array = NDArray[np.float64]

RESOLUTION_UG = 2.0
TEMPERATURE_SLACK_K = 2.0


@dataclass(frozen=True)
class InPose:
    """Mean output (3,) of a unit under a known force (3,), g, at a temperature, °C."""

    pose: str
    force: Array
    output: Array
    temperature: float


def require_moved(one: ProgrammingOutcome, plain: Array, moved: Array, tolerance_ug: float) -> None:
    """Refuses a device whose output did not change by the value of its offset registers."""
    if one.block is None:
        return
    scale = float(np.mean(np.diag(one.unit.response[0])))
    expected = one.step_counts * np.array(one.block.offsets) / scale
    off = float(np.max(np.abs((moved - plain) / scale - expected))) * MICRO
    if not off <= tolerance_ug:
        raise StationRefused(
            f"{one.memory.name}: the output moved by {off:.0f} µg more or less than the offset registers add, "
            f"{tolerance_ug:g} µg is allowed; check range and alignment of the device"
        )


def require_in_pose(one: ProgrammingOutcome, at: InPose, tolerance_ug: float) -> None:
    """Refuses coefficients in the device that do not give the force, or do not agree with those of the archive."""
    pose, force, output, temperature = at.pose, at.force, at.output, at.temperature
    held = unpack(one.memory.read(one.copy))
    if held is None:
        raise StationRefused(f"{one.memory.name}: copy {one.copy.upper()} is not valid any more; replace the device")
    low, high = held.temperatures
    if not low - TEMPERATURE_SLACK_K <= temperature <= high + TEMPERATURE_SLACK_K:
        raise StationRefused(
            f"{one.memory.name}: {temperature:.1f} °C, {low:.1f} to {high:.1f} °C is needed to verify the coefficients; "
            "bring the chamber to such a temperature, and repeat the command"
        )
    corrected = held.correct(output[None], temperature)[0]
    archived = one.unit.correct((output - one.step_counts * np.array(held.offsets))[None], temperature)[0]
    error = MICRO * (corrected - force)
    apart = MICRO * float(np.max(np.abs(corrected - archived)))
    one.poses.append({
        "pose": pose, "temperature_C": temperature, "force_g": force.tolist(), "output": output.tolist(),
        "corrected_g": corrected.tolist(), "error_ug": error.tolist(), "magnitude_g": float(np.linalg.norm(corrected)),
        "from_archive_ug": apart,
    })  # fmt: skip
    if not float(np.max(np.abs(error))) <= tolerance_ug:
        raise StationRefused(
            f"{one.memory.name}: pose {pose}: the corrected output is {error[0]:.0f}, {error[1]:.0f}, {error[2]:.0f} µg from "
            f"the force, {tolerance_ug:g} µg is allowed; measure the unit again"
        )
    if not apart <= RESOLUTION_UG:
        raise StationRefused(
            f"{one.memory.name}: pose {pose}: the device's coefficients differ by {apart:.2f} µg from the archive's, "
            f"{RESOLUTION_UG:g} µg is allowed; use form float32"
        )


def write_offsets_again(one: ProgrammingOutcome) -> None:
    """Writes the offset registers again, which lose their value without power, as a host does at every start."""
    if one.block is None:
        return
    if any(one.memory.offsets()):
        raise StationRefused(f"{one.memory.name}: offset registers kept their value without power; check the device")
    one.memory.set_offsets(one.block.offsets)
