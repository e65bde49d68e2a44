"""The fits that an import may ask for, by name: labelled faces, a temperature ramp, or gravity's norm."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pipelines.diagnosis.imported_norms import norm
from pipelines.importers.faces import six_faces
from pipelines.importers.ramp import ramp

if TYPE_CHECKING:
    from collections.abc import Callable

    from pipelines.importers.judged import FitAnswer
    from pipelines.importers.mapping import Mapping
    from pipelines.importers.record import Imported

METHODS: dict[str, Callable[[Imported, Mapping], FitAnswer]] = {"norm": norm, "faces": six_faces, "temperature": ramp}


def judge(method: str, data: Imported, mapping: Mapping) -> FitAnswer:
    """The fit called ``method``, one of :data:`METHODS`, of one unit's import, with a verdict on its own adequacy."""
    return METHODS[method](data, mapping)
