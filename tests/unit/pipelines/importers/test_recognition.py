"""Files as loggers, telephones and benches write them, made from physics: the right three columns are recognised, or none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from each import each
from hand import G, Hand, sensed
from scipy import signal
from scipy.io import savemat

from pipelines.importers.inspection import inspect
from pipelines.importers.mapping import build
from pipelines.importers.recognition import Recognition, recognise
from pipelines.importers.record import imported

Rng = np.random.Generator
Columns = dict[Any, np.ndarray]


def accelerations(
    rng: Rng, true: np.ndarray, scale: float = 1.0, bias: tuple[float, ...] = (0.01, -0.02, 0.03)
) -> np.ndarray:
    return sensed(rng, true, scale, bias, 0.003 * scale)


def three(names: str, values: np.ndarray) -> dict[str, np.ndarray]:
    return dict(zip(names.split(), values.T, strict=True))


def csv(path: Path, columns: dict) -> Path:
    """Columns with their names, or without where these are numbers."""
    named = isinstance(next(iter(columns)), str)
    pd.DataFrame(columns).to_csv(path, index=False, header=named, float_format="%.6f")
    return path


# files with an answer: file → columns of x, y, z; unit of the output; unit of time; whether rows are positions


def logger_of_imu(rng: Rng, hand: Hand, _: Path) -> Columns:
    """Counts of a gyroscope before those of an accelerometer, time in µs since power-on, one pause of the logger."""
    time = np.rint(2.3e9 + 1e6 * hand.time + np.where(hand.time > 40.0, 344_000.0, 0.0))
    rates = three("gx gy gz", np.rint(sensed(rng, hand.rate, 1880.0, (0.02, -0.03, -0.02), 8.0)))
    return {"ustime": time} | rates | three("ax ay az", np.rint(accelerations(rng, hand.force, 16384.0)))


def positions_without_header(rng: Rng, _: Hand, __: Path) -> Columns:
    """Means of counts in thirty positions, nothing else."""
    return dict(enumerate(np.round(accelerations(rng, Hand(rng, stops=30).stops, 16384.0), 3).T))


def matrix_with_clock(rng: Rng, hand: Hand, at: Path) -> Path:
    """Time and words of a converter with its zero in the middle, as one matrix."""
    counts = np.rint(32768.0 + accelerations(rng, hand.force, 4060.0))
    savemat(str(at / "a.mat"), {"IMU0x2Dalpha": np.column_stack([hand.time + 0.03, counts])})
    return at / "a.mat"


def bursts(rng: Rng, _: Hand, __: Path) -> Columns:
    """A buffer of eight samples each 12 ms, with temperatures of two other sensors that rest at zero."""
    hand = Hand(rng, rate=8.0 / 0.0135)
    stamp = 12.0 * (np.arange(hand.n) // 8) + 0.2 * (np.arange(hand.n) % 8) + 1.5 * (np.arange(hand.n) // 8)
    columns = {"now[ms]": 71556.0 + stamp, "AHT_tmp[C]": np.zeros(hand.n), "BMP_pres": np.zeros(hand.n)}
    columns |= three("gx gy gz", np.degrees(sensed(rng, hand.rate, 1.0, (0.1, 0.0, 0.0), 0.05)))
    columns |= three("ax ay az", accelerations(rng, hand.force)) | {"gtemp": 41.0 + 0.3 * np.sin(hand.time)}
    return columns | three("magx magy magz", sensed(rng, hand.field, 1.0, (5.0, 8.0, -4.0), 0.5))


def maker_of_sensors(rng: Rng, _: Hand, at: Path) -> Path:
    """Lines of settings, counters of 100 µs, angles in every fourth row only."""
    n = 4000
    still = G * accelerations(rng, np.tile([1.0, 0.03, -0.01], (n, 1)))
    angles = [["", "", ""] if k % 4 != 1 else [f"{v:.4f}" for v in (112.9, -88.2, 28.1)] for k in range(n)]
    counted = [[str(16213 + k), str(10259826 + 25 * k), *(f"{v:.6f}" for v in still[k])] for k in range(n)]
    rows = ["\t".join([*counted[k], "0.001", "-0.002", "0.000", *angles[k]]) for k in range(n)]
    head = ["// General information: ", "//  version: 2022.0.0 ", "// Coordinate system: ENU"]
    head.append("PacketCounter SampleTimeFine Acc_X Acc_Y Acc_Z Gyr_X Gyr_Y Gyr_Z Roll Pitch Yaw".replace(" ", "\t"))
    (at / "a.txt").write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")
    return at / "a.txt"


def labelled_records(rng: Rng, _: Hand, at: Path) -> Path:
    """Records of NumPy with a label in each, the time last; the sensor lies still."""
    n = 1500
    table = pd.DataFrame(accelerations(rng, np.tile([-0.02, 0.0, 1.03], (n, 1))), columns=["ax", "ay", "az"])
    table[["gx", "gy", "gz"]] = rng.normal(0.0, 0.1, (n, 3))
    table = table.assign(timestamp=28_902_133 + 10_000 * np.arange(n), label="Stationary")
    records = table.to_records(index=False, column_dtypes={"timestamp": "<i8", "label": "<U32"})
    np.save(at / "a.npy", np.asarray(records))
    return at / "a.npy"


def telephone_export(rng: Rng, hand: Hand, _: Path) -> Columns:
    """Acceleration beside the gravity and the linear acceleration that a telephone computes."""
    names = " ".join(f"{one}_{axis}" for one in ("gravity", "linear", "accelerometer") for axis in "xyz")
    parts = G * hand.force, rng.normal(0.0, 0.1, (hand.n, 3)), G * accelerations(rng, hand.force)
    return {"time": hand.time} | three(names, np.hstack(parts))


def volts_beside_force(rng: Rng, _: Hand, __: Path, forces: str = "force_x force_y force_z") -> Columns:
    """A bench: the force that was applied, in g and without noise, before the outputs in V."""
    true = Hand(rng, stops=24).stops
    outputs = three("out_x[V] out_y[V] out_z[V]", 0.66 * accelerations(rng, true))
    return {"step": np.arange(24.0)} | three(forces, true) | outputs


def references_beside_means(rng: Rng, _: Hand, __: Path) -> Columns:
    """Six faces: what each axis should read, its mean, its standard deviation, axis after axis."""
    true = np.vstack([np.eye(3), -np.eye(3)])
    each_axis = np.stack([true, accelerations(rng, true), np.full((6, 3), 0.003)], axis=2).reshape(6, 9)
    names = [f"{axis}_{one}" for axis in "xyz" for one in ("true (g)", "mean (g)", "std")]
    return dict(zip(names, each_axis.T, strict=True))


RIGHT = {
    references_beside_means: ("x_mean (g) y_mean (g) z_mean (g)", "g", "", True),
    logger_of_imu: ("ax ay az", "LSB", "us", False),
    positions_without_header: ("1 2 3", "LSB", "", True),
    matrix_with_clock: ("IMU0x2Dalpha_2 IMU0x2Dalpha_3 IMU0x2Dalpha_4", "LSB", "s", False),
    bursts: ("ax ay az", "g", "ms", False),
    maker_of_sensors: ("Acc_X Acc_Y Acc_Z", "m/s^2", "samples", False),
    labelled_records: ("ax ay az", "g", "us", False),
    telephone_export: ("accelerometer_x accelerometer_y accelerometer_z", "m/s^2", "s", False),
    volts_beside_force: ("out_x[V] out_y[V] out_z[V]", "V", "", True),
}


def weather(rng: Rng, _: Hand, __: Path) -> Columns:
    n = 3000
    day = np.sin(np.arange(n) / 400.0)
    places = {"T1": (20.0, 5.0), "T2": (20.3, 4.6), "T3": (19.0, 5.5)}
    air = {name: mean + swing * day + 0.01 * rng.normal(size=n) for name, (mean, swing) in places.items()}
    return {"row": np.arange(n), "t": np.arange(n)} | air


def two_sensors_mixed(rng: Rng, hand: Hand, _: Path) -> Columns:
    """x and y of one sensor, z of another that is mounted otherwise; no names."""
    one, other = accelerations(rng, hand.force), accelerations(rng, hand.force)
    return dict(enumerate([hand.time, one[:, 0], one[:, 1], other[:, 1]]))


TWO = "acc1_x acc1_y acc1_z acc2_x acc2_y acc2_z"
SEALED: dict[str, Callable[[Rng, Hand, Path], Columns]] = {  # what must not be proposed
    "counts of a gyroscope without names": lambda rng, hand, _: dict(
        enumerate([hand.time, *np.rint(sensed(rng, hand.rate, 1880.0, (17.4,) * 3, 8.0)).T])
    ),
    "a gyroscope called x, y, z": lambda rng, hand, _: (
        {"time": hand.time} | three("x y z", sensed(rng, hand.rate, 1.0, (0.01, 0.02, -0.01), 0.002))
    ),
    "a magnetometer": lambda rng, hand, _: (
        {"time": hand.time} | three("mx my mz", sensed(rng, hand.field, 1.0, (5.0, 8.0, -4.0), 0.3))
    ),
    "two sensors": lambda rng, hand, _: (
        {"time": hand.time} | three(TWO, np.hstack([accelerations(rng, hand.force) for _ in "12"]))
    ),
    "two sensors mixed": two_sensors_mixed,
    "weather": weather,
    "a reference alone": lambda rng, *_: (
        {"position": np.arange(24.0)} | three("ref_x ref_y ref_z", np.round(Hand(rng, stops=24).stops, 6))
    ),
    "voltages that drift": lambda rng, *_: dict(
        enumerate([np.arange(4000) / 50.0, *(1.65 + 0.001 * np.cumsum(rng.normal(size=(3, 4000)), axis=1))])
    ),
    "a force called like an output": lambda rng, *more: volts_beside_force(rng, *more, "fx[g] fy[g] fz[g]"),
    "standard deviations": lambda rng, *_: (
        {"time": np.arange(200.0) / 10.0} | three("sd_x sd_y sd_z", 0.003 + 3e-4 * rng.normal(size=(200, 3)))
    ),
}


def file_of(make: Callable[[Rng, Hand, Path], Columns | Path], rng: Rng, at: Path) -> Path:
    made = make(rng, Hand(rng), at)
    return made if isinstance(made, Path) else csv(at / "a.csv", made)


def axes_of(seen: Recognition) -> str:
    return " ".join(filter(None, (seen.guessed.column(axis) for axis in "xyz")))


@each(RIGHT)
def test_the_three_columns_their_unit_and_the_clock_are_recognised(write: Callable, rng: Rng, tmp_path: Path) -> None:
    seen = recognise([file_of(write, rng, tmp_path)])
    columns, unit, time, positions = RIGHT[write]
    assert axes_of(seen) == columns
    assert seen.guessed.output.meaning == unit
    assert seen.guessed.time_unit.meaning == time
    assert seen.guessed.dwells is positions
    assert [text for text in seen.open if not text.startswith("the rate of the samples")] == []
    if write is bursts:  # one record
        assert seen.gaps == 0
        assert seen.rate_hz == pytest.approx(8.0 / 0.0135, rel=0.01)
        assert seen.guessed.column("temperature") == "gtemp"
    assert seen.gaps == 1 or write is not logger_of_imu
    if write is references_beside_means:  # by their names; the poses are known, and it is fitted as a run is
        means = {f"force_{axis}": f"{axis}_true (g)" for axis in "xyz"}
        assert (means | {f"sd_{axis}": f"{axis}_std" for axis in "xyz"}).items() <= seen.keys["columns"].items()
        assert seen.for_fit().fit == ""


@each(SEALED)
def test_nothing_is_proposed_where_no_three_columns_are_one_accelerometer(name: str, rng: Rng, tmp_path: Path) -> None:
    seen = recognise([file_of(SEALED[name], rng, tmp_path)])
    assert axes_of(seen) == ""
    assert seen.open
    assert "x=COLUMN" in seen.import_command
    if name == "a force called like an output":
        assert "2 groups" in seen.open[0]
        assert len(seen.open) == 1


@each([("-- Data File Created By ActiGraph GT3X+ date format M/d/yyyy at 30 Hz  Filter Normal --", 30.0),
       ("Sampling rate: 12.5 Hz", 12.5), ("Sampling frequency [Hz];50", 50.0),
       ("Low pass 42 Hz", None), ("Shaker test at 80 Hz, 1 g", None), ("Low-pass filter at 10 Hz", None),
       ("Anti-alias filter: -3 dB at 45 Hz", None), ("Bandwidth sampled down, filter 20 Hz", None),
       ("sampled at 30 Hz\nsampled at 60 Hz", None)])  # fmt: skip
def test_the_rate_that_stands_above_a_table_without_a_clock_is_taken(told, rng: Rng, tmp_path: Path) -> None:
    text, rate = told
    path = csv(tmp_path / "a.csv", three("ax ay az", accelerations(rng, Hand(rng, rate=30.0).force)))
    path.write_text(f"{text}\nSerial number A1\n{path.read_text('utf-8')}", encoding="utf-8")
    seen = recognise([path])
    assert seen.rate_hz == (None if rate is None else pytest.approx(rate))
    assert bool(seen.open) is (rate is None)
    assert ("--rate HZ" if rate is None else f"--rate {rate:g} ") in f"{seen.import_command} "


def test_a_record_that_never_rests_has_no_stops_and_a_noisy_one_at_rest_has(rng: Rng, tmp_path: Path) -> None:
    """A hand that trembles by ten degrees and turns over; and a wide range with a noise of a third of g."""
    time = np.arange(0.0, 70.0, 0.03)
    slow = np.cumsum(rng.normal(size=(len(time), 2)), axis=0)
    slow = 0.15 * (slow - signal.savgol_filter(slow, 101, 1, axis=0))
    tilt = np.pi * (time // 12.0)[:, None] / 3.0 + slow
    force = np.column_stack(
        [np.sin(tilt[:, 0]), np.cos(tilt[:, 0]) * np.sin(tilt[:, 1]), np.cos(tilt[:, 0]) * np.cos(tilt[:, 1])]
    )
    noisy = [0.0, 0.0, 1.0] + 0.3 * rng.normal(size=force.shape)
    for name, output, stops in (("moving", force, 0), ("noisy", noisy, 1)):
        columns = {"time [s]": time} | three("ax[g] ay[g] az[g]", output + 0.002 * rng.normal(size=force.shape))
        seen = recognise([csv(tmp_path / f"{name}.csv", columns)])
        assert len(seen.stops.found) == stops
        told = inspect([tmp_path / f"{name}.csv"]).document["remarks"]
        assert any("no position at rest" in text for text in told) is (stops == 0)
        made = imported(pd.DataFrame(columns), build(seen.keys, name), name)
        assert (0 if made.dwells is None else len(made.dwells)) == stops
        assert any("are no rest" in text for text in made.remarks) is (stops == 0)


def test_files_that_follow_one_another_are_positions_of_their_own(rng: Rng, tmp_path: Path) -> None:
    paths = []
    for k, force in enumerate(np.vstack([np.eye(3), -np.eye(3)])):
        outputs = three("ax[g] ay[g] az[g]", accelerations(rng, np.tile(force, (400, 1))))
        paths.append(csv(tmp_path / f"face-{k}.csv", {"time [s]": np.arange(400) / 100.0} | outputs))
    seen = recognise(paths, join="rows")
    assert seen.stops.found.spans == tuple((400 * k, 400 * (k + 1)) for k in range(6))
    assert seen.import_command.endswith("--set join=rows")


def test_two_levels_of_something_are_no_clock(rng: Rng, tmp_path: Path) -> None:
    columns = {"length": rng.uniform(30.0, 60.0, 8), "frequency": rng.uniform(4.0, 100.0, 8)}
    columns["mode"] = np.repeat([1.0, 2.0], 4)
    assert recognise([csv(tmp_path / "a.csv", columns)]).guessed.column("time") == ""


@each([("°C", "temperature"), ("°", ""), ("Hz", ""), ("mV/g", "")])
def test_what_grows_in_another_unit_than_one_of_time_is_no_clock(told, rng: Rng, tmp_path: Path) -> None:
    unit, meaning = told
    means = pd.DataFrame(accelerations(rng, Hand(rng, stops=24).stops), columns=["x [g]", "y [g]", "z [g]"])
    means.insert(0, f"T [{unit}]", 10.0 * np.arange(24))
    means.to_csv(tmp_path / "a.csv", index=False)
    assert recognise([tmp_path / "a.csv"]).guessed.columns[f"T [{unit}]"].meaning == meaning


def test_a_day_beside_the_time_of_day_marks_no_dwells(rng: Rng, tmp_path: Path) -> None:
    hand = Hand(rng)
    stamps = pd.Timestamp("2026-03-02T23:59:30") + pd.to_timedelta(hand.time, unit="s")
    columns = {"Datum": stamps.strftime("%d.%m.%Y"), "Uhrzeit": stamps.strftime("%H:%M:%S.%f")}
    seen = recognise([csv(tmp_path / "a.csv", columns | three("ax ay az", accelerations(rng, hand.force)))])
    assert (seen.guessed.column("time"), seen.guessed.column("dwell")) == ("Uhrzeit", "")


IN_EXCHANGE_FORMAT = {
    "unit": "unit", "dwell": "dwell", "time": "time_s", "n": "n", "duration": "duration_s", "temperature": "unit_C",
    "slot": "slot", "outer": "outer_deg", "inner": "inner_deg", "since_move": "since_move_s", "since_power": "since_power_s",
    "sd_x": "sd_x", "sd_y": "sd_y", "sd_z": "sd_z", "humidity_pct": "humidity_pct",
}  # fmt: skip


def dwells_of_units(rng: Rng, scale: float = 1.0) -> pd.DataFrame:
    """Dwells of three units in the exchange format, one unit after the other, but for the names of the outputs."""
    rows, time = 3 * 24, np.tile(90.0 * np.arange(24), 3) + 1800.0
    columns = {"unit": np.repeat(["S1", "S2", "S3"], 24), "slot": np.repeat(range(3), 24)}
    columns |= {"dwell": np.tile(range(3, 27), 3), "time_s": time, "duration_s": 40.0, "n": 400}
    columns |= {"since_power_s": time, "since_move_s": rng.uniform(30.0, 60.0, rows)}
    columns |= {"outer_deg": rng.uniform(0.0, 180.0, rows), "inner_deg": rng.uniform(-180.0, 180.0, rows)}
    columns |= three("ax ay az", accelerations(rng, np.tile(Hand(rng, stops=24).stops, (3, 1)), scale))
    columns |= three("sd_x sd_y sd_z", rng.uniform(0.001, 0.002, (rows, 3)) * scale)
    columns |= {"unit_C": 25.0 + rng.uniform(size=rows), "humidity_pct": rng.uniform(40.0, 50.0, rows)}
    return pd.DataFrame(columns)


@each([{}, {"unit": "Serial No", "dwell": "no", "time_s": "t", "unit_C": "sensor temperature"}], str)
def test_columns_named_as_in_the_exchange_format_serials_and_numbers_of_dwells_are_recognised(
    renamed, rng, tmp_path
) -> None:
    file = dwells_of_units(rng).rename(columns=renamed)
    mixed = file.sort_values(renamed.get("dwell", "dwell"), kind="stable")  # a row of each unit in turn
    mixed.to_csv(tmp_path / "lot.csv", index=False)
    in_turn = recognise([tmp_path / "lot.csv"])
    file.to_csv(tmp_path / "lot.csv", index=False)
    seen = recognise([tmp_path / "lot.csv"])
    assert (in_turn.keys, in_turn.rate_hz, in_turn.open) == (seen.keys, seen.rate_hz, ())
    expected = {meaning: renamed.get(name, name) for meaning, name in IN_EXCHANGE_FORMAT.items()}
    assert seen.keys["columns"] == expected | {"x": "ax", "y": "ay", "z": "az"}
    assert (seen.keys["units"], seen.keys["rows"], seen.open) == ({"output": "g"}, "dwells", ())
    assert "--units " not in seen.import_command
    assert seen.for_fit().fit == ""  # its poses are known
    dwells = imported(file, build(seen.for_fit().keys, "t"), "lot.csv").dwells
    assert sorted(set(dwells["unit"])) == ["S1", "S2", "S3"]
    assert dwells["dwell"].tolist() == [*range(3, 27)] * 3
    file.drop(columns=renamed.get("dwell", "dwell")).to_csv(tmp_path / "unnumbered.csv", index=False)
    assert recognise([tmp_path / "unnumbered.csv"]).open == ()  # each unit has a clock of its own


def test_labels_at_which_the_time_begins_anew_are_units_whatever_they_are_called(rng: Rng, tmp_path: Path) -> None:
    file = dwells_of_units(rng).rename(columns={"unit": "Prüfling", "dwell": "Lage", "time_s": "Zeit [s]"})
    file.drop(columns=["slot", "since_power_s", "since_move_s", "duration_s"]).to_csv(tmp_path / "lot.csv", index=False)
    seen = recognise([tmp_path / "lot.csv"])
    assert [seen.keys["columns"].get(one) for one in ("unit", "time", "dwell")] == ["Prüfling", "Zeit [s]", None]
    dwells = imported(file, build(seen.keys, "t"), "lot.csv").dwells
    assert sorted(set(dwells["unit"])) == ["S1", "S2", "S3"]
    whole = file.assign(**{"Zeit [s]": np.arange(len(file)) * 60.0}).rename(columns={"Prüfling": "Kammer"})
    whole.to_csv(tmp_path / "soaks.csv", index=False)  # one clock throughout: the labels may be those of soaks
    seen = recognise([tmp_path / "soaks.csv"])
    assert "unit" not in (seen.keys or {"columns": {}})["columns"]


def test_names_of_the_exchange_format_in_a_record_of_samples_are_no_dwells(rng: Rng, tmp_path: Path) -> None:
    hand = Hand(rng)
    columns = {"n": np.arange(hand.n), "unit": np.repeat("mg", hand.n), "time_s": hand.time}
    columns |= three("ax ay az", np.round(accelerations(rng, hand.force, 1000.0), 2)) | {
        "supply_V": np.full(hand.n, 3.3)
    }
    seen = recognise([csv(tmp_path / "a.csv", columns)])
    assert seen.keys["columns"] == {"time": "time_s", "x": "ax", "y": "ay", "z": "az", "supply": "supply_V"}
    assert "rows" not in seen.keys
    columns["unit"] = np.where(hand.time < 30.0, "S1", "S2")
    assert recognise([csv(tmp_path / "b.csv", columns)]).open[0].startswith("samples of 2 units, one is needed")


def test_means_of_counts_close_to_gravity_in_mg_are_asked_about(rng: Rng, tmp_path: Path) -> None:
    for scale, doubt in ((1024.0, True), (1000.0, False)):
        dwells_of_units(rng, scale).to_csv(tmp_path / "lot.csv", index=False)
        seen = recognise([tmp_path / "lot.csv"])
        assert [one for one in seen.open if "means of counts are closer to 1024" in one] or not doubt
        assert bool(seen.open) == doubt


@each(["ax", "ay", "az"])
def test_an_axis_that_never_changes_is_recognised_and_told(axis: str, tmp_path: Path, rng: Rng) -> None:
    columns = logger_of_imu(rng, Hand(rng), tmp_path)
    columns[axis] = np.full_like(columns[axis], 3698.0)
    document = inspect([csv(tmp_path / "a.csv", columns)]).document
    assert [(one["fault"], one["axis"]) for one in document["faults"]] == [("stuck_output", axis[1])]
