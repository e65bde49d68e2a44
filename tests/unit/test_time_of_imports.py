"""Seconds from whatever a file has as time: its unit is stated, shown by its steps, or asked for, and never assumed."""

import numpy as np
import pandas as pd
import pytest
from each import each

from pipelines.importers import clocks
from pipelines.importers.content import Content
from pipelines.importers.mapping import build
from pipelines.importers.record import imported
from schemas.errors import DataRejected, WrongUse

CONTENT = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "units": {"output": "g"}, "unit": "A1"}
N = 600


def record(time, name: str = "t") -> pd.DataFrame:
    rng = np.random.default_rng(8)
    frame = pd.DataFrame(0.002 * rng.normal(size=(N, 3)) + [0.0, 0.6, 0.8], columns=["ax", "ay", "az"])
    frame.insert(0, name, time)
    return frame


def seconds(time, claimed: str = "", name: str = "t", **units: str):
    units_ = {"output": "g"} | ({"time": claimed} if claimed else {})
    how = build({**CONTENT, "columns": {**CONTENT["columns"], "time": name}, "units": units_}, "t")
    table = record(time, name)
    recording = imported(table, how, "f.csv", Content(table, (), units))
    return recording.samples["time_s"].to_numpy(), recording.remarks


STEPS = np.arange(N)


@pytest.mark.parametrize(
    ("time", "name", "stated", "rate"),
    [
        (STEPS / 100.0, "t", {}, 100.0),
        (STEPS * 10, "t", {}, 100.0),
        (STEPS * 10_000 + 123_456, "t", {}, 100.0),
        (STEPS * 200_000_000, "t", {}, 5.0),
        (1.7e9 + STEPS / 100.0, "t", {}, 100.0),
        (1_700_000_000_000 + STEPS * 10, "t", {}, 100.0),
        (1_700_000_000_000_000 + STEPS * 1000, "t", {}, 1000.0),
        (1_700_000_000_000_000_000 + STEPS * 1_000_000, "t", {}, 1000.0),
        (STEPS * 1, "time_ms", {}, 1000.0),
        (STEPS * 1000, "timestamp (µs)", {}, 1000.0),
        (STEPS * 1, "t", {"t": "ms"}, 1000.0),
    ],
)
def test_the_unit_of_a_counter_is_recognised_and_said(time, name: str, stated: dict, rate: float) -> None:
    times, remarks = seconds(time, name=name, **stated)
    np.testing.assert_allclose(times, STEPS / rate, rtol=1e-6, atol=1e-6)
    assert any("time in " in remark and f"{rate:.4g} Hz" in remark for remark in remarks)


@each([1, 2, 1000, 500_000])
def test_steps_that_several_units_allow_are_asked_about(step: int) -> None:
    with pytest.raises(WrongUse, match=r"steps of .* Hz in .* Hz in .*add --units time="):
        seconds(STEPS * step)


@pytest.mark.parametrize(
    ("time", "claimed"), [(1_700_000_000_000 + STEPS * 10, "s"), (1_700_000_000_000_000 + STEPS * 10_000, "ms")]
)
def test_unix_time_in_another_unit_than_claimed_is_refused(time, claimed: str) -> None:
    with pytest.raises(WrongUse, match=r"Unix time, in .*, but --units time=.* was given"):
        seconds(time, claimed)


def test_microseconds_claimed_to_be_seconds_are_remarked_upon() -> None:
    assert any("CHECK THE UNIT OF TIME" in remark for remark in seconds(STEPS * 10_000, "s")[1])


STAMPS = pd.Timestamp("2026-03-01T23:59:58") + pd.to_timedelta(STEPS * 10, unit="ms")


@pytest.mark.parametrize(
    "form",
    [
        "%Y-%m-%dT%H:%M:%S.%fZ",
        "%Y-%m-%d %H:%M:%S.%f",
        "%Y-%m-%d %H:%M:%S,%f",
        "%Y-%m-%dT%H:%M:%S.%f+02:00",
        "%d.%m.%Y %H:%M:%S.%f",
        "%Y/%m/%d %H:%M:%S.%f",
        "%d-%b-%Y %H:%M:%S.%f",
        "%H:%M:%S.%f",
        "%H:%M:%S,%f",
    ],
)
def test_stamps_become_seconds_also_over_midnight(form: str) -> None:
    np.testing.assert_allclose(seconds([stamp.strftime(form) for stamp in STAMPS])[0], STEPS / 100.0, atol=1e-6)


def test_day_and_month_that_cannot_be_told_apart_matter_only_where_the_date_changes() -> None:
    form = "%d/%m/%Y %H:%M:%S.%f"
    same_day = [stamp.strftime(form) for stamp in STAMPS - pd.Timedelta(hours=1)]
    np.testing.assert_allclose(seconds(same_day)[0], STEPS / 100.0, atol=1e-6)
    with pytest.raises(DataRejected, match="day and month are ambiguous"):
        seconds([stamp.strftime(form) for stamp in STAMPS])


def test_a_broken_stamp_is_refused_with_its_row() -> None:
    stamps = [stamp.isoformat() for stamp in STAMPS]
    stamps[17] = "2026-13-45"
    with pytest.raises(DataRejected, match=r"row 18, column 't': found '2026-13-45', a time is needed"):
        seconds(stamps)


def test_a_unit_is_read_from_a_name_and_not_from_a_letter() -> None:
    assert clocks.recognised(STEPS * 1.0, "time_ms").unit == "ms"
    assert clocks.recognised(STEPS * 1.0, "s").unit == ""
    assert clocks.recognised(STEPS * 1.0, "SampleTimeFine").unit == ""
