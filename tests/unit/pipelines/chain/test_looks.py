"""A look during a run: the numbers of the run as if it ended there, with the allowance for its own noise."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from capture_double import AT_ROOM, recipe_file
from each import each
from in_process import refused
from once import once

from inertial.fits.known import noise_guard
from pipelines.archive import Archive, Run
from pipelines.capture.look import Look
from pipelines.chain.chain import ORDER
from pipelines.chain.looks import LotLooks
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Job, Request
from pipelines.schedule.early_end import early_end
from pipelines.stages.uncertainty.budget import lot_budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables, archived_terms
from pipelines.stages.validate import validate
from schemas.stopping import StopTerms

ASKED = "[stop]\nbias_ug = {bias}\n{more}"
LIMITS = """
name = "offsets"
rule = "guarded_acceptance"
grade = "none"
[figures]
zero_g_offset_mg = { max = 75.0, unit = "mg" }
misalignment_mrad = { max = 20.0, unit = "mrad" }
"""
CHANGES = (
    *AT_ROOM[:2],
    ('limits = "consumer"', 'limits = "offsets.toml"'),
    ('poses = "nine"', 'poses = "orthogonal24"'),
    ("static_record_s = 30.0", 'static_record_s = 0.0\nverification_order = "interleaved"'),
)


def recipe_of(folder: Path, bias: float, more: str = "") -> str:
    """Path of the small recipe in one soak, which asks for U of the bias in µg."""
    path = Path(recipe_file(folder, *CHANGES))
    path.write_text(f"{path.read_text(encoding='utf-8')}\n{ASKED.format(bias=bias, more=more)}", encoding="utf-8")
    (folder / "offsets.toml").write_text(LIMITS, encoding="utf-8")
    return str(path)


def job_of(folder: Path, bias: float) -> Job:
    return Request(recipe=recipe_of(folder, bias)).job()


def at_the_end(run: Run, job: Job, terms: StopTerms, told: frozenset[str] = frozenset()) -> Look:
    """What a look at all records of the run says."""
    return LotLooks(job, terms, run.records).look(int(run.table("readings")["record"].max()), told)


def made(folder: Path) -> tuple[Path, str]:
    runner = Runner(job_of(folder, 800.0), Archive(folder / "archive"))
    for stage in ORDER[: ORDER.index("budget") + 1]:
        runner.stage(stage)
    return folder / "archive", runner.run.id


@pytest.fixture
def run() -> Run:
    root, name = once("ended-early", made)
    return Archive(root).run(name)


def test_a_lot_that_knows_enough_ends(run: Run) -> None:
    end = early_end(run)
    assert end["ended"]
    taken = run.table("readings").drop_duplicates("record")["kind"].value_counts()
    assert 10 <= taken["dwell"] < 24
    assert taken["verification"] == 2
    assert end["dwells"] == 24 - taken["dwell"]


def test_what_the_look_says_is_what_the_run_states(run: Run, tmp_path: Path) -> None:
    job, terms = job_of(tmp_path, 800.0), StopTerms(bias_ug=800.0)
    stated = run.table("uncertainties").query("quantity == 'bias'")["u"].max()
    guard = noise_guard(int(run.table("wander")["dof"].sum()), len(LotLooks(job, terms, run.records)._due))
    told = f"U at most {2.0 * stated / 800.0:.2f} of what is asked (times {guard:.2f} as allowance for its noise), "
    assert at_the_end(run, job, terms).text.startswith(told)


@pytest.mark.slow
def test_a_unit_beyond_its_limit_is_told_once(run: Run, tmp_path: Path) -> None:
    job = job_of(tmp_path, 800.0)
    figures = dict(job.limits.figures)
    name = next(name for name in figures if name.endswith("_mg"))
    figures[name] = figures[name].model_copy(update={"max": 0.5})
    strict = Job(job.recipe, job.limits.model_copy(update={"figures": figures}), job.lot, job.station)
    told = at_the_end(run, strict, StopTerms(bias_ug=1.0), frozenset({"A1"}))
    assert told.known
    assert set(told.fails) == {"A2", "A3"}
    assert "limit 0.5 mg" in told.fails["A2"]
    assert told.text == "3 of 3 units decided"  # no U is compared with what is asked where every unit fails


@pytest.mark.slow
def test_a_unit_that_is_not_fitted_is_not_decided(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def one_refused(*given: Any) -> pd.DataFrame:
        verdicts = validate(*given)
        return verdicts.assign(refused=verdicts["refused"] | (verdicts["unit"] == "A2"))

    monkeypatch.setattr("pipelines.chain.looks.validate", one_refused)
    assert at_the_end(run, job_of(tmp_path, 800.0), StopTerms()).text == "2 of 2 units decided, 1 not fitted"


@pytest.mark.parametrize("stated", [True, False])
def test_an_uncertainty_that_was_asked_for_and_not_reached_is_said(
    run: Run, monkeypatch: pytest.MonkeyPatch, *, stated: bool
) -> None:
    """By hand: U = 2·u of the budget, or of the noise alone where nothing is stated."""
    about = {**run.about, "recipe": {**run.about["recipe"], "stop": {"bias_ug": 100.0}}}
    monkeypatch.setattr(Run, "about", about)
    tables, sums = Run.table, run.table("uncertainties")
    if not stated:
        monkeypatch.setattr(Run, "table", lambda run, name: sums[:0] if name == "uncertainties" else tables(run, name))
    end = early_end(run)
    found = {one["unit"]: one["share"] for one in end["not_reached"] if one["figure"] == "bias"}
    by_unit = sums[sums["quantity"] == "bias"].groupby("unit")["u" if stated else "u_a"].max()
    assert found == pytest.approx((by_unit / 50.0).to_dict())


def test_the_period_counts_from_dwells_as_long_as_they_were(run: Run) -> None:
    """A user averages over a dwell: as measured where the run chose it, of the recipe elsewhere."""
    names = [field.name for field in fields(BudgetTables) if field.name in run.tables()]
    tables = BudgetTables(**{name: run.table(name) for name in names})
    longer = replace(tables, dwells=tables.dwells.assign(duration_s=3.0))
    terms = archived_terms(run.about)
    assert not terms.dwells_chosen
    chosen = replace(terms, dwells_chosen=True)
    assert [lot_budget(longer, one).terms.dwell_s for one in (terms, chosen)] == [1.0, 3.0]
    about = {**run.about, "recipe": {**run.about["recipe"], "stop": {"longest_dwell_s": 2.0}}}
    assert archived_terms(about) == chosen


@pytest.mark.slow
def test_a_model_that_is_not_adequate_keeps_the_lot_going(run: Run, tmp_path: Path) -> None:
    """Misalignment of milliradians that the model lacks: its U is small, and means nothing."""
    job = job_of(tmp_path, 800.0)
    figures = {"zero_g_offset_mg": job.limits.figures["zero_g_offset_mg"]}
    recipe = job.recipe.model_copy(update={"effects": ["bias", "scale"]})
    plain = Job(recipe, job.limits.model_copy(update={"figures": figures}), job.lot, job.station)
    found = at_the_end(run, plain, StopTerms())
    assert not found.known
    assert found.text == "3 of 3 units decided; the model is not adequate, a diagnosis needs the other dwells"


def test_effects_that_must_be_visible_keep_the_lot_going(run: Run, tmp_path: Path) -> None:
    found = at_the_end(run, job_of(tmp_path, 800.0), StopTerms(visible=["bias_temperature"]))
    assert not found.known
    assert found.text.endswith("; bias_temperature not visible yet")


ENDLESS = [
    (0.001, "", "[stop] asks for U = 0.001 µg of bias, the references alone have U ="),
    (800.0, 'visible = ["no_such"]', "no_such"),
    (800.0, 'visible = ["bias"]', "key 'stop.visible': bias in the model, effects beside it are needed"),
    (800.0, 'visible = ["bias_temperature"]', "the whole plan does not show bias_temperature"),
    (800.0, "longest_dwell_s = 0.6", "key 'stop.longest_dwell_s': 0.6 s, dwell_s is 1 s"),
    (800.0, "scale_temperature_ppm_K = 5.0", "uncertainty of scale_temperature is asked for, the model has no such"),
]


@each(ENDLESS)
def test_what_can_never_end_a_lot_is_refused(row: tuple[float, str, str], tmp_path: Path) -> None:
    bias, more, message = row
    assert message in refused("run", recipe_of(tmp_path, bias, more), "--direct", "--archive", tmp_path / "archive")
