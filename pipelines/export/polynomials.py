"""A calibration as polynomials in temperature: bias b(θ) and response K(θ), the form that firmware can apply."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import pandas as pd

from inertial.arrays import Array
from inertial.effects.base import AXES, others
from inertial.fits.linear import axis_rows, of_every_axis
from inertial.state import ALL_AXES, T_REFERENCE
from pipelines.archive import Run
from pipelines.certificates import validity
from pipelines.certificates.ledger import stated
from pipelines.export.unit_noise import UnitNoise, noise_of_units
from pipelines.importers.exchange import refuse_other_procedures
from pipelines.stages.figures import plain_reason
from pipelines.tables.calibration import Calibration, read_calibration
from schemas.errors import RecipeInvalid, WrongUse, did_you_mean
from stations.plant.preset import load_preset

BIAS = ("bias", "bias_temperature", "bias_temperature_quadratic", "bias_temperature_cubic")
SCALE = ("scale", "scale_temperature", "scale_temperature_quadratic")
ACROSS = ("misalignment", "misalignment_temperature")
ORDER = 4
EXPORTABLE = ("pass",)


@dataclass(frozen=True)
class UnitCalibration:
    """Calibration of one unit.

    bias : (4, m), output unit per K^k, coefficients of θ⁰ … θ³, of the m axes that have an output
    response : (4, m, 3), output unit per g and K^k
    left_out : effects of the model that this form cannot hold
    reasons : why it failed its limits; empty where it passed
    certificate : that the unit has for this run; None where it was not certified
    noise : terms of its static record; None without that record
    full_scale : largest excursion of the output from 0 g, output unit; None where it is not recorded
    dwells : that the calibration is made from, those of verification left out
    nominal : output per g that the data sheet of this kind of device states, by its preset; None where no preset is known
    """

    unit: str
    outcome: str
    grade: str
    out_unit: str
    bias: Array
    response: Array
    temperatures: tuple[float, float]
    left_out: tuple[str, ...]
    certificate: validity.Calibration | None = None
    noise: UnitNoise | None = None
    full_scale: float | None = None
    nominal: float | None = None
    axes: tuple[int, ...] = ALL_AXES
    dwells: pd.DataFrame = field(default_factory=pd.DataFrame)
    reasons: str = ""

    @property
    def letters(self) -> tuple[str, ...]:
        """Letters of the axes that have an output."""
        return tuple(AXES[axis] for axis in self.axes)

    @property
    def with_every_axis(self) -> UnitCalibration:
        """The calibration with three outputs: for an axis without an output it is the force along it in g, 0 where unknown."""
        if self.bias.shape[-1] == len(AXES):
            return self
        axes = list(self.axes)
        bias, response = np.zeros((ORDER, len(AXES))), np.zeros((ORDER, len(AXES), 3))
        response[0] = np.eye(len(AXES))
        bias[:, axes], response[:, axes] = self.bias, self.response
        return replace(self, bias=bias, response=response)

    def with_forces(self, output: Array, force: Array) -> Array:
        """Outputs (3,) of :attr:`with_every_axis`, from those of the axes that have one, under a known force (3,), g."""
        outputs = np.array(force, dtype=np.float64)
        outputs[list(self.axes)] = output
        return outputs

    @property
    def certified(self) -> str:
        """That the unit failed, and why, and the state of the certificate, in one line."""
        return standing(self.grade, self.reasons, self.certificate)

    def correct(self, output: Array, temperature: float) -> Array:
        """Specific force (n, 3) in g for outputs (n, 3), as firmware computes it."""
        return corrected_output(self.bias, self.response, output, temperature)


def standing(grade: str, reasons: str, certificate: validity.Calibration | None) -> str:
    """What a file says of a unit in one line: that it failed, and why; the state of its certificate."""
    failed = f"FAILED: grade {grade}, outside its limits: {plain_reason(reasons)}; " if reasons else ""
    return failed + ("not certified" if certificate is None else certificate.sentence())


def corrected_output(bias: Array, response: Array, output: Array, temperature: float) -> Array:
    """Specific force (n, 3) in g for outputs (n, 3), by coefficients (4, 3) and (4, 3, 3) of θ⁰ … θ³."""
    powers = (temperature - T_REFERENCE) ** np.arange(ORDER)
    matrix = np.einsum("k,kij->ij", powers, response)
    return np.linalg.solve(matrix, (output - np.einsum("k,ki->i", powers, bias)).T).T


def unit_calibrations(
    run: Run, serials: tuple[str, ...], *, failed: bool, revoked: bool = False
) -> list[UnitCalibration]:
    """Calibrations of the units that passed and were not revoked, or of those named.

    Parameters
    ----------
    failed : include units that failed their limits; units whose data were refused have no calibration
    revoked : include units whose calibration was revoked
    """
    graded = "grades" in run.tables()
    chosen, grades, certificates = (
        _exportable(run, serials, failed=failed, revoked=revoked) if graded else _imported(run, serials)
    )
    calibration = read_calibration(run.table("coefficients"), run.table("covariance"))
    dwells = run.table("dwells")
    out_unit = str(dwells["out_unit"].iloc[0])
    noise, full_scale, nominal = noise_of_units(run), _full_scales(run), _nominal(run, out_unit) if graded else None
    left_out = effects_left_out(calibration)
    fitted = dwells[dwells["kind"] != "verification"] if "kind" in dwells else dwells
    calibrations: list[UnitCalibration] = []
    for unit in chosen:
        outcome, grade, reasons = grades.get(unit, (UNGRADED, "none", ""))
        calibrations.append(
            UnitCalibration(
                unit, outcome, grade, out_unit, *polynomials(calibration, unit), _temperatures(dwells, unit), left_out,
                certificates.get(unit), noise.get(unit), full_scale.get(unit), nominal, calibration.axes,
                fitted[fitted["unit"].astype(str) == unit], reasons,
            )
        )  # fmt: skip
    return calibrations


def refuse_fewer_axes(units: Sequence[UnitCalibration], what: str) -> None:
    """Refuse what needs three outputs for a device with one axis or two; ``what`` begins the message."""
    for unit in units:
        if len(unit.axes) < len(AXES):
            raise WrongUse(
                f"{what} needs three axes, and unit {unit.unit} has {', '.join(unit.letters)} alone; "
                "'tumbleline export --format json' has its coefficients"
            )


def refuse_equal_names(units: Sequence[UnitCalibration], names: Sequence[str], language: str) -> None:
    """Refuse two units whose serial numbers become one name in the language of the file."""
    for k, name in enumerate(names):
        if name in names[:k]:
            raise WrongUse(
                f"export: units {units[names.index(name)].unit} and {units[k].unit} are both {name} in {language}, different "
                "names are needed; export them one by one with --units"
            )


UNGRADED = "no limits"
"""The outcome of a unit that was fitted and compared with no limits: that of an import."""

Chosen: TypeAlias = "tuple[Sequence[str], dict[str, tuple[str, str, str]], Mapping[str, validity.Calibration]]"
"""Units to export; outcome, grade and reasons, and certificate by unit."""


def _exportable(run: Run, serials: tuple[str, ...], *, failed: bool, revoked: bool) -> Chosen:
    """The units with coefficients that were compared with limits, by their outcome."""
    refuse_other_procedures(run, "coefficients")
    return graded_units(run, serials, failed=failed, revoked=revoked)


def graded_units(run: Run, serials: tuple[str, ...], *, failed: bool, revoked: bool) -> Chosen:
    """The units that were compared with limits, by their outcome."""
    table = run.table("grades").set_index("unit")
    _refuse(table, serials, failed=failed)
    allowed = ("pass", "fail") if failed else EXPORTABLE
    chosen = [unit for unit in (serials or tuple(table.index)) if table.loc[unit, "outcome"] in allowed]
    if not chosen:
        raise WrongUse(f"run {run.id}: no unit passed, at least one is needed; --include failed takes failed ones, too")
    certificates = stated(run, chosen)
    if not revoked:
        chosen = _not_revoked(run, chosen, certificates, named=bool(serials))
    rows = table.loc[chosen, ["outcome", "grade", "reasons"]].fillna("").astype(str)
    return chosen, dict(zip(chosen, rows.itertuples(index=False, name=None), strict=True)), certificates


def _imported(run: Run, serials: tuple[str, ...]) -> Chosen:
    """The units of an import that was fitted without limits; a captured run without grades is not finished."""
    if run.about.get("capture"):
        raise WrongUse(f"run {run.id} has no grades, they are needed; it is not finished: repeat its 'tumbleline run'")
    if axis := run.about.get("plane_across"):
        raise WrongUse(
            f"run {run.id} was turned about {axis} alone: the scale of {axis} is not known, and a correction needs three "
            f"axes; measure other orientations ('tumbleline fit {run.id}' prints what is known of the others)"
        )
    refuse_other_procedures(run, "coefficients")
    missing = [name for name in ("dwells", "coefficients", "covariance") if name not in run.tables()]
    if missing:
        raise WrongUse(
            f"run {run.id} was imported and has no {', '.join(missing)}; fit it with 'tumbleline fit {run.id} --effects "
            "bias,scale,misalignment' and take the run that this makes"
        )
    units = tuple(dict.fromkeys(run.table("coefficients")["unit"].tolist()))
    _refuse_unknown(serials, units)
    return serials or units, {}, {}


def _full_scales(run: Run) -> dict[str, float]:
    """Full scale of the outputs by unit, output unit; empty where the run has no readings of a capture."""
    readings = run.table("readings") if "readings" in run.tables() else None
    if readings is None or "full_scale" not in readings:
        return {}
    good = readings[readings["status"] == "ok"].groupby("unit")["full_scale"].first().dropna()
    return {str(unit): float(value) for unit, value in good.items()}


def _nominal(run: Run, out_unit: str) -> float | None:
    """Output per g of the preset that a captured run's recipe names, with what its simulated station changes of it."""
    device = str((run.about.get("recipe") or {}).get("device", ""))
    simulation = (run.about.get("station") or {}).get("simulation") or {}
    try:
        preset = load_preset(device, simulation.get("preset_overrides"))
    except RecipeInvalid:  # a device of hardware needs no preset
        return None
    return preset.scale if preset.output_unit == out_unit else None


def _temperatures(dwells: pd.DataFrame, unit: str) -> tuple[float, float]:
    """Lowest and highest temperature of a unit's dwells, °C; the reference temperature where none was recorded."""
    column = next((name for name in ("unit_C", "chamber_C") if name in dwells.columns), None)
    values = [] if column is None else dwells.loc[dwells["unit"] == unit, column].dropna().tolist()
    return (float(min(values)), float(max(values))) if values else (T_REFERENCE, T_REFERENCE)


def revoked_units(run: Run) -> dict[str, validity.Calibration]:
    """Units of a run whose calibration was revoked; they are exported only on request."""
    if "grades" not in run.tables():
        return {}
    states = stated(run, tuple(run.table("grades")["unit"]))
    return {unit: calibration for unit, calibration in states.items() if calibration.state == "revoked"}


def _not_revoked(
    run: Run, chosen: list[str], certificates: Mapping[str, validity.Calibration], *, named: bool
) -> list[str]:
    """Units whose calibration was not revoked; refused where a revoked unit is named, or no unit is left."""
    gone = [unit for unit in chosen if unit in certificates and certificates[unit].state == "revoked"]
    if gone and (named or len(gone) == len(chosen)):
        raise WrongUse(
            f"the calibration of unit {gone[0]} in run {run.id} was revoked ({certificates[gone[0]].reason}), a "
            "valid one is needed; measure the unit again, or take the old coefficients with --include revoked"
        )
    return [unit for unit in chosen if unit not in gone]


def _refuse_unknown(serials: tuple[str, ...], units: Collection[str]) -> None:
    for unit in serials:
        if unit not in units:
            raise WrongUse(f"no unit {unit} in this run; {did_you_mean(unit, units)}")


def _refuse(grades: pd.DataFrame, serials: tuple[str, ...], *, failed: bool) -> None:
    _refuse_unknown(serials, grades.index.tolist())
    for unit in serials:
        outcome, reasons = grades.loc[unit, "outcome"], plain_reason(str(grades.loc[unit, "reasons"]))
        if outcome == "refused":
            raise WrongUse(
                f"the data of unit {unit} were refused ({reasons}), so it has no coefficients; measure it again"
            )
        if outcome == "fail" and not failed:
            raise WrongUse(f"unit {unit} failed ({reasons}); --include failed takes its coefficients")


def effects_left_out(calibration: Calibration) -> tuple[str, ...]:
    """Effects of a model that polynomials of temperature cannot hold."""
    return tuple(effect for effect in calibration.effects if effect not in {*BIAS, *SCALE, *ACROSS})


def polynomials(calibration: Calibration, unit: str) -> tuple[Array, Array]:
    """Bias (4, 3) and response (4, 3, 3) of a unit as coefficients of θ⁰ … θ³."""
    u = calibration.units.index(unit)
    axes = calibration.axes
    bias, response = np.zeros((ORDER, len(axes))), np.zeros((ORDER, len(axes), 3))
    for power, effect in enumerate(BIAS):
        values = calibration.value(effect)[u]
        if values.size:
            bias[power] = values[:, 0]
    for power, effect in enumerate(ACROSS):
        values = calibration.value(effect)[u]
        if values.size:
            for row, axis in enumerate(axes):
                # one column where the poses of a device with fewer axes show one direction across
                names = [name for name_of, name in calibration.names[row] if name_of == effect]
                shown = others(axis) if len(names) > 1 else ["xyz".index(names[0][-1])]
                response[power, row, shown] = values[row]
    for power, effect in enumerate(SCALE):
        values = calibration.value(effect)[u]
        if values.size:
            # the temperature acts on the whole row: S(θ)·M
            rows = axis_rows(of_every_axis(response[0], axes)) if power else np.eye(3)
            response[power] += values * rows[list(axes)]
    return bias, response
