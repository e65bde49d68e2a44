"""IEEE 1451.4: what a data sheet in a sensor states beside its calibration, and the bits of basic TEDS and template 25.

Fields follow one another without gaps, each with its lowest bit first. A page of the memory has 32 bytes; the first makes their
sum 0 modulo 256. Sources that agree, read in 2026: NI, "An Overview of IEEE 1451.4 Transducer Electronic Data Sheets" (widths of
basic TEDS; units, ranges and tolerances of template 25); the readers SDLMA-Core ``teds.py`` (fields and widths; the bits of a
4507 B accelerometer, which settle selectors, polarity, initials, and order and widths of the transfer function) and Zetlab
``TEDS.cpp`` (widths, checksum); L-Card ``ltedsapi_stdtmpl.h`` (meaning of the enumerations and of the transfer function).
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from datetime import date
from math import log, log1p
from typing import Any

from schemas.errors import WrongUse, did_you_mean
from schemas.foreign import shown

PAGE_BYTES = 32
HIGHEST_SERIAL = 2**24 - 1
_EXAMPLE = "--set teds=manufacturer=17,model=4507,version=B5,mass_g=4.6,initials=QA"
_EPOCH = date(1998, 1, 1)
_TEMPLATE = 25
_END = 3  # selector: no further template
_NO_USER_DATA = 1


@dataclass(frozen=True)
class ConRelRes:
    """A number with constant relative resolution: start·(1 + 2·tolerance)ⁿ with n in some bits."""

    what: str
    unit: str
    start: float
    tolerance: float
    bits: int

    def code(self, value: float) -> int:
        """The n nearest to a value above 0.

        Raises
        ------
        WrongUse
            No n is that near. The published ranges end one below the word whose bits are all set.
        """
        n = round(log(value / self.start) / log1p(2.0 * self.tolerance))
        highest = 2**self.bits - 2
        if not 0 <= n <= highest:
            raise WrongUse(
                f"export: {self.what}: found {value:g} {self.unit}, template {_TEMPLATE} states {self.start:g} to "
                f"{self.value(highest):.3g} {self.unit}; correct it, or export another format"
            )
        return n

    def value(self, code: int) -> float:
        """The value that a reader decodes from the code n."""
        return self.start * (1.0 + 2.0 * self.tolerance) ** code

    def stated(self, value: float) -> float:
        """The value that a reader decodes after it was encoded, which is rounded."""
        return self.value(self.code(value))


SENSITIVITY = ConRelRes("sensitivity", "V/(m/s²)", 5e-7, 1.5e-4, 16)
HIGH_PASS = ConRelRes("high-pass frequency", "Hz", 0.005, 0.03, 8)
MASS = ConRelRes("mass", "g", 0.1, 0.1, 6)
REFERENCE = ConRelRes("reference frequency", "Hz", 0.35, 0.0175, 8)
POLE = ConRelRes("low-pass frequency", "Hz", 10.0, 0.05, 7)
RESONANCE = ConRelRes("resonance frequency", "Hz", 100.0, 0.01, 9)
QUALITY = ConRelRes("quality factor", "1", 0.4, 0.01, 9)
_NO_SLOPE, _NO_TEMPERATURE = 63, 32  # −6.3 % a decade and −0.8 %/°C are code 0, in steps of 0.1 and 0.025


_RANGES = {
    "manufacturer": (17, 16381),
    "model": (0, 32767),
    "mass_g": (MASS.start, MASS.value(2**MASS.bits - 2)),
    "period_days": (1, 4094),
    "days_after_1998": (0, 65534),
}
_TEXTS = {"version": (r"[A-Z](\d|[1-5]\d|6[0-3])", "A0 to Z63"), "initials": (r"[A-Z]{1,3}", "one to three of A to Z")}


@dataclass(frozen=True)
class DataSheet:
    """Entries of the TEDS that a run does not contain, and the day of the measurement.

    manufacturer : number given by IEEE; model : the maker's number; version : letter and number; mass_g : of the sensor
    initials : of who calibrated; period_days : to the next calibration; None: not stated, and 0 in the page
    """

    manufacturer: int
    model: int
    version: str
    mass_g: float
    initials: str
    measured: str
    period_days: int | None = None

    def __post_init__(self) -> None:
        """Refuses what the bits cannot hold."""
        for key, (low, high) in _RANGES.items():
            value = getattr(self, key)
            if value is not None and not low <= value <= high:
                raise WrongUse(f"export: TEDS: {key}: found {value}, {low:g} to {high:.5g} is needed; correct it")
        for key, (pattern, needed) in _TEXTS.items():
            if not re.fullmatch(pattern, getattr(self, key), flags=re.ASCII):
                raise WrongUse(
                    f"export: TEDS: {key}: found '{shown(getattr(self, key))}', {needed} is needed; correct it"
                )

    @property
    def days_after_1998(self) -> int:
        """The day of the measurement, from 1 January 1998."""
        return (date.fromisoformat(self.measured) - _EPOCH).days


def data_sheet(text: str, measured: str) -> DataSheet:
    """The data sheet from ``KEY=VALUE,…`` and the day of the measurement.

    Raises
    ------
    WrongUse
        A key is unknown or missing, or a value is none of those that the bits hold.
    """
    pairs = [part.partition("=") for part in text.split(",") if part.strip()]
    given = {key.strip(): value.strip() for key, _, value in pairs}
    known = [field.name for field in fields(DataSheet) if field.name != "measured"]
    for key in given:
        if key not in known:
            raise WrongUse(f"--set teds: no key is called '{shown(key)}'; {did_you_mean(key, known)}")
    if missing := [key for key in known if not given.get(key) and key != "period_days"]:
        raise WrongUse(
            f"--set teds: found no {', '.join(missing)}, a run does not contain it; add it, as in {_EXAMPLE}"
        )
    kinds = {"manufacturer": int, "model": int, "mass_g": float, "period_days": int}
    values: dict[str, Any] = dict(given)
    for key in values.keys() & kinds:
        try:
            values[key] = kinds[key](given[key])
        except ValueError:
            raise WrongUse(
                f"--set teds: {key}: found '{shown(given[key])}', a number is needed; correct it, as in {_EXAMPLE}"
            ) from None
    return DataSheet(**values, measured=measured)


@dataclass(frozen=True)
class TransferFunction:
    """1/(1 + jf/pole) · 1/(1 + jf/(Q·resonance) + (jf/resonance)²), without slope and temperature coefficient; Hz."""

    pole_hz: float
    resonance_hz: float
    quality: float

    @property
    def bits(self) -> list[tuple[int, int]]:
        """The fields of the transfer function, as (code, bits)."""
        return [
            (POLE.code(self.pole_hz), 7), (RESONANCE.code(self.resonance_hz), 9), (QUALITY.code(self.quality), 9),
            (_NO_SLOPE, 7), (_NO_TEMPERATURE, 6),
        ]  # fmt: skip


@dataclass(frozen=True)
class Accelerometer:
    """The entries of template 25 for one axis: an accelerometer with fixed sensitivity.

    sensitivity : V/(m/s²), negative where the output falls with the force; axis : 0 to 2; reference_C : 15 to 30 °C
    """

    axis: int
    sensitivity: float
    high_pass_hz: float = HIGH_PASS.start
    reference_hz: float = REFERENCE.start
    reference_C: float = 25.0
    transfer: TransferFunction | None = None


def page(sheet: DataSheet, serial: int, accelerometer: Accelerometer) -> bytes:
    """The 32 bytes with basic TEDS and template 25."""
    letter, number = sheet.version[0], int(sheet.version[1:])
    basic = [(sheet.manufacturer, 14), (sheet.model, 15), (_letters(letter), 5), (number, 6), (serial, 24)]
    template = [
        (0, 2), (_TEMPLATE, 8),  # selector of a template of IEEE
        (0, 1), (0, 1),  # accelerometer, no switching of the sensitivity
        (SENSITIVITY.code(abs(accelerometer.sensitivity)), 16),
        (HIGH_PASS.code(accelerometer.high_pass_hz), 8), (accelerometer.axis, 2),
        (MASS.code(sheet.mass_g), 6), (int(accelerometer.sensitivity < 0.0), 1),
        (int(accelerometer.transfer is not None), 1), *(accelerometer.transfer.bits if accelerometer.transfer else ()),
        (REFERENCE.code(accelerometer.reference_hz), 8), (round(2.0 * (accelerometer.reference_C - 15.0)), 5),
        (sheet.days_after_1998, 16), (_letters(sheet.initials), 15), (sheet.period_days or 0, 12),
        (0, 11),  # place of the measurement
        (_END, 2), (_NO_USER_DATA, 1),
    ]  # fmt: skip
    content = _packed([*basic, *template]).ljust(PAGE_BYTES - 1, b"\0")
    return bytes([-sum(content) % 256]) + content


def _letters(text: str) -> int:
    """Letters of five bits, A = 1; a blank is 0."""
    return sum((ord(letter) - ord("A") + 1) << (5 * k) for k, letter in enumerate(text))


def _packed(parts: Iterable[tuple[int, int]]) -> bytes:
    """The (value, bits) pairs packed bit by bit, least significant first."""
    packed = at = 0
    for value, bits in parts:
        packed |= value << at
        at += bits
    return packed.to_bytes(-(-at // 8), "little")
