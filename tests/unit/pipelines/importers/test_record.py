"""Recordings as they are read: a time in any unit or as stamps, and an axis that stands still in a dwell."""

import lots
import numpy as np
import pandas as pd
import pytest
from each import each

from inertial.quantities import FORCE_COLUMNS, RECORDED
from pipelines.diagnosis.diagnose import default_model, diagnose
from pipelines.importers import clocks
from pipelines.importers.content import Content
from pipelines.importers.mapping import build
from pipelines.importers.record import Imported, imported
from pipelines.importers.stated_units import refuse_contradiction
from pipelines.tables.dwell_table import DwellTable, state_of_table
from schemas.errors import DataRejected, RecipeInvalid, WrongUse
from schemas.units import STANDARD_GRAVITY_M_S2

AXES = {"x": "ax", "y": "ay", "z": "az"}
STEPS = np.arange(600)


def of_size(rng: np.random.Generator, size: float = 1.0, rows: int = 12) -> pd.DataFrame:
    """Means of positions with this norm, which are not whole numbers."""
    out = rng.normal(size=(rows, 3))
    return pd.DataFrame(size * out / np.linalg.norm(out, axis=1, keepdims=True), columns=["ax", "ay", "az"])


def read(frame: pd.DataFrame, columns: dict[str, str], stated: Content | None = None, **more: object) -> Imported:
    """The import of means in g of one unit; ``columns`` beside those of the output, other keys in ``more``."""
    content = {"units": {"output": "g"}, "unit": "A1", "rows": "dwells", "columns": AXES | columns} | more
    return imported(frame, build(content, "t"), "f.csv", stated)


@each(range(8))
def test_one_frozen_dwell_of_known_pose_is_a_stuck_output(seed: int) -> None:
    rng = np.random.default_rng([4_401, seed])
    table = lots.lot(rng, units=1)
    row, axis = int(rng.integers(1, len(table))), str(rng.choice(list("xyz")))
    # 1000 equal samples: their mean differs from them, and from the last mean, in the last digits only
    table.loc[row, f"out_{axis}"] = float(np.mean(np.full(1000, table.loc[row - 1, f"out_{axis}"]) + 1e-17))
    table.loc[row, f"sd_{axis}"] = 1e-16
    found = [(one["fault"], one["dwells"]) for one in diagnose(table)["blocked_by"]]
    assert found == [("stuck_output", [int(table.loc[row, "dwell"])])]


def test_dwells_of_a_file_in_which_an_axis_stands_still_are_refused_or_left_out(rng: np.random.Generator) -> None:
    frame, spreads = of_size(rng).assign(sx=1e-3, sy=1e-3, sz=1e-3), {"sd_x": "sx", "sd_y": "sy", "sd_z": "sz"}
    frame.loc[7, "sy"] = 0.0
    with pytest.raises(DataRejected, match=r"axis y is constant in dwell 'dwell 7' \(row 8\).*1 such dwells"):
        read(frame, spreads)
    assert len(read(frame, spreads, faulty="leave-out").dwells) == 11
    assert len(read(frame, spreads, faulty="keep").dwells) == 12


@each({"2026-03-29 00:55": "forward", "2026-10-25 00:30": "back", "2026-10-28 00:30": ""}.items())
def test_local_times_over_a_change_of_the_clock_are_told_and_right_where_the_zone_is_stated(
    clock: tuple[str, str], rng: np.random.Generator
) -> None:
    start, jump = clock
    moments = pd.date_range(start, periods=90, freq="60s", tz="UTC").tz_convert("Europe/Berlin")
    frame, time = of_size(rng, rows=90), {"time": "when"}
    for when in (moments.strftime("%d.%m.%Y %H:%M:%S"), moments.tz_localize(None)):
        told = f"the times jump {jump} by an hour before row"
        try:
            remarks = read(frame.assign(when=when), time).remarks
        except DataRejected as refused:
            assert jump == "back"
            remarks = (str(refused),)
        assert [told in remark and "--set zone=NAME, for instance Europe/Berlin" in remark for remark in remarks] == (
            [True] if jump else []
        )
        right = read(frame.assign(when=when), time, zone="Europe/Berlin")
        assert right.remarks == ()
        np.testing.assert_allclose(right.dwells["time_s"], 60.0 * np.arange(90))
    if jump == "forward":
        frame["when"] = moments.tz_convert("UTC").tz_localize(None) + pd.Timedelta("1h")
        with pytest.raises(DataRejected, match=r"row 6: 2026-03-29 02:00:00 does not exist in Europe/Berlin"):
            read(frame, time, zone="Europe/Berlin")
    with pytest.raises(RecipeInvalid, match=r"zone: no zone 'Europe/Berln'; did you mean Europe/Berlin"):
        read(frame, time, zone="Europe/Berln")


def test_one_pose_is_judged_by_bias_and_its_temperature(rng: np.random.Generator) -> None:
    table = lots.lot(rng, units=1)
    assert default_model(table)[:3] == ["bias", "scale", "misalignment"]
    one = table.assign(outer_deg=0.0, inner_deg=0.0)
    assert default_model(one) == ["bias", "bias_temperature"]
    assert default_model(one.assign(unit_C=25.0)) == ["bias"]


def seconds(time, claimed: str = "", name: str = "t", **units: str):
    """Times of a record of samples, and what is remarked; ``claimed`` by the user, ``units`` stated by the file."""
    out = 0.002 * np.random.default_rng(8).normal(size=(STEPS.size, 3)) + [0.0, 0.6, 0.8]
    table = pd.DataFrame(out, columns=["ax", "ay", "az"]).assign(**{name: time})
    stated = {"output": "g"} | ({"time": claimed} if claimed else {})
    recording = read(table, {"time": name}, Content(table, (), units), rows="samples", units=stated)
    return recording.samples["time_s"].to_numpy(), recording.remarks


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


def test_times_in_a_doubtful_or_another_unit_than_claimed_are_asked_about_refused_or_remarked_upon(rng) -> None:
    for step in (1, 2, 1000, 500_000):
        with pytest.raises(WrongUse, match=r"steps of .* Hz in .* Hz in .*add --unit-of time="):
            seconds(STEPS * step)
    for first, step, claimed in ((1_700_000_000_000, 10, "s"), (1_700_000_000_000_000, 10_000, "ms")):
        with pytest.raises(WrongUse, match=r"Unix time, in .*, but --unit-of time=.* was given"):
            seconds(first + STEPS * step, claimed)
    assert any("CHECK THE UNIT OF TIME" in remark for remark in seconds(STEPS * 10_000, "s")[1])
    # a unit is read from a name and not from a letter
    assert [clocks.recognised(STEPS * 1.0, n).unit for n in ("time_ms", "s", "SampleTimeFine")] == ["ms", "", ""]
    frame = of_size(rng).assign(when=60_000.0 * np.arange(12))  # of dwells the unit that the file states counts
    dwells = read(frame, {"time": "when"}, Content(frame, units={"when": "ms"})).dwells
    np.testing.assert_allclose(dwells["time_s"], 60.0 * np.arange(12))


STAMPS = pd.Timestamp("2026-03-01T23:59:58") + pd.to_timedelta(STEPS * 10, unit="ms")


@each(["%Y-%m-%dT{}.%fZ", "%Y-%m-%d {}.%f", "%Y-%m-%d {},%f", "%Y-%m-%dT{}.%f+02:00", "%d.%m.%Y {}.%f", "%Y/%m/%d {}.%f",
       "%d-%b-%Y {}.%f", "{}.%f", "{},%f"])  # fmt: skip
def test_stamps_become_seconds_also_over_midnight(form: str) -> None:
    stamps = [stamp.strftime(form.format("%H:%M:%S")) for stamp in STAMPS]
    np.testing.assert_allclose(seconds(stamps)[0], STEPS / 100.0, atol=1e-6)


def test_day_and_month_that_cannot_be_told_apart_matter_only_where_the_date_changes() -> None:
    form = "%d/%m/%Y %H:%M:%S.%f"
    same_day = [stamp.strftime(form) for stamp in STAMPS - pd.Timedelta(hours=1)]
    np.testing.assert_allclose(seconds(same_day)[0], STEPS / 100.0, atol=1e-6)
    with pytest.raises(DataRejected, match="day and month are ambiguous"):
        seconds([stamp.strftime(form) for stamp in STAMPS])
    stamps = [stamp.isoformat() for stamp in STAMPS]
    stamps[17] = "2026-13-45"
    with pytest.raises(DataRejected, match=r"row 18, column 't': found '2026-13-45', a time is needed"):
        seconds(stamps)


def test_standard_deviations_of_no_output_or_in_another_unit_than_theirs_are_refused(rng: np.random.Generator) -> None:
    names = ["x", "y", "z", "sd_x", "sd_y", "sd_z"]
    frame = pd.DataFrame(rng.normal(size=(12, 6)), columns=names)
    mapping = build({"columns": {name: name for name in names}, "units": {"output": "V"}}, "t")
    outputs = dict.fromkeys("xyz", "V")
    for stated in ("µV", "mV"):
        content = Content(frame, units=outputs | {"sd_y": stated})
        with pytest.raises(WrongUse, match=f"column 'sd_y' .* states {stated}, V is the unit of the output"):
            refuse_contradiction(mapping, content, "f.csv")
    refuse_contradiction(mapping, Content(frame, units=outputs | {"sd_x": "V", "sd_y": "n=400"}), "f.csv")
    with pytest.raises(RecipeInvalid, match="sd_y without y"):
        build({"columns": {"x": "a", "sd_y": "b"}, "units": {"output": "V"}, "axes": ["x"]}, "t")


@each([(name, rows) for name in ("column", "mapped") for rows in ("dwells", "samples")])
def test_recorded_quantities_of_a_file_are_kept_as_they_are_stated(row: tuple[str, str], rng) -> None:
    name, rows = row
    quantities = [one for one in RECORDED if one.mapped]
    file = of_size(rng).assign(no=range(12), **{one.label: rng.integers(1, 9, 12).astype(float) for one in quantities})
    columns = {"dwell": "no"} | {getattr(one, name): one.label for one in quantities}
    dwells = read(file, columns, rows=rows, rate_hz=1.0).dwells
    for one in quantities:
        np.testing.assert_array_equal(dwells[one.column], file[one.label])


def test_means_of_counts_need_not_be_whole_numbers_but_where_there_are_fewer_a_g_than_converters_have(
    rng: np.random.Generator,
) -> None:
    counts = {"units": {"output": "LSB"}, "rate_hz": 1.0}
    found = read(of_size(rng, 1033.0), {}, **counts)
    assert found.out_unit == "LSB"
    assert [one for one in found.remarks if "the norm of the output is 1033, as gravity in mg; LSB was given" in one]
    for size, rows in ((1.01, "dwells"), (9.8, "dwells"), (1033.0, "samples")):
        with pytest.raises(DataRejected, match="are not whole numbers, counts are needed"):
            read(of_size(rng, size), {}, rows=rows, **counts)


@pytest.mark.parametrize(
    ("labels", "numbers", "remark"),
    [
        ([3, 5, 8, 3, 5, 8], [3, 5, 8, 3, 5, 8], ""),
        ([3.0, 5.0, 8.0, 3.0, 5.0, 9.0], [3, 5, 8, 3, 5, 9], ""),
        (["up", "down", "1", "up", "down", "1"], [0, 1, 2, 0, 1, 2], ""),
        ([0.5, 1.5, 2.5, 0.5, 1.5, 2.5], [0, 1, 2, 0, 1, 2], ""),
        ([1, 2, 1, 1, 2, 1], [0, 1, 2, 0, 1, 2], "repeat or go back"),
        ([2, 1, 3, 2, 1, 3], [0, 1, 2, 0, 1, 2], "repeat or go back"),
        ([1, 2, 3, 4, 5, 6], [0, 1, 2, 0, 1, 2], "run on from unit to unit"),
    ],
)
def test_dwells_have_the_numbers_of_the_file_where_these_number_them(labels, numbers, remark: str, rng) -> None:
    file = of_size(rng, rows=6).assign(no=labels, serial=["A1"] * 3 + ["B1"] * 3)
    found = read(file, {"dwell": "no", "unit": "serial"}, unit="")
    assert found.dwells["dwell"].tolist() == numbers
    assert found.dwells["pose"].tolist() == [str(one) for one in labels]
    told = [one for one in found.remarks if "labels only" in one]
    assert [remark in one for one in told] == [True] * bool(remark)


def test_labelled_samples_have_the_numbers_of_their_labels(rng: np.random.Generator) -> None:
    file = pd.concat([of_size(rng, rows=3)] * 8, ignore_index=True).assign(no=np.repeat([2, 3, 7, 9], 6))
    stated = {"poses": {"3": "+x", "9": "+z"}, "local_gravity_m_s2": 9.81}
    assert read(file, {"dwell": "no"}, rows="samples", rate_hz=10.0, **stated).dwells["dwell"].tolist() == [3, 9]


@each([(stated, rows) for stated in ({}, {"local_gravity_m_s2": 9.81}) for rows in ("dwells", "samples")])
def test_angles_of_a_table_become_the_force_that_a_diagnosis_of_the_file_reads(row: tuple[dict, str], rng) -> None:
    stated, rows = row
    gravity = stated.get("local_gravity_m_s2", STANDARD_GRAVITY_M_S2) / STANDARD_GRAVITY_M_S2
    angles = {"outer_deg": rng.uniform(-180.0, 180.0, 12), "inner_deg": [180.0, *rng.uniform(-180.0, 180.0, 11)]}
    file = of_size(rng).assign(no=range(12), **angles)
    if rows == "samples":
        file = pd.concat([file, file.assign(inner_deg=file["inner_deg"] - 360.0)]).sort_values("no", ignore_index=True)
    columns = {"dwell": "no", "outer": "outer_deg", "inner": "inner_deg"}
    dwells = read(file, columns, rows=rows, rate_hz=1.0, **stated).dwells
    plain = pd.DataFrame({"unit": "A1", "dwell": range(12), "time_s": np.arange(12.0), **angles})
    reference, state = state_of_table(DwellTable(plain.assign(out_x=0.0, out_y=0.0, out_z=0.0)))
    assert reference == "angles"
    np.testing.assert_allclose(dwells[[*FORCE_COLUMNS]], gravity * state.force[0], atol=1e-12)
    force = {"force_x": "fx", "force_y": "fy", "force_z": "fz"}  # one that is stated beside the angles is kept
    kept = read(file.assign(fx=0.6, fy=0.0, fz=0.8), columns | force, rows=rows, rate_hz=1.0, **stated).dwells
    np.testing.assert_array_equal(kept[[*FORCE_COLUMNS]], np.tile([0.6, 0.0, 0.8], (12, 1)))
