"""TEDS: IEEE 1451.4 basic TEDS and template 25 of each axis with a voltage output, as bytes of a memory, with a text."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inertial.arrays import Array
from pipelines.certificates.validity import Calibration
from pipelines.export.omissions import ACROSS, ACROSS_T, BIAS, BIAS_T, SCALE_T, comment, comment_lines
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.settings import ExportSettings
from pipelines.export.teds import (
    HIGH_PASS,
    HIGHEST_SERIAL,
    MASS,
    PAGE_BYTES,
    REFERENCE,
    SENSITIVITY,
    Accelerometer,
    DataSheet,
    data_sheet,
    page,
)
from schemas.errors import WrongUse
from schemas.units import STANDARD_GRAVITY_M_S2

SUFFIX = (".teds", ".txt")
FEWER_AXES = True


def write(units: Sequence[UnitCalibration], run: str, settings: ExportSettings) -> dict[str, bytes]:
    """The files by name: a page of memory for each axis of a unit, and a text for each unit.

    Template 25 is for one axis and states its sensitivity at 25 °C; the text says what that leaves out. The high-pass and the
    reference frequency are the lowest that can be stated: a calibration at rest is one at 0 Hz.

    Raises
    ------
    WrongUse
        The output is not in V, the data sheet is missing, or a serial number does not end in digits that no other unit has.
    """
    sheet = settings.data_sheet or data_sheet("", "")  # which refuses, as no key is given
    files: dict[str, bytes] = {}
    serials = serial_numbers([unit.unit for unit in units])
    for unit in units:
        serial = serials[unit.unit]
        refuse_digital(unit.unit, unit.out_unit)
        dated = with_period(unit.unit, unit.certificate, sheet)
        stated = {
            letter: Accelerometer(axis, float(unit.response[0, row, axis]) / STANDARD_GRAVITY_M_S2)
            for row, (axis, letter) in enumerate(zip(unit.axes, unit.letters, strict=True))
        }
        files |= {f"{unit.unit}-{letter}.teds": page(dated, serial, sensor) for letter, sensor in stated.items()}
        text = [
            *heading(unit.unit, unit.certified, run, dated, serial),
            AT_REST,
            *axis_lines(stated),
            *_left_out(unit, stated),
        ]
        files[f"{unit.unit}.txt"] = "".join(f"{comment(line)}\n" for line in text).encode()
    return files


def serial_numbers(units: Sequence[str]) -> dict[str, int]:
    """The digits at the end of each serial number, by unit; two units with equal digits are refused."""
    owners: dict[int, str] = {}
    for unit in units:
        serial = _serial(unit)
        if serial in owners:
            raise WrongUse(
                f"export: units {owners[serial]} and {unit}: TEDS hold the digits at the end of a serial number, {serial} "
                "for both, different ones are needed; export them one by one with --units, with different models"
            )
        owners[serial] = unit
    return {unit: serial for serial, unit in owners.items()}


def _serial(unit: str) -> int:
    """The digits at the end of a serial number."""
    digits = re.search(r"[0-9]+$", unit)
    if digits is None or int(digits[0]) > HIGHEST_SERIAL:
        raise WrongUse(
            f"export: serial number '{unit}': TEDS hold the digits at its end, a number up to {HIGHEST_SERIAL} is needed; export "
            "json"
        )
    return int(digits[0])


def refuse_digital(unit: str, out_unit: str) -> None:
    """Refuse an output that is no voltage."""
    if out_unit != "V":
        raise WrongUse(
            f"export: output of unit {unit} is in {out_unit}, V is needed for TEDS, whose template 25 states V/(m/s²); export "
            "json, csv or c"
        )


def with_period(unit: str, certificate: Calibration | None, sheet: DataSheet) -> DataSheet:
    """The data sheet with the days to the next calibration: those given, else those of the certificate."""
    days = sheet.period_days or (certificate.stated_days if certificate else None)
    if days is None:
        raise WrongUse(
            f"export: unit {unit} is not certified, so nothing states its period of calibration, TEDS needs it; add "
            "period_days=DAYS to --set teds=…, or certify the run"
        )
    return replace(sheet, period_days=days)


def heading(unit: str, certified: str, run: str, sheet: DataSheet, serial: int) -> list[str]:
    """Lines of text on what the page states beside the calibration."""
    return [
        f"accelerometer {unit}, run {run}: IEEE 1451.4 basic TEDS and template 25, {PAGE_BYTES} bytes for each axis",
        certified,
        f"manufacturer {sheet.manufacturer}, model {sheet.model}, version {sheet.version}, serial number {serial}",
        f"mass {MASS.stated(sheet.mass_g):.3g} g ({sheet.mass_g:g} g given)",
        f"calibrated {sheet.measured} by {sheet.initials}, period {sheet.period_days} days",
        "template 25 says constant-current supply and AC coupling: an instrument that reads it may switch both on",
    ]


AT_REST = f"reference 25 °C and {REFERENCE.start:g} Hz, high-pass {HIGH_PASS.start:g} Hz: the lowest there is; measured at 0 Hz"


def axis_lines(stated: dict[str, Accelerometer]) -> list[str]:
    """The sensitivities as stated beside those that were measured."""
    lines: list[str] = []
    for letter, sensor in stated.items():
        polarity = "negative" if sensor.sensitivity < 0.0 else "positive"
        measured = abs(sensor.sensitivity)
        value = SENSITIVITY.stated(measured)
        lines.append(
            f"axis {letter}: {value:.6g} V/(m/s²), {polarity}; measured {measured:.6g}, "
            f"{1e6 * (value / measured - 1.0):+.0f} ppm by rounding"
        )
    return lines


def _left_out(unit: UnitCalibration, stated: dict[str, Accelerometer]) -> list[str]:
    """Error of a reader that divides V by the sensitivity, against the calibration, µg; the axes without an output are known."""
    full = unit.with_every_axis
    scale = np.ones(3)
    for sensor in stated.values():
        scale[sensor.axis] = STANDARD_GRAVITY_M_S2 * np.copysign(
            SENSITIVITY.stated(abs(sensor.sensitivity)), sensor.sensitivity
        )

    def applied(output: Array, temperature: float) -> Array:
        return output / scale

    return comment_lines(full, applied, (BIAS, BIAS_T, SCALE_T, ACROSS, ACROSS_T))
