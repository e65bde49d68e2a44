"""Inputs of a budget: the tables of a run, and the statements of station, device and certificate."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import pandas as pd

from pipelines.stages.reduce import FollowedSupply
from pipelines.stages.uncertainty.contributions import merged, reads_own_temperature
from pipelines.tables.calibration import Calibration, read_calibration
from pipelines.tables.dwells import LotArrays, LotTables
from pipelines.tables.frames import own_rows
from schemas.limits import VALIDITY_MONTHS
from schemas.recipe import Recipe
from schemas.reference import Reference
from schemas.station import Pace
from schemas.uncertainty import Uncertainty
from schemas.validity import CertificateTerms, Stability

MANY = 1e6


@dataclass(frozen=True)
class BudgetTables:
    """The tables that a budget is computed from.

    prior : None for a fit without a prior
    lot, calibration : dwells with their history, and coefficients, where other stages have converted them already
    results : of comparisons; None where the run has none
    """

    dwells: pd.DataFrame
    history: pd.DataFrame | None
    coefficients: pd.DataFrame
    covariance: pd.DataFrame
    wander: pd.DataFrame
    verification: pd.DataFrame
    verification_poses: pd.DataFrame
    noise: pd.DataFrame
    prior: pd.DataFrame | None = None
    lot: LotTables | None = None
    calibration: Calibration | None = None
    results: pd.DataFrame | None = None

    def arrays(self) -> LotArrays:
        """The dwells of fit and verification."""
        return (self.lot or LotTables(self.dwells, self.history)).fitted_kinds

    def parts(self) -> "list[BudgetTables]":
        """The tables in parts whose units have the same dwells; empty where no unit was fitted."""
        lots = (self.lot or LotTables(self.dwells, self.history)).parts
        if self.coefficients.empty or len(lots) == 1:
            return [] if self.coefficients.empty else [self]
        tables = {
            field.name: value for field in fields(self) if isinstance(value := getattr(self, field.name), pd.DataFrame)
        }
        return [
            replace(
                self, lot=lot, calibration=None, **{name: own_rows(table, lot.dwells) for name, table in tables.items()}
            )
            for lot in lots
        ]

    def calibrated(self) -> Calibration:
        """The coefficients with their covariance."""
        return self.calibration or read_calibration(self.coefficients, self.covariance)


@dataclass(frozen=True)
class BudgetTerms:
    """The statements of station, device and certificate; JSON-able, part of the stage's key.

    stated : ``[uncertainty]`` of station and recipe together; None: noise only
    dwell_s : of the recipe; dwells_chosen : whether a run may choose it, so that the mean of its dwells counts
    """

    stated: Uncertainty | None
    stability: Stability | None
    certificate: CertificateTerms
    references: tuple[Reference, ...]
    soak_min_s: float
    dwell_s: float
    room_C: float
    dwells_chosen: bool = False

    @property
    def follows(self) -> FollowedSupply | None:
        """How the outputs follow the measured supply; None where it is not measured, or the outputs do not follow it.

        None as well for runs of earlier versions, which state no nominal supply and are as they were read.
        """
        dut = self.stability
        supply = None if self.stated is None else self.stated.supply
        if dut is None or dut.supply_V is None or supply is None or not supply.ratio_measured or dut.ratiometric == 0.0:
            return None
        return FollowedSupply(dut.supply_V, dut.ratiometric)

    @property
    def switch_on_dof(self) -> float:
        """Degrees of freedom that the scatter of switching on is known from; many where nothing is said of them."""
        cycles = None if self.stability is None else self.stability.power_cycles
        return MANY if cycles is None else cycles - 1.0

    @property
    def reads_own_temperature(self) -> bool:
        """Whether fit and user read the same thermometer of the device, by the function of this name."""
        return self.stated is not None and reads_own_temperature(self.stated, self.stability)

    def document(self) -> dict[str, Any]:
        """The statements as JSON values, for the parameters of a stage."""
        if self.stated is None:
            return {"uncertainty": None}
        return {
            "uncertainty": self.stated.model_dump(mode="json"),
            "stability": None if self.stability is None else self.stability.model_dump(mode="json"),
            "certificate": self.certificate.model_dump(mode="json"),
            "reference": [reference.model_dump(mode="json") for reference in self.references],
            "soak_min_s": self.soak_min_s,
            "dwell_s": self.dwell_s,
            "room_C": self.room_C,
        }


def terms_of(
    recipe: Recipe, station: Uncertainty | None, references: Sequence[Reference], room_c: float, months: int
) -> BudgetTerms:
    """The statements of a recipe on a station.

    Parameters
    ----------
    months : period of validity where the recipe states no certificate
    """
    return BudgetTerms(
        stated=merged(station, recipe.uncertainty),
        stability=recipe.stability,
        certificate=recipe.certificate or CertificateTerms(validity_months=months),
        references=tuple(references),
        soak_min_s=recipe.soak_min_s,
        dwell_s=recipe.dwell_s,
        room_C=room_c,
        dwells_chosen=recipe.stop is not None and recipe.stop.longest_dwell_s is not None,
    )


def archived_terms(about: Mapping[str, Any]) -> BudgetTerms | None:
    """The terms of an archived run, from its ``run.json``; None for runs without a stated uncertainty."""
    station, recipe = about.get("station") or {}, about.get("recipe") or {}
    stated = merged(
        *(
            Uncertainty.model_validate(part["uncertainty"]) if part.get("uncertainty") else None
            for part in (station, recipe)
        )
    )
    if stated is None:
        return None
    months = (about.get("limits") or {}).get("validity_months") or VALIDITY_MONTHS
    certificate, stability = recipe.get("certificate"), recipe.get("stability")
    return BudgetTerms(
        stated=stated,
        stability=Stability.model_validate(stability) if stability else None,
        certificate=CertificateTerms.model_validate(certificate or {"validity_months": months}),
        references=tuple(Reference.model_validate(reference) for reference in station.get("reference", [])),
        soak_min_s=float(recipe.get("soak_min_s", 0.0)),
        dwell_s=float(recipe.get("dwell_s", 1.0)),
        room_C=float((station.get("pace") or {}).get("room_C", Pace().room_C)),
        dwells_chosen=(recipe.get("stop") or {}).get("longest_dwell_s") is not None,
    )
