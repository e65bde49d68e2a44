"""The station end to end: recipe, adapters, Modbus TCP, plant; and a client of another maker."""

import json
import os
import shutil
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import pytest
from in_process import command
from pydantic import TypeAdapter
from small_station import MemorySink, lot_of, quiet_progress, short_recipe, station_of

from inertial.frames import force_from_angles
from pipelines.capture.capture import capture
from pipelines.cli.documents.station import StationServeDocument
from pipelines.schedule.steps import steps
from schemas.station import load_station
from schemas.table_check import check
from stations import open_station

ROOT = Path(__file__).resolve().parents[2]


def run(recipe, lot, sink=None, config=None):
    sink = sink or MemorySink()
    with open_station(config or load_station(), lot, resume=sink.last_state()) as station:
        capture(station, recipe, lot, sink, progress=quiet_progress)
    return sink


def same(a: MemorySink, b: MemorySink) -> None:
    assert sorted(a.records) == sorted(b.records)
    for part in range(3):
        pd.testing.assert_frame_equal(a.all(part), b.all(part), check_exact=True)
    assert a.state == b.state


RECIPE = short_recipe(poses=2, static_s=30.0, temperatures=(25.0, 40.0))


@pytest.fixture(scope="module")
def captured() -> MemorySink:
    return run(RECIPE, lot_of())


def test_captured_tables_keep_their_contracts(captured):
    for name, part in (("samples", 0), ("readings", 1), ("history", 2)):
        for record in captured.records.values():
            check(name, record[part])


def test_every_record_of_the_recipe_is_there_in_order(captured):
    readings = captured.all(1)
    assert list(captured.records) == [step.record for step in steps(RECIPE)] == list(range(7))
    per_record = readings.drop_duplicates("record")
    assert per_record["kind"].tolist() == ["dwell", "dwell", "verification"] * 2 + ["allan"]
    assert per_record["soak"].tolist() == [0, 0, 0, 1, 1, 1, 2]
    assert (readings.groupby("record")["unit"].nunique() == 3).all()


def test_dwells_have_the_samples_that_were_asked_for(captured):
    samples, readings = captured.all(0), captured.all(1)
    assert (samples.groupby(["record", "unit"]).size() == [200] * 18 + [3000] * 3).all()
    assert readings["n"].sum() == len(samples)
    assert not readings["overflow"].any()
    one = samples.query("record == 0 and unit == 'U001'")["time_s"]
    assert one.diff().dropna().to_numpy() == pytest.approx(0.01, abs=1e-9)
    assert one.iloc[0] == pytest.approx(readings.loc[0, "start_s"] + 0.01)


def test_devices_feel_gravity_where_the_encoders_say(captured):
    samples, readings = captured.all(0), captured.all(1)
    means = samples.groupby(["record", "unit"])[["x", "y", "z"]].mean() / 256000.0
    for row in readings.itertuples():
        force = force_from_angles(row.outer_deg * 0.017453292519943295, row.inner_deg * 0.017453292519943295)
        # uncalibrated: bias of some 10 mg, scale and misalignment of some parts in a thousand
        assert means.loc[(row.record, row.unit)].to_numpy() == pytest.approx(force, abs=0.06)


def test_soaks_bring_every_unit_to_its_temperature_and_history_tells_how(captured):
    readings, history = captured.all(1), captured.all(2)
    assert abs(readings.query("soak == 1")["unit_C"] - 40.0).max() < 1.0
    begins = readings.drop_duplicates("record").set_index("record")["start_s"].diff()
    assert (begins[[1, 2, 4, 5]] < 30.0).all()  # within a soak, a pose follows the other
    assert (begins[[3, 6]] > RECIPE.soak_min_s).all()
    assert history["time_s"].diff().dropna().min() >= 0.0
    times = history["time_s"].drop_duplicates()
    assert times.diff().dropna().max() <= 20.0
    assert history["unit_C"].min() < 24.0


def test_second_run_gives_the_same_bytes(captured):
    same(captured, run(RECIPE, lot_of()))


def test_another_repeat_measures_the_same_devices_with_new_noise(captured):
    again = run(short_recipe(poses=2), lot_of(repeat=1))
    first, fresh = (s.all(0).query("record == 0 and unit == 'U000'")["x"].to_numpy() for s in (captured, again))
    assert (first != fresh).any()
    assert first.mean() == pytest.approx(fresh.mean(), abs=256.0)  # 1 mg: the same bias, other flicker


@pytest.mark.parametrize(
    "records", [pytest.param(1, marks=pytest.mark.slow), 3, pytest.param(5, marks=pytest.mark.slow)]
)
def test_a_killed_run_goes_on_bit_for_bit(captured, records):
    sink = MemorySink(die_after=records)
    with pytest.raises(KeyboardInterrupt):
        run(RECIPE, lot_of(), sink)
    assert len(sink.records) == records
    sink.die_after = 10**6
    same(captured, run(RECIPE, lot_of(), sink))


@pytest.mark.slow
def test_a_killed_run_with_a_silent_unit_goes_on_bit_for_bit():
    config = station_of(faults=[{"kind": "silent", "at_s": 905.0, "serial": "U001"}])
    whole, sink = run(RECIPE, lot_of(), config=config), MemorySink(die_after=2)
    with pytest.raises(KeyboardInterrupt):
        run(RECIPE, lot_of(), sink, config)
    sink.die_after = 10**6
    same(whole, run(RECIPE, lot_of(), sink, config))


@pytest.mark.parametrize("device", ["sf1500", "qa700", "analogue"])
def test_analogue_devices_are_read_in_volts(device):
    sink = run(short_recipe(poses=1), lot_of(2, device))
    readings = sink.all(1)
    assert (readings["out_unit"] == "V").all()
    assert (sink.all(0)[["x", "y", "z"]].abs().max() < readings["full_scale"].max() + 1.5).all()


@pytest.mark.parametrize("path", sorted((ROOT / "deploy" / "stations").glob("*.toml")), ids=lambda p: p.name)
def test_sample_stations_load(path):
    assert load_station(path).name


@pytest.mark.slow
def test_ten_hours_of_soak_take_seconds():
    recipe = short_recipe(poses=1).model_copy(update={"soak_min_s": 36000.0})
    assert run(recipe, lot_of(8)).all(1)["start_s"].min() > 36000.0


@contextmanager
def served(*options: str):
    """``tumbleline station serve`` as a process of its own; gives its port."""
    words = [
        sys.executable,
        "-m",
        "pipelines.cli",
        "station",
        "serve",
        "--port",
        "0",
        "--units",
        "2",
        "--json",
        *options,
    ]
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=buffered) as process:
        try:
            lines = []
            for line in process.stdout:
                lines.append(line)
                if line == "}\n":
                    break
            yield int(TypeAdapter(StationServeDocument).validate_json("".join(lines), extra="forbid")["port"])
        finally:
            process.terminate()
            process.wait(20.0)


def mbpoll(port: int, device_id: int, address: int, kind: str, *more: str) -> list[str]:
    """What Debian's mbpoll reads at an address."""
    program = shutil.which("mbpoll")
    if program is None:
        pytest.skip("mbpoll is not installed; 'make debian' as root installs it")
    options = f"-m tcp -p {port} -a {device_id} -0 -r {address} -t {kind} -1".split()
    done = subprocess.run(
        [program, *options, *more, "127.0.0.1"], capture_output=True, text=True, timeout=20, check=True
    )
    return [line.split("\t")[-1].strip() for line in done.stdout.splitlines() if line.startswith("[")]


def test_a_client_of_another_maker_reads_what_the_profiles_say():
    with served("--speed", "20") as port:
        assert [int(word, 16) for word in mbpoll(port, 11, 0, "4:hex", "-c", "4")] == [0x5349, 0x4D30, 0x3030, 0x3000]
        assert float(mbpoll(port, 3, 2820, "4:float")[0]) == pytest.approx(23.0, abs=0.5)  # low word first
        assert float(mbpoll(port, 10, 2, "4:float", "-B")[0]) == 100.0  # high word first
        early = float(mbpoll(port, 10, 4, "4:float", "-B")[0])
        assert float(mbpoll(port, 10, 4, "4:float", "-B")[0]) >= early > 0.0
        assert mbpoll(port, 10, 0, "4")[0] == "8"


def test_check_reads_every_register_of_the_built_in_station():
    document = json.loads(command(["station", "check", "--units", "2", "--registers", "--json"]).stdout)
    assert document["ok"]
    assert {row["device"] for row in document["registers"]} == {
        "outer axis", "inner axis", "chamber", "reader", "slot 0", "slot 1"
    }  # fmt: skip
