"""What import, exchange format, recipes and manifests refuse: one message that names place, value and remedy."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import recordings
from each import each
from in_process import given, text_of
from lots import lot
from root_process import ROOT

from pipelines.archive import files as archive_files
from pipelines.importers import exchange, files
from pipelines.importers.mapping import Mapping, build, pairs
from pipelines.importers.record import imported
from pipelines.jobs.recipes import load_recipe, lot_of
from pipelines.jobs.seating import Seating, scan
from pipelines.procedures import parts_of
from schemas.errors import ArchiveUnusable, DataRejected, RecipeInvalid, TumblelineError, WrongUse
from schemas.model import ModelFile
from schemas.toml_files import parse_as, parse_toml

Change = Callable[[pd.DataFrame], pd.DataFrame]
CONTENT: dict[str, Any] = {
    "columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "units": {"output": "g"}, "unit": "A1"
}  # fmt: skip


def how(**more: object) -> Mapping:
    return build({**CONTENT, **more}, "test")


def record(n: int = 400) -> pd.DataFrame:
    output = np.random.default_rng(1).normal([0.0, 0.6, 0.8], 0.002, size=(n, 3))
    frame = pd.DataFrame(output, columns=["ax", "ay", "az"])
    frame.insert(0, "t", np.arange(n) / 100.0)
    return frame


def dwells(n: int = 4) -> pd.DataFrame:
    frame = pd.DataFrame({"unit": "A1", "dwell": range(n), "time_s": np.arange(n) * 10.0})
    return frame.assign(out_x=0.1, out_y=0.2, out_z=0.97, hum=np.arange(n) + 40.0)


RECORDS: list[tuple[Change, tuple[str, ...], str]] = [  # a change of the record, more options, what is told
    (lambda t: t.head(1), (), "1 sample, a record of two at least"),
    (lambda t: t.assign(t=3.0), (), "400 samples, all at 3 s"),
    (lambda t: t, ("--rate", "inf"), "rate_hz: found inf"),
    (lambda t: t, ("--rate", "0"), "rate_hz: found 0"),
    (lambda t: t, ("--set", "block_s=1e-300"), "block_s: found 1e-300"),
    (lambda t: t, ("--unit-of", "output=LSB"), "not whole numbers"),
    (lambda t: t.assign(ax=t.ax > -1.0), (), "column 'ax' holds true and false"),
    (lambda t: t.assign(t=t.t * 1e300), (), "column t: found 1e+298"),
    (lambda t: t.assign(t=t.t * 1e12), ("--unit-of", "output=g,time=s"), "-1e+11 to 1e+11 s is needed"),
    (lambda t: t.assign(az=1e200), (), "column az: found 1e+200"),
    (lambda t: t.rename(columns={"ax": "acc_x"}), (), "column 'ax' (for x) is not there; "),
    (lambda t: t.assign(ay=t.ay.where(t.index != 7)), (), "row 8 (line 9), column 'ay': found nan"),
    (lambda t: t.assign(az=t.az.where(t.index != 3, np.inf)), (), "row 4 (line 5), column 'az': found inf"),
    (
        lambda t: t.assign(ax=t.ax.astype(str).where(t.index != 2, "much")),
        (),
        "row 3 (line 4), column 'ax': found much",
    ),
    (lambda t: t.iloc[::-1], (), "time runs back by 0.01 s"),
    (lambda t: t * [1.0, 9.81, 9.81, 9.81], (), "looks like m/s^2"),
]


@each(RECORDS, lambda row: row[2])
def test_records_that_cannot_be_are_refused_and_leave_nothing(row: tuple[Change, tuple, str], tmp_path: Path) -> None:
    change, more, words = row
    change(record()).to_csv(tmp_path / "a.csv", index=False)
    options = {"--map": "time=t,x=ax,y=ay,z=az", "--unit-of": "output=g", "--units": "A1"}
    options |= dict(zip(more[::2], more[1::2], strict=True))
    options["--archive"] = str(tmp_path / "b")
    status, out, message = given("import", tmp_path / "a.csv", *(word for pair in options.items() for word in pair))
    assert (status, out) == (2, "")
    assert words in message
    assert not (tmp_path / "b").exists()


SERIALS = ("..", "=cmd|x", "АВС1", "A/1", "x" * 65)
DWELLS: list[tuple[Change, str]] = [
    (lambda t: t.drop(columns="time_s"), "column time_s is missing"),
    (lambda t: t.assign(out_x=[0.1, np.nan, 0.1, 0.1]), r"row 2 \(unit A1\), column out_x: found nan"),
    (lambda t: t.assign(hum=[1.0, 2.0, np.inf, 3.0]), "row 3 .*column hum: found inf"),
    (lambda t: t.assign(dwell=[0, 1, 1, 2]), "is there twice"),
    (lambda t: t.assign(dwell=[0, 1, 1.5, 2]), "found 1.5, a whole number"),
    (lambda t: t.assign(unit=["A1", "", "A1", "A1"]), "row 2, column unit: empty"),
    (lambda t: t.assign(unit=" "), "column unit: empty"),
    *((lambda t, serial=serial: t.assign(unit=serial), "column unit: serial") for serial in SERIALS),
    (lambda t: t.assign(outer_deg=0.0), "outer_deg without inner_deg"),
    (lambda t: t.assign(force_x=0.0, force_y=0.0, force_z=9.81), "give force_x, force_y, force_z in g"),
    (lambda t: t.assign(sd_x=-1.0, sd_y=1.0, sd_z=1.0), "column sd_x: found -1, 0 or more"),
    (lambda t: t.assign(duration_s=-5.0), "column duration_s: found -5, 0 s or more is needed"),
    (lambda t: t.assign(unit_C=-400.0), "column unit_C: found -400, -273.15 to 2000 °C is needed"),
    (lambda t: t.assign(time_s=t.time_s * 1e300), r"column time_s: found 1e\+301"),
    (lambda t: t.assign(out_x=t.out_x > 0.0), "column 'out_x' holds true and false"),
    (lambda t: t.assign(hum=1e200), r"column hum: found 1e\+200"),
    (lambda t: t.assign(n=[100, 100, 0, 100]), "row 3, column n: found 0, 1 or more is needed"),
    (lambda t: t.assign(out_unit="parsec"), r"column out_unit: found 'parsec', one of V, LSB, g, m/s\^2 is needed"),
    (lambda t: t.assign(time_s=5.0), "column time_s: all 4 dwells of unit A1 at 5 s"),
]


@each(DWELLS, lambda row: row[1])
def test_dwells_that_cannot_be_are_refused(row: tuple[Change, str], tmp_path: Path) -> None:
    change, words = row
    change(dwells()).to_csv(tmp_path / "dwells.csv", index=False)
    with pytest.raises(DataRejected, match=words):
        exchange.read_dwells(tmp_path / "dwells.csv")


NO_TABLES = [
    (b"", "no rows of data"),
    (b"a,b,c\n", "no rows of data"),
    (b"a,b\n1,2\n3,4,5\n", "do not have the 2 columns"),
    (b"a,a\n1,2\n", "column 'a' is there twice"),
    (b"\x00\xff\xfe\x01", "neither text"),
    (b"\x89HDF\r\n\x1a\n", "MATLAB 7.3"),
]


@each(NO_TABLES, repr)
def test_files_that_are_no_tables_are_refused(row: tuple[bytes, str], tmp_path: Path) -> None:
    content, words = row
    (tmp_path / "file.csv").write_bytes(content)
    with pytest.raises(DataRejected, match=words):
        files.read(tmp_path / "file.csv")


SLIPS = [
    ({"units": {"output": "G"}}, "known unit of the output is needed: g, mg"),
    ({"units": {"output": "g", "tme": "s"}}, "not known; did you mean time"),
    ({"columns": {"x": "a", "y": "b"}}, "^test: z not mapped"),
    ({"axes": ["x", "x", "z"]}, "every axis is needed once"),
    ({"poses": {"up": "z"}}, r"found 'z', one of \+x"),
    ({"local_gravity_m_s2": 1.0}, "local_gravity_m_s2"),
    ({"unitt": "A"}, "not known; did you mean unit"),
    (
        {"columns": {**CONTENT["columns"], "kind": "t"}},
        "'kind' is the name of a column that an import writes.*another name",
    ),
    ({"columns": {**CONTENT["columns"], "out_x": "t"}}, "'out_x' is the name of a column .*map it as 'x'"),
    ({"columns": {**CONTENT["columns"], "temperature": "t", "unit_C": "u"}}, "temperature is mapped twice"),
]


@each(SLIPS, lambda row: row[1])
def test_mappings_with_a_slip_are_refused(row: tuple[dict, str]) -> None:
    content, words = row
    with pytest.raises(RecipeInvalid, match=words):
        how(**content)


def test_refusals_of_a_record_of_nobody_pairs_without_a_sign_dates_elsewhere_and_no_file(tmp_path: Path) -> None:
    with pytest.raises(WrongUse, match="no unit is mapped"):
        imported(record(), how(unit=""), "f")
    with pytest.raises(WrongUse, match="--map: found 'x', name=value"):
        pairs("time=1,x", "--map")
    with pytest.raises(DataRejected, match="column 'ax' holds dates or times"):
        imported(record().assign(ax=pd.Timestamp("2026-01-01")), how(), "a.parquet")
    with pytest.raises(WrongUse, match="neither a file nor a run"):
        exchange.read_dwells("lot-7", archive=tmp_path)
    with pytest.raises(WrongUse, match="cannot be read"):
        exchange.read_dwells(tmp_path / "missing.csv")
    columns = {"x": "a", "y": "b", "z": "c", "temprature": "d", "hum": "e"}  # a covariate may have any name
    assert how(columns=columns).likely_slips == {"temprature": ("temperature",)}
    with pytest.raises(WrongUse, match=r"'АВ' has 'А' \(U\+0410\), which only looks like a plain letter"):
        lot_of(load_recipe(), ["АВ"])


def test_history_needs_a_temperature_and_each_time_once(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    for times, name, words in (
        ([1.0, 1.0], "unit_C", "is there twice"),
        ([1.0, 2.0], "temp", "neither unit_C nor chamber_C"),
    ):
        pd.DataFrame({"time_s": times, name: 20.0}).to_csv(path, index=False)
        with pytest.raises(DataRejected, match=words):
            exchange.read_history(path)
    pd.DataFrame({"time_s": [2.0, 1.0], "unit_C": 20.0}).to_csv(path, index=False)
    assert exchange.read_history(path)["time_s"].tolist() == [1.0, 2.0]


# -- recipes, models, manifests and slot maps beyond all bounds --------------------------------------------------------

RECIPE = ROOT / "schemas" / "samples" / "production.toml"
LAST = 'limits = "production"\n'
BEYOND = [  # a piece of the recipe, what stands in its place, what is told
    ("soak_min_s = 900.0", "soak_min_s = 9e302", "'soak_min_s': found 9e\\+302"),
    ("dwell_s = 10.0", "dwell_s = true", "true and false are not numbers"),
    ("seed = 1", 'seed = "1"', "'seed': found '1': a text, a number without quotes is needed"),
    (LAST, LAST + '[[procedures]]\nkind = "bias_stability"\npose_deg = ["1", 0]\n', "'pose_deg': a text, a number"),
    (LAST, LAST + '[[procedures]]\nkind = "exposure"\nlow_C = "1"\n', "'low_C': found '1': a text"),
    ("dwell_s = 10.0", "dwell_s = -10.0", "'dwell_s': found -10"),
    ("settle_s = 2.0", "settle_s = 1e300", "'settle_s': found 1e\\+300"),
    ("settle_s = 2.0", "settle_s = 1e6", "days, at most 366 are possible"),
    ("rate_hz = 100.0", "rate_hz = 1e200", "'rate_hz': found 1e\\+200"),
    ("rate_hz = 100.0", "rate_hz = 1e6", "static_record_s: 1.2e\\+09 samples in one record"),
    ("static_record_s = 1200.0", "static_record_s = 1e18", "'static_record_s': found"),
    ("[-10.0, 25.0, 60.0]", "[-400.0, 25.0]", "'temperatures_C', number 1: found -400"),
    ("seed = 1", "seed = -1", "'seed': found -1"),
    ("seed = 1", f"seed = 0x{'f' * 6000}", "'seed': found a int too large to show"),
    ("verification_repeats = 3", "verification_repeats = 9999999999", "'verification_repeats'"),
    ('name = "production"', f'name = "{"x" * 5000}"', "'name'"),
    ("seed = 1", f"seed.{'a.' * 3000}b = 1", "deep in one another|nested too deeply"),
    ("[[35.0, 15.0]", "[[1e200, 15.0]", "verification"),
]


@each(BEYOND, lambda row: row[1][-60:])
def test_recipes_beyond_all_bounds_are_refused_with_their_key(row: tuple[str, str, str], tmp_path: Path) -> None:
    (old, new, words), text = row, RECIPE.read_text()
    assert old in text
    (tmp_path / "r.toml").write_text(text.replace(old, new, 1))
    with pytest.raises(RecipeInvalid, match=words) as refused:
        parts_of(load_recipe(str(tmp_path / "r.toml")))
    assert len(str(refused.value)) < 700


def test_nesting_and_long_integers_end_in_one_message_everywhere(tmp_path: Path) -> None:
    for text in ("a = " + "[" * 9999, "a = " + "{b=" * 9999, f"a = {'1' * 9999}"):
        with pytest.raises(RecipeInvalid, match="not valid TOML"):
            parse_toml(text, "f")
        with pytest.raises(RecipeInvalid):
            parse_as(ModelFile, text, "f")
    for text in ("[" * 100_000, '{"a": ' * 100_000, f'{{"a": {"1" * 9999}}}'):
        with pytest.raises(ArchiveUnusable, match="not a manifest"):
            archive_files.parsed(text.encode(), tmp_path / "m.json")
    (tmp_path / "r.toml").write_bytes(b"\xef\xbb\xbf" + RECIPE.read_bytes())
    assert load_recipe(str(tmp_path / "r.toml")).name == "production"  # a mark at the beginning is read over


def test_each_scan_is_checked_when_it_is_scanned() -> None:
    lines, words = iter(["=cmd|x", "A1", "АВ", "..", "B2"]), []
    assert scan(2, lambda _slot: next(lines), words.append) == Seating(("A1", "B2"), (0, 1))
    assert [text.split(":")[0] for text in words] == ["slot 0", "slot 1", "slot 1"]


# -- what is right is taken ---------------------------------------------------------------------------------------------


def test_axes_signs_and_units_are_applied() -> None:
    raw = record().assign(heat=300.15)
    units = {"output": "mg", "temperature": "K"}
    mapping = how(
        columns={**CONTENT["columns"], "temperature": "heat"}, units=units, axes=["y", "x", "z"], signs=["-", "+", "+"]
    )
    recording = imported(raw.assign(ax=raw.ax * 1e3, ay=raw.ay * 1e3, az=raw.az * 1e3), mapping, "f")
    assert recording.samples is not None
    assert recording.dwells is not None
    assert len(recording.samples) == 400
    row = recording.dwells.iloc[0]
    assert [row["out_x"], row["out_y"], row["unit_C"]] == pytest.approx([-0.6, 0.0, 27.0], abs=1e-3)


@each(["ns", "us", "ms", "s"])
def test_time_stamps_of_parquet_become_seconds_whatever_their_unit(unit: str, tmp_path: Path) -> None:
    stamps = (pd.Timestamp("2026-01-01") + pd.to_timedelta(np.arange(400), unit="s")).astype(f"datetime64[{unit}]")
    record().assign(t=stamps).to_parquet(tmp_path / "a.parquet")
    dwells().assign(time_s=stamps[:4]).to_parquet(tmp_path / "d.parquet")
    samples = imported(files.read(tmp_path / "a.parquet")[0], how(), "a.parquet").samples
    assert samples is not None
    assert samples["time_s"].tolist() == np.arange(400.0).tolist()
    assert exchange.read_dwells(tmp_path / "d.parquet")["time_s"].tolist() == [0.0, 1.0, 2.0, 3.0]


@pytest.mark.parametrize("alternating", [False, True])
def test_units_one_after_another_or_in_turn_may_each_begin_their_own_time(*, alternating: bool) -> None:
    frame = pd.DataFrame({"t": [0.0, 10.0, 20.0] * 2, "sn": ["A"] * 3 + ["B"] * 3, "ax": 0.0, "ay": 0.6, "az": 0.8})
    frame = frame.sort_values("t") if alternating else frame
    mapping = how(columns={**CONTENT["columns"], "unit": "sn"}, unit="", rows="dwells")
    dwell_table = imported(frame.reset_index(drop=True), mapping, "f").dwells
    assert dwell_table is not None
    assert dwell_table["unit"].tolist() == ["A"] * 3 + ["B"] * 3
    back = frame.assign(t=[0.0, 10.0, 5.0] * 2).sort_values("sn", kind="stable").reset_index(drop=True)
    with pytest.raises(DataRejected, match="runs back" if alternating else "row 3: time runs back by 5 s within A"):
        imported(back, mapping, "f")


# -- names that could be a formula or markup, and serials of digits ------------------------------------------------------


def test_serials_of_digits_stay_text_and_one_dwell_of_a_unit_needs_no_second_time(tmp_path: Path) -> None:
    dwells().iloc[::-1].assign(unit=17).to_csv(tmp_path / "d.csv", index=False)
    assert exchange.read_dwells(str(tmp_path / "d.csv"))["unit"].tolist() == ["17"] * 4
    assert len(exchange.checked(dwells(1), where="f.csv")) == 1


@pytest.mark.slow
def test_a_column_called_like_a_formula_is_written_as_it_is(tmp_path: Path, rng: np.random.Generator) -> None:
    name = "$\\frac{x$"
    frame = lot(rng, units=1, temperatures=(25.0, 60.0)).assign(温度=1.0)
    frame[name] = rng.normal(size=len(frame))
    frame["out_x"] += 1e-3 * frame[name]
    frame.to_csv(tmp_path / "d.csv", index=False)
    text_of("diagnose", tmp_path / "d.csv", "--output", tmp_path / "page.html", status=1)
    assert (tmp_path / "page.html").read_text().count(name) > 1


# -- mistakes of unit, time and axis: refused, or told in a remark that asks to check -------------------------------------


FEW, MANY, SEED = 30, 300, 5_611_072
G = recordings.G
SIZES = {"g": 1.0, "mg": 1e3, "m/s^2": G}


def sound(rng: np.random.Generator) -> tuple[recordings.Recording, dict, pd.DataFrame]:
    """A recording in some unit with a clock of some unit, and the mapping that is right for it."""
    unit = str(rng.choice(["g", "mg", "m/s^2", "LSB", "V", "mV"]))
    per_g = {**SIZES, "LSB": float(rng.choice([256, 4096, 16384])), "V": 0.66, "mV": 660.0}[unit]
    noise = max(3e-4 * per_g, 0.4 if unit == "LSB" else 0.0)
    faces = bool(rng.random() < 0.4)
    one = recordings.recording(
        rng,
        rate=float(rng.choice([50.0, 100.0, 200.0, 400.0])),
        per_g=per_g,
        noise=noise,
        directions=recordings.FACES if faces else None,
    )
    if unit == "LSB":
        one = dataclasses.replace(one, output=np.round(one.output))
    clock = str(rng.choice(["s", "ms", "us"]))
    time = one.time * {"s": 1.0, "ms": 1e3, "us": 1e6}[clock]
    frame = recordings.table(one, t=time if clock == "s" else np.round(time).astype(np.int64))
    frame = frame.assign(
        gx=rng.normal(0.0, 0.02, len(frame)), mx=0.4 + rng.normal(0.0, 1e-3, len(frame)), heat=24.0 + 1e-4 * one.time
    )
    content = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "unit": "A1"}
    content["units"] = {"output": unit, "time": clock}
    if faces:
        frame["part"] = "move"
        for (start, stop), face in zip(one.spans, ("+x", "-x", "+y", "-y", "+z", "-z"), strict=True):
            frame.loc[start : stop - 1, "part"] = face
        content["columns"]["dwell"] = "part"
        content |= {"poses": {face: face for face in set(frame["part"]) - {"move"}}, "local_gravity_m_s2": G}
    return one, content, frame


def mistaken(rng: np.random.Generator, content: dict, *, faces: bool) -> tuple[str, dict]:
    """The mapping with one mistake in it."""
    kinds = ["unit of time", "unit of output", "column twice", "other quantity", *(["axes", "sign"] if faces else [])]
    kind = str(rng.choice(kinds))
    columns, units = dict(content["columns"]), dict(content["units"])
    if kind == "unit of time":
        units["time"] = str(rng.choice([unit for unit in ("s", "ms", "us", "ns") if unit != units["time"]]))
    elif kind == "unit of output":
        others = {"g": ["mg", "m/s^2", "LSB", "mV"], "mg": ["g", "m/s^2", "LSB", "V"], "m/s^2": ["g", "mg", "LSB", "mV"],
                  "LSB": ["g", "m/s^2", "V"], "V": ["mg", "m/s^2", "mV"], "mV": ["g", "m/s^2", "V"]}  # fmt: skip
        units["output"] = str(rng.choice(others[units["output"]]))
    elif kind == "column twice":
        one, other = rng.permutation(["x", "y", "z"])[:2]
        columns[str(one)] = columns[str(other)]
    elif kind == "other quantity":
        columns[str(rng.choice(["x", "y", "z"]))] = str(rng.choice(["gx", "mx", "heat", "t"]))
    elif kind == "axes":
        one, other = rng.permutation(["x", "y", "z"])[:2]
        columns[str(one)], columns[str(other)] = columns[str(other)], columns[str(one)]
    else:
        signs = ["+", "+", "+"]
        signs[int(rng.integers(3))] = "-"
        return kind, content | {"signs": signs}
    return kind, content | {"columns": columns, "units": units}


def outcome(frame: pd.DataFrame, content: dict) -> str:
    """The refusal or the remarks that ask to check; empty where the import says nothing."""
    try:
        recording = imported(frame, build(content, "t"), "f.csv")
    except TumblelineError as problem:
        return f"refused: {problem}"
    return "; ".join(remark for remark in recording.remarks if "CHECK" in remark)


@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow, id="many")])
def test_mistakes_are_refused_or_told_and_sound_imports_are_not(count: int) -> None:
    silent, false = [], []
    for number in range(count):
        rng = np.random.default_rng([SEED, number])
        _, content, frame = sound(rng)
        said = outcome(frame, content)
        if said:
            false.append((number, content["units"], said))
        kind, wrong = mistaken(rng, content, faces="poses" in content)
        if not outcome(frame, wrong):
            silent.append((number, kind, content["units"], wrong["units"], wrong["columns"]))
    assert len(silent) <= 0.01 * count, silent
    assert len(false) <= 0.01 * count, false
