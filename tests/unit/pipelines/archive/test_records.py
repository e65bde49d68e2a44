"""Records that are longer than the memory: stored in pieces, and read again piece by piece."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import CaptureDouble, small_job
from long_suites import mostly_slow
from small_station import MemorySink, lot_of, quiet_progress, short_recipe

from inertial.noise.allan import overlapping
from pipelines.archive import Archive
from pipelines.capture import acquisition
from pipelines.capture import capture as capture_stage
from pipelines.stages import noise as noise_stage
from pipelines.stages.reduce import reduce
from pipelines.stages.validate import validate
from pipelines.tables.summaries import by_record, summarised
from schemas.lot import Unit
from schemas.station import load_station
from stations import open_station

UNITS = ["A1", "A2", "A3"]


def captured(recipe, sink: MemorySink) -> MemorySink:
    with open_station(load_station(), lot_of(2)) as station:
        capture_stage.capture(station, recipe, lot_of(2), sink, progress=quiet_progress)
    return sink


def test_a_record_in_pieces_has_the_samples_of_one_in_a_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    recipe = short_recipe(poses=1, static_s=120.0)
    whole = captured(recipe, MemorySink())
    monkeypatch.setattr(acquisition, "LONG_ROWS", 20000)
    monkeypatch.setattr(acquisition, "PIECE_ROWS", 5000)
    pieces = captured(recipe, MemorySink())
    assert len(pieces.ahead) == 4
    assert max(len(piece) for piece in pieces.ahead) < 8000
    for part in range(3):
        known = [name for name in ("record", "unit", "time_s") if name in whole.all(part)]
        left, right = (sink.all(part).sort_values(known) for sink in (whole, pieces))
        pd.testing.assert_frame_equal(left.reset_index(drop=True), right.reset_index(drop=True), check_exact=True)
    assert pieces.all(1)["n"].tolist()[-2:] == [12000, 12000]


def record(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    job = small_job(folder)
    return CaptureDouble().record(job, 0, "dwell", 0, 0.0, job.recipe.poses[0])


def test_pieces_are_published_with_their_record_or_not_at_all(tmp_path: Path) -> None:
    samples, readings, history = record(tmp_path)
    records = Archive(tmp_path / "archive").capture("c1")
    for number, piece in enumerate((samples[:100], samples[100:200])):
        records.part(0, number, piece)
    assert records.finished() == set()
    assert list(records.samples()) == []
    records.put(0, samples[200:], readings, history, b"state", parts=2)
    assert records.finished() == {0}
    pd.testing.assert_frame_equal(pd.concat(records.samples(), ignore_index=True), samples)
    assert [len(piece) for piece in records.samples()] == [100, 100, 100]


def test_pieces_of_a_killed_or_spoilt_attempt_do_not_reach_the_next(tmp_path: Path) -> None:
    samples, readings, history = record(tmp_path)
    Archive(tmp_path / "archive").capture("c1").part(0, 0, samples[:100])  # killed
    records = Archive(tmp_path / "archive").capture("c1")
    records.begin()
    assert not list(Path(str(records.path)).iterdir())
    records.part(0, 0, samples[:50])
    records.part(0, 1, samples[50:60])
    records.part(0, 0, samples[:100])
    records.put(0, samples[100:], readings, history, b"state", parts=1)
    pd.testing.assert_frame_equal(pd.concat(records.samples(), ignore_index=True), samples)
    records.part(1, 0, samples[:100].assign(record=1))
    records.put(1, samples.assign(record=1), readings.assign(record=1), history, b"state")
    assert len(list(records.samples({1}))) == 1


def lot_in_memory(folder: Path, faults: dict[str, str]) -> tuple[list[pd.DataFrame], pd.DataFrame]:
    job, double = small_job(folder), CaptureDouble(faults)
    steps = [("dwell", pose) for pose in job.recipe.poses] + [("allan", job.recipe.static_pose)]
    made = [double.record(job, number, kind, 0, 0.0, pose) for number, (kind, pose) in enumerate(steps)]
    return [samples for samples, _, _ in made], pd.concat([readings for _, readings, _ in made], ignore_index=True)


def cut(tables: list[pd.DataFrame], cuts: int) -> Iterator[pd.DataFrame]:
    """Tables cut into pieces by time, as a capture would cut them."""
    for table in tables:
        edges = np.linspace(table["time_s"].min() - 0.001, table["time_s"].max() + 0.001, cuts + 1)
        for low, high in pairwise(edges):
            yield table[(table["time_s"] > low) & (table["time_s"] <= high)].reset_index(drop=True)


CUTS = [*((fault, 7) for fault in ("", "stuck", "nan", "infinity", "clipped", "short", "overflow")), ("", 2)]


@pytest.mark.parametrize(("fault", "cuts"), mostly_slow(CUTS, ("nan", 7)))
def test_pieces_are_judged_as_the_whole_is(tmp_path: Path, fault: str, cuts: int) -> None:
    samples, readings = lot_in_memory(tmp_path, {"A2": fault} if fault else {})
    assert [(n, len(list(own))) for n, own in by_record(cut(samples, cuts))] == [(n, cuts) for n in range(10)]
    units = [Unit(serial=serial, slot=slot) for slot, serial in enumerate(UNITS)]
    summaries = [summarised(tables, readings) for tables in (samples, cut(samples, cuts))]
    whole, pieces = (validate(own, readings, units) for own in summaries)
    pd.testing.assert_frame_equal(whole, pieces)
    assert whole["refused"].tolist() == [False, bool(fault), False]
    pd.testing.assert_frame_equal(
        *(reduce(own, readings, judged, 9.81) for own, judged in zip(summaries, (whole, pieces), strict=True)),
        rtol=1e-12,
    )


def test_a_long_series_is_averaged_and_keeps_its_allan_deviation(rng: np.random.Generator) -> None:
    n, size = 40000, 8
    values = rng.normal(size=(n, 3)) + np.cumsum(0.001 * rng.normal(size=(n, 3)), axis=0)

    def series(size: int) -> np.ndarray:
        made = noise_stage.StaticSeries(["U"], size)
        for part in np.array_split(values, 13):
            made.add(pd.DataFrame(part, columns=["x", "y", "z"]).assign(unit="U"))
        return made.of("U")

    assert series(size).shape == (n // size, 3)
    whole, means = overlapping(values.T, 100.0), overlapping(series(size).T, 100.0 / size)
    shared = np.isin(np.round(whole.tau, 9), np.round(means.tau, 9))
    ratio = means.deviation[:, : shared.sum()] / whole.deviation[:, shared]
    assert means.tau[0] == pytest.approx(size / 100.0)
    assert ratio[:, :6] == pytest.approx(1.0, abs=0.05)  # the same record with less overlap
    assert np.array_equal(series(1), values)
