"""What jobs come to, as pages and their charts read it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pipelines.report.residual_table import ResidualTable

    Array = NDArray[Any]


@dataclass(frozen=True)
class Diagnosed:
    """A diagnosis for its page.

    before : residuals of the model before the last step, µg, as in ``table``; None where there was none
    names : what formulas may speak of, with what it is
    """

    document: dict[str, Any]
    table: ResidualTable | None
    ladder: list[dict[str, Any]]
    before: Array | None
    names: dict[str, str]
