"""Fit, verification and budget of a lot in memory: the numbers of the stages, without their tables in an archive."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import pandas as pd

from pipelines.jobs.job import Job
from pipelines.jobs.priors import family
from pipelines.stages.fit import fit_in_memory
from pipelines.stages.grade import GradeEvidence
from pipelines.stages.uncertainty.budget_terms import BudgetTables
from pipelines.stages.uncertainty.decision_budget import decision_budget
from pipelines.stages.verify import verify_tables
from pipelines.tables.dwells import LotTables


def evaluated(
    job: Job,
    lot: LotTables,
    verdicts: pd.DataFrame,
    noise: pd.DataFrame,
    full_scale: Mapping[str, float] = MappingProxyType({}),
) -> tuple[dict[str, pd.DataFrame], GradeEvidence]:
    """Tables of fit and verification of a lot, and what its decisions are based on.

    Parameters
    ----------
    verdicts, noise : tables of validation and of the static record
    full_scale : by unit, as in :class:`GradeEvidence`
    """
    made, expected, calibration = fit_in_memory(lot, job.recipe.effects, family(job.prior))
    made |= verify_tables(lot, made["coefficients"], made["covariance"], expected, calibration)
    names = ("coefficients", "covariance", "verification", "verification_poses")
    shared: dict[str, Any] = {**{name: made[name] for name in names}, "noise": noise, "calibration": calibration}
    tables = BudgetTables(lot.dwells, lot.history, wander=made["wander"], prior=made["prior"], lot=lot, **shared)
    stated = decision_budget(tables, job.terms)
    evidence = GradeEvidence(verdicts, residuals=made["residuals"], budget=stated, full_scale=full_scale, **shared)
    return made, evidence
