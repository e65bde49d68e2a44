"""TEDS of a sweep: sensitivity at the reference frequency, and the transfer function where template 25 can hold it."""

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.dynamics.transfer_diagnosis import TransferDiagnosis, diagnose_transfer
from inertial.dynamics.transfer_effects import Conditions
from inertial.dynamics.transfer_model import Points
from inertial.errors import NotIdentified
from pipelines.archive import Run
from pipelines.export.formats.teds import axis_lines, heading, refuse_digital, serial_numbers, with_period
from pipelines.export.omissions import comment
from pipelines.export.polynomials import graded_units, standing
from pipelines.export.teds import (
    HIGH_PASS,
    POLE,
    QUALITY,
    REFERENCE,
    RESONANCE,
    Accelerometer,
    DataSheet,
    TransferFunction,
    page,
)
from pipelines.procedures.sweep_points import FEWEST_POINTS, transfer_points
from schemas.errors import WrongUse
from schemas.exposure_profile import AMBIENT_HPA
from schemas.units import AXES, STANDARD_GRAVITY_M_S2

AT_HZ = 160.0
"""ISO 16063-21 compares at 160 Hz; the point of the sweep that is nearest is taken."""
TEMPERATURE_C = (15.0, 30.0)  # that template 25 can state
ONE_STATE_K, ONE_STATE_HPA = 2.0, 100.0  # from the state at 25 °C in the room, of a sweep in several
MOST_PERCENT = 5.0
"""Largest departure of the template from the measured magnitude with which a transfer function is stated."""


def is_sweep(run: Run) -> bool:
    """Whether a run measured a sweep, and no coefficients."""
    kinds = [part["kind"] for part in (run.about.get("recipe") or {}).get("procedures", ())]
    return "sweep" in kinds and "multi_position" not in kinds


def swept_files(
    run: Run, serials: tuple[str, ...], sheet: DataSheet, *, failed: bool, revoked: bool = False
) -> dict[str, bytes]:
    """A page of memory for each swept axis of a unit, and a text for each unit, by their names.

    Raises
    ------
    WrongUse
        No unit passed, its output is not in V, it has too few points, or none at a temperature that template 25 states.
    """
    chosen, grades, certificates = graded_units(run, serials, failed=failed, revoked=revoked)
    points, readings = run.table("procedure_points"), run.table("readings").set_index("unit")
    rows = points[(points["procedure"] == "sweep") & (points["series"] == "response") & np.isfinite(points["value"])]
    files: dict[str, bytes] = {}
    serials_of = serial_numbers(list(chosen))
    for unit in chosen:
        refuse_digital(unit, str(readings.loc[[unit], "out_unit"].iloc[0]))
        certificate, serial = certificates.get(unit), serials_of[unit]
        dated = with_period(unit, certificate, sheet)
        text = heading(unit, standing(*grades[unit][1:], certificate), run.id, dated, serial)
        for name, axis in rows[rows["unit"] == unit].groupby("axis", sort=True):
            sensor, lines = swept_axis(unit, axis, AXES.index(str(name)))
            files[f"{unit}-{name}.teds"] = page(dated, serial, sensor)
            text += [*axis_lines({str(name): sensor}), *lines]
        if (rows["unit"] != unit).all():
            raise WrongUse(
                f"export: unit {unit} has no point of a sweep with a value; check its cable, and measure again"
            )
        files[f"{unit}.txt"] = "".join(f"{comment(line)}\n" for line in text).encode()
    return files


def swept_axis(unit: str, rows: pd.DataFrame, axis: int) -> tuple[Accelerometer, list[str]]:
    """The entries of template 25 for the points of one axis, and lines of text on them."""
    rows = _one_state(unit, rows)
    points = transfer_points(rows)
    c = points.conditions
    at = int(np.argmin(np.abs(np.log(c.frequency / AT_HZ))))
    sign = float(np.sign(points.value[np.argmin(c.frequency)].real))
    sensitivity = sign * float(np.abs(points.value[at])) / STANDARD_GRAVITY_M_S2
    frequency, temperature = float(c.frequency[at]), float(c.temperature[at])
    transfer, why = _transfer(rows, at)
    stated = "no transfer function: " + why if transfer is None else why
    where = f"at {frequency:.5g} Hz and {temperature:.1f} °C, stated as {REFERENCE.stated(frequency):.5g} Hz and "
    where += f"{0.5 * round(2.0 * temperature):g} °C; high-pass {HIGH_PASS.start:g} Hz, the lowest there is"
    lines = [where, stated]
    return Accelerometer(axis, sensitivity, HIGH_PASS.start, frequency, temperature, transfer), lines


def _one_state(unit: str, rows: pd.DataFrame) -> pd.DataFrame:
    """The points nearest to 25 °C in the room's air, of a sweep at several temperatures and pressures."""
    temperature = rows["temperature_C"].to_numpy(dtype=float)
    pressure = (
        rows["pressure_hPa"].fillna(AMBIENT_HPA) if "pressure_hPa" in rows else pd.Series(AMBIENT_HPA, rows.index)
    )
    room = np.abs(pressure.to_numpy(dtype=float) - AMBIENT_HPA) < ONE_STATE_HPA
    inside = room & (np.abs(temperature - 25.0) < np.abs(temperature - 25.0).min() + ONE_STATE_K)
    low, high = TEMPERATURE_C
    inside &= (temperature >= low) & (temperature <= high)
    if int(inside.sum()) < FEWEST_POINTS:
        raise WrongUse(
            f"export: unit {unit} has {int(inside.sum())} points of a sweep at {low:g} to {high:g} °C in the air of the room, "
            f"{FEWEST_POINTS} are needed for template 25, which states no other temperature; sweep again at room temperature"
        )
    return rows[inside]


def _transfer(rows: pd.DataFrame, at: int) -> tuple[TransferFunction | None, str]:
    """A transfer function of one pole and one resonance, where the points identify it and it describes them; else the reason."""
    points = transfer_points(rows)
    try:
        found: TransferDiagnosis = diagnose_transfer(points, ("second_order", "one_pole", "delay"))
        if not found.fit.identified("natural_hz") or not found.fit.identified("damping"):
            found = diagnose_transfer(points, ("second_order", "delay"))
    except NotIdentified as problem:
        return None, str(problem)
    fit = found.fit
    natural, damping = fit.of("natural_hz")[0], fit.of("damping")[0]
    if not (fit.identified("natural_hz") and fit.identified("damping")) or natural > found.highest_hz:
        return None, "the points do not determine a resonance; sweep beyond it"
    pole = min(fit.of("one_pole_hz")[0] if fit.has("one_pole_hz") else np.inf, POLE.value(2**POLE.bits - 2))
    try:
        stated = TransferFunction(POLE.stated(pole), RESONANCE.stated(natural), QUALITY.stated(0.5 / damping))
    except WrongUse as problem:
        return None, str(problem).removeprefix("export: ")
    # in steps of 2 % a sharp resonance is off at its own flank, whatever its form
    below = points.conditions.frequency < 0.5 * natural
    everywhere = _percent(TransferFunction(pole, natural, 0.5 / damping), points, at).max()
    usable = _percent(stated, points, at)[below].max() if below.any() else np.inf
    if max(everywhere, usable) > MOST_PERCENT:
        away = f"{max(everywhere, usable):.0f} % apart, {MOST_PERCENT:g} % at most"
        return None, f"one pole and one resonance do not describe the points ({away})"
    return stated, (
        f"transfer function: low-pass {stated.pole_hz:.4g} Hz, resonance {stated.resonance_hz:.4g} Hz (measured {natural:.4g}), "
        f"Q {stated.quality:.3g}; within {usable:.2g} % of the magnitude of every point to half the resonance"
    )


def _percent(function: TransferFunction, points: Points, at: int) -> Array:
    """Departure of the magnitude from that of the points (n,), both over those of one point."""
    size, measured = _magnitude(function, points.conditions), np.abs(points.value)
    return np.asarray(100.0 * np.abs(size / size[at] / (measured / measured[at]) - 1.0))


def _magnitude(function: TransferFunction, conditions: Conditions) -> Array:
    ratio = conditions.frequency / function.resonance_hz
    resonance = np.abs(1.0 - ratio**2 + 1j * ratio / function.quality)
    return np.asarray(1.0 / resonance / np.hypot(1.0, conditions.frequency / function.pole_hz))
