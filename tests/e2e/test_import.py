"""What somebody with a file of his own does: look at it, run the command that is printed, and be told what is wrong with it."""

import re
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import recordings
from each import each
from in_process import document_of, given, refused, text_of
from long_suites import mostly_slow
from recordings import FACES, Recording

from pipelines.importers.exchange import read_dwells
from schemas.errors import DONE

UP = "xp=+x,xm=-x,yp=+y,ym=-y,zp=+z,zm=-z"
MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--unit-of", "output=LSB", "--units", "A1")
FITTED = ("--set", "local_gravity_m_s2=9.80665", "--fit", "norm")

pytestmark = pytest.mark.usefixtures("home")


@pytest.fixture
def record(rng: np.random.Generator) -> Recording:
    return recordings.counts(rng, positions=9)


def written(frame: pd.DataFrame, name: str = "a.csv", before: str = "") -> Path:
    Path(name).write_text(before + frame.to_csv(index=False), encoding="utf-8")
    return Path(name)


def imported(*words: object, status: int | None = DONE) -> dict[str, Any]:
    return document_of("import", *words, status=status)


def refused_import(*words: object) -> str:
    message = refused("import", *words, "--archive", "none")
    assert not Path("none").exists()
    return message


def stamped_file(one: Recording) -> str:
    stamps = pd.Timestamp("2026-03-01") + pd.to_timedelta(one.time, unit="s")
    return recordings.table(one, t=stamps.strftime("%Y-%m-%dT%H:%M:%S.%f"), part="a").to_csv(index=False)


def gapped_file(one: Recording) -> str:
    frame = recordings.table(one).astype({"ay": float})
    frame.loc[[700, 701], "ay"] = np.nan
    return frame.drop(index=range(1500, 1560)).to_csv(index=False)


def frozen_file(one: Recording) -> str:
    frame = recordings.table(one)
    start, stop = one.spans[4]
    frame.loc[start:stop, "az"] = frame.loc[start, "az"]
    return frame.to_csv(index=False)


WRITTEN = (stamped_file, gapped_file, frozen_file)


@pytest.mark.parametrize("write", mostly_slow(WRITTEN, *WRITTEN[:2]))
def test_the_command_that_inspect_prints_imports_the_file(write, record: Recording) -> None:
    Path("my sensor.csv").write_text(write(record), encoding="utf-8")
    status, out, _ = given("inspect", "my sensor.csv")
    assert status == 0, out
    command = shlex.split(out.strip().splitlines()[-1])
    assert command[:2] == ["tumbleline", "import"]
    document = imported(*command[2:])
    assert document["out_unit"] == "LSB"
    assert 8 <= document["dwells"] <= 11
    assert read_dwells(document["run"])["time_s"].iloc[-1] == pytest.approx(record.time[-1], abs=6.0)


def test_inspect_draws_the_record_writes_a_page_and_names_faults(record: Recording) -> None:
    Path("a.csv").write_text(frozen_file(record), encoding="utf-8")
    document = document_of("inspect", "a.csv", "--output", "a.svg", "--output", "a.html", status=0)
    assert [(fault["fault"], fault["axis"]) for fault in document["faults"]] == [("stuck_output", "z")]
    assert "<svg" in Path("a.svg").read_text(encoding="utf-8")
    page = Path("a.html").read_text(encoding="utf-8")
    assert "the axis is constant" in page
    frame = recordings.table(recordings.counts(np.random.default_rng(11), directions=FACES, noise=20.0))
    frame["ax"] = frame["ax"].clip(-15_000, 15_000)  # an axis at the end of its range is told as clipped
    count = int((frame["ax"].abs() == 15_000).sum())  # two whole dwells, and moments of the moves
    said = text_of("inspect", written(frame))
    told = re.search(r"axis x is clipped: (\d+) samples", said)
    assert told, said
    assert 0.9 * count <= int(told[1]) <= count
    assert "axis y is clipped" not in said


def test_inspect_says_in_capitals_what_a_file_does_not_say_and_offers_to_join_several(record: Recording) -> None:
    table, half = recordings.table(record), len(record.time) // 2
    told = text_of("inspect", written(table.drop(columns="t")), status=1)
    assert "to be added by you: the rate of the samples" in told
    assert told.endswith("--rate HZ")
    parts = [written(part, name) for name, part in (("p1.csv", table[:half]), ("p2.csv", table[half:]))]
    _, out, _ = given("inspect", *parts)
    assert "add --set join=rows (one after the other) or --set join=" in out
    assert out.rstrip().splitlines()[-1].startswith("tumbleline import ")
    assert "--set join=rows (one" not in text_of("inspect", *parts, "--set", "join=rows")


def damaged(frame: pd.DataFrame, row: int, column: str) -> pd.DataFrame:
    out = frame.astype(object)
    out.loc[row, column] = "nan"
    return out


def line_of(path: Path) -> int:
    """The line, as an editor counts, of the first cell without a number."""
    return next(k for k, line in enumerate(path.read_text(encoding="utf-8").split("\n"), 1) if "nan" in line)


BEFORE = ("", "# logger 7\n# second line\n\n", "Recorded by me\nin the cellar\n")


@each([(before, column) for before in BEFORE for column in ("ay", "t")], repr)
def test_a_value_that_is_no_number_is_refused_with_the_line_of_the_file(case: tuple[str, str], rng) -> None:
    before, column = case
    path = written(damaged(recordings.table(recordings.counts(rng, positions=6)), 500, column), before=before)
    said = refused_import(path, *MAPPED)
    assert f"row 501 (line {line_of(path)}), column '{column}'" in said
    assert "(1 such row)" in said


def test_comments_quoted_line_breaks_and_joined_files_do_not_confuse_the_line(record: Recording) -> None:
    whole = recordings.table(record)
    path = written(damaged(whole, 500, "az"))
    lines = path.read_text(encoding="utf-8").split("\n")
    lines[100:100] = ["# knocked at the table", ""]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert f"(line {line_of(path)})" in refused_import(path, *MAPPED)
    noted = damaged(whole, 500, "az").assign(note="-")
    noted.loc[3, "note"] = "two\nlines"
    assert "row 501, column 'az'" in refused_import(written(noted), *MAPPED)
    first = written(whole.iloc[:900])
    second = written(damaged(whole.iloc[900:].reset_index(drop=True), 40, "ax"), "b.csv", "# two\n")
    told = refused_import(first, second, "--set", "join=rows", *MAPPED)
    assert f"row 941 (line {line_of(second)} of b.csv)" in told
    beside = (written(damaged(whole[["t", "ax"]], 40, "ax"), "c.csv"), written(whole[["t", "ay", "az"]], "d.csv"))
    # two files side by side have no line in common
    assert "row 41, column 'ax'" in refused_import(*beside, "--set", "join=columns", *MAPPED)


def test_gaps_and_rows_without_a_number_are_refused_with_their_row_and_split_on_request(record: Recording) -> None:
    path = Path("a.csv")
    path.write_text(gapped_file(record), encoding="utf-8")
    told = refused_import(path, *MAPPED)
    assert "a.csv: row 701 (line 702), column 'ay': found nan" in told
    assert "--set gaps=split" in told
    written(recordings.table(record).drop(index=range(1500, 1560)))
    gap = "1 gap in time longer than 5 samples, the first before row 1501, the longest 0.61 s"
    assert gap in refused_import(path, *MAPPED)
    path.write_text(gapped_file(record), encoding="utf-8")
    document = imported(path, *MAPPED, "--set", "gaps=split")
    assert document["remarks"][0].startswith("2 of ")
    assert "the first is row 701 (line 702)" in document["remarks"][0]
    assert document["samples"] == len(record.time) - 62
    for one in document["dwell_list"]:  # no dwell goes over a gap
        assert one["end_s"] - one["start_s"] == pytest.approx((one["n"] - 1) / 100.0, abs=1e-9)


def test_positions_logged_back_to_back_are_seen_and_divided(rng: np.random.Generator) -> None:
    full = recordings.counts(rng, positions=20, moves=False)
    keep = np.concatenate([np.arange(a, a + 40) for a, _ in full.spans])  # 0.4 s each
    frame = pd.DataFrame(full.output[keep], columns=["ax", "ay", "az"]).assign(t=np.arange(keep.size) / 100.0)
    told = refused_import(written(frame), *MAPPED)
    assert "positions logged back to back" in told
    assert "--set positions=20" in told
    document = imported("a.csv", *MAPPED, "--set", "positions=20")
    means = np.array([one["mean"] for one in document["dwell_list"]])
    truth = np.array([full.output[a : a + 40].mean(axis=0) for a, _ in full.spans])
    np.testing.assert_allclose(means, truth, atol=5.0)


def test_torn_words_are_named_and_left_out_of_the_means(record: Recording, rng: np.random.Generator) -> None:
    frame = recordings.table(record)
    clean = imported(written(frame, "clean.csv"), *MAPPED)
    torn = rng.random(len(frame)) < 0.08
    frame.loc[torn, "ax"] += 256.0 * rng.choice([-1.0, 1.0, 1.0], size=int(torn.sum()))
    told = refused_import(written(frame), *MAPPED)
    assert "axis x has torn words" in told
    assert "±256 steps of its resolution" in told
    document = imported("a.csv", *MAPPED, "--set", "faulty=leave-out")
    assert document["dwells"] == clean["dwells"]
    assert imported("a.csv", *MAPPED, "--set", "faulty=keep")["dwells"] == clean["dwells"]
    for one, other in zip(document["dwell_list"], clean["dwell_list"], strict=True):
        np.testing.assert_allclose(one["mean"], other["mean"], atol=2.0)  # 7 with the torn words


def test_two_files_one_after_another_or_side_by_side_are_one_recording(record: Recording) -> None:
    frame = recordings.table(record)
    half = record.spans[4][0] + 100
    first = written(frame.iloc[:half], "1.csv")
    second = written(frame.iloc[half:].assign(t=lambda f: f.t - f.t.iloc[0]), "2.csv")
    document = imported(first, second, *MAPPED, "--set", "join=rows")
    assert document["samples"] == len(frame)
    assert [one["path"] for one in document["source"]["files"]] == [str(first), str(second)]
    assert "2.csv: its clock restarts; it is continued after 1.csv" in document["remarks"]
    boundary = (half - 0.5) / 100.0
    assert all(not one["start_s"] < boundary < one["end_s"] for one in document["dwell_list"])
    other = written(frame.rename(columns={"ax": "bx"}), "3.csv")
    assert "the same are needed" in refused_import(first, other, *MAPPED, "--set", "join=rows")
    slow = np.arange(0.0, record.time[-1] + 2.0, 1.0)  # columns of two files stand side by side by their clocks
    files = (written(frame, "acc.csv"), written(pd.DataFrame({"t": slow, "ax": 20.0 + 0.1 * slow})))
    words = ("--map", "time=t,x=ax,y=ay,z=az,temperature=2:ax", *MAPPED[2:], "--set", "join=columns")
    dwells = read_dwells(imported(*files, *words)["run"])
    np.testing.assert_allclose(dwells["unit_C"], 20.0 + 0.1 * dwells["time_s"], atol=1e-6)


def test_a_list_of_dwells_has_residual_and_influence_of_a_fit(rng: np.random.Generator) -> None:
    path = written(recordings.table(recordings.counts(rng, positions=16)))
    assert "residual, µg" in text_of("import", path, *MAPPED, *FITTED, "--all")
    document = imported(path, *MAPPED, *FITTED, status=None)
    residual = np.array([row["residual_ug"] for row in document["dwell_list"]])
    assert np.sqrt(np.mean(residual**2)) == pytest.approx(document["error"]["rms_ug"], rel=0.05)
    # the influence is what leaving a dwell out does: the largest belongs to the dwell whose removal moves the bias most
    assert all(row["influence"] >= 0.0 for row in document["dwell_list"])


def test_settings_decide_what_a_dwell_is_a_stated_unit_is_taken_and_a_dead_axis_is_named(record: Recording) -> None:
    frame = recordings.table(record)
    path = written(frame)
    assert imported(path, *MAPPED, "--set", "shortest_s=4")["dwells"] < 9
    assert imported(path, *MAPPED, "--set", "threshold=0.001")["dwells"] == 0
    assert imported(path, *MAPPED, "--set", "window_s=0.5")["dwells"] == 9
    in_g = (frame * [1.0, *[1.0 / 16384.0] * 3]).set_axis(["t [s]", "ax [g]", "ay [g]", "az [g]"], axis=1)
    words = (written(in_g), "--map", "time=t [s],x=ax [g],y=ay [g],z=az [g]", "--units", "A1")
    assert imported(*words)["out_unit"] == "g"
    assert "the file states g for its output" in refused_import(*words, "--unit-of", "output=m/s^2")
    frame["ay"] = np.round(12.0 + np.random.default_rng(3).normal(0.0, 4.0, len(frame)))
    told = refused_import(written(frame), *MAPPED, *FITTED)
    assert "axis y changes by" in told
    assert "add poses" not in told


@pytest.mark.slow
def test_one_pose_says_what_it_shows_and_is_not_told_to_fit_a_scale() -> None:
    rng = np.random.default_rng(7)
    time = np.arange(12_000) / 100.0
    output = np.round(rng.normal([0.0, 0.0, 16384.0], 5.0, (time.size, 3)))
    frame = pd.DataFrame(output, columns=["ax", "ay", "az"]).assign(t=time, temp=25.0 + 5.0 * np.sin(time / 20.0))
    told = text_of("import", written(frame), *MAPPED, status=0)
    assert "12000 samples, 1 dwell in LSB" in told
    assert "one pose whose force is not known: 'tumbleline noise allan' gives its noise" in told
    assert "--set face=+x … -z" in told
    set_up = ("--set", "face=+z", "--set", "local_gravity_m_s2=9.81")
    mapped = ("--map", f"{MAPPED[1]},temperature=temp", "--units", "P1", *set_up)
    told = text_of("import", "a.csv", *mapped, "--unit-of", "output=LSB", "--set", "block_s=10")
    assert "12 dwells in LSB" in told
    assert "one pose whose" not in told
    fit = ("fit", "latest", "--effects", "bias,bias_temperature")
    _, out, err = given(*fit)
    assert "--unit-of output=g" in " ".join((out + err).split())
    frame[["ax", "ay", "az"]] /= 16384.0  # the advice, followed, leads to a fit
    imported(written(frame), *mapped, "--unit-of", "output=g", "--set", "block_s=10")
    text_of(*fit)


def test_faces_without_a_known_noise_print_no_number_that_is_none() -> None:
    means = FACES @ np.diag([1.01, 0.99, 1.0]) + [0.02, -0.01, 0.03] + 1e-4 * np.sin(np.arange(18.0).reshape(6, 3))
    orders = {
        "6 degrees of freedom": range(6),
        "+y exchanged": [2, 1, 0, 3, 4, 5],
        "check the labels of the faces": [0, 1, 3, 4, 5, 2],  # no axes in any order give these outputs
    }
    for verdict, order in orders.items():
        faces = ["xp", "xm", "yp", "ym", "zp", "zm"]
        frame = pd.DataFrame(means[list(order)], columns=["x", "y", "z"]).assign(face=faces)
        _, said, _ = given(
            "import", written(frame), "--map", "x=x,y=y,z=z,dwell=face", "--set", "rows=dwells", "--unit-of", "output=g",
            "--units", "S1", "--set", f"poses={UP}", "--set", "local_gravity_m_s2=9.81", "--fit", "faces",
        )  # fmt: skip
        assert "nan" not in said
        assert "lack of fit" in said
        assert not re.search(r"^\s*adequate", said, re.MULTILINE)
        assert verdict in said


@pytest.fixture(scope="module")
def one_axis(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twelve rests of 4 s at 50 Hz between turns, in mg, with the force along the axis."""
    rng, parts = np.random.default_rng(3), list[np.ndarray]()
    for angle in np.arange(0.0, 360.0, 30.0):
        parts += [np.full(200, angle), np.linspace(angle, angle + 30.0, 25)]
    force, moving = np.sin(np.radians(np.concatenate(parts))), np.tile(np.repeat([0.2, 30.0], [200, 25]), 12)
    output = 1003.0 * force + 12.0 + moving * rng.normal(size=force.size)
    path = tmp_path_factory.mktemp("given") / "one.csv"
    table = pd.DataFrame({"time_s": np.arange(force.size) / 50.0, "acc [mg]": output, "along": force})
    table.to_csv(path, index=False)
    return path


def test_it_has_the_unit_of_its_heading_and_is_fitted_where_the_force_along_it_is_known(
    one_axis: Path, tmp_path: Path
) -> None:
    given = ("import", one_axis, "--units", "S1", "--set", "axes=x", "--archive", tmp_path)
    known = document_of(*given, "--map", "time=time_s,x=acc [mg],force_x=along")["run"]
    fitted = document_of("fit", known, "--archive", tmp_path)
    assert fitted["adequate"] is True
    assert document_of("diagnose", known, "--archive", tmp_path)["error"] == fitted["error"]


def test_without_a_reference_fit_and_diagnosis_say_what_is_needed(one_axis: Path, tmp_path: Path) -> None:
    given = ("import", one_axis, "--units", "S1", "--archive", tmp_path)
    alone = document_of(*given, "--set", "axes=x", "--map", "time=time_s,x=acc [mg]")["run"]
    messages = {refused(command, alone, "--archive", tmp_path) for command in ("fit", "diagnose")}
    assert len(messages) == 1
    assert "--map tilt=… or force_x=…" in messages.pop()
    two = ("--set", "axes=x,y", "--map", "time=time_s,x=acc [mg],y=along,force_x=along", "--unit-of", "output=mg")
    assert "force_x without force_y, force_z" in refused(*given, *two)
