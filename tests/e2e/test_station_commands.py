"""See the station: status, check, log and watch, on the simulated one and on one like hardware."""

import re
from pathlib import Path

import pytest
from capture_double import BRIEF, recipe_file
from each import each
from in_process import document_of, text_of
from served_station import modbus_station, served, station_file
from small_station import lot_of, station_of

from stations.opening import open_station
from stations.safety.folder import read_log as machine_log
from stations.self_test import Standard, control_limits, keep, read_history

pytestmark = pytest.mark.usefixtures("state")


def status_of(*words: object, status: int = 0) -> dict:
    return document_of("station", "status", *words, status=status)


def checked(*words: object, status: int = 0) -> dict:
    return document_of("station", "check", *words, status=status)


def changed(folder: Path, **sections: dict) -> Path:
    content = station_of().model_dump(mode="json")
    for name, changes in sections.items():
        content[name] |= changes
    return station_file(folder, type(station_of()).model_validate(content), "changed.toml")


def test_status_tells_angles_temperatures_states_and_units():
    now = status_of("--slots", "3")
    assert now["ok"]
    assert now["angles_deg"] == pytest.approx({"outer": 0.0, "inner": 0.0}, abs=0.01)
    assert now["axes"] == {"outer": "in position", "inner": "in position"}
    assert now["chamber_C"] == pytest.approx(23.0, abs=0.2)
    assert (now["door"], now["emergency_stop"], now["sampling"]) == ("closed", "released", "stopped")
    assert [slot["serial"] for slot in now["slots"]] == ["SIM0000", "SIM0001", "SIM0002"]


def test_status_of_a_station_that_is_driven_says_by_whom_and_disturbs_nothing(tmp_path):
    with served() as port:
        config = modbus_station(port)
        where = ("--station", station_file(tmp_path, config))
        with open_station(config, lot_of(), run="lot 7") as station:
            station.reader.start(100.0)
            now = status_of(*where)
            assert (now["lease"]["run"], now["sampling"]) == ("lot 7", "running")
            shown = text_of("station", "status", *where)
            assert "driven by" in shown
        assert status_of(*where)["lease"] is None
    assert set(status_of(*where, status=3)["faults"]) == {"table", "chamber", "reader"}  # it does not answer any more


def test_a_healthy_station_passes_its_self_test():
    document = checked("--slots", "3")
    assert (document["ok"], document["failed"]) == (True, [])
    tested = [finding["check"] for finding in document["checks"]]
    assert set(tested) >= {
        "door", "emergency stop", "vibration", "supply", "air", "move to 10°", "move to 0°", "samples", "noise",
    }  # fmt: skip
    assert tested.count("noise") == 3
    assert {row["device"] for row in document["registers"]} >= {"outer axis", "chamber", "slot 2"}
    assert "checks" not in checked("--slots", "2", "--read-only")  # moves nothing


FAULTS = {
    "reader: door is open, closed is needed": {"kind": "door"},
    "reader: emergency stop is pressed, released is needed": {"kind": "emergency_stop"},
    "reader: vibration at rest 0.0": {"kind": "vibration"},
    "slot 1: the output on x is constant": {"kind": "dead", "serial": "SIM0001"},
    "table: not at (10, 10) deg": {"kind": "table_stall", "device": "inner", "at_s": 0.5},
}


@each(FAULTS)
def test_what_fails_is_named_with_status_3(words, tmp_path):
    path = changed(tmp_path, simulation={"faults": [FAULTS[words]]})
    document = checked("--station", path, "--slots", "3", status=3)
    assert not document["ok"]
    assert any(words in message for message in document["failed"]), document["failed"]


def failed(folder: Path, units: int = 1, **self_test: object) -> list[str]:
    path = changed(folder, self_test=self_test)
    return checked("--station", path, "--slots", str(units), status=3)["failed"]


def test_noise_and_the_check_standard_are_held_against_the_limits_of_the_file(tmp_path):
    good = changed(tmp_path, self_test={"standard": "SIM0000", "scale": [250e3, 262e3], "offset": [-12e3, 12e3]})
    document = checked("--station", good, "--slots", "2")
    scale = next(finding for finding in document["checks"] if finding["check"] == "scale")
    assert (scale["value"], scale["unit"]) == (pytest.approx(256e3, rel=0.02), "LSB/g")
    (message,) = failed(tmp_path, 2, standard="SIM0000", scale=[1.0, 2.0])[:1]
    assert message.startswith("standard SIM0000: scale 25")
    assert [message.split(":")[0] for message in failed(tmp_path, 2, noise_max=50.0)] == ["slot 0", "slot 1"]
    assert failed(tmp_path, standard="CS-1") == [
        "slots: check standard CS-1 is in no slot; insert it, or correct [self_test]"
    ]


@pytest.mark.slow
def test_without_limits_the_check_standard_makes_its_own_from_its_history(tmp_path, state):
    own = {"standard": "SIM0000", "history_min": 5}
    path, kept = changed(tmp_path, self_test=own), state / "checks" / "simulated.jsonl"
    for _ in range(5):
        checked("--station", path, "--slots", "1")
    history = read_history(kept)
    assert len({standard.offset for standard in history}) == 5  # each time new noise
    kept.unlink()
    for s in history:
        keep(kept, Standard("SIM0000", s.offset + 5000.0, s.scale, s.unit_C))
    assert failed(tmp_path, **own)[0].startswith("standard SIM0000: offset")
    assert len(read_history(kept)) == 5  # what is out of control does not count


def test_control_limits_are_those_of_an_individuals_chart():
    # NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2: flow rates of ten batches, limits 45.8159 and 55.8041
    flow = [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]
    assert control_limits(flow, 8) == pytest.approx((45.8159, 55.8041), abs=2e-4)
    assert control_limits(flow[:7], 8) is None


@pytest.mark.slow
def test_check_drives_hardware_under_a_lease_and_leaves_it_safe(tmp_path):
    with served(lot_of(2)) as port:
        quick = {"limits": {"speed_deg_s": 90.0}, "self_test": {"sample_s": 1.0, "settle_s": 0.2}}
        where = ("--station", station_file(tmp_path, modbus_station(port, **quick)))
        assert checked(*where)["ok"]
        assert status_of(*where)["set_point_C"] == 25.0
    assert [line["event"] for line in machine_log(tmp_path / "state")] == ["driven", "left_safe"]


@pytest.mark.slow
def test_log_tells_why_a_run_was_paused_and_watch_draws_it(tmp_path):
    warm = ("temperatures_C = [0.0, 50.0]", "temperatures_C = [20.0, 50.0]")
    recipe = recipe_file(tmp_path, warm, ('["A1", "A2", "A3"]', '["A1"]'), BRIEF[2], BRIEF[4])
    archive = ("--archive", tmp_path / "archive")
    text_of("run", recipe, "--direct", "--fault", "door:at_s=930:for_s=120", *archive)
    events = document_of("station", "log", *archive)["events"]
    assert [event["kind"] for event in events] == ["suspended", "resumed"]
    seen = document_of("station", "watch", "latest", *archive)
    assert seen["over"]
    assert max(value for _, value in seen["chamber"]) > 45.0
    drawn = text_of("station", "watch", "latest", "--every", "0", *archive)
    assert re.search("[⠀-⣿]", drawn)
