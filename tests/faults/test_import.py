"""What import and the exchange format refuse: one message that names place, value and remedy."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from pipelines.importers import exchange, files
from pipelines.importers.mapping import Mapping, build, pairs
from pipelines.importers.record import imported
from pipelines.tables.dwell_table import covariates
from schemas.errors import DataRejected, RecipeInvalid, WrongUse

CONTENT = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "units": {"output": "g"}, "unit": "A1"}


def how(**more: object) -> Mapping:
    return build({**CONTENT, **more}, "test")


def table(rng: np.random.Generator, n: int = 400) -> pd.DataFrame:
    frame = pd.DataFrame(0.002 * rng.normal(size=(n, 3)) + [0.0, 0.6, 0.8], columns=["ax", "ay", "az"])
    frame.insert(0, "t", np.arange(n) / 100.0)
    return frame


def dwells(n: int = 4) -> pd.DataFrame:
    frame = pd.DataFrame({"unit": "A1", "dwell": range(n), "time_s": np.arange(n) * 10.0})
    return frame.assign(out_x=0.1, out_y=0.2, out_z=0.97, hum=np.arange(n) + 40.0)


def test_a_clean_record_becomes_samples_and_a_dwell(rng: np.random.Generator) -> None:
    recording = imported(table(rng), how(), "file.csv")
    assert recording.samples is not None
    assert recording.dwells is not None
    assert len(recording.samples) == 400
    assert recording.dwells[["out_x", "out_y", "out_z"]].to_numpy()[0] == pytest.approx([0.0, 0.6, 0.8], abs=1e-3)


def test_axes_signs_and_units_are_applied(rng: np.random.Generator) -> None:
    raw = table(rng).assign(heat=300.15)
    mapping = how(
        columns={**CONTENT["columns"], "temperature": "heat"},
        units={"output": "mg", "temperature": "K"},
        axes=["y", "x", "z"],
        signs=["-", "+", "+"],
    )
    recording = imported(raw.assign(ax=raw.ax * 1e3, ay=raw.ay * 1e3, az=raw.az * 1e3), mapping, "f")
    assert recording.dwells is not None
    row = recording.dwells.iloc[0]
    assert [row["out_x"], row["out_y"], row["unit_C"]] == pytest.approx([-0.6, 0.0, 27.0], abs=1e-3)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: t.rename(columns={"ax": "acc_x"}), r"column 'ax' \(for x\) is not there; .*"),
        (lambda t: t.assign(ay=t.ay.where(t.index != 7)), r"row 8, column 'ay': found nan"),
        (lambda t: t.assign(az=t.az.where(t.index != 3, np.inf)), r"row 4, column 'az': found inf"),
        (lambda t: t.assign(ax=t.ax.astype(str).where(t.index != 2, "n/a")), r"row 3, column 'ax': found n/a"),
        (lambda t: t.iloc[::-1].reset_index(drop=True), r"row 2: time runs back by 0.01 s"),
        (lambda t: t * [1.0, 9.81, 9.81, 9.81], r"norm of the output is 9.8\d*, .*looks like m/s\^2"),
    ],
    ids=["column", "nan", "inf", "text", "time", "unit"],
)
def test_refuses_records_that_contradict_their_mapping(change: object, words: str, rng: np.random.Generator) -> None:
    with pytest.raises(DataRejected, match=words):
        imported(change(table(rng)), how(), "file.csv")


def test_refuses_g_claimed_as_counts(rng: np.random.Generator) -> None:
    with pytest.raises(DataRejected, match="not whole numbers"):
        imported(table(rng), how(units={"output": "LSB"}), "file.csv")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"units": {"output": "G"}}, "known unit of the output is needed: g, mg"),
        ({"units": {"output": "g", "tme": "s"}}, "not known; did you mean time"),
        ({"columns": {"x": "a", "y": "b"}}, "z not mapped"),
        ({"axes": ["x", "x", "z"]}, "every axis is needed once"),
        ({"poses": {"up": "z"}}, r"found 'z', one of \+x"),
        ({"local_gravity_m_s2": 1.0}, "local_gravity_m_s2"),
        ({"unitt": "A"}, "not known; did you mean unit"),
    ],
)
def test_refuses_mappings_with_a_slip(content: dict, words: str) -> None:
    with pytest.raises(RecipeInvalid, match=words):
        how(**content)


def test_a_covariate_may_have_any_name_and_a_likely_slip_is_remarked() -> None:
    columns = {"x": "a", "y": "b", "z": "c", "temprature": "d", "hum": "e"}
    assert how(columns=columns).likely_slips == {"temprature": ("temperature",)}


def test_refuses_a_record_of_nobody(rng: np.random.Generator) -> None:
    with pytest.raises(WrongUse, match="no unit is mapped"):
        imported(table(rng), how(unit=""), "f")


def test_refuses_pairs_without_an_equals_sign() -> None:
    with pytest.raises(WrongUse, match="--map: found 'x', name=value"):
        pairs("time=1,x", "--map")


def test_refuses_a_truncated_parquet_file(tmp_path: Path) -> None:
    path = tmp_path / "cut.parquet"
    dwells().to_parquet(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(DataRejected, match="begin as Parquet but are not a whole file"):
        files.read(path)


def test_refuses_a_truncated_gzip_file(tmp_path: Path) -> None:
    path = tmp_path / "cut.csv.gz"
    path.write_bytes(gzip.compress(b"a,b\n" + b"1,2\n" * 1000)[:-20])
    with pytest.raises(DataRejected, match="does not unpack"):
        files.read(path)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no rows of data"),
        (b"a,b,c\n", "no rows of data"),
        (b"a,b\n1,2\n3,4,5\n", "do not have the 2 columns"),
        (b"a,b\n1,2\n3,4,5,6\n", "do not have the 2 columns"),
        (b"a,a\n1,2\n", "column 'a' is there twice"),
        (b"\x00\xff\xfe\x01", "neither text"),
        (b"\x89HDF\r\n\x1a\n", "MATLAB 7.3"),
    ],
)
def test_refuses_files_that_are_no_tables(content: bytes, words: str, tmp_path: Path) -> None:
    path = tmp_path / "file.csv"
    path.write_bytes(content)
    with pytest.raises(DataRejected, match=words):
        files.read(path)


def test_reads_the_same_table_from_every_format(tmp_path: Path) -> None:
    frame = pd.DataFrame({"t": [0.0, 0.5, 1.0], "ax": [1.0, 2.0, 3.5]})
    frame.to_csv(tmp_path / "a.csv", index=False)
    frame.to_csv(tmp_path / "b.tsv", index=False, sep="\t")
    (tmp_path / "c.txt").write_text("# made by hand\nt ax\n" + "\n".join(f"{t}  {a}" for t, a in frame.to_numpy()))
    frame.to_parquet(tmp_path / "d.parquet")
    savemat(tmp_path / "e.mat", {"t": frame.t.to_numpy(), "ax": frame.ax.to_numpy()})
    (tmp_path / "f.csv.gz").write_bytes(gzip.compress((tmp_path / "a.csv").read_bytes()))
    for path in sorted(tmp_path.iterdir()):
        pd.testing.assert_frame_equal(files.read(path)[0], frame, check_dtype=False)


def test_reads_structures_and_matrices_of_matlab(tmp_path: Path) -> None:
    savemat(tmp_path / "e.mat", {"imu": {"acc": np.arange(12.0).reshape(4, 3)}, "fs": 100.0})
    assert list(files.read(tmp_path / "e.mat")[0].columns) == ["imu.acc_1", "imu.acc_2", "imu.acc_3"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d.drop(columns="time_s"), "column time_s is missing"),
        (lambda d: d.assign(out_x=[0.1, np.nan, 0.1, 0.1]), r"row 1 \(unit A1\), column out_x: found nan"),
        (lambda d: d.assign(hum=[1.0, 2.0, np.inf, 3.0]), "row 2 .*column hum: found inf"),
        (lambda d: d.assign(dwell=[0, 1, 1, 2]), "is there twice"),
        (lambda d: d.assign(dwell=[0, 1, 1.5, 2]), "found 1.5, a whole number"),
        (lambda d: d.assign(unit=["A1", "", "A1", "A1"]), "row 1, column unit: empty"),
        (lambda d: d.assign(outer_deg=0.0), "outer_deg without inner_deg"),
        (lambda d: d.assign(force_x=0.0, force_y=0.0, force_z=9.81), "give force_x, force_y, force_z in g"),
        (lambda d: d.assign(sd_x=-1.0, sd_y=1.0, sd_z=1.0), "column sd_x: found -1, 0 or more"),
    ],
)
def test_refuses_dwells_outside_the_exchange_format(change: object, words: str, tmp_path: Path) -> None:
    change(dwells()).to_csv(tmp_path / "dwells.csv", index=False)
    with pytest.raises(DataRejected, match=words):
        exchange.read_dwells(tmp_path / "dwells.csv")


def test_dwells_come_back_in_order_with_their_covariates(tmp_path: Path) -> None:
    dwells().iloc[::-1].to_parquet(tmp_path / "dwells.parquet")
    frame = exchange.read_dwells(str(tmp_path / "dwells.parquet"))
    assert frame["dwell"].tolist() == [0, 1, 2, 3]
    assert covariates(frame) == ["hum"]


def test_a_serial_number_of_digits_stays_text(tmp_path: Path) -> None:
    dwells().assign(unit=17).to_csv(tmp_path / "d.csv", index=False)
    assert exchange.read_dwells(tmp_path / "d.csv")["unit"].tolist() == ["17"] * 4


def test_says_so_when_there_is_neither_file_nor_run(tmp_path: Path) -> None:
    with pytest.raises(WrongUse, match="neither a file nor a run"):
        exchange.read_dwells("lot-7", archive=tmp_path)
    with pytest.raises(WrongUse, match="cannot be read"):
        exchange.read_dwells(tmp_path / "missing.csv")


def test_history_needs_a_temperature_and_each_time_once(tmp_path: Path) -> None:
    path = tmp_path / "history.csv"
    pd.DataFrame({"time_s": [2.0, 1.0], "unit_C": [20.0, 21.0]}).to_csv(path, index=False)
    assert exchange.read_history(path)["time_s"].tolist() == [1.0, 2.0]
    pd.DataFrame({"time_s": [1.0, 1.0], "unit_C": [20.0, 21.0]}).to_csv(path, index=False)
    with pytest.raises(DataRejected, match="is there twice"):
        exchange.read_history(path)
    pd.DataFrame({"time_s": [1.0, 1.0], "temp": [20.0, 21.0]}).to_csv(path, index=False)
    with pytest.raises(DataRejected, match="neither unit_C nor chamber_C"):
        exchange.read_history(path)
