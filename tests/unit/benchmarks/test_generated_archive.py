"""The generated archive is one that the product reads, fits again and grades, and holds the truth that it tells."""

import sys

import numpy as np
import pytest
from root_process import ROOT

sys.path.insert(0, str(ROOT))

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive
from pipelines.stages.fit import fit
from pipelines.stages.verify import verify
from schemas import table_check


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory):
    folder = tmp_path_factory.mktemp("made") / "archive"
    truth = write_archive(folder, 12, years=1.0, seed=3, workers=1)
    return Archive(folder), truth


def test_every_table_keeps_its_contract_and_its_hash(made):
    archive, _ = made
    run = archive.run(archive.runs()[0].id)
    assert len(run.tables()) == 15
    for name in run.tables():
        assert len(table_check.check(name, run.table(name))) == run.manifest(name)["rows"]


def test_runs_come_in_order_of_time_with_ten_units_each(made):
    archive, truth = made
    infos = archive.runs()
    assert len(infos) == 12
    assert infos[0].started < infos[-1].started
    assert {len([u for u in info.units if not u.startswith("CS-")]) for info in infos} == {10}
    assert truth["drifting"]["unit"] in infos[0].units


def test_today_s_fit_agrees_with_the_archived_coefficients(made):
    archive, _ = made
    run = archive.run(archive.runs()[0].id)
    dwells, history, old = (run.table(name) for name in ("dwells", "history", "coefficients"))
    assert (dwells.groupby("unit")["kind"].value_counts().unstack()["dwell"] == 72).all()
    new = fit(dwells, history, run.about["recipe"]["effects"])
    joined = old.merge(new["coefficients"], on=["unit", "axis", "effect", "name"], suffixes=("", "_new"))
    assert len(joined) == len(old)
    assert (joined["unit_text"] == joined["unit_text_new"]).all()
    away = (joined["value"] - joined["value_new"]) / joined["standard_error_new"]
    assert np.sqrt(np.mean(away**2)) < 1.5  # another estimator of the same, which knows of the wander
    assert len(
        verify(dwells, history, *(new[n] for n in ("coefficients", "covariance", "predictions")))["verification"]
    )


def test_the_same_seed_makes_the_same_bytes(made, tmp_path):
    archive, _ = made
    again = write_archive(tmp_path / "again", 12, years=1.0, seed=3, workers=1)
    assert again["drifting"] == made[1]["drifting"]
    for name in sorted(path.relative_to(archive.root) for path in archive.root.rglob("dwells.parquet"))[:3]:
        assert (tmp_path / "again" / name).read_bytes() == (archive.root / name).read_bytes()
