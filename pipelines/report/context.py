"""Inputs of the panels of a run's report: the run, its tables, and the part of each unit."""

from collections.abc import Mapping
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pandas as pd

from pipelines.archive import Run
from pipelines.certificates.validity import Calibration
from pipelines.stages.figures import plain_reason
from pipelines.tables.frames import rows_of

TABLES = (
    *("verdicts", "dwells", "coefficients", "residuals", "verification", "verification_poses"),
    *("allan", "noise", "figures", "grades"),
)
OPTIONAL = (  # runs of earlier versions have none
    *("wander", "budget", "uncertainties", "lot_risks", "soak_noise", "noise_temperature"),
    *("procedure_points", "procedure_figures", "procedure_findings"),
)


class ReportContext:
    """A run as its panels read it.

    Parameters
    ----------
    certificates : of the run's units, in their present state in the ledger.
    """

    not_needed: tuple[str, ...] = ()
    """Entries of [uncertainty] that nothing of the run depends on."""

    def __init__(self, run: Run, certificates: Mapping[str, Calibration]) -> None:
        self.run = run
        self.certificates = certificates
        self.about: dict[str, Any] = run.about
        self.recipe: dict[str, Any] = run.about["recipe"]
        stored = set(run.tables())
        self.tables: dict[str, pd.DataFrame] = {
            name: run.table(name) for name in (*TABLES, *OPTIONAL) if name in stored
        }

    @property
    def coverage(self) -> float:
        """The coverage factor k of the limits, by which every uncertainty of the page is expanded."""
        return float(self.about["limits"]["coverage_factor"])

    @property
    def rule(self) -> str:
        """The decision rule."""
        return str(self.tables["grades"].sort_values("slot")["rule"].iloc[0])

    @cached_property
    def units(self) -> "list[UnitContext]":
        """Every unit, by slot."""
        return [UnitContext(self, row) for row in rows_of(self.tables["grades"].sort_values("slot"))]

    @property
    def calibrated(self) -> "list[UnitContext]":
        """The units that were not refused, by slot."""
        return [unit for unit in self.units if unit.outcome != "refused"]

    def limit(self, figure: str, end: Literal["max", "min"] = "max") -> float:
        """The limit of a figure, or its least value, in the figure's unit; nan where it has none."""
        return float(self.about["limits"]["figures"].get(figure, {}).get(end, np.nan))


class UnitContext:
    """A unit of a run as its panels read it."""

    def __init__(self, report: ReportContext, row: dict[str, Any]) -> None:
        self.report = report
        self.unit = str(row["unit"])
        self.slot = row["slot"]
        self.outcome: str = row["outcome"]
        self.grade: str = row["grade"]
        self.reasons = [plain_reason(reason) for reason in str(row["reasons"]).split("; ") if reason]
        self.certificate = report.certificates.get(self.unit)

    @cached_property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The rows of this unit in the run's tables."""
        return {
            name: table[table["unit"] == self.unit] for name, table in self.report.tables.items() if "unit" in table
        }
