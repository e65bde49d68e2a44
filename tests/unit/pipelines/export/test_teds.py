"""TEDS: a second decoder, written from the published fields, reads what the export writes, and a maker's own bits come out."""

from dataclasses import replace
from datetime import date, timedelta

import numpy as np
import pytest
from each import each
from ledger_events import event

from pipelines.certificates.validity import Calibration
from pipelines.export import ExportSettings, UnitCalibration, export_files
from pipelines.export.polynomials import ORDER
from pipelines.export.teds import Accelerometer, DataSheet, TransferFunction, data_sheet, page
from schemas.errors import WrongUse

G = 9.80665
SHEET = DataSheet(17, 4507, "B5", 4.6, "QA", "2026-05-01", 365)
# name and bits of every field, in the order of the page
FIELDS = (
    ("manufacturer", 14), ("model", 15), ("letter", 5), ("number", 6), ("serial", 24), ("selector", 2), ("template", 8),
    ("force", 1), ("switched", 1), ("sensitivity", 16), ("high_pass", 8), ("direction", 2), ("mass", 6), ("negative", 1),
    ("transfer", 1), ("frequency", 8), ("temperature", 5), ("day", 16), ("initials", 15), ("period", 12), ("place", 11),
    ("end", 2), ("end_extended", 1),
)  # fmt: skip
# A 4507 B of Brüel & Kjær as NI writes a virtual TEDS: first bit of a field first, after five bytes of NI's own.
# From SDLMA-Core (MIT), src/sdlma_teds/teds.py at 4bf2c57.
MAKERS = "8803662228909e002601679c22a4da87224894d097620840b68001c000"


def decoded(image: bytes) -> dict[str, int]:
    """The fields of a page: its bits from the lowest of the second byte on."""
    bits = "".join(f"{byte:08b}"[::-1] for byte in image[1:])
    values, at = {}, 0
    for name, width in FIELDS:
        values[name] = int(bits[at : at + width][::-1], 2)
        at += width
    assert "1" not in bits[at:]
    return values


def unit(serial: str = "SN 0042", axes: tuple[int, ...] = (0, 1, 2), scale: float = 0.3) -> UnitCalibration:
    """A device with 0.3 V/g and 20 mg of bias."""
    bias, response = np.zeros((ORDER, len(axes))), np.zeros((ORDER, len(axes), 3))
    bias[0] = 0.02 * scale
    response[0] = scale * (np.diag([1.004, -0.997, 1.011]) + 1e-3 * (1.0 - np.eye(3)))[list(axes)]
    return UnitCalibration(serial, "pass", "none", "V", bias, response, (0.0, 50.0), (), axes=axes)


def files(*units: UnitCalibration, sheet: DataSheet | None = SHEET) -> dict[str, bytes]:
    return export_files("teds", list(units), "run-1", ExportSettings(data_sheet=sheet))


def test_the_bits_of_a_maker_come_out() -> None:
    theirs = "".join(f"{int(digit, 16):04b}" for digit in MAKERS)
    flag = sum(width for _, width in FIELDS[:14])
    assert theirs[flag] == "1"
    # slope −2.7 % a decade and +0.1 %/°C, which a sweep does not state: codes 36 and 36 in place of 63 and 32
    pole, resonance, quality = 10.0 * 1.1**108, 100.0 * 1.02**266, 0.4 * 1.02**275
    theirs = theirs[: flag + 26] + f"{63:07b}"[::-1] + f"{32:06b}"[::-1] + theirs[flag + 39 :]
    transfer = TransferFunction(pole, resonance, quality)
    reference = {"high_pass_hz": 0.248, "reference_hz": 159.75, "reference_C": 23.0}
    one = Accelerometer(0, 0.09585849228848693, transfer=transfer, **reference)
    image = page(DataSheet(17, 4507, "B5", 4.6005, "HH", "2022-11-07", 365), 30985, one)
    ours = "".join(f"{byte:08b}"[::-1] for byte in image[1:])
    assert ours.startswith(theirs.rstrip("0"))
    assert "1" not in ours[len(theirs) :]


def test_a_second_decoder_reads_every_axis() -> None:
    made = files(unit())
    assert sorted(made) == ["SN_0042-x.teds", "SN_0042-y.teds", "SN_0042-z.teds", "SN_0042.txt"]
    for direction, (axis, scale) in enumerate((("x", 1.004), ("y", -0.997), ("z", 1.011))):
        image = made[f"SN_0042-{axis}.teds"]
        assert len(image) == 32
        assert sum(image) % 256 == 0
        own = decoded(image)
        assert own["negative"] == (scale < 0.0)
        assert 5e-7 * 1.0003 ** own["sensitivity"] == pytest.approx(abs(0.3 * scale / G), rel=1.5e-4)
        assert 0.1 * 1.2 ** own["mass"] == pytest.approx(4.6, rel=0.1)
        assert 15.0 + 0.5 * own["temperature"] == 25.0
        assert date(1998, 1, 1) + timedelta(own["day"]) == date(2026, 5, 1)
        assert [chr(64 + (own["initials"] >> 5 * k & 31)) for k in range(3)] == ["Q", "A", "@"]
        known = ("manufacturer", "model", "letter", "number", "serial", "template", "direction", "period", "end")
        assert [own[name] for name in known] == [17, 4507, 2, 5, 42, 25, direction, 365, 3]
        empty = ("selector", "force", "switched", "high_pass", "transfer", "frequency", "place")
        assert not any(own[name] for name in empty)


def test_the_text_says_what_a_reader_gets_and_what_it_leaves() -> None:
    text = files(unit())["SN_0042.txt"].decode()
    for part in ("axis y: 0.030", "negative", "bias, up to 2e+04 µg", "not in this file: misalignment", "AC coupling"):
        assert part in text


@each([((0,), ["x"]), ((0, 1), ["x", "y"])])
def test_a_device_with_fewer_axes_has_an_image_of_each(row: tuple[tuple[int, ...], list[str]]) -> None:
    axes, letters = row
    made = files(unit(axes=axes))
    assert sorted(made) == [*(f"SN_0042-{letter}.teds" for letter in letters), "SN_0042.txt"]
    assert decoded(made["SN_0042-x.teds"]) == decoded(files(unit())["SN_0042-x.teds"])
    left = made["SN_0042.txt"].decode().splitlines()[-1]
    assert left.startswith("largest error of this file against the full calibration, at 1 g: ")


def test_what_teds_do_not_hold_is_refused() -> None:
    digits = "TEDS hold the digits at its end, a number up to 16777215"
    for units, why in (
        ((replace(unit(), out_unit="LSB"),), "output of unit SN 0042 is in LSB, V is needed for TEDS.*export json, csv or c"),
        ((unit("A"),), digits), ((unit("16777216"),), digits), ((unit("A-7"), unit("B-07")), r"units A-7 and B-07.* 7 for both"),
        ((unit(scale=1e-7),), r"sensitivity: found .* template 25 states 5e-07 to 172 V/\(m/s²\)"),
    ):  # fmt: skip
        with pytest.raises(WrongUse, match=why):
            files(*units)
    with pytest.raises(WrongUse, match="days_after_1998: found -1"):
        replace(SHEET, measured="1997-12-31")


def test_a_period_comes_from_the_certificate_or_is_asked_for() -> None:
    open_sheet = replace(SHEET, period_days=None)
    with pytest.raises(WrongUse, match=r"unit SN 0042 is not certified.*period_days=DAYS"):
        files(unit(), sheet=open_sheet)

    def period(until: str, sheet: DataSheet) -> int:
        certified = replace(unit(), certificate=Calibration(event(start="2026-05-01", until=until), until))
        return decoded(files(certified, sheet=sheet)["SN_0042-x.teds"])["period"]

    periods = [period("2027-05-01", open_sheet), period("2026-11-01", open_sheet), period("2028-05-01", SHEET)]
    assert periods == [365, 184, 365]
    with pytest.raises(WrongUse, match="period_days: found 9131, 1 to 4094"):
        period("2051-05-01", open_sheet)


SLIPS = {
    "manufacturer=x": "manufacturer: found 'x', a number",
    "manufacturer=16": "manufacturer: found 16, 17 to 16381",
    "version=1A": "version: found '1A', A0 to Z63",
    "mass_g=nan": "mass_g: found nan, 0.1 to 8114",
    "initials=qa": "initials: found 'qa', one to three",
    "maker=17": "no key is called 'maker'",
}


@each(SLIPS)
def test_a_data_sheet_that_the_bits_cannot_hold_is_refused(slip: str) -> None:
    keys = dict(
        pair.split("=") for pair in f"manufacturer=17,model=1,version=A1,mass_g=1,initials=QA,{slip}".split(",")
    )
    with pytest.raises(WrongUse, match=SLIPS[slip]):
        data_sheet(",".join(f"{name}={value}" for name, value in keys.items()), "2026-05-01")
    with pytest.raises(WrongUse, match="found no manufacturer, model, version, mass_g, initials, a run does not"):
        data_sheet("", "2026-05-01")
