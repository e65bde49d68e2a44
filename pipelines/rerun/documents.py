"""The JSON documents of rerun, diff, whatif and the fit of an import. A NotRequired key may be missing."""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.diagnosis.documents import LeaveOut, VerdictEvidence
from pipelines.rerun.reproduce import Reproduction
from pipelines.rerun.rerun import RerunOutcome


class UnitDifference(TypedDict):
    """A unit of both runs."""

    unit: str
    flipped: Annotated[bool, "outcome or grade differs"]
    changed: Annotated[bool, "anything of the unit differs"]
    outcome: Annotated[list[str], "in a and b; empty: not graded"]
    grade: Annotated[list[str], "in a and b"]
    reasons: Annotated[list[str], "in a and b, separated by `; `"]
    largest_over_both: Annotated[float | None, "largest change of a coefficient over the uncertainty of both"]


class ValueDifference(TypedDict):
    """A value that differs between two runs."""

    unit: str
    unit_text: str
    a: Annotated[float | None, "null: only b has it"]
    b: Annotated[float | None, "null: only a has it"]
    change: float | None
    u_a: Annotated[float | None, "standard uncertainty in a"]
    u_b: Annotated[float | None, "standard uncertainty in b"]
    over_a: Annotated[float | None, "change over the uncertainty in a"]
    over_b: float | None
    over_both: Annotated[float | None, "change over the root sum of squares of both uncertainties"]


class CoefficientDifference(ValueDifference):
    """A coefficient that differs."""

    axis: str
    effect: str
    name: str


class FigureDifference(ValueDifference):
    """A figure of merit that differs."""

    figure: str


class CauseOfDifference(TypedDict):
    """What differs between two runs."""

    what: Annotated[str, "data, code, model, limits or library"]
    stage: NotRequired[str]
    name: NotRequired[str]
    a: NotRequired[str]
    b: NotRequired[str]


class DiffDocument(TypedDict):
    """``archive diff --json``: what differs between two runs, by how much against its uncertainty, and why."""

    a: Annotated[str, "id of the first run"]
    b: Annotated[str, "id of the second run"]
    same: Annotated[bool, "no coefficient, figure or grade differs"]
    because: list[CauseOfDifference]
    flipped: Annotated[list[str], "units whose outcome or grade differs"]
    units: list[UnitDifference]
    coefficients: Annotated[list[CoefficientDifference], "largest against its uncertainty first"]
    figures: list[FigureDifference]
    only_a: Annotated[list[str], "units"]
    only_b: list[str]


LotFigures = TypedDict(
    "LotFigures",
    {
        "lots": int,
        "units": int,
        "yield": Annotated[list[float | None], "with the old and the new model"],
        "fit_rms_ug": Annotated[list[float | None], "residual of the fit, old and new, µg"],
        "verification_rms_ug": Annotated[list[float | None], "error in poses that were not fitted, old and new, µg"],
        "fresh_rms_ug": Annotated[list[float | None], "error on later runs of the same units, old and new, µg"],
        "fresh_units": int,
    },
)


class GroupFigures(LotFigures):
    """The figures of the lots of one kind of device on one station."""

    station: str
    device: str


class FlippedUnit(TypedDict):
    """A unit that passes with one model only."""

    run: str
    unit: str
    old: str
    new: str
    reasons: str


class FlippedUnits(TypedDict):
    """Units whose outcome changes."""

    to_fail: list[FlippedUnit]
    to_pass: list[FlippedUnit]


class FailedLot(TypedDict):
    """A lot that could not be judged."""

    run: str
    error: str


class WhatIfDocument(TypedDict):
    """``release whatif --json``: what a model would make of the archive's lots."""

    archive: str
    name: Annotated[str, "of the model"]
    version: int
    effects: list[str]
    limits: str
    lots: int
    total: LotFigures
    groups: list[GroupFigures]
    flips: FlippedUnits
    failed: list[FailedLot]
    verdict: Annotated[str, "`better`, `worse`, `no better` or that nothing tells the models apart"]
    words: Annotated[str, "the verdict as a sentence"]
    evidence: Annotated[str, "name of the evidence kept for `tumbleline release`"]


class RerunDocument(TypedDict):
    """``rerun --json``: the re-runs of the selected runs."""

    archive: str
    runs: list[RerunOutcome]
    selected: int
    rerun: int
    failed: int
    unchanged: NotRequired[int]


class RerunCheckDocument(TypedDict):
    """``rerun --check --json``: whether every table is reproduced byte for byte."""

    selected: int
    same: int
    runs: list[Reproduction]
    archive: NotRequired[str]


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
    faulty: Annotated[list[str], "units with a data fault, which are not judged: do not use their coefficients"]
    open: NotRequired[Annotated[list[str], "of a unit that was turned about one axis: what that does not show"]]
