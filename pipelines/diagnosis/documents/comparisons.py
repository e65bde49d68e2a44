"""The JSON documents of compare and history: errors of models on data that were fitted, and that were not."""

from __future__ import annotations

from typing import Annotated, Any, NotRequired

from typing_extensions import TypedDict


class UnitComparison(TypedDict):
    """Errors of one unit."""

    rms_ug: float
    fresh_rms_ug: float | None


class PoseComparison(TypedDict):
    """Error of one pose over all units and axes."""

    force: Annotated[list[float], "specific force on x, y, z, g"]
    dwells: int
    rms_ug: float


class StationParameter(TypedDict):
    """A parameter of the station that the fit shares over all units."""

    effect: str
    name: str
    value: float
    standard_error: float


class Confirmation(TypedDict):
    """Evidence of data that were not fitted for the effects that were added to a model."""

    judged_by: Annotated[str, "`fresh run` or `dwells left out`"]
    confirmed: Annotated[bool | None, "null: cannot be decided"]
    part: Annotated[float | None, "share λ of the predicted change that appears in the fresh run"]
    part_u: Annotated[float | None, "standard uncertainty of λ"]
    fall_ug: Annotated[float | None, "decrease of the error, µg"]
    fall_u_ug: Annotated[float | None, "standard uncertainty of the decrease, µg"]
    rises: NotRequired[Annotated[str | None, "the error that rises with the effect; null: none"]]
    reason: NotRequired[Annotated[str | None, "why it is not decided; null: it is"]]
    estimated_again: Annotated[str | None, "coefficients estimated from the fresh run before it is judged"]
    log_density: Annotated[float | None, "gain in log predictive density of the dwells left out"]


class ComparisonDocument(TypedDict):
    """``compare --json``: error of a model on the run it is fitted to, on poses left out, and on a fresh run."""

    rms_ug: Annotated[float, "residual of the fit, µg"]
    floor_ug: Annotated[float, "noise floor, µg"]
    fresh_rms_ug: Annotated[
        float | None, "error on the fresh run with the coefficients unchanged, µg; null without `--fresh`"
    ]
    by_unit: dict[str, UnitComparison]
    by_pose: Annotated[list[PoseComparison], "worst first; empty if only the norm is known"]
    effects: NotRequired[list[str]]
    heldout_rms_ug: NotRequired[Annotated[float | None, "cross-validated error, µg"]]
    by_axis: NotRequired[Annotated[dict[str, float], "µg by axis, or `norm` alone"]]
    nonlinear: NotRequired[Annotated[dict[str, Any], "estimated parameters by effect"]]
    nonlinear_interval: NotRequired[Annotated[dict[str, Any], "68 % interval of each parameter that all axes share"]]
    station: NotRequired[list[StationParameter]]
    fresh_by_pose: NotRequired[list[PoseComparison]]
    heldout: NotRequired[Annotated[dict[str, float], "cross-validated error by kind of dwells left out, µg"]]
    warnings: NotRequired[list[str]]
    progress: NotRequired[Annotated[Confirmation | None, "null without a version to compare with"]]


class VersionDocument(TypedDict):
    """A version of a model; its errors are null without `--dwells`."""

    version: int
    added: list[str]
    removed: list[str]
    effects: list[str]
    by: str
    at: Annotated[str, "ISO date and time; empty if the file does not have it"]
    why: str
    run: str
    fitted_ug: Annotated[float | None, "residual of the fit, µg"]
    heldout_ug: Annotated[float | None, "worst cross-validated error of poses, soaks and blocks of time, µg"]
    fresh_ug: Annotated[float | None, "error on the fresh run, µg"]
    floor_ug: Annotated[float | None, "noise floor, µg"]
    fall_ug: Annotated[float | None, "decrease of the error by what was added, µg"]
    fall_u_ug: Annotated[float | None, "standard uncertainty of the decrease, µg"]
    confirmed: Annotated[bool | None, "whether data that were not fitted confirm the change; null: cannot be decided"]
    reason: NotRequired[Annotated[str | None, "why it is not decided; null: it is, or nothing is judged"]]
    text: Annotated[str, "`confirmed` as a sentence"]
    warnings: NotRequired[list[str]]


class HistoryDocument(TypedDict):
    """``history --json``: the versions of a model, oldest first, with their errors."""

    model: str
    file: str
    versions: list[VersionDocument]
