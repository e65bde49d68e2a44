"""Devices on serial lines and behind TLS, driven by the production adapters through a station's file."""

from contextlib import contextmanager

import pytest
from other_devices import station_with
from plant_wires import Authority, SerialPlantServer, TlsPlantServer, serial_line
from small_station import lot_of, plant_of

from schemas.errors import LinkLost, RecipeInvalid, StationRefused, StationTimeout
from schemas.station import StationConfig
from stations.links import serial_wire
from stations.opening import open_devices
from stations.profile_files import load_profile, profile_names

CHAMBERS = [n for n in profile_names() if load_profile(n).kind == "chamber" and "rtu" in load_profile(n).links]
PATIENCE_S = 10.0
DRIVES = [n for n in profile_names() if load_profile(n).kind == "axis"]


def hardware(config, **carried) -> StationConfig:
    """The same station as if it were hardware, every device carried so."""
    tables = config.model_dump(exclude_unset=True)
    for place in config.devices.model_dump():
        device = tables["devices"][place]
        tables["devices"][place] = {k: device[k] for k in ("profile", "device_id")} | carried
    tables |= {"kind": "modbus", "link": {"timeout_s": 1.0, "read_attempts": 2}, "uncertainty": None}
    return StationConfig.model_validate(tables)


@contextmanager
def on_a_serial_line(**link):
    """A plant, its serial line, and a station on it that asks once and has much patience."""
    config = station_with()
    plant = plant_of(config, lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        real = hardware(config, link="rtu", serial=line.host, baud=115200, parity="none")
        patient = {"read_attempts": 1, "timeout_s": PATIENCE_S, **link}
        real = real.model_copy(update={"link": real.link.model_copy(update=patient)})
        with open_devices(real, ()) as station:
            yield plant, line, station


def wire_of(station):
    return station.chamber._values._link._link._wire


def refuses_to_wait(station):
    """The set point of the chamber is asked for with little patience, where no answer can come."""
    wire = wire_of(station)
    wire.timeout_s = 0.1
    with pytest.raises(StationTimeout):
        station.chamber.set_point()
    wire.timeout_s = PATIENCE_S


@pytest.mark.parametrize("name", CHAMBERS)
def test_chambers_answer_on_a_serial_line(name):
    config = station_with(chamber=name)
    plant = plant_of(config, lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        real = hardware(config, link="rtu", serial=line.host, baud=115200, parity="none")
        with open_devices(real, ()) as station:
            station.chamber.set_temperature(30.0)
            assert station.chamber.temperature() == pytest.approx(23.0, abs=0.2)
    assert plant.fixture.chamber.set_point == 30.0


@pytest.mark.parametrize("name", DRIVES)
def test_drives_move_on_a_serial_line(name):
    config = station_with(axis=name)
    plant = plant_of(config, lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        real = hardware(config, link="rtu", serial=line.host, baud=115200, parity="none")
        with open_devices(real, (0,)) as station:
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


def test_a_serial_answer_with_a_wrong_check_is_asked_for_again_and_never_believed():
    config = station_with()
    plant = plant_of(config, lot_of(1))
    with serial_line() as line, SerialPlantServer(plant, line.device):
        real = hardware(config, link="rtu", serial=line.host, baud=115200, parity="none")
        with open_devices(real, ()) as station:
            station.chamber.temperature()
            line.to_host.append(corrupted)
            assert station.chamber.temperature() == pytest.approx(23.0, abs=0.2)  # the second attempt
            line.to_host += [
                corrupted,
                lambda data: data,
                corrupted,
            ]  # between them the device's sign that it is heard again
            with pytest.raises(LinkLost, match=r"no valid answer to 'read chamber temperature .* \(CRC "):
                station.chamber.temperature()


def test_a_serial_answer_that_comes_late_is_heard_out_before_the_next_question(monkeypatch):
    with on_a_serial_line() as (plant, line, station):
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
    with on_a_serial_line() as (plant, line, station):
        line.to_host += [line.hold, *([] if knows_echo else [unheard]), line.behind_what_is_held]
        for _ in range(1 if knows_echo else 2):
            refuses_to_wait(station)
        plant.fixture.chamber.set_point = 50.0
        assert station.chamber.set_point() == 50.0
        assert not line.held
        assert not line.to_host
        assert station.chamber.set_point() == 50.0


def test_a_serial_answer_with_more_behind_it_is_not_believed():
    with on_a_serial_line() as (_, line, station):
        line.to_host.append(lambda data: data + data)
        with pytest.raises(LinkLost, match="bytes after"):
            station.chamber.set_point()


def test_a_line_that_nobody_answers_on_costs_one_time_out_an_attempt(monkeypatch):
    config, waited, read = station_with(), [], serial_wire.Serial.read

    def noted(port, size=1):
        waited.append(port.timeout)
        return read(port, size)

    monkeypatch.setattr(serial_wire.Serial, "read", noted)
    with serial_line() as line:
        real = hardware(config, link="rtu", serial=line.host, baud=115200, parity="none")
        real = real.model_copy(update={"link": real.link.model_copy(update={"read_attempts": 1, "timeout_s": 0.2})})
        with (
            open_devices(real, ()) as station,
            pytest.raises(StationTimeout, match=f"{line.host} device 3: no answer"),
        ):
            station.chamber.temperature()
    assert len(waited) == 1
    assert 0.0 < waited[0] <= 0.2
    assert line.heard


def test_a_terminal_that_is_not_there_is_told_by_name():
    real = hardware(station_with(), link="rtu", serial="/dev/none", baud=19200)
    with open_devices(real, ()) as station, pytest.raises(LinkLost, match="/dev/none"):
        station.chamber.temperature()


@pytest.fixture
def secured(tmp_path):
    """A plant behind TLS that asks clients for certificates, and what a client needs."""
    config = station_with()
    plant = plant_of(config, lot_of(1))
    authority = Authority(tmp_path)
    certificate, key = authority.issue("station")
    with TlsPlantServer(plant, certificate, key, clients=authority.file) as server:
        yield config, plant, authority, {"link": "tls", "host": server.host, "port": server.port}


def test_a_station_behind_tls_is_driven_when_both_sides_are_who_they_say(secured):
    config, plant, authority, where = secured
    mine, my_key = authority.issue("client")
    files = {"ca_file": str(authority.file), "certificate_file": str(mine), "key_file": str(my_key)}
    with open_devices(hardware(config, **where, **files), (0,)) as station:
        station.chamber.set_temperature(31.0)
        assert station.reader.slots[0].identity().serial == "U000"
    assert plant.fixture.chamber.set_point == 31.0


def test_a_device_of_another_authority_is_not_believed(secured, tmp_path):
    config, plant, _, where = secured
    (tmp_path / "other").mkdir()
    other = Authority(tmp_path / "other")
    files = {"ca_file": str(other.file)}
    with open_devices(hardware(config, **where, **files), ()) as station, pytest.raises(LinkLost, match="certificate"):
        station.chamber.set_temperature(31.0)
    assert plant.fixture.chamber.set_point == 23.0


def test_a_device_under_another_name_is_not_believed(secured):
    config, _, authority, where = secured
    files = {"ca_file": str(authority.file), "server_name": "chamber.line-1"}
    with open_devices(hardware(config, **where, **files), ()) as station, pytest.raises(LinkLost, match="certificate"):
        station.chamber.temperature()


def test_a_client_without_a_certificate_is_turned_away(secured):
    config, _, authority, where = secured
    real = hardware(config, **where, ca_file=str(authority.file))
    with open_devices(real, ()) as station, pytest.raises(LinkLost):
        station.chamber.temperature()


def test_a_key_that_is_not_there_is_told_by_name(secured, tmp_path):
    config, _, authority, where = secured
    files = {"ca_file": str(authority.file), "certificate_file": "none.pem", "key_file": "none.key"}
    with pytest.raises(RecipeInvalid, match=r"none\.pem"), open_devices(hardware(config, **where, **files), ()):
        pass


def test_settings_that_a_line_cannot_have_are_told_or_taken():
    # pseudo-terminals know no parity on some kernels: whatever they do, it is an answer by name
    with serial_line() as line:
        real = hardware(station_with(), link="rtu", serial=line.host, baud=19200, parity="even")
        real = real.model_copy(update={"link": real.link.model_copy(update={"read_attempts": 1, "timeout_s": 0.1})})
        with open_devices(real, ()) as station, pytest.raises((LinkLost, StationTimeout), match=line.host):
            station.chamber.temperature()


def test_a_device_that_has_no_tls_is_not_asked_for_it(secured):
    _, _, authority, where = secured
    real = hardware(station_with(chamber="espec_p300"), **where, ca_file=str(authority.file))
    with pytest.raises(RecipeInvalid, match="is carried by ascii"), open_devices(real, ()):
        pass
