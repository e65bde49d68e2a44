"""What a writer writes a reader reads back: recordings in every format, tables as text, exported calibrations."""

import csv
import gzip
import io
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from generated import FEW
from hypothesis import given
from hypothesis import strategies as st

from pipelines.export import FORMATS, ExportSettings, UnitCalibration, export_files
from pipelines.export.polynomials import ORDER
from pipelines.export.teds import DataSheet
from pipelines.export.unit_noise import TERMS, UnitNoise
from pipelines.export.waveforms import WRITERS, Channel, write_waveforms
from pipelines.importers import files
from pipelines.importers.exchange import checked, read_dwells

VALUES = st.floats(-1e4, 1e4, allow_subnormal=False)
STATE_THE_INTERVAL = ("uff58", "tdms", "lvm", "wav")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("written")


@st.composite
def channels(draw: st.DrawFn) -> list[Channel]:
    count, length = draw(st.integers(1, 3)), draw(st.integers(8, 40))
    interval, unit = 1.0 / draw(st.integers(1, 50_000)), draw(st.sampled_from(["g", "V", "m/s^2"]))
    samples = [np.array(draw(st.lists(VALUES, min_size=length, max_size=length))) for _ in range(count)]
    return [Channel(f"unit {'xyz'[k]}", unit, "units", own, interval, k) for k, own in enumerate(samples)]


@pytest.mark.parametrize("form", WRITERS)
@FEW
@given(written=channels())
def test_samples_and_interval_of_a_recording_read_back_exactly(form: str, written: list[Channel], folder: Path) -> None:
    path = folder / f"recording{WRITERS[form].suffix}"
    assert write_waveforms(form, written, path) == [path]
    content, source = files.read_content(path)
    columns = [name for name in content.table if not str(name).lower().startswith(("time", "x_value"))]
    assert len(columns) == len(written)
    for name, channel in zip(columns, written, strict=True):
        np.testing.assert_array_equal(content.table[name].to_numpy(dtype=float), channel.samples)
    if form in STATE_THE_INTERVAL:
        assert source.form == form
        assert content.interval_s == pytest.approx(written[0].interval_s, rel=1e-5)


@st.composite
def dwells(draw: st.DrawFn) -> pd.DataFrame:
    rows = draw(st.integers(2, 6))
    numbers = st.lists(st.floats(-1.2, 1.2).map(lambda value: round(value, 9)), min_size=2 * rows, max_size=2 * rows)
    temperature = draw(st.lists(st.integers(-400, 850), min_size=2 * rows, max_size=2 * rows))
    return pd.DataFrame({
        "unit": np.repeat(["A1", "B2"], rows),
        "dwell": np.tile(np.arange(rows), 2),
        "time_s": np.tile(30.0 * np.arange(rows), 2),
        "unit_C": np.array(temperature) / 10.0,
        **{f"out_{axis}": draw(numbers) for axis in "xyz"},
    })  # fmt: skip


def same(one: pd.DataFrame, other: pd.DataFrame) -> None:
    pd.testing.assert_frame_equal(one, other[list(one.columns)], check_exact=True, check_dtype=False)


@pytest.mark.parametrize(("separator", "decimal"), [(",", "."), (";", "."), (";", ","), ("\t", "."), ("\t", ",")])
@FEW
@given(frame=dwells(), encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
def test_dwells_as_text_read_back(
    separator: str, decimal: str, encoding: str, frame: pd.DataFrame, folder: Path
) -> None:
    frame.to_csv(folder / "dwells.csv", sep=separator, decimal=decimal, index=False, encoding=encoding)
    same(frame, read_dwells(folder / "dwells.csv"))


@FEW
@given(frame=dwells())
def test_dwells_as_parquet_and_compressed_read_back(frame: pd.DataFrame, folder: Path) -> None:
    frame.to_parquet(folder / "dwells.parquet")
    (folder / "dwells.csv.gz").write_bytes(gzip.compress(frame.to_csv(index=False).encode()))
    same(frame, read_dwells(folder / "dwells.parquet"))
    same(frame, read_dwells(folder / "dwells.csv.gz"))


@FEW
@given(frame=dwells(), seed=st.integers(0, 2**32 - 1))
def test_dwells_in_any_order_are_the_same_and_checked_once_is_checked(frame: pd.DataFrame, seed: int) -> None:
    known = checked(frame, where="a")
    same(known, checked(frame.sample(frac=1.0, random_state=seed), where="a"))
    same(known, checked(known, where="a"))


@st.composite
def calibrations(draw: st.DrawFn, unit: str) -> UnitCalibration:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    bias, response = 1e-4 * rng.normal(size=(ORDER, 3)), np.zeros((ORDER, 3, 3))
    bias[1:] *= 1e-4
    response[0] = 0.3 * (np.eye(3) + 1e-3 * rng.normal(size=(3, 3)))
    sizes, known = rng.uniform(5.0, 50.0, 3), np.ones(3, dtype=bool)
    noise = UnitNoise(dict.fromkeys(TERMS, sizes), dict.fromkeys(TERMS, known), 100.0)
    force = np.vstack([np.eye(3), -np.eye(3)])
    columns = [f"{what}_{axis}" for what in ("force", "out") for axis in "xyz"]
    dwells = pd.DataFrame(np.hstack([force, bias[0] + force @ response[0].T]), columns=columns)
    coefficients = (bias, response, (-10.0, 60.0), (), None)
    return UnitCalibration(unit, "pass", "industrial", "V", *coefficients, noise, 1.5, dwells=dwells)


SETTINGS = ExportSettings(
    nominal=0.3,
    device_ids={"SN1": 1310988, "SN2": 1310996},
    data_sheet=DataSheet(17, 4507, "B5", 4.6, "QA", "2026-05-01", 365),
)


@pytest.mark.parametrize("form", FORMATS)
@FEW
@given(one=calibrations("SN1"), other=calibrations("SN2"))
def test_an_export_depends_on_its_calibrations_alone(form: str, one: UnitCalibration, other: UnitCalibration) -> None:
    written = export_files(form, [one, other], "run-1", SETTINGS)
    assert written == export_files(form, [one, other], "run-1", SETTINGS)
    assert written != export_files(form, [other, one], "run-1", SETTINGS) or len(written) > 1


@FEW
@given(unit=calibrations("SN1"))
def test_an_exported_json_and_csv_have_every_digit(unit: UnitCalibration) -> None:
    (data,) = export_files("json", [unit], "run-1", SETTINGS).values()
    (back,) = json.loads(data)["units"]
    np.testing.assert_array_equal(back["bias"], unit.bias)
    np.testing.assert_array_equal(back["response"], unit.response)
    (data,) = export_files("csv", [unit], "run-1", SETTINGS).values()
    for row in csv.DictReader(io.StringIO(data.decode())):
        values = {"bias": unit.bias, "response": unit.response}[row["quantity"]]
        place = ["xyz".index(row[name]) for name in ("row", "column") if row[name]]
        assert float(row["value"]) == values[int(row["power_of_theta"])][tuple(place)]


@FEW
@given(
    unit=calibrations("SN1"), force=st.lists(st.floats(-2.0, 2.0), min_size=3, max_size=3), warm=st.floats(-10.0, 60.0)
)
def test_a_correction_takes_back_what_the_unit_does(unit: UnitCalibration, force: list[float], warm: float) -> None:
    powers = (warm - 25.0) ** np.arange(ORDER)
    output = powers @ unit.bias + np.einsum("k,kij->ij", powers, unit.response) @ force
    np.testing.assert_allclose(unit.correct(output[None], warm)[0], force, atol=1e-9)
