"""What an export states that a run does not contain: conventions of the receiver, and what its firmware does besides."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from inertial.dynamics.output_filter import OutputFilter
from inertial.noise.bias_filter import first_covariances, transitions_by_axis
from inertial.noise.gauss_markov import BiasModel, bias_model
from pipelines.archive import Run
from pipelines.export.corrected import fit_of_unit, steps_flicker, terms_of_unit
from pipelines.export.polynomials import UnitCalibration
from pipelines.export.teds import DataSheet
from pipelines.stages.uncertainty.budget_terms import archived_terms
from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown
from schemas.units import MICRO

ARITHMETICS = ("double", "float", "q24")
HIGHEST_ID = 2**31 - 1
MOST_SENSORS = 4


@dataclass(frozen=True)
class Firmware:
    """What firmware does behind a correction: a low-pass, and models of the bias by unit with steps of ``step_s``."""

    low_pass: OutputFilter | None = None
    bias: dict[str, BiasModel] | None = None
    step_s: float = 1.0

    def names(
        self, literal: Callable[[Any], str], braces: Callable[[Any, Callable[[Any], str]], str]
    ) -> dict[str, str]:
        """Values of the fields in the template of the low-pass; empty without a low-pass."""
        low_pass = self.low_pass
        if low_pass is None:
            return {}
        steady = np.concatenate([low_pass.steady(np.ones(1))[:, 0], [0.0]])
        return {
            "FILTER": f"{low_pass.kind}, {low_pass.numerator.size} coefficients",
            "CUTOFF": f"{low_pass.cutoff_hz:.6g}",
            "RATE": f"{low_pass.rate_hz:.9g}",
            "DELAY": f"{1e3 * low_pass.delay_s:.4g}",
            "TAPS": str(low_pass.numerator.size),
            "B": braces(low_pass.numerator, literal),
            "A": braces(low_pass.denominator, literal),
            "STEADY": braces(steady, literal),
        }

    def models(
        self, symbols: dict[str, str], literal: Callable[[Any], str], braces: Callable[[Any, Callable[[Any], str]], str]
    ) -> dict[str, str]:
        """Values of the fields in the template of the bias model: ``symbols`` are the C names of the units."""
        if not self.bias:
            return {}
        texts: list[str] = []
        parts = 0
        for unit, model in self.bias.items():
            keep, grown = transitions_by_axis(model, self.step_s, mean=True)
            tables = (keep[0], grown, first_covariances(model), model.white**2 / self.step_s)
            inner = ",\n    ".join(braces(table, literal) for table in tables)
            texts.append(f"static const tumbleline_bias_model tumbleline_bias_{symbols[unit]} = {{\n    {inner}\n}};\n")
            parts = keep.shape[-1]
        return {
            "STEP": f"{self.step_s:g}",
            "PARTS": str(parts),
            "PROCESSES": str(parts - 2),
            "MODELS": "\n".join(texts),
        }


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
        if self.arithmetic not in ARITHMETICS:
            raise WrongUse(
                f"--set arithmetic: found '{shown(self.arithmetic)}'; {did_you_mean(self.arithmetic, ARITHMETICS)}"
            )
        if not 0 <= self.sensor < MOST_SENSORS:
            raise WrongUse(f"--set sensor: found {self.sensor}, 0 to {MOST_SENSORS - 1} is needed; correct it")
        if self.rate_hz is not None and not self.rate_hz > 0.0:
            raise WrongUse(f"--rate: found {self.rate_hz:g} Hz, a rate above 0 is needed; correct it")
        if self.counts_per_g < 1:
            raise WrongUse(f"--set counts_per_g: found {self.counts_per_g}, 1 or more is needed; correct it")

    def nominal_for(self, unit: UnitCalibration, what: str) -> float:
        """The driver's output per g: the given value, else that of the unit's preset; refused where neither states it."""
        nominal = unit.nominal if self.nominal is None else self.nominal
        if nominal is None or not nominal > 0.0:
            found = "none is given and no preset states it" if nominal is None else f"{nominal:g}"
            raise WrongUse(
                f"export: nominal scale of unit {unit.unit}: {found}, a positive output per g is needed for {what} (their driver "
                "divides by it); give it with --set nominal=N"
            )
        return nominal


def device_ids(text: str, units: Sequence[str]) -> dict[str, int]:
    """Identifications by unit from ``ID`` for one unit, or ``UNIT=ID,…`` for several.

    Raises
    ------
    WrongUse
        An identification is not a number, a unit is not exported, or two units share an identification.
    """
    ids: dict[str, int] = {}
    for part in filter(None, map(str.strip, text.split(","))):
        unit, equals, number = part.rpartition("=")
        if not equals and len(units) != 1:
            raise WrongUse(
                f"--set device_id: found '{shown(part)}' for {len(units)} units, one for each is needed as UNIT=ID,…; or choose "
                "one unit with --units"
            )
        unit = unit.strip() if equals else units[0]
        if unit not in units:
            raise WrongUse(f"--set device_id: unit '{shown(unit)}' is not exported; {did_you_mean(unit, units)}")
        ids[unit] = _number(number.strip() if equals else part)
    if len(set(ids.values())) < len(ids):
        raise WrongUse(
            f"--set device_id: found '{shown(text)}', a different number for each unit is needed; an autopilot "
            "identifies its sensors by it; correct it"
        )
    return ids


def _number(text: str) -> int:
    number = 0
    with suppress(ValueError):
        number = int(text, 0)
    if not 0 < number <= HIGHEST_ID:
        raise WrongUse(
            f"--set device_id: found '{shown(text)}', a whole number from 1 to {HIGHEST_ID} is needed, as in the "
            "autopilot's parameter of the sensor; correct it"
        )
    return number


def bias_models(run: Run, serials: Sequence[str], step_s: float, turn_on_ug: float | None) -> dict[str, BiasModel]:
    """The models of the bias that ``correct`` tracks with, by unit, from the noise of its static record.

    Parameters
    ----------
    turn_on_ug : change of the bias from one switch-on to the next; None: that of the run

    Raises
    ------
    WrongUse
        Neither is known, or the run has no static record.
    """
    terms = archived_terms(run.about)
    if turn_on_ug is None and terms is not None and terms.stability is not None:
        turn_on_ug = terms.stability.switch_on_ug
    if turn_on_ug is None:
        raise WrongUse(
            f"export: run {run.id} states no change of the bias from switch-on to switch-on, the "
            "filter of the bias needs it; add --set turn_on=UG"
        )
    models: dict[str, BiasModel] = {}
    for serial in serials:
        noise = terms_of_unit(fit_of_unit(run, serial, failed=True, revoked=True))[0]
        flicker = steps_flicker(step_s, 0.0)
        models[serial] = bias_model(noise.white, noise.instability, noise.walk, turn_on_ug / MICRO, flicker)
    return models
