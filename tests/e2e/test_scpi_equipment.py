"""Equipment by SCPI on its line: the level loop of the exciter, refusals, safe states; adapters that know no plant."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import cast

import pytest
from each import each
from root_process import ROOT
from small_station import lot_of

from inertial.dynamics.sine_fit import fit_tone
from schemas.errors import OperatorNeeded, StationRefused
from schemas.fault import FaultOrder
from schemas.station import load_station, with_faults
from schemas.station_devices import Device, Equipment
from stations import open_station
from stations.clock import Clock
from stations.devices.commands import Values
from stations.devices.equipment import RecordingSpoilt
from stations.devices.families.scpi_supply import ScpiSupply
from stations.station import Station

FAMILIES = ROOT / "stations" / "devices" / "families"


EXCITER = {"exciter": Device(profile="scpi_exciter", device_id=241, link="ascii")}
SHOCK_MACHINE = {"shock_machine": Device(profile="modbus_shock", device_id=60, link="tcp")}


@contextmanager
def opened(equipment: dict[str, Device], *faults: str, units: int = 1) -> Iterator[Station]:
    config = load_station().model_copy(update={"equipment": Equipment(**equipment)})
    orders = [FaultOrder(kind=kind) for kind in faults]
    with open_station(with_faults(config, orders), lot_of(units), roles=[*equipment]) as station:
        yield station


@each([(20.0, 0.3), (160.0, 2.0), (900.0, 5.0)])
def test_the_level_of_an_open_loop_generator_is_reached(case: tuple[float, float]) -> None:
    frequency, level = case
    with opened(EXCITER) as station:
        recording = station.equipment["exciter"].sine(frequency, level, 2, 0.2, [0])
        tone = fit_tone(recording.reference, recording.reference_rate_hz, frequency)
        assert abs(tone.value[2]) == pytest.approx(level, rel=0.12)
        assert recording.outputs[0].shape[1] == 3


def test_a_level_beyond_the_exciter_and_a_missed_trigger_give_no_recording() -> None:
    with opened(EXCITER) as station, pytest.raises((OperatorNeeded, RecordingSpoilt)):
        station.equipment["exciter"].sine(5.0, 5.0, 2, 0.2, [0])
    with opened(EXCITER, "missed_trigger") as station, pytest.raises(RecordingSpoilt, match="trigger"):
        station.equipment["exciter"].sine(80.0, 1.0, 2, 0.1, [0])


def test_the_supply_sets_measures_and_returns_to_its_nominal_voltage() -> None:
    with open_station(load_station(), lot_of(1), roles=["power_supply"]) as station:
        supply = station.equipment["power_supply"]
        nominal = station.reader.instruments().supply_V[0]
        ratio = supply.set_voltage(0.9 * 3.3)
        assert station.reader.instruments().supply_V[0] / nominal == pytest.approx(ratio, rel=1e-3)
        supply.stand_by()
        assert station.reader.instruments().supply_V[0] == pytest.approx(nominal, rel=1e-3)
        for volt in (60.0, 12.0, float("nan")):  # in the range of the supply or not: devices for 3.3 V do not endure it
            with pytest.raises(StationRefused, match=r"at most 50 % from the nominal 3\.3 V"):
                supply.set_voltage(volt)
        assert station.reader.instruments().supply_V[0] == pytest.approx(nominal, rel=1e-3)
        supply.set_voltage(3.0)
        assert "power supply stopped" in station.make_safe().done
        assert station.reader.instruments().supply_V[0] == pytest.approx(nominal, rel=1e-3)


class Queue:
    """A supply whose queue has errors that somebody else has caused."""

    name = "power supply"

    def __init__(self, codes: list[int]) -> None:
        self.codes, self.set, self.profile = codes, 3.3, SimpleNamespace(stated={})

    def number(self, name: str) -> float:
        if name == "error":
            return float(self.codes.pop(0)) if self.codes else 0.0
        return self.set

    def has(self, name: str) -> bool:
        return name != "ripple"

    def write(self, name: str, value: object) -> None:
        if name == "voltage":
            self.set = float(str(value))


def supply_with(codes: list[int]) -> tuple[Queue, ScpiSupply]:
    queue = Queue(codes)
    return queue, ScpiSupply(cast("Values", queue), cast("Clock", SimpleNamespace(sleep=lambda seconds: None)))


def test_errors_of_earlier_users_of_a_supply_are_not_those_of_our_orders_unless_they_never_end() -> None:
    queue, supply = supply_with([-113, -222, -410])
    assert supply.set_voltage(3.0) == pytest.approx(3.0 / 3.3)
    queue.codes.append(-222)
    with pytest.raises(StationRefused, match=r"error -222 at 2\.8 V"):
        supply.set_voltage(2.8)
    _, endless = supply_with([-350] * 1000)
    with pytest.raises(StationRefused, match="queue is not empty, an end is needed"):
        endless.set_voltage(3.0)


TROUBLE = {
    "guard_door": (OperatorNeeded, "guard door is open"),
    "missed_trigger": (RecordingSpoilt, "trigger was missed"),
    "level_not_reached": (RecordingSpoilt, "was ordered"),
}


def test_a_shock_machine_by_modbus_is_armed_released_and_read_and_gives_no_recording_in_trouble() -> None:
    with opened(SHOCK_MACHINE, units=2) as station:
        recording = station.equipment["shock_machine"].shock(30.0, 0.011, 2, -1, [0, 1])
        assert float(recording.reference[:, 2].min()) == pytest.approx(-30.0, rel=0.15)
        assert set(recording.outputs) == {0, 1}
        assert "shock machine stopped" in station.make_safe().done
    for kind, (error, text) in TROUBLE.items():
        with opened(SHOCK_MACHINE, kind) as station, pytest.raises(error, match=text):
            station.equipment["shock_machine"].shock(30.0, 0.011, 2, 1, [0])


def test_production_adapters_of_equipment_know_no_plant() -> None:
    for path in FAMILIES.glob("*.py"):
        assert "plant" not in path.read_text(encoding="utf-8"), path.name
