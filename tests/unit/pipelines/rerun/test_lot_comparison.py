"""A comparison in memory has the numbers of the tables: of the fit, the verification, the budget and the decisions."""

import shutil
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from pipelines.archive import Archive, Run
from pipelines.jobs.model_change import ModelChange
from pipelines.rerun.steps import ArchivedJob, archived_job
from pipelines.stages.figures.base import BudgetRow
from pipelines.stages.fit import fit_in_memory, fit_tables
from pipelines.stages.grade import GradeEvidence, grade
from pipelines.stages.uncertainty.budget import budget
from pipelines.stages.uncertainty.budget_terms import BudgetTables, BudgetTerms
from pipelines.stages.uncertainty.decision_budget import DecisionBudget, decision_budget
from pipelines.stages.uncertainty.measurands import PARTS
from pipelines.stages.verify import verify_tables
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.dwells import LotTables
from schemas.errors import ArchiveUnusable
from schemas.validity import Stability

READ = ("dwells", "history", "coefficients", "covariance", "wander", "verification", "verification_poses", "noise")
STABLE = {"horizon_days": 4000.0, "switch_on_ug": 7.0, "source": "data_sheet"}


@pytest.fixture(scope="module", params=["without stability", "with stability"])
def given(run: Run, request: pytest.FixtureRequest) -> tuple[ArchivedJob, BudgetTables, BudgetTerms]:
    job = archived_job(run, ModelChange())
    stability = Stability.model_validate(STABLE) if request.param == "with stability" else None
    terms = replace(job.terms, stability=stability)
    tables: dict[str, Any] = {name: run.table(name) for name in READ}
    return job, BudgetTables(**tables), terms


def same_numbers(known: DecisionBudget, rows: pd.DataFrame) -> None:
    for row in rows.to_dict("records"):
        numbers = BudgetRow(*(row[name] for name in ("value", "u_a", "u_b", "u")))
        np.testing.assert_array_equal(known.of(row["unit"])[row["quantity"], row["axis"]], numbers)


def test_every_quantity_has_the_numbers_of_the_table(given: tuple[ArchivedJob, BudgetTables, BudgetTerms]) -> None:
    _, tables, terms = given
    whole = budget(tables, terms)
    rows, known = whole["uncertainties"], DecisionBudget(tables, terms)
    assert len(rows) > 0
    assert set(rows["quantity"]) <= set(PARTS)
    assert ("bias_error_period" in set(rows["quantity"])) == (terms.stability is not None)
    same_numbers(known, rows)
    for unit, own in rows.groupby("unit"):
        assert list(known.of(str(unit))) == list(zip(own["quantity"], own["axis"], strict=True))
    assert not known.of("nobody")
    unit = str(rows["unit"].iloc[0])
    assert not {("weight", "x"), ("bias_error", "w")} & set(known.of(unit))
    covariance = whole["budget_covariance"]
    np.testing.assert_array_equal(
        known.covariance[:, covariance["row"].max(), : covariance["column"].max() + 1].ravel(),
        covariance["value"][covariance["row"] == covariance["row"].max()],
    )


@pytest.mark.parametrize(
    "more", [(), ("third_order",), ("thermal_lag",), ("level_error",)], ids=["linear", "cubic", "nonlinear", "station"]
)
def test_what_a_fit_hands_on_is_what_its_tables_hold(run: Run, more: tuple[str, ...]) -> None:
    lot = LotTables(run.table("dwells"), run.table("history"))
    effects = (*run.about["recipe"]["effects"], *more)
    tables, (made, expected, calibration) = fit_tables(lot, effects), fit_in_memory(lot, effects)
    for name, own in made.items():
        pd.testing.assert_frame_equal(own, tables[name], check_exact=True)
    assert isinstance(expected, np.ndarray)
    assert {*tables} - {*made} == {"predictions"}
    read = read_calibration(tables["coefficients"], tables["covariance"])
    for field in fields(Calibration):
        one, other = getattr(calibration, field.name), getattr(read, field.name)
        assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other, field.name
    verified = verify_tables(lot, made["coefficients"], made["covariance"], expected, calibration)
    of_tables = verify_tables(lot, tables["coefficients"], tables["covariance"], tables["predictions"])
    for name, own in of_tables.items():
        pd.testing.assert_frame_equal(verified[name], own, check_exact=True)


@pytest.mark.slow
@pytest.mark.parametrize("more", [(), ("level_error",), ("thermal_lag",)], ids=["own", "station", "nonlinear"])
def test_a_lot_with_gaps_is_decided_in_memory_as_by_its_tables(
    run: Run, given: tuple[ArchivedJob, BudgetTables, BudgetTerms], more: tuple[str, ...]
) -> None:
    """The last unit lacks a dwell of the fit and one for verification; a station effect is fitted over all units at once."""
    _, known, terms = given
    dwells, history = run.table("dwells"), run.table("history")
    last = dwells["unit"] == dwells["unit"].max()
    gone = dwells[last].groupby("kind")["dwell"].nth(1)
    lot = LotTables(dwells[~(last & dwells["dwell"].isin(gone))], history)
    effects = (*run.about["recipe"]["effects"], *more)
    tables, handed = fit_tables(lot, effects), fit_in_memory(lot, effects)
    made = handed.tables | verify_tables(
        lot, tables["coefficients"], tables["covariance"], handed.expected, handed.calibration
    )
    assert not set(made["residuals"].loc[made["residuals"]["unit"] == dwells["unit"].max(), "dwell"]) & set(gone)
    names = ("coefficients", "covariance", "wander", "verification", "verification_poses")
    found = BudgetTables(lot.dwells, history, noise=known.noise, **{name: made[name] for name in names})
    rows = budget(found, terms)["uncertainties"]
    decisions = DecisionBudget(replace(found, lot=lot, calibration=handed.calibration), terms)
    same_numbers(decisions, rows)
    assert set(rows["unit"]) == set(dwells["unit"])
    assert len(decisions.covariance) == dwells["unit"].nunique()


def test_nothing_is_handed_on_where_nothing_was_fitted(run: Run) -> None:
    dwells = run.table("dwells")
    lot = LotTables(dwells[dwells["kind"] != "dwell"], run.table("history"))
    made, expected, calibration = fit_in_memory(lot, run.about["recipe"]["effects"])
    assert calibration is None
    assert made["coefficients"].empty
    assert verify_tables(lot, made["coefficients"], made["covariance"], expected)["verification"].empty


def evidence(run: Run) -> GradeEvidence:
    names = ("verdicts", "coefficients", "covariance", "residuals", "verification", "verification_poses", "noise")
    tables: dict[str, Any] = {name: run.table(name) for name in names}
    return GradeEvidence(**tables)


def test_decisions_are_those_of_the_tables_and_nothing_is_known_where_nothing_is_stated(
    run: Run, given: tuple[ArchivedJob, BudgetTables, BudgetTerms]
) -> None:
    job, tables, terms = given
    whole = budget(tables, terms)
    of_tables = replace(
        evidence(run), uncertainties=whole["uncertainties"], budget_covariance=whole["budget_covariance"]
    )
    without = replace(evidence(run), budget=decision_budget(tables, terms))
    stated, alone = grade(of_tables, job.limits), grade(without, job.limits, figures=False)
    assert set(alone) == {"grades"}
    assert set(alone["grades"]["basis"]) == {"budget"}
    pd.testing.assert_frame_equal(alone["grades"], stated["grades"], check_exact=True)
    pd.testing.assert_frame_equal(grade(without, job.limits)["figures"], stated["figures"], check_exact=True)
    assert decision_budget(tables, replace(terms, stated=None)) is None
    assert decision_budget(replace(tables, coefficients=tables.coefficients.iloc[:0]), terms) is None


def test_a_change_in_a_column_that_is_not_read_is_refused(run: Run, tmp_path: Path) -> None:
    shutil.copytree(str(run.archive.root), tmp_path / "archive")
    copy = Archive(tmp_path / "archive").run(run.id)
    place = tmp_path / "archive" / "runs" / run.id / "residuals.parquet"
    table = pq.ParquetFile(place).read()
    other = pa.array([1.0] * table.num_rows)
    pq.write_table(table.set_column(table.column_names.index("force_g"), "force_g", other), place, compression="zstd")
    with pytest.raises(ArchiveUnusable, match="has changed since it was written"):
        copy.table("residuals", ("unit", "residual_ug"))
