"""The result of a fit at import, and the inputs of every such fit: dwells of one unit, and local gravity."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pandas as pd

from inertial.quantities import OUTPUT_COLUMNS
from pipelines.importers.mapping import Mapping
from schemas.errors import DataRejected, WrongUse

if TYPE_CHECKING:
    from pipelines.importers.record import Imported


@dataclass(frozen=True)
class FitAnswer:
    """The result of a fit: a document for JSON, lines for people, and coefficients for the archive."""

    method: str
    adequate: bool | None
    """None if these data cannot decide; the lines state the reason."""
    document: dict[str, Any]
    lines: tuple[str, ...]
    coefficients: list[dict[str, Any]] = field(default_factory=list[dict[str, Any]])
    effects: tuple[str, ...] = ()
    """The model, as ids of the catalogue; empty if the fit uses none of its effects."""
    tables: dict[str, pd.DataFrame] = field(default_factory=dict[str, "pd.DataFrame"])
    """Further tables for the archive: covariance, residuals."""


def imported_dwells(data: "Imported") -> pd.DataFrame:
    """The dwells of an import of one unit."""
    if data.dwells is None:
        raise DataRejected(
            "import: this record has no static interval, dwells are needed for a fit; record static positions"
        )
    units = len(set(data.dwells["unit"]))
    if units > 1:
        raise WrongUse(
            f"import: {units} units, a fit at import takes one; import them one by one, or without --fit and then "
            "'tumbleline fit RUN'"
        )
    if not set(OUTPUT_COLUMNS) <= set(data.dwells.columns):
        raise WrongUse(
            "import: a fit at import needs three axes, and this device has fewer; import it without --fit, and then "
            "'tumbleline fit RUN'"
        )
    return data.dwells


def gravity_of(mapping: Mapping) -> float:
    """Local gravity where the measurement was made, g."""
    if mapping.norm_g is None:
        raise WrongUse(
            "import: gravity at the place of measurement is needed for this fit and has no default; give "
            "--set local_gravity_m_s2=M/S2"
        )
    return mapping.norm_g
