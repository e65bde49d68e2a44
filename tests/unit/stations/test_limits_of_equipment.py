"""Largest values of test equipment: a loose reference cable, motion beyond an exciter, absolute maxima of a station's file."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import pytest
from each import each
from small_station import lot_of

from schemas.errors import OperatorNeeded, RecipeInvalid, StationRefused
from schemas.fault import FaultOrder
from schemas.motion import Motion
from schemas.safety import Suspenders
from schemas.station import Soak, StationConfig, load_station, with_faults
from schemas.station_devices import Device, Equipment
from schemas.vibration_profile import load_vibration_profile
from stations import open_station
from stations.devices.registers import Registers
from stations.plant.families.scpi_generator import Generator
from stations.profile_files import profile_of
from stations.safety.suspenders import Watched


def station_of(role: str, profile: str, faults: list[FaultOrder] | None = None, **maximum: float) -> StationConfig:
    own = Equipment(**{role: Device(profile=profile, device_id=241, link="ascii", maximum=maximum)})
    return with_faults(load_station().model_copy(update={"equipment": own}), faults or [])


@contextmanager
def opened(role: str, profile: str, **maximum: float) -> Iterator[Any]:
    with open_station(station_of(role, profile, **maximum), lot_of(1), roles=[role]) as station:
        yield station.equipment[role]


def drives(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    amplitudes: list[float] = []
    begin = Generator._begin

    def noted(self: Generator) -> None:
        amplitudes.append(self._set["SOUR1:VOLT"])
        begin(self)

    monkeypatch.setattr(Generator, "_begin", noted)
    return amplitudes


@pytest.mark.parametrize("at_s", [0.0, 2.0])
def test_a_loose_reference_cable_is_found_and_does_not_raise_the_drive(
    at_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    volts = drives(monkeypatch)
    station = station_of("exciter", "scpi_exciter", [FaultOrder(kind="reference_cable_off", at_s=at_s)])
    with open_station(station, lot_of(1), roles=["exciter"]) as one:
        exciter = one.equipment["exciter"]
        if at_s:  # it comes loose during the level loop
            exciter.sine(160.0, 2.0, 2, 0.1, [0])
            one.clock.sleep(max(0.0, 3.0 - one.clock.now()))
        before = len(volts)
        with pytest.raises(OperatorNeeded, match="check the cable of the reference sensor"):
            exciter.sine(160.0, 30.0, 2, 0.1, [0])
        assert exciter.values.text("output") == "0"
    assert at_s or len(volts) == 2
    assert max(volts[before:]) <= (0.2 if at_s else 10.0 * volts[0]) * (1.0 + 1e-12)


def test_the_drive_rises_tenfold_at_most_and_not_beyond_the_station_file(monkeypatch: pytest.MonkeyPatch) -> None:
    volts = drives(monkeypatch)
    with opened("exciter", "scpi_exciter") as exciter:
        exciter.sine(160.0, 30.0, 2, 0.1, [0])
    rises = [b / a for a, b in pairwise(volts)]
    assert max(rises) <= 10.0 * (1.0 + 1e-9)
    volts.clear()
    refused = pytest.raises(OperatorNeeded, match=r"at most 0\.5 V is allowed")
    with opened("exciter", "scpi_exciter", amplitude=0.5) as exciter, refused:
        exciter.sine(160.0, 30.0, 2, 0.1, [0])
    assert max(volts) <= 0.5


@pytest.mark.parametrize("profile", ["vibration_controller", "scpi_exciter"])
def test_motion_beyond_the_exciter_is_refused_before_it_moves_and_the_station_file_narrows_it(profile):
    with opened("exciter", profile) as exciter:
        for frequency, level, text in ((8, 5, "displacement"), (30, 31, "velocity"), (500, 51, "acceleration")):
            with pytest.raises(OperatorNeeded, match=rf"peak {text} .* at most .* is allowed"):
                exciter.sine(frequency, level, 2, 0.1, [0])
    if profile != "vibration_controller":
        return
    refused = pytest.raises(OperatorNeeded, match=r"peak displacement .* mm, at most 0\.1 mm")
    with opened("exciter", "vibration_controller", displacement_mm=0.1) as exciter, refused:
        exciter.random("mil_std_810_truck_vertical", 1.04, 2, 2.0, [0])


def test_motion_of_a_flat_profile_agrees_with_its_closed_form() -> None:
    points = load_vibration_profile("flat_20_2000").breakpoints
    flat = [(f, 0.04) for f, _ in points]
    g, w1, w2 = 9.80665, 2.0 * math.pi * flat[0][0], 2.0 * math.pi * flat[-1][0]
    level = math.sqrt(0.04 * (flat[-1][0] - flat[0][0]))
    rms_mm = 1e3 * g * math.sqrt(0.04 / (2.0 * math.pi) * (w1**-3 - w2**-3) / 3.0)
    assert Motion(displacement_mm=3.0 * rms_mm * 1.01).beyond_random(flat, level) == ""
    assert "displacement" in Motion(displacement_mm=3.0 * rms_mm * 0.99).beyond_random(flat, level)
    assert Motion().beyond_sine(1.0, 50.0) == ""


@each([("shock_machine", "arm_release_shock", "peak", 100.0), ("centrifuge", "acutrol_3000", "rate", 500.0),
       ("step_generator", "scpi_step_generator", "amplitude", 1.0)])  # fmt: skip
def test_a_maximum_of_the_station_file_bounds_every_order(row: tuple[str, str, str, float]) -> None:
    role, profile, name, value = row
    with opened(role, profile, **{name: value}) as device:
        device.values.write(name, value)
        with pytest.raises(StationRefused, match="is allowed"):
            device.values.write(name, 1.01 * value)


def test_a_reading_that_is_no_number_agrees_with_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    with open_station(load_station(), lot_of(1)) as station, monkeypatch.context() as patch:
        patch.setattr(Registers, "number", lambda *_: math.nan)
        with pytest.raises(StationRefused, match="samples at nan Hz, 100 Hz is needed"):
            station.reader.start(100.0)
        with pytest.raises(OperatorNeeded, match="stands at nan deg"):
            station.table.axes["outer"].confirm(10.0)


def test_a_supply_keeps_below_the_absolute_maximum_of_the_devices() -> None:
    with open_station(load_station(), lot_of(1), roles=["power_supply"]) as station:
        with pytest.raises(StationRefused, match="states no absolute maximum"):
            station.equipment["power_supply"].set_voltage(4.5)  # less than half above 3.3 V, more than a fifth
        station.equipment["power_supply"].set_voltage(3.9)
    with opened("power_supply", "scpi_supply", voltage=3.6) as supply:
        with pytest.raises(StationRefused, match=r"at most 3\.6 V is allowed"):
            supply.set_voltage(3.7)
        supply.set_voltage(3.5)


def test_the_monitor_holds_the_absolute_maximum_while_a_procedure_sets_the_supply() -> None:
    for most, said in ((3.6, "at most 3.6 V is allowed"), (None, "")):
        watched = Watched(Suspenders(), Soak(), {0: 3.3}, supply_ratio=1.2, **({"most_V": most} if most else {}))
        assert said in (told := watched._supply(0, 3.96))
        assert bool(told) == bool(said)
    assert "maximum" not in Device(profile="scpi_supply", device_id=9).model_dump()  # written as before


def test_a_station_of_hardware_states_the_absolute_maximum_of_its_supply_and_none_of_no_order() -> None:
    content = load_station().model_dump()
    content |= {"kind": "modbus", "simulation": None, "uncertainty": None}
    for device in content["devices"].values():
        device["host"] = "192.0.2.1"
    supply = {"profile": "scpi_supply", "device_id": 9, "link": "ascii", "host": "192.0.2.1"}
    with pytest.raises(ValueError, match=r"maximum\.voltage: missing"):
        StationConfig.model_validate(content | {"equipment": {"power_supply": supply}})
    StationConfig.model_validate(content | {"equipment": {"power_supply": supply | {"maximum": {"voltage": 3.6}}}})
    device = Device(profile="arm_release_shock", device_id=9, link="ascii", maximum={"peek": 100.0})
    with pytest.raises(RecipeInvalid, match="peak"):
        profile_of(device)
    own = profile_of(device.model_copy(update={"maximum": {"peak": 1e9}}))
    assert own.command("peak").maximum == 50000.0  # the profile's own is smaller
