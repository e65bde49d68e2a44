"""A client of another maker, libmodbus behind Debian's mbpoll, sees in every space what the profiles say."""

import shutil
import subprocess

import pytest
from each import each
from other_devices import station_with
from small_station import lot_of, plant_of

from stations.codec import decode
from stations.plant.server import PlantServer
from stations.profile_files import load_profile, profile_names

KINDS = {"coil": "0", "discrete": "1", "input": "3:hex", "holding": "4:hex"}
LONGEST = 100
REAL = [n for n in profile_names() if load_profile(n).registers and load_profile(n).maker != "Tumbleline"]


@pytest.fixture(scope="module")
def program():
    path = shutil.which("mbpoll")
    if path is None:
        pytest.skip("mbpoll is not installed; 'make debian' as root installs it")
    return path


def mbpoll(program, port, device_id, address, count, kind, *more):
    """What mbpoll reads, as text."""
    command = [program, "-m", "tcp", "-p", str(port), "-a", str(device_id), "-0", "-r", str(address), "-c", str(count)]
    done = subprocess.run(
        [*command, "-t", kind, "-1", "-o", "5", *more, "127.0.0.1"],
        capture_output=True,
        text=True,
        timeout=20,
        check=False,
    )
    return [line.split("\t")[-1].strip() for line in done.stdout.splitlines() if line.startswith("[")], done.stderr


def served_with(name):
    kind = load_profile(name).kind
    plant = plant_of(station_with(**{kind: name}), lot_of(2))
    plant.advance(12_345_678)
    return plant, {"axis": 1, "chamber": 3}[kind]


@each(REAL)
def test_mbpoll_reads_what_the_profile_says(name, program):
    plant, device_id = served_with(name)
    bank = plant.banks[device_id]
    seen = set()
    with PlantServer(plant) as server:
        for register in bank._registers:
            if register.access == "write":
                continue
            texts, problem = mbpoll(
                program, server.port, device_id, register.address, register.words, KINDS[register.space]
            )
            assert len(texts) == register.words, (register.name, problem)
            words = [int(text, 0) for text in texts]
            told = [w for _, part in bank.read(register.address, register.words, register.space) for w in part]
            assert words == told, register.name
            value = bank._sources[register.name]()
            if isinstance(value, float) and not register.enumeration:
                back = decode(register, bank.profile.order(register), words)
                assert back == pytest.approx(value, abs=max(register.scale, 1e-4)), register.name
            seen.add(register.space)
    assert seen == {register.space for register in bank.profile.registers}


@each([n for n in REAL if load_profile(n).kind == "chamber"])
def test_mbpoll_decodes_the_air_temperature_by_type_and_word_order_alone(name, program):
    plant, device_id = served_with(name)
    profile = load_profile(name)
    air = profile.register("temperature")
    big = ["-B"] if profile.order(air) == "high_first" and air.type == "float32" else []
    with PlantServer(plant) as server:
        (text,), _ = mbpoll(
            program, server.port, device_id, air.address, 1, "4:float" if air.type == "float32" else "4", *big
        )
    assert float(text) * (0.1 if air.scaled_by else 1.0) == pytest.approx(23.0, abs=0.2)


@each(REAL)
def test_mbpoll_finds_nothing_in_spaces_that_the_profile_does_not_have(name, program):
    plant, device_id = served_with(name)
    profile = load_profile(name)
    address = profile.registers[0].address
    with PlantServer(plant) as server:
        for space in {"coil", "discrete", "input"} - {r.space for r in profile.registers}:
            texts, problem = mbpoll(program, server.port, device_id, address, 1, KINDS[space])
            assert not texts
            assert "Illegal data address" in problem
