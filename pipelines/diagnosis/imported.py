"""The fits of an import, by name: labelled faces, a plane, a temperature ramp, or gravity's norm."""

from __future__ import annotations

from collections.abc import Callable

from pipelines.diagnosis.imported_norms import norm
from pipelines.importers.faces import six_faces
from pipelines.importers.judged import FitAnswer
from pipelines.importers.mapping import Mapping
from pipelines.importers.plane import plane, shown_turn
from pipelines.importers.pose_check import silent_axis
from pipelines.importers.ramp import ramp
from pipelines.importers.record import Imported
from schemas.errors import DataRejected

METHODS: dict[str, Callable[[Imported, Mapping], FitAnswer]] = {
    "norm": norm,
    "faces": six_faces,
    "plane": plane,
    "temperature": ramp,
}


_NORM_NEEDS = 9
"""Bias, scale and the angles between the axes."""


def judge(method: str, data: Imported, mapping: Mapping) -> FitAnswer:
    """The fit called ``method``, one of :data:`METHODS`, of one unit's import, with a verdict on its own adequacy."""
    silent = silent_axis(data.dwells) if method == "norm" and data.dwells is not None else ""
    if silent and (turned := shown_turn(data, mapping)) is not None:
        return turned
    if silent:  # more poses, which the fit requests, do not help
        raise DataRejected(
            f"import: axis {silent}; three axes that respond to gravity are needed for --fit norm; correct --map {silent[0]}=…"
        )
    if method == "norm" and data.dwells is not None and not mapping.poses and len(data.dwells) <= _NORM_NEEDS:
        raise DataRejected(
            f"import: {len(data.dwells)} dwells of unknown orientation, more than {_NORM_NEEDS} are needed for --fit norm; add "
            "positions; or, if faces were up, name them with --poses LABEL=+x,LABEL=-x,… and give --fit faces"
        )
    return METHODS[method](data, mapping)
