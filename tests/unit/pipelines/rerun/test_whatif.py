"""A model before it is released: yield and errors of all lots, and the records that make it the line's."""

import json
import shutil
from collections import Counter
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from capture_double import CaptureDouble, measured_run, small_job

from pipelines.archive import Archive, files
from pipelines.certificates.measured import measured_on, measured_span
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.jobs.job import job_of_run
from pipelines.jobs.model_change import ModelChange, change_from_options
from pipelines.jobs.releases import evidence_for, keep_evidence, line_model, release, released, releases
from pipelines.rerun.lot_comparison import LotComparison, Side, applied, fresh, judged
from pipelines.rerun.partition import Batch
from pipelines.rerun.rerun import again
from pipelines.rerun.selection import selected
from pipelines.rerun.whatif import fresh_tasks, summary
from pipelines.tables.calibration import read_calibration
from schemas.errors import RecipeInvalid, WrongUse

pytestmark = pytest.mark.usefixtures("no_verdict")
FULL = 'effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]'
POOR = 'effects = ["bias", "scale", "misalignment", "bias_temperature"]'
LIGHT = ('poses = "nine"', 'poses = "six"'), ("static_record_s = 30.0", "static_record_s = 0.0")
LIMITS = """
name = "plain"
rule = "simple_acceptance"
[figures]
verification_norm_ug = { max = 300.0, unit = "µg" }
"""
MODEL = '[model]\nname = "better"\nversion = 2\neffects = {}\n'
GOOD = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Archive:
    """Two measurements of one lot whose scale depends on temperature, under a model that does not know it."""
    folder = tmp_path_factory.mktemp("whatif")
    (folder / "plain.toml").write_text(LIMITS)
    for repeat, noise in enumerate((1e-4, 2e-4)):
        job = small_job(folder, (FULL, POOR), *LIGHT, ('limits = "consumer"', 'limits = "plain.toml"'), repeat=repeat)
        measured_run(job, Archive(folder / "archive"), CaptureDouble(noise_g=noise))
    return Archive(folder / "archive")


def model_file(folder: Path, effects: tuple[str, ...] = GOOD) -> Path:
    path = folder / "better.toml"
    path.write_text(MODEL.format(json.dumps(effects)))
    return path


def what_if(archive: Archive, change: ModelChange) -> dict:
    runs = [info.id for info in archive.runs() if "rerun_of" not in archive.run(info.id).about]
    comparisons = judged(Batch(archive.address, tuple(runs), change))
    return summary(comparisons, fresh(fresh_tasks(comparisons, archive.address, change)))


@pytest.fixture(scope="module")
def better(archive: Archive, tmp_path_factory: pytest.TempPathFactory) -> tuple[ModelChange, dict]:
    change = change_from_options("", model_file(tmp_path_factory.mktemp("model")))
    return change, what_if(archive, change)


def test_a_model_with_the_missing_effect_is_better_on_fresh_runs_and_in_yield_and_is_what_a_rerun_makes(
    better: tuple[ModelChange, dict], archive: Archive
) -> None:
    _, document = better
    total = document["total"]
    assert (document["verdict"], document["lots"], total["fresh_units"]) == ("better", 2, 3)
    assert total["fresh_rms_ug"][1] < 0.2 * total["fresh_rms_ug"][0]
    assert total["yield"] == [0.0, 1.0]
    assert len(document["flips"]["to_pass"]) == 6
    assert [(row["device"], row["station"]) for row in document["groups"]] == [("adxl355", "simulated")]
    change, _ = better
    run = archive.runs()[0].id
    side = judged(Batch(archive.address, (run,), change))[0].sides[1]
    made = archive.run(again(archive, run, change).new)
    stored = read_calibration(made.table("coefficients"), made.table("covariance"))
    np.testing.assert_array_equal(side.calibration.coefficients, stored.coefficients)
    grades = made.table("grades")
    assert side.outcome == dict(zip(grades["unit"], grades["outcome"], strict=True))


def test_the_error_on_a_fresh_run_is_that_of_the_corrected_norm(archive: Archive) -> None:
    first, again_ = (archive.run(info.id) for info in archive.runs()[:2])
    calibration = read_calibration(first.table("coefficients"), first.table("covariance"))
    dwells = again_.table("dwells")
    sums = applied(calibration, ["A2"], dwells, again_.table("history"))
    own = dwells[(dwells["unit"] == "A2") & dwells["kind"].isin(["dwell", "verification"])]
    u = calibration.units.index("A2")
    names = {name: c for c, (name, _) in enumerate(calibration.names[0])}
    theta = own["unit_C"].to_numpy() - 25.0
    c = calibration.coefficients[u]
    offset = c[:, names["bias"]][None, :] + theta[:, None] * c[:, names["bias_temperature"]][None, :]
    force = np.linalg.solve(calibration.response[u], (own[["out_x", "out_y", "out_z"]].to_numpy() - offset).T).T
    true = np.linalg.norm(own[["force_x", "force_y", "force_z"]].to_numpy(), axis=1)
    expected = 1e6 * (np.linalg.norm(force, axis=1) - true)
    assert sums["A2"][0] == pytest.approx(float(np.sum(expected**2)), rel=1e-6)
    assert sums["A2"][1] == len(own)


@pytest.mark.slow
def test_a_fit_of_measured_data_is_no_measurement_and_no_fresh_run(archive: Archive, tmp_path: Path) -> None:
    shutil.copytree(archive.root, tmp_path / "archive")
    own = Archive(tmp_path / "archive")
    measured = [info.id for info in own.runs() if not info.rerun_of]
    last = own.run(measured[-1])
    (last.path / "run.json").write_bytes(files.json_bytes({**last.about, "when": "2020-02-03T04:05:06.000+00:00"}))
    own = Archive(own.root)
    job = job_of_run(own.run(measured[-1]), effects=list(GOOD))
    runner = Runner(job, own)
    for stage in ORDER[:-1]:
        assert runner.stage(stage).reused or stage != "capture"
    fitted = runner.run
    assert fitted.about["rerun_of"] == measured[-1]
    assert fitted.about["measured"] == own.run(measured[-1]).about["when"]
    assert (measured_span(fitted), measured_on(fitted)) == (None, "2020-02-03")
    assert sorted(one.id for one in selected(own, ["all"])) == sorted(measured)
    about = {key: value for key, value in fitted.about.items() if key not in {"rerun_of", "measured"}}
    (fitted.path / "run.json").write_bytes(files.json_bytes(about))  # as by an older version
    assert sorted(one.id for one in selected(own, ["all"])) == sorted(measured)
    change = change_from_options("", model_file(tmp_path))
    both = judged(Batch(own.address, (measured[-1], fitted.id), change))
    assert fresh_tasks(both, own.address, change) == []


def test_a_model_that_was_there_is_no_better_and_a_lot_that_it_cannot_be_fitted_to_is_named(
    archive: Archive, tmp_path: Path
) -> None:
    same = change_from_options("", model_file(tmp_path, GOOD[:-1]))
    document = what_if(archive, same)
    assert document["verdict"] == "no better"
    assert document["total"]["fresh_rms_ug"][0] == pytest.approx(document["total"]["fresh_rms_ug"][1])
    document = what_if(archive, change_from_options("", model_file(tmp_path, (*GOOD, "bias_temperature_quadratic"))))
    assert document["verdict"] == "nothing to judge"
    assert all("bias_temperature_quadratic" in row["error"] for row in document["failed"])


def test_a_release_needs_a_what_if_of_its_device_or_force_and_a_reason(
    archive: Archive, tmp_path: Path, better: tuple[ModelChange, dict]
) -> None:
    (change, document), since = better, datetime(2026, 3, 1, tzinfo=UTC)
    own = Archive(tmp_path / "archive")
    own.prepare()
    with pytest.raises(WrongUse, match="a what-if is needed"):
        release(own, change, since, reason="it looks good")
    with pytest.raises(WrongUse, match="no reason"):
        release(own, change, since, reason=" ", force=True)
    record = release(own, change, since, reason="the line stands still", force=True)
    assert (record.forced, record.evidence) == (True, "")
    name = keep_evidence(own, change, document, ["a"])
    assert evidence_for(own, change, "ADXL355", "") is not None
    with pytest.raises(WrongUse, match="lots of SF1500"):
        release(own, change, since, device="SF1500", reason="same family")
    assert release(own, change, since, device="ADXL355", reason="fresh error falls").evidence == name
    keep_evidence(own, change, {**document, "verdict": "worse", "words": "it rises"}, ["a"])
    with pytest.raises(WrongUse, match="says worse: it rises"):
        release(own, change, since, device="ADXL355", reason="hope")


def test_the_line_uses_the_narrowest_release_whose_date_is_reached(tmp_path: Path) -> None:
    own = Archive(tmp_path / "archive")
    own.prepare()

    def made(version: int, month: int, **where: str) -> int:
        path = tmp_path / "m.toml"
        path.write_text(f'[model]\nname = "m"\nversion = {version}\neffects = ["bias", "scale"]\n')
        since = datetime(2026, month, 1, tzinfo=UTC)
        return release(own, change_from_options("", path), since, reason="test", force=True, **where).number

    def valid(month: int, device: str = "ADXL355", station: str = "s1") -> int | None:
        current = released(own, device, station, datetime(2026, month, 15, tzinfo=UTC))
        return current.number if current else None

    first, later = made(1, 2), made(2, 6)
    own_device, own_station = made(3, 4, device="adxl355"), made(4, 5, station="s2")
    assert [valid(1), valid(2), valid(3), valid(4), valid(7)] == [None, first, first, own_device, own_device]
    assert valid(7, device="SF1500") == later
    assert [valid(4, station="s2"), valid(5, station="s2")] == [own_device, own_station]
    assert len(releases(own)) == 4
    assert line_model(own, "ADXL355", "s1", datetime(2026, 4, 2, tzinfo=UTC))["model_version"] == 3
    with pytest.raises(
        RecipeInvalid, match=r"no model is released at 2026-01-02 \(released: every device from 2026-02-01"
    ):
        line_model(own, "ADXL355", "s1", datetime(2026, 1, 2, tzinfo=UTC))


def test_verdicts_on_models_that_are_equally_good_are_seldom_better(archive: Archive) -> None:
    """Errors of six units under two models of one truth, which differ by noise alone: 'better' in 2.5 % of archives."""
    rng, units = np.random.default_rng(2611), [f"U{u}" for u in range(6)]
    entry = judged(Batch(archive.address, (archive.runs()[0].id,), change_from_options("", None)))[0].entry
    side = Side(dict.fromkeys(units, "pass"), {}, {}, {}, None)
    verdicts: Counter[str] = Counter()
    for _ in range(1000):
        squares = rng.chisquare(18, (6, 2)) * 25.0
        errors = [{u: (s[k], 18) for u, s in zip(units, squares, strict=True)} for k in (0, 1)]
        sides = tuple(replace(side, verified=verified) for verified in errors)
        verdicts[summary([LotComparison(entry, sides)], [])["verdict"]] += 1
    assert verdicts["better"] <= 40  # 25 expected
    assert verdicts["worse"] <= 40
