"""Settings of an export that a calibration run does not contain: conventions of the receiver."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field

from pipelines.export.firmware import Firmware
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.teds import DataSheet
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown

ARITHMETICS = ("double", "float", "q24")
HIGHEST_ID = 2**31 - 1
MOST_SENSORS = 4


@dataclass(frozen=True)
class ExportSettings:
    """Settings of an export.

    nominal : output per g that the receiver's driver assumes, in the unit of the output; that of the unit's preset where None
    device_ids : identification of the sensor in the autopilot, by unit
    sensor : number of the accelerometer in the autopilot, from 0
    arithmetic : of exported C code, one of :data:`ARITHMETICS`
    rate_hz : of the receiver's samples; that of the static record where None
    counts_per_g : acceleration of 1 g in counts of Betaflight's driver (``acc_1G``)
    firmware : low-pass and filter of the bias in exported C code
    data_sheet : what TEDS state beside a calibration
    """

    nominal: float | None = None
    device_ids: Mapping[str, int] = field(default_factory=dict[str, int])
    sensor: int = 0
    arithmetic: str = "double"
    rate_hz: float | None = None
    counts_per_g: int = 2048
    firmware: Firmware = field(default_factory=Firmware)
    data_sheet: DataSheet | None = None

    def __post_init__(self) -> None:
        """Refuses settings outside their range."""
        if self.arithmetic not in ARITHMETICS:
            raise WrongUse(
                f"--arithmetic: found '{shown(self.arithmetic)}'; {did_you_mean(self.arithmetic, ARITHMETICS)}"
            )
        if not 0 <= self.sensor < MOST_SENSORS:
            raise WrongUse(f"--sensor: found {self.sensor}, 0 to {MOST_SENSORS - 1} is needed; correct it")
        if self.rate_hz is not None and not self.rate_hz > 0.0:
            raise WrongUse(f"--rate: found {self.rate_hz:g} Hz, a rate above 0 is needed; correct it")
        if self.counts_per_g < 1:
            raise WrongUse(f"--counts-per-g: found {self.counts_per_g}, 1 or more is needed; correct it")

    def nominal_for(self, unit: UnitCalibration, what: str) -> float:
        """The driver's output per g: the one given, else that of the unit's preset; refused where neither states it."""
        nominal = unit.nominal if self.nominal is None else self.nominal
        if nominal is None or not nominal > 0.0:
            found = "none is given and no preset states it" if nominal is None else f"{nominal:g}"
            raise WrongUse(
                f"export: nominal scale of unit {unit.unit}: {found}, a positive output per g is needed for {what} (their driver "
                "divides by it); give it with --nominal"
            )
        return nominal


def device_ids(text: str, units: Sequence[str]) -> dict[str, int]:
    """Identifications by unit from ``ID`` for one unit, or ``UNIT=ID,…`` for several.

    Raises
    ------
    WrongUse
        An identification is not a number, a unit is not exported, or two units have the same identification.
    """
    ids: dict[str, int] = {}
    for part in filter(None, map(str.strip, text.split(","))):
        unit, equals, number = part.rpartition("=")
        if not equals and len(units) != 1:
            raise WrongUse(
                f"--device-id: found '{shown(part)}' for {len(units)} units, one for each is needed as UNIT=ID,…; or choose one "
                "unit with --units"
            )
        unit = unit.strip() if equals else units[0]
        if unit not in units:
            raise WrongUse(f"--device-id: unit '{shown(unit)}' is not exported; {did_you_mean(unit, units)}")
        ids[unit] = _number(number.strip() if equals else part)
    if len(set(ids.values())) < len(ids):
        raise WrongUse(
            f"--device-id: found '{shown(text)}', a different number for each unit is needed; an autopilot "
            "identifies its sensors by it; correct it"
        )
    return ids


def _number(text: str) -> int:
    number = 0
    with suppress(ValueError):
        number = int(text, 0)
    if not 0 < number <= HIGHEST_ID:
        raise WrongUse(
            f"--device-id: found '{shown(text)}', a whole number from 1 to {HIGHEST_ID} is needed, as in the "
            "autopilot's parameter of the sensor; correct it"
        )
    return number
