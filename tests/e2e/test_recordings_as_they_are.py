"""What somebody with a file of his own does: look at it, run the command that is printed, and be told what is wrong with it."""

import json
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import recordings
from in_process import given
from typer.testing import CliRunner

from pipelines.cli import app
from pipelines.importers.exchange import read_dwells

MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--units", "output=LSB", "--unit", "A1")


def imported(path: Path, tmp_path: Path, *more: str) -> dict:
    files = map(str, path if isinstance(path, list) else [path])
    words = ["import", *files, *more, "--archive", str(tmp_path / "archive"), "--json"]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0 or isinstance(done.exception, SystemExit), done.exception
    return json.loads(done.stdout)


@pytest.fixture
def record(rng: np.random.Generator) -> recordings.Recording:
    return recordings.counts(rng, positions=9)


def device_file(one: recordings.Recording) -> str:
    """A preamble, decimal commas, semicolons, milliseconds."""
    rows = [
        f"{1000 * t:.1f};{x:.1f};{y:.1f};{z:.1f}".replace(".", ",")
        for t, (x, y, z) in zip(one.time, one.output, strict=True)
    ]
    return "\n".join(["Recorder: R-9", "Started: 12:00:00", "", "Time [ms];Acc X;Acc Y;Acc Z", *rows, ""])


def epoch_file(one: recordings.Recording) -> str:
    frame = recordings.table(one, t=(1_772_400_000_000_000 + np.round(1e6 * one.time)).astype(np.int64))
    return frame.rename(columns={"t": "timestamp"}).to_csv(index=False)


def stamped_file(one: recordings.Recording) -> str:
    stamps = pd.Timestamp("2026-03-01") + pd.to_timedelta(one.time, unit="s")
    return recordings.table(one, t=stamps.strftime("%Y-%m-%dT%H:%M:%S.%f"), part="a").to_csv(index=False)


def gapped_file(one: recordings.Recording) -> str:
    frame = recordings.table(one).astype({"ay": float})
    frame.loc[[700, 701], "ay"] = np.nan
    return frame.drop(index=range(1500, 1560)).to_csv(index=False)


def frozen_file(one: recordings.Recording) -> str:
    frame = recordings.table(one)
    start, stop = one.spans[4]
    frame.loc[start:stop, "az"] = frame.loc[start, "az"]
    return frame.to_csv(index=False)


@pytest.mark.parametrize("write", [device_file, epoch_file, stamped_file, gapped_file, frozen_file])
def test_the_command_that_inspect_prints_imports_the_file(write, record, tmp_path: Path) -> None:
    path = tmp_path / "my sensor.csv"
    path.write_text(write(record), encoding="utf-8")
    status, out, _ = given("inspect", path)
    assert status == 0, out
    command = shlex.split(out.strip().splitlines()[-1])
    assert command[:2] == ["tumbleline", "import"]
    status, out, err = given(*command[1:], "--archive", tmp_path / "archive", "--json")
    assert status == 0, err
    document = json.loads(out)
    assert document["out_unit"] == "LSB"
    assert 8 <= document["dwells"] <= 11
    dwells = read_dwells(document["run"], archive=tmp_path / "archive")
    assert dwells["time_s"].iloc[-1] == pytest.approx(record.time[-1], abs=6.0)


def test_inspect_draws_the_record_and_writes_a_page(record, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(frozen_file(record), encoding="utf-8")
    words = [
        "inspect",
        str(tmp_path / "a.csv"),
        "--picture",
        str(tmp_path / "a.svg"),
        "--page",
        str(tmp_path / "a.html"),
        "--json",
    ]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert [fault["fault"] for fault in document["faults"]] == ["stuck_output"]
    assert document["faults"][0]["axis"] == "z"
    assert [column["resolution"] for column in document["columns"]][1:] == [1.0, 1.0, 1.0]
    assert "<svg" in (tmp_path / "a.svg").read_text(encoding="utf-8")
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "the axis is constant" in page
    assert document["command"].replace("'", "&#39;") in page


def test_what_a_file_does_not_say_stands_in_capitals_and_leaves_with_1(record, tmp_path: Path) -> None:
    recordings.table(record).drop(columns="t").to_csv(tmp_path / "a.csv", index=False)
    status, out, _ = given("inspect", tmp_path / "a.csv")
    assert status == 1
    assert "to be added by you: the rate of the samples" in out
    assert out.strip().endswith("--rate HZ")


def test_gaps_and_rows_without_a_number_are_refused_with_their_row_and_split_on_request(record, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text(gapped_file(record), encoding="utf-8")
    status, _, err = given("import", path, *MAPPED, "--archive", tmp_path / "b")
    assert status == 2
    assert "a.csv: row 701 (line 702), column 'ay': found nan" in err
    assert "--gaps split" in err
    assert not (tmp_path / "b").exists()
    path.write_text(recordings.table(record).drop(index=range(1500, 1560)).to_csv(index=False), encoding="utf-8")
    _, _, err = given("import", path, *MAPPED, "--archive", tmp_path / "b")
    assert "1 gap in time longer than 5 samples, the first before row 1501, the longest 0.61 s" in err
    path.write_text(gapped_file(record), encoding="utf-8")
    document = imported(path, tmp_path, *MAPPED, "--gaps", "split")
    assert "2 of " in document["remarks"][0]
    assert document["samples"] == len(record.time) - 62
    for one in document["dwell_list"]:  # no dwell goes over a gap
        assert one["end_s"] - one["start_s"] == pytest.approx((one["n"] - 1) / 100.0, abs=1e-9)


def test_positions_logged_back_to_back_are_seen_and_divided(rng, tmp_path: Path) -> None:
    full = recordings.counts(rng, positions=20, moves=False)
    keep = np.concatenate([np.arange(a, a + 40) for a, _ in full.spans])  # 0.4 s each
    frame = pd.DataFrame(full.output[keep], columns=["ax", "ay", "az"]).assign(t=np.arange(keep.size) / 100.0)
    frame.to_csv(tmp_path / "a.csv", index=False)
    status, _, err = given("import", tmp_path / "a.csv", *MAPPED, "--archive", tmp_path / "b")
    assert status == 2
    assert "positions logged back to back" in err
    assert "--positions 20" in err
    document = imported(tmp_path / "a.csv", tmp_path, *MAPPED, "--positions", "20")
    means = np.array([one["mean"] for one in document["dwell_list"]])
    truth = np.array([full.output[a : a + 40].mean(axis=0) for a, _ in full.spans])
    np.testing.assert_allclose(means, truth, atol=5.0)


def test_a_frozen_axis_among_unknown_poses_is_named_and_what_is_sound_is_used(record, tmp_path) -> None:
    (tmp_path / "a.csv").write_text(frozen_file(record), encoding="utf-8")
    status, _, err = given("import", tmp_path / "a.csv", *MAPPED, "--archive", tmp_path / "b")
    assert status == 2
    assert "axis z is constant for" in err
    assert f"from row {record.spans[4][0] + 1} on" in err
    document = imported(tmp_path / "a.csv", tmp_path, *MAPPED, "--faulty", "leave-out")
    assert document["dwells"] == 8
    assert [fault["fault"] for fault in document["faults"]] == ["stuck_output"]
    assert imported(tmp_path / "a.csv", tmp_path, *MAPPED, "--faulty", "keep")["dwells"] == 9


def test_torn_words_are_named_and_left_out_of_the_means(record, rng, tmp_path: Path) -> None:
    frame = recordings.table(record)
    torn = rng.random(len(frame)) < 0.08
    frame.loc[torn, "ax"] += 256.0 * rng.choice([-1.0, 1.0, 1.0], size=int(torn.sum()))
    frame.to_csv(tmp_path / "a.csv", index=False)
    status, _, err = given("import", tmp_path / "a.csv", *MAPPED, "--archive", tmp_path / "b")
    assert status == 2
    assert "axis x has torn words" in err
    assert "±256 steps of its resolution" in err
    document = imported(tmp_path / "a.csv", tmp_path, *MAPPED, "--faulty", "leave-out")
    clean = imported(_written(recordings.table(record), tmp_path / "clean.csv"), tmp_path, *MAPPED)
    assert document["dwells"] == clean["dwells"]
    for one, other in zip(document["dwell_list"], clean["dwell_list"], strict=True):
        np.testing.assert_allclose(one["mean"], other["mean"], atol=2.0)  # 7 with the torn words


def _written(frame: pd.DataFrame, path: Path) -> Path:
    frame.to_csv(path, index=False)
    return path


def test_two_files_one_after_another_are_one_recording(record, tmp_path: Path) -> None:
    frame = recordings.table(record)
    half = record.spans[4][0] + 100
    first = _written(frame.iloc[:half], tmp_path / "1.csv")
    second = _written(frame.iloc[half:].assign(t=lambda f: f.t - f.t.iloc[0]), tmp_path / "2.csv")
    document = imported([first, second], tmp_path, *MAPPED, "--join", "rows")
    assert document["samples"] == len(frame)
    assert [one["path"] for one in document["source"]["files"]] == [str(first), str(second)]
    assert "2.csv: its clock restarts; it is continued after 1.csv" in document["remarks"]
    boundary = (half - 0.5) / 100.0
    assert all(not one["start_s"] < boundary < one["end_s"] for one in document["dwell_list"])
    other = _written(frame.rename(columns={"ax": "bx"}), tmp_path / "3.csv")
    status, _, err = given("import", first, other, *MAPPED, "--join", "rows", "--archive", tmp_path / "b")
    assert status == 2
    assert "the same are needed" in err


def test_columns_of_two_files_stand_side_by_side_by_their_clocks(record, tmp_path: Path) -> None:
    first = _written(recordings.table(record), tmp_path / "acc.csv")
    slow = np.arange(0.0, record.time[-1] + 2.0, 1.0)
    second = _written(pd.DataFrame({"t": slow, "ax": 20.0 + 0.1 * slow}), tmp_path / "heat.csv")
    document = imported(
        [first, second], tmp_path, "--map", "time=t,x=ax,y=ay,z=az,temperature=2:ax", "--units", "output=LSB",
        "--unit", "A1", "--join", "columns",
    )  # fmt: skip
    dwells = read_dwells(document["run"], archive=tmp_path / "archive")
    np.testing.assert_allclose(dwells["unit_C"], 20.0 + 0.1 * dwells["time_s"], atol=1e-6)


def test_a_list_of_dwells_has_residual_and_influence_of_a_fit(rng, tmp_path: Path) -> None:
    one = recordings.counts(rng, positions=16)
    path = _written(recordings.table(one), tmp_path / "a.csv")
    words = (*MAPPED, "--local-g", "9.80665", "--fit", "norm", "--archive", tmp_path / "b")
    _, out, _ = given("import", path, *words, "--list-dwells")
    assert "residual, µg" in out
    _, out, _ = given("import", path, *words, "--json")
    document = json.loads(out)
    residual = np.array([row["residual_ug"] for row in document["dwell_list"]])
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(document["error"]["rms_ug"], rel=0.05)
    # the influence is what leaving a dwell out does: the largest belongs to the dwell whose removal moves the bias most
    assert all(row["influence"] >= 0.0 for row in document["dwell_list"])


def test_window_threshold_and_shortest_decide_what_a_dwell_is(record, tmp_path: Path) -> None:
    path = _written(recordings.table(record), tmp_path / "a.csv")
    assert imported(path, tmp_path, *MAPPED, "--shortest", "4")["dwells"] < 9
    assert imported(path, tmp_path, *MAPPED, "--threshold", "0.001")["dwells"] == 0
    assert imported(path, tmp_path, *MAPPED, "--window", "0.5")["dwells"] == 9


def test_a_unit_that_the_file_states_is_taken_and_not_contradicted(record, tmp_path: Path) -> None:
    frame = recordings.table(record)
    frame[["ax", "ay", "az"]] /= 16384.0
    path = _written(frame.set_axis(["t [s]", "ax [g]", "ay [g]", "az [g]"], axis=1), tmp_path / "a.csv")
    words = ("--map", "time=t [s],x=ax [g],y=ay [g],z=az [g]", "--unit", "A1", "--archive", tmp_path / "b")
    status, out, _ = given("import", path, *words)
    assert status == 0
    assert "dwells in g" in out
    status, _, err = given("import", path, *words, "--units", "output=m/s^2")
    assert (status, "the file states g for its output" in err) == (2, True)


def test_the_export_of_an_import_says_how_to_fit_it(record, tmp_path: Path) -> None:
    run = imported(_written(recordings.table(record), tmp_path / "a.csv"), tmp_path, *MAPPED)["run"]
    status, _, err = given("export", run, "--archive", tmp_path / "archive")
    assert status in {2, 3}
    assert f"tumbleline fit {run} --effects" in err
    assert "give its command again" not in err


def test_a_dead_axis_is_named_instead_of_asking_for_more_poses(record, tmp_path: Path) -> None:
    frame = recordings.table(record)
    frame["ay"] = np.round(frame["ay"] * 0.0 + 12.0 + np.random.default_rng(3).normal(0.0, 4.0, len(frame)))
    words = (*MAPPED, "--local-g", "9.80665", "--fit", "norm", "--archive", tmp_path / "b")
    status, _, err = given("import", _written(frame, tmp_path / "a.csv"), *words)
    assert status == 2
    assert "axis y changes by" in err
    assert "add poses" not in err


def test_one_pose_says_what_it_shows(tmp_path: Path, rng: np.random.Generator) -> None:
    n = 3000
    frame = pd.DataFrame(
        np.round(16384 * np.array([0.0, 0.0, 1.0]) + 5.0 * rng.normal(size=(n, 3))), columns=["ax", "ay", "az"]
    )
    (tmp_path / "a.csv").write_text(frame.assign(t=np.arange(n) / 100.0).to_csv(index=False), encoding="utf-8")
    status, out, _ = given("import", tmp_path / "a.csv", *MAPPED, "--archive", tmp_path / "b")
    assert status == 0
    assert "3000 samples, 1 dwell in LSB" in out
    assert "one pose whose force is not known: its noise by 'tumbleline allan'" in out
    assert "--face +x … -z" in out
    stated = ("--face", "+z", "--blocks", "5", "--local-g", "9.81")
    _, out, err = given("import", tmp_path / "a.csv", *MAPPED, *stated, "--archive", tmp_path / "b")
    assert "6 dwells in LSB" in out, err
    assert "one pose whose" not in out


def test_several_recordings_are_offered_as_one(record, tmp_path: Path) -> None:
    table, half = recordings.table(record), len(record.time) // 2
    for name, part in (("p1.csv", table[:half]), ("p2.csv", table[half:])):
        (tmp_path / name).write_text(part.to_csv(index=False), encoding="utf-8")
    _, out, _ = given("inspect", tmp_path / "p1.csv", tmp_path / "p2.csv")
    assert "add --join rows (one after the other) or --join" in out
    assert out.rstrip().splitlines()[-1].startswith("tumbleline import ")
    _, out, _ = given("inspect", tmp_path / "p1.csv", tmp_path / "p2.csv", "--join", "rows")
    assert "--join rows (one" not in out
