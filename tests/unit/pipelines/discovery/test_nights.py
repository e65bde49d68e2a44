"""The evidence of an archive from night to night: a ledger that is not rewritten, caches that are made again."""

import json
import logging
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from calibration_rows import calibrations
from demonstrations import wafer_line

from inertial.discovery.naming import Name
from inertial.discovery.running_sums import Levels, Scale
from inertial.discovery.station_wander import Wander
from inertial.frames import to_fixture
from pipelines.archive import Archive, derived, files
from pipelines.audit.parameters import NAMES
from pipelines.demo.archive_lots import STATIONS, Line, write_lots, write_run
from pipelines.discovery import coefficient_populations
from pipelines.discovery.attributes import add_attributes
from pipelines.discovery.discover import Look, discovered
from pipelines.discovery.discoveries import Discoveries, Discovery
from pipelines.discovery.evidence_state import ALPHA, STATION_DRIVERS, Alarm
from pipelines.discovery.findings import document_of
from pipelines.discovery.lot_source import DiscoveryArchive
from pipelines.discovery.nights import brought_up, remembered
from pipelines.discovery.score_store import ScoreStore

LOTS, FEW = 44, 6


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    """A line with a soft spring in one wafer, scored, with the wafers as attributes."""
    made = wafer_line(tmp_path_factory.mktemp("line"))
    archive = Archive(str(made.folder))
    add_attributes(archive, pd.read_csv(made.units, dtype=str), "serial", "units.csv")
    return archive


@pytest.fixture
def archive(written: Archive, tmp_path: Path) -> Archive:
    shutil.copytree(str(written.root), tmp_path / "archive")
    return Archive(str(tmp_path / "archive"))


def nights(archive: Archive) -> list[Path]:
    return sorted((Path(str(archive.root)) / "discovery" / "DEMO" / "nights").iterdir())


def largest(archive: Archive) -> dict[str, float]:
    state = brought_up(DiscoveryArchive(archive))
    return {name: float(sums.log_e.max()) for name, sums in state.sensor.drivers.items()}


def test_scores_on_disk_are_few_bytes_and_nearly_those_of_the_dwells(archive: Archive) -> None:
    source = DiscoveryArchive(archive)
    files = list((Path(str(archive.root)) / "discovery" / "scores").iterdir())
    assert len(source.pooled()) == LOTS
    assert sum(file.stat().st_size for file in files) / LOTS < 3000
    before = source.store.run(source.pooled()[3])
    shutil.rmtree(Path(str(archive.root)) / "discovery")
    again = ScoreStore(archive)
    again.add([before.run], 1)
    after = again.run(before.run)
    assert after.scores.score == pytest.approx(before.scores.score, rel=1e-12)  # the same bytes from the same dwells
    assert after.units == before.units


def test_the_same_dwells_in_another_run_count_once(tmp_path: Path) -> None:
    """A file that is imported again from another format is another run; its noise would confirm itself."""
    archive = Archive(str(tmp_path / "archive"))
    archive.prepare()
    dwells, about = Line(5, units=2).lot("line-1")
    for number, taken in enumerate((dwells, dwells, dwells[dwells["unit"] == about["unit"][1]])):
        write_run(archive, number, "line-1", taken, about[about["unit"].isin(taken["unit"])])
    source = DiscoveryArchive(archive)
    source.score(1)
    first, *others = source.store.heads
    assert source.pooled() == [first]
    assert source.left_out() == [(run, f"its dwells are those of {first}, which counts") for run in others]


def leaning_line(folder: Path, lots: int, stations: int) -> tuple[list[Any], float]:
    """Discoveries of a level error in a line whose first station leans, and the rms in µg that the model leaves of it."""
    archive, line = Archive(str(folder / "archive")), Line(5, units=2)
    archive.prepare()
    dwells, leaning = pd.DataFrame(), np.zeros((0, 3))
    for number in range(lots):
        dwells, about = line.lot(STATIONS[number % stations])
        leaning = to_fixture((200e-6, 0.0, 0.0), *np.radians(dwells[["outer_deg", "inner_deg"]].to_numpy().T))
        dwells[["out_x", "out_y", "out_z"]] += leaning * (number % stations == 0)
        write_run(archive, number, STATIONS[number % stations], dwells, about)
    columns = np.column_stack([np.ones(len(dwells)), dwells[["force_x", "force_y", "force_z"]]])
    left = 1e6 * (leaning - columns @ np.linalg.lstsq(columns, leaning, rcond=None)[0])
    rows = discovered(archive, Look()).document["discoveries"]
    return [row for row in rows if "level_error" in row["effects"]], float(np.sqrt(np.mean(left**2)))


def test_the_size_of_an_error_of_a_station_is_what_the_models_of_its_lots_leave(tmp_path: Path) -> None:
    rows, left = leaning_line(tmp_path, 66, 3)
    (row,) = (row for row in rows if row["driver"] == "station")
    # about the mean of three stations, of which one leans
    assert row["size_ug"] == pytest.approx(np.sqrt(2.0 / 9.0) * left, rel=0.15)


def test_the_only_station_has_the_size_that_its_lots_have_in_common(tmp_path: Path) -> None:
    ((row,), left) = leaning_line(tmp_path, 40, 1)
    (level,) = row["levels"]
    assert row["driver"] == "mean"
    assert (row["size_ug"], level["size_ug"]) == pytest.approx((left, left), rel=0.15)


def test_sums_that_are_lost_are_made_again_with_what_was_known_in_each_night(tmp_path: Path) -> None:
    """An attribute that is added after the lots were judged is no evidence in them, now or after the sums were lost."""
    made = wafer_line(tmp_path)
    archive = Archive(str(made.folder))
    assert discovered(archive, Look()).document["discoveries"] == []
    (entry,) = nights(archive)
    night = json.loads(entry.read_bytes())
    entry.write_bytes(files.json_bytes({**night, "when": "2026-01-01T00:00:00+00:00"}))  # long before the attributes
    add_attributes(archive, pd.read_csv(made.units, dtype=str), "serial", "units.csv")
    assert discovered(archive, Look()).document["discoveries"] == []
    (entry.parent.parent / "state").unlink()
    assert discovered(archive, Look()).document["discoveries"] == []
    assert discovered(archive, Look(looking_back=True)).document["discoveries"]


def test_a_second_night_adds_an_entry_and_rewrites_none(archive: Archive) -> None:
    source = DiscoveryArchive(archive)
    every = source.pooled()
    early = DiscoveryArchive(archive)
    early.pooled = lambda: every[:40]  # type: ignore[method-assign]  # the lots of the first night
    brought_up(early)
    (first,) = nights(archive)
    before = first.read_bytes()
    assert json.loads(before)["lots"] == 40
    one_go = largest(archive)
    assert [json.loads(place.read_bytes())["lots"] for place in nights(archive)] == [40, LOTS]
    assert first.read_bytes() == before
    assert largest(archive) == one_go  # nothing new: nothing is written
    assert len(nights(archive)) == 2
    shutil.rmtree(Path(str(archive.root)) / "discovery" / "DEMO")
    assert largest(archive) == pytest.approx(one_go, rel=1e-9)  # in one go or night by night


def test_a_state_that_is_gone_or_edited_is_made_again(archive: Archive, caplog: pytest.LogCaptureFixture) -> None:
    before = largest(archive)
    state = Path(str(archive.root)) / "discovery" / "DEMO" / "state"
    data = bytearray(state.read_bytes())
    data[-40] ^= 1
    state.write_bytes(bytes(data))
    with caplog.at_level(logging.WARNING):
        assert largest(archive) == pytest.approx(before, rel=1e-12)
    assert "was edited" in caplog.text
    state.unlink()
    assert largest(archive) == pytest.approx(before, rel=1e-12)


@pytest.mark.slow
def test_edited_scores_are_made_again_and_a_damaged_run_is_told_and_pooled_once_it_is_restored(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    archive = Archive(str(write_lots(tmp_path, Line(5, units=2), FEW).folder))
    DiscoveryArchive(archive).score(1)
    (file,) = (Path(str(archive.root)) / "discovery" / "scores").iterdir()
    data = bytearray(file.read_bytes())
    data[-100] ^= 255
    file.write_bytes(bytes(data))
    source = DiscoveryArchive(archive)
    with caplog.at_level(logging.WARNING):
        assert source.pooled() == []
    assert "was edited" in caplog.text
    assert source.score(1) == FEW
    assert len(DiscoveryArchive(archive).pooled()) == FEW
    shutil.rmtree(Path(str(archive.root)) / "discovery")
    table = next((Path(str(archive.root)) / "runs").iterdir()) / "dwells.parquet"
    sound = table.read_bytes()
    table.write_bytes(sound[:-50])
    with caplog.at_level(logging.WARNING):
        assert source.score(1) == FEW - 1
    assert table.parent.name in caplog.text
    table.write_bytes(sound)
    assert DiscoveryArchive(archive).score(1) == 1


def test_a_revoked_run_is_taken_out_from_that_night_on_and_one_that_goes_on_is_not_judged_yet(archive: Archive) -> None:
    brought_up(DiscoveryArchive(archive))
    later = DiscoveryArchive(archive)
    gone = later.pooled()[10]
    later.__dict__["revoked"] = {gone}
    state = brought_up(later)
    assert gone not in state.order
    assert state.taken_out == [gone]
    entries = [json.loads(place.read_bytes()) for place in nights(archive)]
    assert gone in entries[0]["runs"]
    assert entries[1]["taken_out"] == [gone]
    assert entries[1]["lots"] == LOTS - 1
    # read by the next night, by the state or without it
    again = DiscoveryArchive(archive)
    again.__dict__["revoked"] = {gone}
    (Path(str(archive.root)) / "discovery" / "DEMO" / "state").unlink()
    replayed = brought_up(again)
    assert replayed.order == state.order
    assert {(a.driver, a.index) for a in replayed.alarms} == {(a.driver, a.index) for a in state.alarms}
    assert state.alarms
    # with fewer lots than a discovery needs there is no evidence: what was found is not judged any more
    again.__dict__["revoked"] = set(again.pooled()[20:])
    left = document_of(Discoveries(again, brought_up(again)))
    assert (left["discoveries"], left["unexplained"], left["held"]) == ([], [], [])
    assert left["warnings"][0].startswith("19 lots: a discovery needs at least 30")
    assert f"{LOTS - 19} runs taken out, because a calibration was revoked" in left["warnings"]
    run = next((Path(str(archive.root)) / "runs").iterdir())
    (run / "sealed.json").unlink()
    assert run.name not in {info.id for info in DiscoveryArchive(archive).infos}


def test_attributes_that_come_later_start_with_the_lots_after_them(archive: Archive) -> None:
    brought_up(DiscoveryArchive(archive))
    units = [unit for info in archive.runs() for unit in info.units]
    values = pd.DataFrame({"serial": units, "supplier": ["s" + unit[-1] for unit in units]})
    add_attributes(archive, values, "serial", "late.csv")
    ordinary = discovered(archive, Look()).document
    assert {"name": "supplier", "status": "no unit of a pooled lot has it"} in ordinary["drivers"]
    looked_back = discovered(archive, Look(looking_back=True)).document
    assert {"name": "supplier", "status": "judged"} in looked_back["drivers"]
    assert looked_back["looking_back"]
    assert len(nights(archive)) == 1
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DiscoveryArchive, "pooled", lambda _: [])
        assert discovered(archive, Look(looking_back=True)).document["pooled"]["lots"] == 0


@pytest.mark.slow
def test_two_populations_in_a_coefficient_are_told_with_their_means(
    archive: Archive, monkeypatch: pytest.MonkeyPatch
) -> None:
    units = 200
    values = np.random.default_rng(3).standard_normal((units, len(NAMES)))
    values[:30, NAMES.index("bias_y")] += 5.0
    rows = [(f"U{k}", "line-1", float(k)) for k in range(units)]
    every = calibrations(rows, values, device="DEMO", errors=1.0)
    monkeypatch.setattr(coefficient_populations, "load", lambda *_: every)
    (row,) = discovered(archive, Look(populations=True)).document["population"]
    assert (row["figure"], row["kind"], row["detail"]["units"]) == ("bias_y", "two_populations", units)
    assert row["detail"]["share"] == pytest.approx(0.15, abs=0.02)
    assert row["detail"]["means"][0] == pytest.approx(5.0, abs=0.5)


def told(
    source: DiscoveryArchive, lots: int, named: dict[str, str], unexplained: tuple[str, ...], *, keep: bool = True
) -> str:
    """Ids of the rows of a document that is remembered, by effect and driver and by driver alone, then of those that are new."""
    since = {"since": "2026-01-01", "lots_then": 9}
    made: Any = {
        "discoveries": [{"effects": [effect], "driver": driver, **since} for effect, driver in named.items()],
        "unexplained": [{"driver": driver, **since} for driver in unexplained],
    }
    state: Any = SimpleNamespace(judged=lambda **_: [], order=[""] * lots)
    document = remembered(source, state, made, keep=keep)
    rows = (*document["discoveries"], *document["unexplained"])
    return " ".join([*(row["id"] for row in rows), "new", *document["new"]])


def test_what_is_unexplained_is_new_once_and_keeps_its_id_when_it_has_a_name_and_that_of_an_earlier_version(
    archive: Archive,
) -> None:
    source = DiscoveryArchive(archive)
    # a look at a part, as with --model, --since or --explain, leaves what is new to the night
    assert told(source, 40, {}, ("wafer",), keep=False) == "D1 new D1"
    assert told(source, 40, {}, ("wafer",)) == "D1 new D1"
    assert told(source, 60, {}, ("wafer",)) == "D1 new"
    assert told(source, 80, {}, ("wafer", "slot")) == "D1 D2 new D2"
    assert told(source, 100, {"third_order": "wafer"}, ("slot",)) == "D1 D2 new"
    assert told(source, 120, {"third_order": "wafer"}, ("wafer", "slot")) == "D1 D3 D2 new D3"
    assert told(source, 140, {"magnetic": "slot", "second_order": "wafer"}, ()) == "D2 D3 new"
    # another effect by the same driver is another discovery
    assert told(source, 160, {"magnetic": "slot", "fifth_order": "wafer"}, ()) == "D2 D4 new D4"
    row = {"id": "D7", "effects": ["third_order"], "driver": "wafer", "since": "2025-01-01", "lots_then": 31}
    kept = {"discoveries": [row], "alarms": ["wafer 1"], "lots": 40}
    files.publish(source.folder() / "found", derived.framed(json.dumps(kept).encode()))
    assert told(source, 40, {"third_order": "wafer"}, ("slot",)) == "D7 D8 new D8"


def test_shares_of_hypotheses_add_up_to_the_probability_of_an_error_and_an_effect_is_held_back_with_its_axes(
    archive: Archive,
) -> None:
    """Of every night that a driver comes in; an effect of many columns takes no more than one of a single column."""
    state = brought_up(DiscoveryArchive(archive))
    state.generations["later"] = 1
    sensor, sums = state.sensor, state.sensor.drivers["mean"]
    shares = [np.exp(-state.needed(driver)).sum() for driver in state.generations]
    assert set(state.generations) >= STATION_DRIVERS
    assert sum(shares) == pytest.approx(ALPHA * (0.5 + 0.25))
    names = [*sensor.effects, *range(sensor.size - sensor.count)]
    of_effect = np.bincount(names, np.exp(-state.needed("mean")[: sensor.size]))
    assert of_effect == pytest.approx(of_effect[0])
    effect = state.columns.index(("third_order", 0))
    place = sensor.count + int(sensor.effects[effect])
    axes = np.arange(3) * len(state.columns) + effect
    alarm = Alarm("mean", place, 1, 40, 20.0)
    for strengths, is_held in (((9.0, 0.1, 0.1), False), ((1.0, 9.0, 0.1), True)):
        sums.s[axes], sums.v[axes] = strengths, 1.0
        with pytest.MonkeyPatch.context() as patch:
            shared = np.isin(np.arange(sensor.count), axes[[0, 2]])
            patch.setattr(type(sensor), "shared_by_stations", lambda _, flags=shared: flags)
            patch.setattr(type(sensor), "guarded", np.zeros(sensor.count, dtype=bool))
            assert state.held(alarm) is is_held
            assert state.held(replace(alarm, index=int(axes[1])))


def test_errors_that_references_of_stations_have_alike_by_chance_are_not_said_to_be_of_the_sensors(
    archive: Archive, rng: np.random.Generator
) -> None:
    """A reference has few errors, each in many columns and axes: four of them, at random in each of four stations."""
    source = DiscoveryArchive(archive)
    found = Discoveries(source, brought_up(source))
    sensor, pool = found.state.sensor, source.pool
    sensor._scales = {"between": Scale(np.ones(sensor.count))}

    def scopes(sizes: np.ndarray) -> set[str]:
        """Scopes of means of all effects, at stations (k, h) of these sizes, well known."""
        sensor.levels["station"] = table = Levels(sensor.count)
        sensor.wander = Wander(sensor.count)
        for k, size in enumerate(sizes):
            table.add((f"s{k}",), 1e8 * size[None], np.full((1, sensor.count), 1e8))
            sensor.wander.level(f"s{k}")
        nothing = np.zeros((1, 3))
        alarm = Alarm("mean", 0, 1, 40, 20.0)
        names = (Name((effect,), ("mean",), ("all",), np.ones(1), nothing, nothing, 50.0) for effect in pool.effects)
        return {found._scope(Discovery(name, alarm, ("mean",), np.zeros(1), None))[0] for name in names}

    pattern = rng.standard_normal((4, sensor.count))
    told = sum("sensor" in scopes(rng.standard_normal((4, 4)) @ pattern) for _ in range(40))
    assert told <= 5  # 5 % are allowed; more than this come with 1.4 %
    # what is much larger than the differences is told, with more stations by a smaller ratio
    common, apart = np.ones(sensor.count), rng.standard_normal((4, sensor.count))
    assert scopes(common + 0.02 * apart / apart.std(axis=0)) == {"sensor"}
    assert "sensor" not in scopes(common + 0.3 * (apart - apart.mean(axis=0)) / apart.std(axis=0))
    twelve = rng.standard_normal((12, sensor.count))
    assert scopes(common + 0.3 * (twelve - twelve.mean(axis=0)) / twelve.std(axis=0)) == {"sensor"}
    assert scopes(common[None]) == scopes(common + apart[:2]) == {"sensor_or_station"}
