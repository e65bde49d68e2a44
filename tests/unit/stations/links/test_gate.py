"""Writes go to devices that the station's file names, to registers that their profiles let be written, and nowhere else."""

import ast
import math
from contextlib import nullcontext
from types import SimpleNamespace

import pytest
from each import each
from hypothesis import given
from hypothesis import strategies as st
from other_devices import station_with
from pydantic import ValidationError
from root_process import ROOT
from small_station import lot_of, plant_of

from schemas.errors import RecipeInvalid, StationRefused
from schemas.profile import Command
from schemas.station import StationConfig, load_station
from stations.clock import WallClock
from stations.devices.memory import UnitMemory
from stations.links.gate import GatedLines, GatedLink
from stations.links.making import Links
from stations.opening import serve_devices
from stations.profile_files import load_profile, profile_names

CARRIERS = {"TcpWire", "SerialWire", "WireLink", "LineLink"}
PLACES = ("outer", "inner", "chamber", "reader", "slots")
WITH_REGISTERS = [name for name in profile_names() if load_profile(name).registers]


class Nowhere:
    """A link that leads nowhere and notes what would have been sent."""

    def __init__(self):
        self.sent = []

    def write(self, device_id, address, words, what, space="holding"):
        self.sent.append((device_id, space, address, list(words)))

    def tell(self, order, what):
        self.sent.append(order)
        return f"OK:{order}"

    ask = tell


@given(st.sampled_from(WITH_REGISTERS), st.data())
def test_a_span_passes_just_when_writable_registers_fill_it_wholly(name, data):
    profile = load_profile(name)
    near = data.draw(st.sampled_from(profile.registers))
    space = data.draw(st.sampled_from(["holding", "coil", "discrete", "input"]))
    address = max(0, near.address + data.draw(st.integers(-2, 2)))
    count = data.draw(st.integers(0, 20))
    wanted = set(range(address, address + count))
    whole = [r for r in profile.registers if r.writable and r.space == space and set(range(r.address, r.end)) <= wanted]
    covered = {a for r in whole for a in range(r.address, r.end)}
    assert profile.may_write(space, address, count) == (bool(wanted) and covered == wanted)


@each(WITH_REGISTERS)
def test_only_whole_writable_registers_of_devices_that_the_file_names_pass(name):
    profile, nowhere = load_profile(name), Nowhere()
    gated = GatedLink(nowhere, "10.0.0.9:502", {7: profile})
    for register in profile.registers:
        passes = (
            nullcontext() if register.writable else pytest.raises(StationRefused, match="no such writable registers")
        )
        with passes:
            gated.write(7, register.address, [0] * register.words, register.name, register.space)
    with pytest.raises(StationRefused, match=r"10\.0\.0\.9:502 device 2: .* has no such device"):
        gated.write(2, 0x7C, [0, 0], "command")
    assert len(nowhere.sent) == sum(register.writable for register in profile.registers)


def test_only_lines_of_the_profile_pass_with_values_that_it_allows():
    nowhere = Nowhere()
    gated = GatedLines(nowhere, "here", load_profile("espec_p300"))
    for order in ("TEMP, S25.0", "TEMP, S-70.0", "MODE,CONSTANT", "MODE,STANDBY"):
        gated.tell(order, "chamber")
    gated.ask("TEMP?", "chamber")
    refused = ("TEMP, S181.0", "TEMP, Snan", "TEMP, H200.0", "MODE,RUN1", "POWER,OFF", "KEYPROTECT,OFF", "TEMP?", "")
    no_numbers = [f"TEMP, S{value}" for value in ("inf", "1_0", " 20.0", "0x14", "20.0;STOP")]
    for order in (*refused, *no_numbers):
        with pytest.raises(StationRefused, match="has no such command"):
            gated.tell(order, "chamber")
    with pytest.raises(StationRefused, match="has no such command"):
        gated.ask("PRGM DATA?", "chamber")
    assert len(nowhere.sent) == 5


def test_one_module_makes_links_and_hands_them_out_gated_alone():
    makers = set()
    for folder in ("stations", "pipelines"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text("utf-8")
            tree = ast.parse(text if any(name in text for name in CARRIERS) else "")
            calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
            if any(getattr(call.func, "id", getattr(call.func, "attr", "")) in CARRIERS for call in calls):
                makers.add(path.relative_to(ROOT).as_posix())
    assert makers == {"stations/links/making.py"}
    plant = plant_of(load_station(), lot_of(1))
    with serve_devices(load_station(), plant) as links:
        assert all(isinstance(links.registers(place), GatedLink) for place in PLACES)
    config = load_station()
    outer = config.devices.outer.model_copy(update={"link": "rtu", "serial": "/dev/ttyS0"})
    config = config.model_copy(update={"devices": config.devices.model_copy(update={"outer": outer})})
    refused = pytest.raises(RecipeInvalid, match="a simulated station's devices answer on tcp")
    with serve_devices(config, plant) as links, refused:
        links.registers("outer")


def test_links_lead_to_the_addresses_of_the_file_and_share_them():
    tables = load_station().model_dump(exclude_unset=True) | {"kind": "modbus", "uncertainty": None}
    hosts = {place: f"10.0.0.{k}" for place, k in zip(PLACES, (1, 1, 2, 3, 3), strict=True)}
    for place, host in hosts.items():
        tables["devices"][place]["host"] = host
    links = Links(StationConfig.model_validate(tables))
    made = {place: links.registers(place) for place in PLACES}
    assert made["outer"] is made["inner"]
    assert made["reader"] is made["slots"]
    assert {host for _, host, _ in links.made} == {"10.0.0.1", "10.0.0.2", "10.0.0.3"}
    with pytest.raises(StationRefused, match="has no such device"):  # the chamber's id, at the drives' address
        made["outer"].write(3, 2782, [0, 0], "set point")


@each([
    ({"serial": "/dev/ttyS0"}, "serial: for link rtu, the link is tcp"),
    ({"link": "rtu"}, r"devices.chamber.serial: empty"),
    ({"link": "tls", "host": "h"}, r"devices.chamber.ca_file: empty"),
    ({"link": "tls", "host": "h", "ca_file": "a", "key_file": "k"}, "one without the other"),
    ({"host": "h", "ca_file": "a"}, "ca_file: for link tls"),
    ({"host": ""}, r"devices.chamber.host: empty"),
])  # fmt: skip
def test_addresses_that_say_too_much_or_too_little_are_refused(row):
    changed, told = row
    tables = station_with().model_dump(exclude_unset=True) | {"kind": "modbus", "uncertainty": None}
    for place in tables["devices"].values():
        place["host"] = "10.0.0.1"
    tables["devices"]["chamber"] = {"profile": "watlow_f4t", "device_id": 3} | changed
    with pytest.raises(ValueError, match=told):
        StationConfig.model_validate(tables)


def test_a_command_without_one_place_for_its_value_is_refused_in_the_profile() -> None:
    for tell in ("*RST", "SET {} {}", "SET {"):
        with pytest.raises(ValidationError, match="tell"):
            Command(name="reset", ask="RST?", tell=tell)
    assert not Command(name="state", ask="STAT?").writable


@each(["memory_state", "erases_a", "endurance"])
def test_a_memory_whose_status_is_no_number_is_refused_by_the_name_of_the_register(register: str) -> None:
    values = dict.fromkeys(("memory_state", "erases_a", "erases_b", "endurance"), 1.0) | {register: math.nan}
    state = SimpleNamespace(enumeration={"ready": 1})
    registers = SimpleNamespace(
        name="slot 3", read_group=lambda group: values, profile=SimpleNamespace(register=lambda name: state)
    )
    with pytest.raises(StationRefused, match=f"slot 3: register {register} has nan"):
        UnitMemory(registers, WallClock()).status()
