"""Records and dwells that could not be right, and were taken, or ended in a traceback: each case by itself."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from lots import lot

from pipelines.cli import main
from pipelines.drawing import Chart, Plot, PlotAxis, Trace, svg_text
from pipelines.importers import exchange, files
from pipelines.importers.faces import six_faces
from pipelines.importers.mapping import build
from pipelines.importers.record import imported
from pipelines.jobs.recipes import load_recipe, lot_of
from schemas.errors import DataRejected, RecipeInvalid, WrongUse

MAPPED = ("--map", "time=t,x=ax,y=ay,z=az", "--units", "output=g", "--unit", "A1")
CONTENT = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "units": {"output": "g"}, "unit": "A1"}


def record(n: int = 400) -> pd.DataFrame:
    frame = pd.DataFrame(np.tile([0.0, 0.6, 0.8], (n, 1)), columns=["ax", "ay", "az"])
    frame.insert(0, "t", np.arange(n) / 100.0)
    return frame


def dwells(n: int = 4) -> pd.DataFrame:
    frame = pd.DataFrame({"unit": "A1", "dwell": range(n), "time_s": np.arange(n) * 10.0})
    return frame.assign(out_x=0.1, out_y=0.2, out_z=0.97)


def told(monkeypatch, capsys, *words: object) -> tuple[int, str, str]:
    monkeypatch.setattr("sys.argv", ["tumbleline", *map(str, words)])
    with pytest.raises(SystemExit) as left:
        main()
    captured = capsys.readouterr()
    return int(left.value.code or 0), captured.out, captured.err


@pytest.mark.parametrize(
    ("change", "more", "words"),
    [
        (lambda t: t.head(1), (), "1 sample, a record of two at least"),
        (lambda t: t.assign(t=3.0), (), "400 samples, all at 3 s"),
        (lambda t: t, ("--rate", "inf"), "rate_hz: found inf"),
        (lambda t: t, ("--rate", "0"), "rate_hz: found 0"),
        (lambda t: t, ("--blocks", "1e-300"), "block_s: found 1e-300"),
        (lambda t: t.assign(ax=t.ax > -1.0), (), "column 'ax' holds true and false"),
        (lambda t: t.assign(t=t.t * 1e300), (), "column t: found 1e\\+298"),
        (
            lambda t: t.assign(t=t.t * 1e12),
            ("--units", "output=g,time=s"),
            "column time_s: found .*, -1e\\+11 to 1e\\+11 s is needed",
        ),
        (lambda t: t.assign(az=1e200), (), "column az: found 1e\\+200"),
    ],
)
def test_records_that_cannot_be_are_refused_with_status_2(monkeypatch, capsys, tmp_path, change, more, words) -> None:
    change(record()).to_csv(tmp_path / "a.csv", index=False)
    status, out, message = told(
        monkeypatch, capsys, "import", tmp_path / "a.csv", *MAPPED, *more, "--archive", tmp_path / "b"
    )
    assert (status, out) == (2, "")
    assert pd.Series([message]).str.contains(words).all(), message
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize("name", ["record", "slot", "time_s", "out_x", "unit_C", "kind"])
def test_a_covariate_cannot_take_the_name_of_a_column_of_the_tables(name: str) -> None:
    with pytest.raises(RecipeInvalid, match=f"'{name}' is the name of a column that an import writes itself"):
        build({**CONTENT, "columns": {**CONTENT["columns"], name: "t"}}, "import")


@pytest.mark.parametrize("unit", ["ns", "us", "ms", "s"])
def test_time_stamps_of_parquet_become_seconds_whatever_their_unit(tmp_path: Path, unit: str) -> None:
    stamps = (pd.Timestamp("2026-01-01") + pd.to_timedelta(np.arange(400), unit="s")).astype(f"datetime64[{unit}]")
    record().assign(t=stamps).to_parquet(tmp_path / "a.parquet")
    dwells().assign(time_s=stamps[:4]).to_parquet(tmp_path / "d.parquet")
    samples = imported(files.read(tmp_path / "a.parquet")[0], build(CONTENT, "import"), "a.parquet").samples
    assert samples is not None
    assert samples["time_s"].tolist() == np.arange(400.0).tolist()
    assert exchange.read_dwells(tmp_path / "d.parquet")["time_s"].tolist() == [0.0, 1.0, 2.0, 3.0]


def test_time_stamps_elsewhere_are_refused(tmp_path: Path) -> None:
    frame = record().assign(ax=pd.Timestamp("2026-01-01"))
    with pytest.raises(DataRejected, match="column 'ax' holds dates or times"):
        imported(frame, build(CONTENT, "import"), "a.parquet")


@pytest.mark.parametrize("alternating", [False, True])
def test_units_one_after_another_or_in_turn_may_each_begin_their_own_time(*, alternating: bool) -> None:
    frame = pd.DataFrame({"t": [0.0, 10.0, 20.0] * 2, "sn": ["A"] * 3 + ["B"] * 3, "ax": 0.0, "ay": 0.6, "az": 0.8})
    frame = frame.sort_values("t") if alternating else frame
    how = build({**CONTENT, "columns": {**CONTENT["columns"], "unit": "sn"}, "unit": "", "rows": "dwells"}, "import")
    dwell_table = imported(frame.reset_index(drop=True), how, "f").dwells
    assert dwell_table is not None
    assert dwell_table["unit"].tolist() == ["A"] * 3 + ["B"] * 3
    back = frame.assign(t=[0.0, 10.0, 5.0] * 2).sort_values("sn", kind="stable").reset_index(drop=True)
    with pytest.raises(DataRejected, match="row 3: time runs back by 5 s within A" if not alternating else "runs back"):
        imported(back, how, "f")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.assign(duration_s=-5.0), "column duration_s: found -5, 0 s or more is needed"),
        (lambda t: t.assign(unit_C=-400.0), "column unit_C: found -400, -273.15 to 2000 °C is needed"),
        (lambda t: t.assign(time_s=t.time_s * 1e300), "column time_s: found 1e\\+301"),
        (lambda t: t.assign(out_x=t.out_x > 0.0), "column 'out_x' holds true and false"),
        (lambda t: t.assign(hum=1e200), "column hum: found 1e\\+200"),
        *((lambda t, sn=sn: t.assign(unit=sn), "column unit: serial") for sn in ("..", "=cmd|x", "АВС1", "A/1", "x" * 65)),
        (lambda t: t.assign(unit=" "), "column unit: empty"),
    ],
)  # fmt: skip
def test_dwells_that_cannot_be_are_refused(tmp_path: Path, change, words: str) -> None:
    change(dwells()).to_csv(tmp_path / "d.csv", index=False)
    with pytest.raises(DataRejected, match=words):
        exchange.read_dwells(tmp_path / "d.csv")


def test_look_alike_letters_are_named() -> None:
    with pytest.raises(WrongUse, match=r"'АВ' has 'А' \(U\+0410\), which only looks like a plain letter"):
        lot_of(load_recipe(), ["АВ"])


def test_six_faces_without_noise_cannot_be_judged_and_wrong_labels_are_seen_without_it() -> None:
    faces = ["+x", "-x", "+y", "-y", "+z", "-z"]
    force = np.array([[s * (k == a) for k in range(3)] for a in range(3) for s in (1.0, -1.0)]) + 1e-3
    frame = pd.DataFrame(force, columns=["ax", "ay", "az"]).assign(label=faces)
    content = {"columns": {"x": "ax", "y": "ay", "z": "az", "dwell": "label"}, "units": {"output": "g"}, "unit": "A1"}
    content |= {"rows": "dwells", "poses": {face: face for face in faces}, "local_gravity_m_s2": 9.80665}
    judged = six_faces(imported(frame, build(content, "import"), "f"), build(content, "import"))
    assert judged.adequate is None
    assert "cannot be judged" in judged.document["reason"]
    turned = content | {"poses": {**content["poses"], "+x": "-x", "-x": "+y", "+y": "+x"}}
    judged = six_faces(imported(frame, build(turned, "import"), "f"), build(turned, "import"))
    assert judged.adequate is False


def test_a_fit_that_cannot_be_judged_leaves_with_1(monkeypatch, capsys, tmp_path: Path) -> None:
    faces = {"a": "+x", "b": "-x", "c": "+y", "d": "-y", "e": "+z", "f": "-z"}
    force = [[s * (k == a) for k in range(3)] for a in range(3) for s in (1.0, -1.0)]
    pd.DataFrame(force, columns=["x", "y", "z"]).assign(l=[*faces]).to_csv(tmp_path / "a.csv", index=False)
    words = (
        "--map",
        "x=x,y=y,z=z,dwell=l",
        "--units",
        "output=g",
        "--unit",
        "A",
        "--rows",
        "dwells",
        "--local-g",
        "9.81",
    )
    poses = ",".join(f"{label}={face}" for label, face in faces.items())
    fit_options = ("--fit", "faces", "--poses", poses, "--archive", tmp_path / "archive")
    status, out, _ = told(monkeypatch, capsys, "import", tmp_path / "a.csv", *words, *fit_options)
    assert status == 1
    assert "CANNOT BE JUDGED" in out


@pytest.mark.slow
def test_a_column_called_like_a_formula_is_written_as_it_is(monkeypatch, capsys, tmp_path: Path, rng) -> None:
    name = "$\\frac{x$"
    frame = lot(rng, units=1, temperatures=(25.0, 60.0))
    frame[name] = rng.normal(size=len(frame))
    frame["温度"] = rng.normal(size=len(frame))
    frame["out_x"] += 1e-3 * frame[name]
    frame.to_csv(tmp_path / "d.csv", index=False)
    page = tmp_path / "page.html"
    status, _, message = told(monkeypatch, capsys, "diagnose", tmp_path / "d.csv", "--report", page)
    assert status == 1, message
    assert page.read_text().count(name) > 1


def test_no_text_of_a_picture_is_a_formula_or_markup() -> None:
    nothing = Trace("<b>a</b>", np.zeros(1), np.zeros(1))
    drawn = svg_text(Chart("a", (Plot("$a$ 温度", PlotAxis("$\\frac{x$"), PlotAxis("<i>y"), (nothing,)),)))
    assert "$\\frac{x$" in drawn
    assert "$a$ 温度" in drawn
    assert "<i>" not in drawn
    assert "<b>" not in drawn
