"""A lot on one fixture: all slots start together, share table and chamber, and nobody waits for a unit that has failed."""

from pathlib import Path

import pytest
from small_station import MemorySink, lot_of, quiet_progress, short_recipe

from pipelines.capture.capture import capture
from schemas.fault import parse_fault
from schemas.station import load_station, with_faults
from stations.opening import open_station

ROOT = Path(__file__).resolve().parents[2]
RECIPE = short_recipe(poses=6, temperatures=(25.0, 40.0))


def captured(slots: int, units: int, *faults: str) -> MemorySink:
    config = load_station(ROOT / "deploy" / "stations" / f"simulated-{slots}.toml")
    config = config.model_copy(update={"link": config.link.model_copy(update={"timeout_s": 1.0, "read_attempts": 1})})
    sink, lot = MemorySink(), lot_of(units)
    with open_station(with_faults(config, [parse_fault(text) for text in faults]), lot) as station:
        capture(station, RECIPE, lot, sink, progress=quiet_progress)
    return sink


def station_seconds(sink: MemorySink) -> float:
    readings = sink.all(1)
    return float((readings["start_s"] + readings["duration_s"]).max())


@pytest.fixture(scope="module")
def alone() -> float:
    return station_seconds(captured(16, 1))


@pytest.mark.parametrize(("slots", "units"), [(16, 8), (16, 16), (32, 32)])
def test_a_full_fixture_takes_hardly_longer_than_one_unit(alone: float, slots: int, units: int) -> None:
    sink = captured(slots, units)
    readings = sink.all(1)
    assert (readings["status"] == "ok").all()
    assert readings.groupby("record")["unit"].nunique().unique().tolist() == [units]
    assert readings.groupby("record")["start_s"].nunique().max() == 1, "all slots start together"
    assert station_seconds(sink) <= 1.05 * alone


def test_units_that_fail_never_hold_up_the_others(alone: float) -> None:
    faults = (
        "silent:serial=U003:at_s=900", "dead:serial=U007", "garbage:serial=U011:at_s=1200",
        "frozen_temperature:serial=U005:at_s=950", "mute:serial=U015:at_s=990",
    )  # fmt: skip
    sink = captured(16, 16, *faults)
    readings = sink.all(1)
    last = readings[readings["record"] == readings["record"].max()]
    lost = last.loc[last["status"] != "ok", "unit"].tolist()
    assert lost == ["U003", "U005", "U011", "U015"]
    assert len(sink.records) == 14
    assert (last.loc[~last["unit"].isin(lost), "n"] == 200).all()
