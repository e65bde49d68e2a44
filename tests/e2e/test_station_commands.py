"""See the station: status, check, log and watch, on the simulated one and on one like hardware."""

import itertools
import json
import math
import re
from pathlib import Path

import pytest
from capture_double import recipe_file
from rich.text import Text
from served_station import modbus_station, served, station_file
from small_station import lot_of, station_of
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.cli.chart import Line, chart
from stations.opening import open_station
from stations.safety.folder import read_log as machine_log
from stations.self_test import Standard, control_limits, keep, read_history


@pytest.fixture(autouse=True)
def state(tmp_path, monkeypatch):
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    return tmp_path / "state"


def ask(*arguments: str, status: int = 0) -> dict:
    result = CliRunner().invoke(app, [*arguments, "--json"])
    assert result.exit_code == status, result.output
    return json.loads(result.stdout)


def changed(folder: Path, **sections: dict) -> str:
    """The simulated station's file with other sections."""
    content = station_of().model_dump(mode="json")
    for name, changes in sections.items():
        content[name] |= changes
    return str(station_file(folder, type(station_of()).model_validate(content), "changed.toml"))


def test_status_tells_angles_temperatures_states_and_units():
    now = ask("station", "status", "--units", "3")
    assert now["ok"]
    assert now["angles_deg"] == pytest.approx({"outer": 0.0, "inner": 0.0}, abs=0.01)
    assert now["axes"] == {"outer": "in position", "inner": "in position"}
    assert now["chamber_C"] == pytest.approx(23.0, abs=0.2)
    assert (now["door"], now["emergency_stop"], now["sampling"]) == ("closed", "released", "stopped")
    assert [slot["serial"] for slot in now["slots"]] == ["SIM0000", "SIM0001", "SIM0002"]


def test_status_for_people_is_words():
    shown = CliRunner().invoke(app, ["station", "status", "--units", "1"]).stdout
    assert "closed" in shown
    assert "[" not in shown


def test_status_of_a_station_that_is_driven_says_by_whom_and_disturbs_nothing(tmp_path):
    with served() as port:
        config = modbus_station(port)
        path = str(station_file(tmp_path, config))
        with open_station(config, lot_of(), run="lot 7") as station:
            station.reader.start(100.0)
            now = ask("station", "status", "--station", path)
            assert now["lease"]["run"] == "lot 7"
            assert now["sampling"] == "running"
            shown = CliRunner().invoke(app, ["station", "status", "--station", path])
            assert "driven by" in shown.stdout
            assert "lot 7, process" in shown.stdout
        assert ask("station", "status", "--station", path)["lease"] is None


def test_status_of_a_station_that_does_not_answer_is_status_3_with_its_reason(tmp_path):
    with served() as port:
        path = str(station_file(tmp_path, modbus_station(port)))
    now = ask("station", "status", "--station", path, status=3)
    assert set(now["faults"]) == {"table", "chamber", "reader"}


def test_a_healthy_station_passes_its_self_test():
    document = ask("station", "check", "--units", "3")
    assert document["ok"]
    assert document["failed"] == []
    tested = {finding["check"] for finding in document["checks"]}
    assert tested >= {
        "door",
        "emergency stop",
        "vibration",
        "supply",
        "air",
        "move to 10°",
        "move to 0°",
        "samples",
        "noise",
    }
    assert sum(finding["check"] == "noise" for finding in document["checks"]) == 3
    assert {row["device"] for row in document["registers"]} >= {"outer axis", "chamber", "slot 2"}


def test_check_with_registers_only_moves_nothing():
    document = ask("station", "check", "--units", "2", "--registers")
    assert "checks" not in document
    assert document["registers"]


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"kind": "door"}, "reader: door is open, closed is needed"),
        ({"kind": "emergency_stop"}, "reader: emergency stop is pressed, released is needed"),
        ({"kind": "vibration"}, "reader: vibration at rest 0.0"),
        ({"kind": "dead", "serial": "SIM0001"}, "slot 1: the output on x is constant"),
        ({"kind": "table_stall", "device": "inner", "at_s": 0.5}, "table: not at (10, 10) deg"),
    ],
)
def test_what_fails_is_named_with_status_3(tmp_path, fault, words):
    path = changed(tmp_path, simulation={"faults": [fault]})
    document = ask("station", "check", "--station", path, "--units", "3", status=3)
    assert not document["ok"]
    assert any(words in message for message in document["failed"]), document["failed"]


def test_a_slot_noisier_than_its_neighbours_is_named(tmp_path):
    path = changed(tmp_path, self_test={"noise_max": 50.0})
    failed = ask("station", "check", "--station", path, "--units", "2", status=3)["failed"]
    assert [message.split(":")[0] for message in failed] == ["slot 0", "slot 1"]


def test_the_check_standard_is_held_against_the_limits_of_the_file(tmp_path):
    good = changed(tmp_path, self_test={"standard": "SIM0000", "scale": [250e3, 262e3], "offset": [-12e3, 12e3]})
    document = ask("station", "check", "--station", good, "--units", "2")
    scale = next(finding for finding in document["checks"] if finding["check"] == "scale")
    assert scale["value"] == pytest.approx(256e3, rel=0.02)
    assert scale["unit"] == "LSB/g"
    bad = changed(tmp_path, self_test={"standard": "SIM0000", "scale": [1.0, 2.0]})
    failed = ask("station", "check", "--station", bad, "--units", "2", status=3)["failed"]
    assert failed[0].startswith("standard SIM0000: scale 25")


def test_without_limits_the_check_standard_makes_its_own_from_its_history(tmp_path, state):
    path = changed(tmp_path, self_test={"standard": "SIM0000", "history_min": 5})
    for _ in range(5):
        ask("station", "check", "--station", path, "--units", "1")
    history = read_history(state / "checks" / "simulated.jsonl")
    assert len(history) == 5
    assert len({standard.offset for standard in history}) == 5  # each time new noise
    moved = [Standard("SIM0000", s.offset + 5000.0, s.scale, s.unit_C) for s in history]
    (state / "checks" / "simulated.jsonl").unlink()
    for standard in moved:
        keep(state / "checks" / "simulated.jsonl", standard)
    failed = ask("station", "check", "--station", path, "--units", "1", status=3)["failed"]
    assert failed[0].startswith("standard SIM0000: offset")
    assert len(read_history(state / "checks" / "simulated.jsonl")) == 5  # what is out of control does not count


def test_a_check_standard_that_is_not_seated_is_named(tmp_path):
    path = changed(tmp_path, self_test={"standard": "CS-1"})
    failed = ask("station", "check", "--station", path, "--units", "1", status=3)["failed"]
    assert failed == ["slots: check standard CS-1 is in no slot; insert it, or correct [self_test]"]


def test_control_limits_are_those_of_an_individuals_chart():
    # NIST/SEMATECH e-Handbook of Statistical Methods, 6.3.2.2: flow rates of ten batches, limits 45.8159 and 55.8041
    flow = [49.6, 47.6, 49.9, 51.3, 47.8, 51.2, 52.6, 52.4, 53.6, 52.1]
    assert control_limits(flow, 8) == pytest.approx((45.8159, 55.8041), abs=2e-4)
    assert control_limits(flow[:7], 8) is None


def test_check_drives_hardware_under_a_lease_and_leaves_it_safe(tmp_path):
    with served(lot_of(2)) as port:
        quick = {"limits": {"speed_deg_s": 90.0}, "self_test": {"sample_s": 1.0, "settle_s": 0.2}}
        path = str(station_file(tmp_path, modbus_station(port, **quick)))
        document = ask("station", "check", "--station", path)
        assert document["ok"], document["failed"]
        assert ask("station", "status", "--station", path)["set_point_C"] == 25.0
    assert [line["event"] for line in machine_log(tmp_path / "state")] == ["driven", "left_safe"]


def run_small(folder: Path, *more: str) -> int:
    recipe = recipe_file(folder, ("temperatures_C = [0.0, 50.0]", "temperatures_C = [20.0, 50.0]"))
    arguments = ["run", recipe, "--direct", "--json", "--archive", str(folder / "archive"), *more]
    return CliRunner().invoke(app, arguments).exit_code


def test_log_tells_why_a_run_was_paused_and_watch_draws_it(tmp_path):
    fault = "door:at_s=930:for_s=120"
    assert run_small(tmp_path, "--fault", fault) in (0, 1)
    archive = ("--archive", str(tmp_path / "archive"))
    events = ask("station", "log", *archive)["events"]
    assert [event["kind"] for event in events] == ["suspended", "resumed"]
    assert {event["record"] for event in events} == {events[0]["record"]}
    assert "door is open" in events[0]["reason"]
    assert ask("show", "latest", "events", *archive)["rows"][-1]["time_s"] > 1000.0
    soaks = ask("show", "latest", "soaks", *archive)["rows"]
    assert [row["target_C"] for row in soaks] == [20.0, 20.0, 50.0, 25.0]
    shown = CliRunner().invoke(app, ["station", "log", *archive])
    assert "door" in shown.stdout
    seen = ask("station", "watch", "latest", *archive)
    assert seen["over"]
    assert max(value for _, value in seen["chamber"]) > 45.0
    drawn = CliRunner().invoke(app, ["station", "watch", "latest", "--once", *archive]).stdout
    assert "warmest unit" in drawn
    assert re.search("[⠀-⣿]", drawn)


def test_a_chart_goes_from_corner_to_corner():
    points = [(float(t), 10.0 * t) for t in range(11)]
    text = chart("°C", [Line("air", "red", points)], width=51, height=8, span=(0.0, 10.0))
    assert isinstance(text, Text)
    rows = text.plain.splitlines()[1:9]
    drawn = [[column for column, c in enumerate(row.split("│")[1]) if c != " "] for row in rows]
    assert min(drawn[-1]) == 0
    assert max(drawn[0]) == len(rows[0].split("│")[1]) - 1
    assert all(min(above) > min(below) for above, below in itertools.pairwise(drawn))


def test_a_chart_of_nothing_says_so():
    assert "no data yet" in chart("°C", [Line("air", "red", [(0.0, math.nan)])], 50, 8, (0.0, 1.0)).plain
