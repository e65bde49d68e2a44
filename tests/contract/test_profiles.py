"""Every profile: read from its file, served by pymodbus, answered as it says, by the same codec on both sides."""

import socket
import struct

import pytest
from each import each
from plant_wires import tcp_link
from small_station import lot_of, plant_of

from schemas.errors import RecipeInvalid, StationRefused
from schemas.profile import Profile
from schemas.station import load_station
from schemas.station_devices import Device, Equipment
from schemas.toml_files import parse_as
from stations.codec import NotEncodable, encode
from stations.devices.registers import Registers
from stations.plant.preset import load_preset, preset_names
from stations.plant.server import PlantServer
from stations.profile_files import load_profile, profile_names

WITH_REGISTERS = [name for name in profile_names() if load_profile(name).registers]


def station_with(name):
    """The built-in station with its device of that kind behind this profile."""
    config, kind = load_station(), load_profile(name).kind
    if kind in Equipment.model_fields:
        own = Equipment.model_validate({kind: Device(profile=name, device_id=60, link="tcp")})
        return config.model_copy(update={"equipment": own})
    places = {"axis": ("outer", "inner"), "slot": ("slots",)}.get(kind, (kind,))
    link = "ascii" if load_profile(name).commands else "tcp"
    update = {"profile": name, "link": link}
    changed = {place: getattr(config.devices, place).model_copy(update=update) for place in places}
    return config.model_copy(update={"devices": config.devices.model_copy(update=changed)})


@each(WITH_REGISTERS)
def test_a_device_answers_as_its_profile_says_and_refuses_what_it_does_not_say(name):
    profile = load_profile(name)
    assert profile.name == name
    assert profile.source
    plant = plant_of(station_with(name), lot_of(2))
    plant.advance(12_345_678)
    devices = [device_id for device_id, bank in plant.banks.items() if bank.profile.name == name]
    assert devices, "no device of the built-in station answers by it"
    with PlantServer(plant) as server:
        link = tcp_link(server.host, server.port, timeout_s=5.0, read_attempts=1)
        try:
            for device_id in devices:
                reads_within_its_limits(Registers(name, link, device_id, profile), profile)
            refuses_what_is_not_in_the_profile(plant.banks[devices[0]], link, devices[0], profile)
        finally:
            link.close()


def reads_within_its_limits(registers, profile):
    for register in profile.registers:
        if register.access != "write":
            value = registers.read(register.name)
            decimals = int(registers.number(register.scaled_by)) if register.scaled_by else 0
            # what was read can be written: inside type, limits and enumeration
            assert encode(register.with_decimals(decimals), profile.order(register), value), register.name
            assert not register.enumeration or registers.text(register.name) in register.enumeration, register.name


def refuses_what_is_not_in_the_profile(bank, link, device_id, profile):
    """Read-only registers, addresses beside the profile, half a register, values outside their limits."""
    with pytest.raises(StationRefused, match="exception 2"):
        link.read(device_id, max(r.end for r in profile.registers), 1, "nothing")
    for register in profile.registers:
        if register.access == "read" and register.space in {"holding", "coil"}:
            with pytest.raises(StationRefused, match=r"exception [23]"):
                link.write(device_id, register.address, [0] * register.words, register.name, register.space)
        if register.access != "read" and register.words > 1:
            before = [bank.read(r.address, r.words) for r in profile.registers]
            with pytest.raises(StationRefused, match="exception 3"):
                link.write(device_id, register.address, [0x41C8], f"half of {register.name}")
            assert before == [bank.read(r.address, r.words) for r in profile.registers]
        for bound, beyond in ((register.minimum, -1.0), (register.maximum, 1.0)):
            if bound is not None:
                with pytest.raises(NotEncodable):  # before it is sent
                    encode(register, profile.order(register), bound + beyond)


def test_words_on_the_wire_are_those_of_the_f4t_low_word_first():
    plant = plant_of()
    # by hand: no library of either side
    with PlantServer(plant) as server, socket.create_connection((server.host, server.port), 5.0) as connection:
        connection.sendall(struct.pack(">HHHBBHH", 7, 0, 6, 3, 3, 2782, 2))
        answer = connection.recv(64)
    transaction, _, length, device_id, function, size, low, high = struct.unpack(">HHHBBBHH", answer)
    assert (transaction, length, device_id, function, size) == (7, 7, 3, 3, 4)
    set_point = struct.unpack(">f", struct.pack(">HH", high, low))[0]
    assert set_point == plant.fixture.chamber.set_point


PROFILE = """
name = "p"
kind = "axis"
adapter = "oriental_az"
maker = "m"
model = "m"
verified = false
source = "s"
registers = [{registers}]
"""


REFUSED = {
    '{name="a",address=0,type="float32"},{name="b",address=1,type="uint16"}': "overlap at address 1",
    '{name="a",address=0,type="uint16"},{name="a",address=1,type="uint16"}': "twice",
    '{name="a",address=65535,type="float32"}': "65535",
    '{name="a",address=0,type="float32",enumeration={x=1}}': "enumeration",
    '{name="a",address=0,type="int16",minimum=2.0,maximum=1.0}': "minimum 2 is above maximum 1",
    '{name="a",address=0,type="int16",unit="degF"}': "a: unit degF, degC is needed",
    '{name="a",adress=0,type="uint16"}': "address",
}


@each(REFUSED)
def test_refuses_profiles_that_contradict_themselves(registers):
    with pytest.raises(RecipeInvalid, match=REFUSED[registers]):
        parse_as(Profile, PROFILE.replace("{registers}", registers), "p.toml")
    with pytest.raises(RecipeInvalid, match="watlow_f4t"):
        load_profile("watlow_f4")  # an unknown one: with what looks like it


@each(preset_names())
def test_every_preset_can_be_built_and_read(name):
    plant = plant_of(load_station(), lot_of(2, name.lower()))
    plant.advance(1_000_000)
    assert plant.preset == load_preset(name)
    assert len(plant.temperature_reading()) == 32
