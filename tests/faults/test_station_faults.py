"""Trouble at the station: reported by name, never passed over, and the rest goes on."""

import threading

import pytest
from each import each
from plant_wires import tcp_link
from root_process import ROOT
from small_server import answering
from small_station import MemorySink, lot_of, quiet_progress, short_recipe, station_of

from pipelines.capture.capture import capture
from schemas.errors import (
    ArchiveUnusable,
    DataRejected,
    LinkLost,
    OperatorNeeded,
    RecipeInvalid,
    StationRefused,
    StationTimeout,
    WrongUse,
)
from schemas.event import MemoryLog
from schemas.poses import Pose
from schemas.station import load_station
from stations.opening import make_plant, open_station
from stations.plant.server import PlantServer
from stations.serving import serve

SIMULATED = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")


def run(config, lot, recipe=None, sink=None):
    sink = sink or MemorySink()
    with open_station(config, lot, resume=sink.last_state()) as station:
        capture(station, recipe or short_recipe(), lot, sink, progress=quiet_progress)
    return sink


def test_a_capture_that_holds_dwells_of_a_worn_table_is_not_gone_on_with():
    """The table is mended, the same command given again: dwells that were stored before the play was seen would stay in it."""
    sink, events = MemorySink(), MemoryLog()
    poses = [Pose(name=f"p{i}", outer_deg=(-1) ** i * (20.0 + 20.0 * i), inner_deg=25.0 * i) for i in range(8)]
    recipe = short_recipe().model_copy(update={"poses": poses})
    worn = station_of(faults=[{"kind": "backlash", "device": "outer", "at_s": 0.0, "figures": {"play_deg": 2.0}}])
    for config in (worn, station_of()):
        with (
            open_station(config, lot_of()) as station,
            pytest.raises(OperatorNeeded, match=r"table: the outputs of all units turn .* measure the lot anew"),
        ):
            capture(station, recipe, lot_of(), sink, progress=quiet_progress, events=events)
        stored = len(sink.finished())
        assert 0 < stored < 8


def test_a_lot_of_which_nobody_answers_is_refused():
    with pytest.raises(OperatorNeeded, match="no unit"):
        run(station_of(faults=[{"kind": "silent", "serial": "U000"}]), lot_of(1))


def test_samples_that_the_ring_has_lost_are_flagged_and_not_made_up():
    lot = lot_of(1)
    with open_station(load_station(), lot) as station:
        station.reader.start(1000.0)
        station.clock.sleep(20.0)
        station.reader.stop()
        samples = station.reader.slots[0].take()
    assert samples.overflow
    assert (samples.first, len(samples.outputs)) == (8000, 12000)


def test_a_write_is_sent_once_and_a_read_as_often_as_allowed():
    with answering(lambda _: b"") as (address, heard):
        link = tcp_link(*address, timeout_s=0.2, read_attempts=2)
        with pytest.raises(StationTimeout, match="no answer"):
            link.write(3, 2782, [0, 0], "set point")
        assert b"".join(heard).count(bytes.fromhex("03100ade0002")) == 1
        with pytest.raises(StationTimeout, match="no answer"):
            link.read(3, 2782, 2, "set point")
        assert b"".join(heard).count(bytes.fromhex("03030ade0002")) == 2
        link.close()


def test_a_server_that_is_gone_is_a_lost_link_with_its_address():
    plant = make_plant(load_station(), lot_of(1))
    with PlantServer(plant) as server:
        port = server.port
        link = tcp_link(server.host, port, timeout_s=1.0, read_attempts=2)
        assert link.read(10, 0, 1, "slots") == [8]
        with pytest.raises(StationRefused, match="free port"):  # its port is taken
            PlantServer(make_plant(load_station(), lot_of(1)), port=port).__enter__()
        begin = {
            "host": "127.0.0.1",
            "port": port - 1,
            "speed": 1.0,
            "stop": threading.Event(),
            "ready": lambda *_: None,
        }
        told = rf":\d+ .*, free ports {port - 1} \(registers\) to \d+ \(one for each text protocol\) are needed"
        with pytest.raises(StationRefused, match=told):
            serve(load_station(), lot_of(1), **begin)
    with pytest.raises((LinkLost, StationTimeout), match=f"127.0.0.1:{port}"):
        link.read(10, 0, 1, "slots")
    link.close()


def test_a_state_of_another_lot_is_refused():
    sink = run(station_of(), lot_of())
    with (
        pytest.raises(DataRejected, match="another station or lot"),
        open_station(station_of(), lot_of(seed=6), resume=sink.state),
    ):
        pass
    with pytest.raises(ArchiveUnusable, match="not readable"), open_station(station_of(), lot_of(), resume=b"torn"):
        pass


@each(
    [
        ("name = 'x'\nkind = 'simulated'\n[limts]\n", "limits"),
        ("name = 'x'\nkind =", "not valid TOML"),
        (SIMULATED.replace("device_id = 2", "device_id = 1"), "one drive would get the orders of both axes"),
        (SIMULATED.replace("seed = 1", "slot_lag_s = [200.0, 90.0]"), "'simulation.slot_lag_s': 200 is above 90"),
        (
            SIMULATED.partition("[uncertainty")[0].replace('kind = "simulated"', 'kind = "modbus"'),
            r"devices\.outer\.host",
        ),
    ],
    lambda row: row[1],
)
def test_a_station_file_with_a_typo_or_hardware_without_an_address_is_refused_and_hardware_not_served(row, tmp_path):
    text, needed = row
    (tmp_path / "station.toml").write_text(text, encoding="utf-8")
    with pytest.raises(RecipeInvalid, match=needed):
        load_station(tmp_path / "station.toml")
    hardware = load_station().model_copy(update={"kind": "modbus"})
    with pytest.raises(WrongUse, match="a simulated station is needed"):
        serve(hardware, lot_of(), host="127.0.0.1", port=0, speed=1.0, stop=threading.Event(), ready=print)
