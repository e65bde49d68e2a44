"""Devices on serial lines, behind TLS and by SCPI, driven by the production adapters: wires, levels, refusals, safe states."""

from collections.abc import Iterator
from contextlib import contextmanager
from types import SimpleNamespace
from typing import cast

import pytest
from each import each
from other_devices import station_with
from plant_wires import Authority, SerialPlantServer, TlsPlantServer, serial_line
from root_process import ROOT
from small_station import lot_of, plant_of

from inertial.dynamics.sine_fit import fit_tone
from schemas.errors import LinkLost, OperatorNeeded, RecipeInvalid, StationRefused, StationTimeout
from schemas.fault import FaultOrder
from schemas.station import StationConfig, load_station, with_faults
from schemas.station_devices import Device, Equipment
from stations import open_station
from stations.clock import Clock
from stations.devices.commands import Values
from stations.devices.equipment import RecordingSpoilt
from stations.devices.families.scpi_supply import ScpiSupply
from stations.links import serial_wire
from stations.opening import open_devices
from stations.profile_files import load_profile, profile_names
from stations.station import Station

CHAMBERS = [n for n in profile_names() if load_profile(n).kind == "chamber" and "rtu" in load_profile(n).links]
PATIENCE_S = 10.0
DRIVES = [n for n in profile_names() if load_profile(n).kind == "axis" and "rtu" in load_profile(n).links]


def hardware(config: StationConfig, patience: dict[str, object] | None = None, **carried: object) -> StationConfig:
    """The same station as if it were hardware, every device carried so; asked twice, with a second of patience."""
    tables = config.model_dump(exclude_unset=True)
    for place in config.devices.model_dump():
        device = tables["devices"][place]
        tables["devices"][place] = {k: device[k] for k in ("profile", "device_id")} | carried
    tables |= {"kind": "modbus", "link": {"timeout_s": 1.0, "read_attempts": 2} | (patience or {}), "uncertainty": None}
    return StationConfig.model_validate(tables)


@contextmanager
def on_a_serial_line(slots=(), devices=None, **patience):
    config = station_with(**(devices or {}))
    plant = plant_of(config, lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        real = hardware(config, patience, link="rtu", serial=line.host, baud=115200, parity="none")
        with open_devices(real, slots) as station:
            yield plant, line, station


ONCE = {"read_attempts": 1, "timeout_s": PATIENCE_S}


def wire_of(station):
    return station.chamber._values._link._link._wire


def refuses_to_wait(station):
    """The set point of the chamber is asked for with little patience, where no answer can come."""
    wire = wire_of(station)
    wire.timeout_s = 0.1
    with pytest.raises(StationTimeout):
        station.chamber.set_point()
    wire.timeout_s = PATIENCE_S


@each(CHAMBERS)
def test_chambers_answer_on_a_serial_line(name):
    with on_a_serial_line(devices={"chamber": name}) as (plant, _, station):
        station.chamber.set_temperature(30.0)
        assert station.chamber.temperature() == pytest.approx(23.0, abs=0.2)
        assert plant.fixture.chamber.set_point == 30.0


@each(DRIVES)
def test_drives_move_on_a_serial_line(name):
    with on_a_serial_line((0,), {"axis": name}) as (plant, _, station):
        axis = station.table.axes["inner"]
        axis.start(12.5)
        plant.advance(30_000_000)
        assert axis.arrived()
        axis.confirm(12.5)
        with pytest.raises(StationRefused, match="exception 2"):
            axis._registers._link._link.read(2, 0xFFF0, 1, "nothing")
        assert station.reader.slots[0].identity().serial == "U000"


def corrupted(data: bytes) -> bytes:
    return data[:-3] + bytes([data[-3] ^ 0x10]) + data[-2:]


def test_a_serial_answer_with_a_wrong_check_or_more_behind_it_is_asked_for_again_and_never_believed():
    with on_a_serial_line() as (_, line, station):
        station.chamber.temperature()
        line.to_host.append(corrupted)
        assert station.chamber.temperature() == pytest.approx(23.0, abs=0.2)  # the second attempt
        # between them the device's sign that it is heard again
        line.to_host += [corrupted, lambda data: data, corrupted]
        with pytest.raises(LinkLost, match=r"no valid answer to 'read chamber temperature .* \(CRC "):
            station.chamber.temperature()
    with on_a_serial_line(**ONCE) as (_, line, station):
        line.to_host.append(lambda data: data + data)
        with pytest.raises(LinkLost, match="bytes after"):
            station.chamber.set_point()


def test_a_serial_answer_that_comes_late_is_heard_out_before_the_next_question(monkeypatch):
    with on_a_serial_line(**ONCE) as (plant, line, station):
        line.to_host.append(line.hold)
        refuses_to_wait(station)
        wire = wire_of(station)
        opened = wire._opened

        def opened_as_it_arrives():
            port = opened()
            line.deliver()
            return port

        monkeypatch.setattr(wire, "_opened", opened_as_it_arrives)
        plant.fixture.chamber.set_point = 50.0
        assert station.chamber.set_point() == 50.0


def unheard(data):
    return b""


@pytest.mark.parametrize("knows_echo", [True, False])
def test_a_serial_answer_that_comes_after_two_time_outs_is_not_believed(knows_echo):
    """It arrives when the question has been put again, in front of the answer to that: a frame has no number to tell them."""
    with on_a_serial_line(**ONCE) as (plant, line, station):
        line.to_host += [line.hold, *([] if knows_echo else [unheard]), line.behind_what_is_held]
        for _ in range(1 if knows_echo else 2):
            refuses_to_wait(station)
        plant.fixture.chamber.set_point = 50.0
        assert station.chamber.set_point() == 50.0
        assert not line.held
        assert not line.to_host
        assert station.chamber.set_point() == 50.0


def test_a_line_that_nobody_answers_on_costs_one_time_out_an_attempt(monkeypatch):
    waited, read = [], serial_wire.Serial.read

    def noted(port, size=1):
        waited.append(port.timeout)
        return read(port, size)

    monkeypatch.setattr(serial_wire.Serial, "read", noted)
    once = {"read_attempts": 1, "timeout_s": 0.2}
    with serial_line() as line:
        real = hardware(station_with(), once, link="rtu", serial=line.host, baud=115200, parity="none")
        silent = pytest.raises(StationTimeout, match=f"{line.host} device 3: no answer")
        with open_devices(real, ()) as station, silent:
            station.chamber.temperature()
    assert len(waited) == 1
    assert 0.0 < waited[0] <= 0.2
    assert line.heard


@pytest.fixture
def secured(tmp_path):
    """A plant behind TLS that asks clients for certificates, who signs them, and a station that trusts it."""
    config = station_with()
    plant, authority = plant_of(config, lot_of(1)), Authority(tmp_path)
    certificate, key = authority.issue("station")
    with TlsPlantServer(plant, certificate, key, clients=authority.file) as server:
        trusting = {"link": "tls", "host": server.host, "port": server.port, "ca_file": str(authority.file)}
        yield plant, authority, lambda **files: hardware(config, **trusting | files)


def test_a_station_behind_tls_is_driven_when_both_sides_are_who_they_say(secured):
    plant, authority, station_of = secured
    mine, key = authority.issue("client")
    with open_devices(station_of(certificate_file=str(mine), key_file=str(key)), (0,)) as station:
        station.chamber.set_temperature(31.0)
        assert station.reader.slots[0].identity().serial == "U000"
    assert plant.fixture.chamber.set_point == 31.0


def test_who_is_not_who_he_says_is_not_believed_by_either_side(secured, tmp_path):
    plant, _, station_of = secured
    (tmp_path / "other").mkdir()
    other = str(Authority(tmp_path / "other").file)
    for files, told in (
        ({"ca_file": other}, "certificate"),  # a device of another authority
        ({"server_name": "chamber.line-1"}, "certificate"),  # under another name
        ({}, None),  # a client without a certificate
    ):
        with open_devices(station_of(**files), ()) as station, pytest.raises(LinkLost, match=told):
            station.chamber.set_temperature(31.0)
    assert plant.fixture.chamber.set_point == 23.0
    with (
        pytest.raises(RecipeInvalid, match=r"none\.pem"),
        open_devices(station_of(certificate_file="none.pem", key_file="none.key"), ()),
    ):
        pass


def test_lines_settings_and_carriers_that_cannot_be_are_told_by_name():
    nowhere = hardware(station_with(), link="rtu", serial="/dev/none", baud=19200)
    with open_devices(nowhere, ()) as station, pytest.raises(LinkLost, match="/dev/none"):
        station.chamber.temperature()
    # pseudo-terminals know no parity on some kernels: whatever they do, it is an answer by name
    once = {"read_attempts": 1, "timeout_s": 0.1}
    with serial_line() as line:
        real = hardware(station_with(), once, link="rtu", serial=line.host, baud=19200, parity="even")
        with open_devices(real, ()) as station, pytest.raises((LinkLost, StationTimeout), match=line.host):
            station.chamber.temperature()


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
