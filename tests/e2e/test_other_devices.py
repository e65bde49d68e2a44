"""Sample stations with other drives and chambers: a recipe is captured on each, and a killed run goes on bit for bit."""

import threading
from pathlib import Path

import pandas as pd
import pytest
from small_station import MemorySink, lot_of, quiet_progress, short_recipe

from pipelines.capture.capture import capture
from schemas.station import load_station
from stations import open_station
from stations.links.lines import LineLink
from stations.serving import look, serve

STATIONS = Path(__file__).resolve().parents[2] / "deploy" / "stations"
NAMES = ["simulated-smc-binder", "simulated-iai-espec"]
RECIPE = short_recipe(poses=2, temperatures=(25.0, 30.0))


def run(config, sink):
    lot = lot_of(2)
    with open_station(config, lot, resume=sink.last_state()) as station:
        capture(station, RECIPE, lot, sink, progress=quiet_progress)
    return sink


@pytest.mark.parametrize("name", NAMES)
def test_a_killed_run_on_other_devices_goes_on_bit_for_bit(name):
    config = load_station(STATIONS / f"{name}.toml")
    whole, sink = run(config, MemorySink()), MemorySink(die_after=4)
    with pytest.raises(KeyboardInterrupt):
        run(config, sink)
    sink.die_after = 10**6
    run(config, sink)
    for part in range(3):
        pd.testing.assert_frame_equal(whole.all(part), sink.all(part), check_exact=True)
    readings = whole.all(1)
    assert (readings["status"] == "ok").all()
    assert abs(readings.query("soak == 1")["unit_C"] - 30.0).max() < 1.0


@pytest.mark.parametrize("name", NAMES)
def test_every_value_of_other_devices_can_be_looked_at(name):
    readings = look(load_station(STATIONS / f"{name}.toml"), lot_of(2))
    assert not [reading for reading in readings if reading.fault]
    chamber = {reading.register: reading.value for reading in readings if reading.device == "chamber"}
    assert float(chamber["temperature"]) == pytest.approx(23.0, abs=0.2)


def test_a_served_station_speaks_in_lines_one_port_behind_its_registers():
    config, ready, stop, where = (
        load_station(STATIONS / "simulated-iai-espec.toml"),
        threading.Event(),
        threading.Event(),
        [],
    )

    def listening(host, port):
        where.extend((host, port))
        ready.set()

    options = {"host": "127.0.0.1", "port": 0, "speed": 1.0, "stop": stop, "ready": listening}
    thread = threading.Thread(target=serve, args=(config, lot_of(1)), kwargs=options, daemon=True)
    thread.start()
    try:
        assert ready.wait(20.0)
        link = LineLink(where[0], where[1] + 1, timeout_s=5.0, read_attempts=1)
        assert link.tell("TEMP, S40.0", "set point") == "OK:TEMP, S40.0"
        air, target, high, low = (float(part) for part in link.ask("TEMP?", "air").split(","))
        assert (target, high, low) == (40.0, 180.0, -70.0)
        assert air == pytest.approx(23.0, abs=0.5)
        link.close()
    finally:
        stop.set()
        thread.join(10.0)
    assert not thread.is_alive()
