"""The JSON documents of models: improved, fitted to imports, extended, released, and of the demonstration."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.diagnosis.documents import DiagnosisDocument, LeaveOut, VerdictEvidence


class ImprovementChoice(TypedDict):
    """The decision on one class of the diagnosis."""

    effect: str
    not_separated_from: Annotated[list[str], "effects of the class that these data do not separate from it"]
    decided_by: Annotated[
        Literal["question", "--effect", "--yes", "undecided"], "`undecided`: a class of several, without an answer"
    ]
    added: bool


class LadderRow(TypedDict):
    """The errors of one version of the model."""

    version: int
    added: list[str]
    fitted_ug: Annotated[float, "residual of the fit, µg"]
    heldout_ug: Annotated[float | None, "worst cross-validated error of poses, soaks and blocks of time, µg"]
    fresh_ug: Annotated[float | None, "error on the fresh run, µg; null without `--fresh`"]
    noise_ug: Annotated[float, "noise of the measurement by the last diagnosis, µg"]
    fall_ug: Annotated[float | None, "decrease of the error by what was added, µg"]
    fall_u_ug: Annotated[float | None, "standard uncertainty of the decrease, µg"]
    confirmed: Annotated[bool | None, "whether data that were not fitted confirm the change; null: cannot be decided"]
    reason: NotRequired[Annotated[str | None, "why it is not decided; null: it is, or nothing is judged"]]
    text: Annotated[str, "`confirmed` as a sentence"]
    warnings: list[str]


class ImproveDocument(TypedDict):
    """``improve --json``: diagnosis of a model, effects added to it, and the error of each version."""

    data: str
    file: Annotated[str | None, "the model file; null: none was given and none written"]
    diagnosis: Annotated[DiagnosisDocument, "of the model to begin with"]
    choices: Annotated[list[ImprovementChoice], "one per class with a recommended effect"]
    added: list[str]
    effects: Annotated[list[str], "the resulting model"]
    after: Annotated[DiagnosisDocument | None, "of the resulting model; null: nothing was added"]
    adequate: Annotated[bool | None, "whether the resulting model is adequate; null: cannot be judged"]
    ladder: Annotated[list[LadderRow], "oldest version first; empty if no unit can be judged"]
    refuted: Annotated[list[str], "added effects that the fresh run is evidence against"]
    warnings: list[str]
    fresh: Annotated[str | None, "the fresh run that judged the last version; null: there was none"]
    next: Annotated[list[str], "commands to give next"]


class FittedUnit(TypedDict):
    """The decision on a unit of an import that was fitted against limits."""

    unit: str
    outcome: Literal["pass", "fail", "refused"]
    grade: str
    reasons: str


class ImportedFitDocument(TypedDict):
    """``fit --json (an import)``: a model fitted to an import, its verdict and the basis of the verdict."""

    run: Annotated[str, "the run that holds the fit"]
    fit_of: Annotated[str, "the import"]
    effects: list[str]
    left_out: Annotated[list[str], "dwells left out, UNIT:DWELL"]
    units: Annotated[list[FittedUnit], "empty without limits"]
    adequate: Annotated[bool | None, "null: cannot be judged"]
    reason: Annotated[str | None, "why it cannot be judged"]
    error: Annotated[dict[str, Any], "as in `diagnose --json`; `fit_rms_ug`: residual of all dwells of the fit, µg"]
    evidence: VerdictEvidence | None
    leave_out: LeaveOut | None
    missing: Annotated[list[list[str]], "classes of effects that are missing"]
    lines: Annotated[list[str], "the same in words"]
    open: NotRequired[Annotated[list[str], "of a unit that was turned about one axis: what that does not show"]]


class ExtendDocument(TypedDict):
    """``extend --json``: the version of a model that was written."""

    file: str
    model: Annotated[str, "its name"]
    version: int
    effects: list[str]
    added: Annotated[str | None, "null: an effect was removed"]
    removed: Annotated[str | None, "null: an effect was added"]
    begun: Annotated[bool, "whether the file is new"]
    by: str
    at: Annotated[str, "ISO date and time, UTC"]
    why: str


ReleaseRecord = TypedDict(
    "ReleaseRecord",
    {
        "release": Annotated[int, "number, from 1"],
        "model": str,
        "version": int,
        "effects": list[str],
        "from": Annotated[str, "first moment of use, ISO date and time, UTC"],
        "device": Annotated[str, "empty: every kind"],
        "station": Annotated[str, "empty: every station"],
        "reason": str,
        "evidence": Annotated[str, "the what-if that supports it; empty if forced"],
        "forced": bool,
        "by": str,
        "at": Annotated[str, "ISO date and time, UTC"],
    },
)
ReleaseRecord.__doc__ = "A model that is released to the line."


class ReleaseDocument(ReleaseRecord):
    """``release MODEL --json``: the release that was made."""

    archive: str


class ListedRelease(ReleaseRecord):
    """A release, and whether it is in use."""

    in_use: Annotated[bool, "today, for its device and station"]


class ReleaseListDocument(TypedDict):
    """``release --list --json``: the releases of the archive, the oldest first."""

    archive: str
    releases: list[ListedRelease]


class DemoErrors(TypedDict):
    """Errors of a model over all units, µg."""

    rms_ug: Annotated[float, "residual of the fit"]
    heldout_rms_ug: Annotated[float | None, "cross-validated"]
    fresh_rms_ug: Annotated[float | None, "on the second run"]
    floor_ug: Annotated[float, "noise of the measurement"]


class HiddenEffect(TypedDict):
    """The effect that the demonstration hid."""

    kind: str
    effect: str
    physics: str


class DemoDocument(TypedDict):
    """``demo --auto --json``: the hidden effect, the diagnosis, and the errors before and after."""

    seed: int
    hidden: HiddenEffect
    classes: Annotated[list[list[str]], "effects that the data do not separate, best first"]
    recommended: list[str]
    unseen: Annotated[list[Any], "effects that the plan cannot show, as in `diagnose --json`"]
    added: list[str]
    found: bool
    told_apart: Annotated[bool, "whether the hidden effect is alone in its class"]
    not_told_apart: list[list[str]]
    next_measurements: Annotated[list[Any], "as in `diagnose --json`"]
    before: DemoErrors
    after: DemoErrors
    folder: str


class DemoFilesDocument(TypedDict):
    """``demo --by-hand --json``: the files of the two runs."""

    folder: str
    files: list[str]
    effects: Annotated[list[str], "the model to begin with"]
