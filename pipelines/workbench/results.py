"""Results of jobs, as used by pages and charts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from pipelines.report.residual_table import ResidualTable

Array = NDArray[Any]


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis for its page.

    before : residuals of the model before the last step, µg, as in ``table``; None if there is none
    names : quantities for formulas, with their meaning
    """

    document: dict[str, Any]
    table: ResidualTable | None
    ladder: list[dict[str, Any]]
    before: Array | None
    names: dict[str, str]
