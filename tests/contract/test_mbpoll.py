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
REAL = [n for n in profile_names() if load_profile(n).registers and load_profile(n).maker != "Tumbleline"]


@pytest.fixture(scope="module")
def program():
    path = shutil.which("mbpoll")
    if path is None:
        pytest.skip("mbpoll is not installed; 'make debian' as root installs it")
    return path


def mbpoll(program, port, device_id, address, count, kind, *more):
    """What mbpoll reads, as text."""
    options = f"-m tcp -p {port} -a {device_id} -0 -r {address} -c {count} -t {kind} -1 -o 5".split()
    command = [program, *options, *more, "127.0.0.1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=20, check=False)
    return [line.split("\t")[-1].strip() for line in done.stdout.splitlines() if line.startswith("[")], done.stderr


@each(REAL)
def test_mbpoll_reads_in_every_space_what_the_profile_says_and_nothing_in_others(name, program):
    profile = load_profile(name)
    plant = plant_of(station_with(**{profile.kind: name}), lot_of(2))
    plant.advance(12_345_678)
    device_id = {"axis": 1, "chamber": 3}[profile.kind]
    bank, readable = plant.banks[device_id], []
    with PlantServer(plant) as server:
        for register in (r for r in bank._registers if r.access != "write"):
            where = (server.port, device_id, register.address, register.words, KINDS[register.space])
            texts, problem = mbpoll(program, *where)
            assert len(texts) == register.words, (register.name, problem)
            words = [int(text, 0) for text in texts]
            told = [w for _, part in bank.read(register.address, register.words, register.space) for w in part]
            assert words == told, register.name
            value = bank._sources[register.name]()
            if isinstance(value, float) and not register.enumeration:
                back = decode(register, bank.profile.order(register), words)
                assert back == pytest.approx(value, abs=max(register.scale, 1e-4)), register.name
            readable.append(register.space)
        spaces = {register.space for register in profile.registers}
        assert set(readable) == spaces
        for space in {"coil", "discrete", "input"} - spaces:
            texts, problem = mbpoll(program, server.port, device_id, profile.registers[0].address, 1, KINDS[space])
            assert (texts, "Illegal data address" in problem) == ([], True)
        if profile.kind == "chamber":  # the air by type and word order alone
            air = profile.register("temperature")
            big = ["-B"] if profile.order(air) == "high_first" and air.type == "float32" else []
            kind = "4:float" if air.type == "float32" else "4"
            (text,), _ = mbpoll(program, server.port, device_id, air.address, 1, kind, *big)
            assert float(text) * (0.1 if air.scaled_by else 1.0) == pytest.approx(23.0, abs=0.2)
