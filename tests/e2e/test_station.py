"""The station end to end: recipe, adapters, Modbus TCP, plant; limits, full fixtures, other devices, another maker's client."""

import os
import socket
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from each import each
from in_process import typed_document
from pydantic import ValidationError
from root_process import ROOT
from served_station import served
from small_station import QUIET, MemorySink, captured, lot_of, quiet_progress, short_recipe, station_of

from inertial.frames import force_from_angles
from pipelines.capture.capture import capture
from pipelines.schedule.steps import steps
from schemas.errors import RecipeInvalid, StationRefused
from schemas.poses import Pose, SoakPart
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station
from schemas.table_check import check as check_table
from stations import serving
from stations.opening import make_plant, one_processor, open_station, serve_plant, tighter
from stations.profile_files import load_profile
from stations.serving import look

STATIONS = ROOT / "deploy" / "stations"
OTHERS = ["simulated-smc-binder", "simulated-iai-espec"]
RECIPE = short_recipe(poses=2, static_s=30.0, temperatures=(25.0, 40.0))


def same(a: MemorySink, b: MemorySink) -> None:
    assert sorted(a.records) == sorted(b.records)
    for part in range(3):
        pd.testing.assert_frame_equal(a.all(part), b.all(part), check_exact=True)
    assert a.state == b.state


@pytest.fixture(scope="module")
def whole() -> MemorySink:
    return captured(RECIPE)


def test_captured_tables_keep_their_contracts_and_have_every_record_in_order(whole: MemorySink) -> None:
    for name, part in (("samples", 0), ("readings", 1), ("history", 2)):
        for record in whole.records.values():
            check_table(name, record[part])
    samples, readings = whole.all(0), whole.all(1)
    assert list(whole.records) == [step.record for step in steps(RECIPE)] == list(range(7))
    per_record = readings.drop_duplicates("record")
    assert per_record["kind"].tolist() == ["dwell", "dwell", "verification"] * 2 + ["allan"]
    assert per_record["soak"].tolist() == [0, 0, 0, 1, 1, 1, 2]
    assert (readings.groupby("record")["unit"].nunique() == 3).all()
    assert (samples.groupby(["record", "unit"]).size() == [200] * 18 + [3000] * 3).all()
    assert readings["n"].sum() == len(samples)
    assert not readings["overflow"].any()
    one = samples.query("record == 0 and unit == 'U001'")["time_s"]
    assert one.diff().dropna().to_numpy() == pytest.approx(0.01, abs=1e-9)
    assert one.iloc[0] == pytest.approx(readings.loc[0, "start_s"] + 0.01)
    means = samples.groupby(["record", "unit"])[["x", "y", "z"]].mean() / 256000.0
    for row in readings.itertuples():  # devices feel gravity where the encoders say
        force = force_from_angles(row.outer_deg * 0.017453292519943295, row.inner_deg * 0.017453292519943295)
        # uncalibrated: bias of some 10 mg, scale and misalignment of some parts in a thousand
        assert means.loc[(row.record, row.unit)].to_numpy() == pytest.approx(force, abs=0.06)


def test_soaks_bring_every_unit_to_its_temperature_and_history_tells_how(whole: MemorySink) -> None:
    readings, history = whole.all(1), whole.all(2)
    assert abs(readings.query("soak == 1")["unit_C"] - 40.0).max() < 1.0
    begins = readings.drop_duplicates("record").set_index("record")["start_s"].diff()
    assert (begins[[1, 2, 4, 5]] < 30.0).all()  # within a soak, a pose follows the other
    assert (begins[[3, 6]] > RECIPE.soak_min_s).all()
    assert history["time_s"].diff().dropna().min() >= 0.0
    assert history["time_s"].drop_duplicates().diff().dropna().max() <= 20.0
    assert history["unit_C"].min() < 24.0


@pytest.mark.slow
def test_a_killed_run_goes_on_bit_for_bit_and_another_repeat_has_new_noise_of_the_same_devices(
    whole: MemorySink,
) -> None:
    same(whole, killed_and_resumed(RECIPE, 3))
    again = captured(short_recipe(poses=2), lot_of(repeat=1))
    first, fresh = (s.all(0).query("record == 0 and unit == 'U000'")["x"].to_numpy() for s in (whole, again))
    assert (first != fresh).any()
    assert first.mean() == pytest.approx(fresh.mean(), abs=256.0)  # 1 mg: the same bias, other flicker


def killed_and_resumed(recipe: Recipe, records: int, config: StationConfig | None = None) -> MemorySink:
    """The records of a run whose process was killed after some of them."""
    sink = MemorySink(die_after=records)
    with pytest.raises(KeyboardInterrupt):
        captured(recipe, sink=sink, config=config)
    assert len(sink.records) == records
    sink.die_after = 10**6
    return captured(recipe, sink=sink, config=config)


@pytest.mark.slow
def test_a_killed_run_with_a_silent_unit_goes_on_bit_for_bit() -> None:
    config = station_of(faults=[{"kind": "silent", "at_s": 905.0, "serial": "U001"}])
    same(captured(RECIPE, config=config), killed_and_resumed(RECIPE, 2, config))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_a_killed_run_on_other_devices_goes_on_bit_for_bit_and_every_value_can_be_looked_at(name: str) -> None:
    config, recipe = load_station(STATIONS / f"{name}.toml"), short_recipe(poses=2, temperatures=(25.0, 30.0))
    complete = captured(recipe, config=config)
    same(complete, killed_and_resumed(recipe, 4, config))
    readings = complete.all(1)
    assert (readings["status"] == "ok").all()
    assert abs(readings.query("soak == 1")["unit_C"] - 30.0).max() < 1.0
    seen = look(config, lot_of(2))
    assert not [reading for reading in seen if reading.fault]
    chamber = {reading.register: reading.value for reading in seen if reading.device == "chamber"}
    assert float(chamber["temperature"]) == pytest.approx(23.0, abs=0.2)


def test_the_temperature_of_a_dwell_on_a_ramp_is_that_of_its_middle() -> None:
    parts = [
        SoakPart(temperature_C=25.0, poses=[1], verification=[]),
        SoakPart(temperature_C=60.0, poses=[1] * 8, verification=[], settled=False),
    ]
    plain = short_recipe(poses=1, temperatures=(25.0, 60.0))
    changed = {"soaks": [p.model_dump() for p in parts], "verification": [], "dwell_s": 20.0, "rate_hz": 10.0}
    recipe = Recipe.model_validate({**plain.model_dump(), **changed})
    config, lot, sink = station_of(preset_overrides=QUIET), lot_of(2), MemorySink()
    plant = make_plant(config, lot)
    with serve_plant(config, lot, plant) as station:
        capture(station, recipe, lot, sink, progress=quiet_progress)
    readings = sink.all(1).query("record > 0")
    middle = readings["start_s"].to_numpy() + 0.5 * readings["duration_s"].to_numpy()
    true = plant.fixture.temperature.at(middle)[np.arange(len(readings)), readings["slot"].to_numpy()]
    moved = plant.fixture.temperature.at(middle + 5.0) - plant.fixture.temperature.at(middle - 5.0)
    assert np.max(np.abs(moved)) > 0.2  # it does move: half a span late would be a tenth of a degree
    assert np.max(np.abs(readings["unit_C"].to_numpy() - true)) < 0.02


def on_a_fixture(slots: int, units: int) -> MemorySink:
    """A lot on one fixture: all slots start together, share table and chamber."""
    config = load_station(STATIONS / f"simulated-{slots}.toml")
    return captured(short_recipe(poses=2, temperatures=(25.0, 40.0)), lot_of(units), config)


def station_seconds(readings: pd.DataFrame) -> float:
    return float((readings["start_s"] + readings["duration_s"]).max())


@pytest.mark.slow
def test_a_full_fixture_takes_hardly_longer_than_one_unit() -> None:
    alone = station_seconds(on_a_fixture(16, 1).all(1))
    for slots, units in ((16, 16), (32, 32)):
        readings = on_a_fixture(slots, units).all(1)
        assert (readings["status"] == "ok").all()
        assert readings.groupby("record")["unit"].nunique().unique().tolist() == [units]
        assert readings.groupby("record")["start_s"].nunique().max() == 1, "all slots start together"
        assert station_seconds(readings) <= 1.05 * alone


def limited(**limits: object) -> StationConfig:
    config = station_of()
    return config.model_copy(update={"limits": config.limits.model_copy(update=limits)})


def test_the_tighter_bound_of_profile_and_file_holds_on_each_side() -> None:
    target, point = load_profile("oriental_az"), load_profile("watlow_f4t")
    assert tighter((-200.0, 200.0), target, "target") == (-200.0, 200.0)
    assert tighter((-500.0, 200.0), target, "target") == (-400.0, 200.0)
    assert tighter((-40.0, 250.0), point, "set_point") == (-40.0, 180.0)
    assert tighter((-90.0, 85.0), point, "set_point") == (-70.0, 85.0)
    assert tighter((0.0, 1.0), point, "no_such_register") == (0.0, 1.0)
    both = r"set_point from -70\.0 to 180\.0 degC, the station's limits are 190 to 250"
    with pytest.raises(RecipeInvalid, match=both):
        tighter((190.0, 250.0), point, "set_point")


def far(outer: float) -> dict[str, object]:
    return {"poses": [Pose(name="far", outer_deg=outer, inner_deg=0.0)]}


FORBIDDEN = {
    "-400 to 400 deg": ({"outer_deg": (-500.0, 500.0)}, far(450.0)),
    "-30 to 30 deg": ({"outer_deg": (-30.0, 30.0)}, far(45.0)),
    "-70 to 180 °C": ({"temperature_C": (-90.0, 250.0)}, {"temperatures_C": [200.0]}),
    "0 to 50 °C": ({"temperature_C": (0.0, 50.0)}, {"temperatures_C": [60.0]}),
    "up to 20000 Hz": ({"rate_hz": 1e6}, {"rate_hz": 50e3}),
    "up to 200 Hz": ({"rate_hz": 200.0}, {"rate_hz": 400.0}),
}


@each(FORBIDDEN)
def test_what_either_limit_forbids_is_refused_before_anything_moves(words: str) -> None:
    limits, recipe = FORBIDDEN[words]
    asked = short_recipe().model_copy(update=recipe)
    with open_station(limited(**limits), lot_of()) as station:
        with pytest.raises(StationRefused, match=words):
            capture(station, asked, lot_of(), MemorySink(), progress=quiet_progress)
        assert station.clock.now() == 0.0
        assert not station.table.axes["outer"].moving()


def test_speed_and_acceleration_stay_within_what_the_drive_takes() -> None:
    with open_station(limited(speed_deg_s=500.0, acceleration_deg_s2=900.0), lot_of(1)) as station:
        axis = station.table.axes["outer"]
        assert (axis._limits.speed_deg_s, axis._limits.acceleration_deg_s2) == (90.0, 200.0)
        station.table.move(90.0, 0.0)
        assert station.clock.now() < 6.0


def test_a_safe_temperature_that_the_station_may_not_reach_is_refused() -> None:
    content = station_of().model_dump(mode="json")
    content["limits"]["temperature_C"] = [30.0, 80.0]
    with pytest.raises(ValidationError, match=r"safety\.temperature_C: 25 °C, 30 to 80 °C is allowed"):
        StationConfig.model_validate(content)
    content["safety"]["chamber"] = "off"
    assert StationConfig.model_validate(content).safety.chamber == "off"


def test_the_safe_state_is_the_one_of_the_file() -> None:
    for chamber, mode, set_point in (
        ("off", "off", 60.0),
        ("hold", "automatic", 60.0),
        ("set_point", "automatic", 25.0),
    ):
        config = station_of()
        config = config.model_copy(update={"safety": config.safety.model_copy(update={"chamber": chamber})})
        with open_station(config, lot_of(1)) as station:
            station.chamber.set_temperature(60.0)
            station.reader.start(100.0)
            station.table.axes["outer"].start(90.0)
            reached = station.make_safe()
            assert reached.safe, reached.sentence()
            assert (station.chamber.mode(), station.chamber.set_point()) == (mode, set_point)
            assert station.reader.sampling() == "stopped"
            assert not station.table.axes["outer"].moving()
    # a part that does not answer does not keep the others from it
    with open_station(station_of(faults=[{"kind": "silent", "device": "outer"}]), lot_of(1)) as station:
        reached = station.make_safe()
        assert list(reached.failed) == ["outer axis stopped"]
        assert station.chamber.set_point() == 25.0
        assert "outer axis stopped not done" in reached.sentence()


@pytest.mark.slow
def test_the_command_serves_a_station_at_the_port_that_it_tells() -> None:
    words = [sys.executable, "-m", "pipelines.cli", "station", "serve", "--port", "0", "--slots", "2", "--json"]
    buffered = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with subprocess.Popen(words, cwd=ROOT, stdout=subprocess.PIPE, text=True, env=buffered) as process:
        document = typed_document("station", "".join(iter(process.stdout.readline, "}\n")) + "}\n")
        with socket.create_connection(("127.0.0.1", document["port"]), 5.0):
            process.terminate()


@pytest.fixture
def claims(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Claims of processors that tests beside this one do not see."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))


@pytest.mark.skipif(
    not hasattr(os, "sched_setaffinity") or len(os.sched_getaffinity(0)) < 2, reason="needs two processors"
)
@pytest.mark.usefixtures("claims")
def test_stations_have_different_processors_and_give_them_back(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    every = os.sched_getaffinity(0)
    with one_processor():
        (own,) = os.sched_getaffinity(0)
        os.sched_setaffinity(0, every)  # as the thread of another station begins
        with one_processor():
            assert os.sched_getaffinity(0).isdisjoint({own})
    assert os.sched_getaffinity(0) == every
    monkeypatch.setattr(tempfile, "tempdir", "/proc/none")
    with one_processor():
        assert os.sched_getaffinity(0) == every  # without a place for its claim nothing changes


@pytest.mark.usefixtures("claims")
def test_a_port_that_another_program_has_just_taken_is_not_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    search = serving._free_port_pair
    with socket.create_server(("127.0.0.1", 0)) as other:
        taken = int(other.getsockname()[1])
        offers = iter([taken, taken - 1])  # the port of the Modbus server, then that of the line device beside it
        monkeypatch.setattr(serving, "_free_port_pair", lambda host: next(offers, 0) or search(host))
        with served() as port, socket.create_connection(("127.0.0.1", port), 5.0):
            assert port not in {taken, taken - 1}
