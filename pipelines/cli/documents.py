"""The JSON documents that commands compose themselves: keys that other programs read. A NotRequired key may be missing."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.capture.interruptions import Interruptions
from pipelines.diagnosis.documents import DiagnosisDocument, LeaveOut, VerdictEvidence


class FigureDocument(TypedDict):
    """A figure of merit of one unit."""

    value: float | None
    uncertainty: Annotated[float | None, "expanded, with the coverage factor of the limits"]
    limit: Annotated[float | None, "null: no limit"]
    unit_text: str
    outcome: str
    rule: str
    accept: NotRequired[Annotated[float | None, "largest value that is accepted; null: no limit"]]
    pfa: NotRequired[Annotated[float | None, "probability of false acceptance; null: no limit"]]
    pfr: NotRequired[Annotated[float | None, "probability of false rejection; null: no limit"]]


class UnitDocument(TypedDict):
    """The decision on one unit."""

    unit: str
    slot: int
    outcome: Literal["pass", "fail", "refused"]
    grade: str
    reasons: Annotated[str, "separated by `; `; empty if it passed"]
    rule: str
    figures: Annotated[dict[str, FigureDocument], "by [name](../reference/figures.md); empty if refused"]
    basis: NotRequired[Annotated[str, "basis of the uncertainties:  `budget` or `noise only`"]]


RunDocument = TypedDict(
    "RunDocument",
    {
        "run": str,
        "recipe": str,
        "effects": list[str],
        "rule": str,
        "units": list[UnitDocument],
        "passed": int,
        "failed": int,
        "refused": int,
        "yield": Annotated[float, "passed / units"],
        "report": Annotated[str, "path of the HTML report"],
        "archive": str,
        "interruptions": NotRequired[Annotated[Interruptions | None, "null: the archive has no record of them"]],
    },
)
RunDocument.__doc__ = "``run --json``: the decisions of a lot. ``fit`` prints the same."


class FillingsDocument(TypedDict):
    """``run --json (several fillings)``: the runs of a lot that is larger than the fixture."""

    fillings: Annotated[list[RunDocument], "one per filling"]


class ListedRun(TypedDict):
    """A run of the archive."""

    id: str
    recipe: str
    device: str
    units: list[str]
    started: Annotated[str, "ISO date and time, UTC"]
    finished: bool
    stages: list[str]
    station: NotRequired[Annotated[str, "its name; empty for an import"]]
    rerun_of: NotRequired[Annotated[str, "the run that it computes again; empty for others"]]
    passed: NotRequired[Annotated[int | None, "units that passed; null before the grades are there"]]
    graded: NotRequired[Annotated[int | None, "units with a decision; null before the grades are there"]]


class ListDocument(TypedDict):
    """``list --json``: the runs of the archive, the oldest first."""

    archive: str
    runs: list[ListedRun]


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


class RunProvenance(TypedDict):
    """Who made a run, where and when."""

    who: str
    where: str
    when: str
    libraries: dict[str, str]
    capture: str | None
    source: Annotated[Any, "files that were imported; null for a captured run"]


class ShowDocument(RunDocument):
    """``show RUN --json``: tables and origin of a finished run, with its decisions."""

    tables: list[str]
    provenance: RunProvenance


class ShowUnfinishedDocument(TypedDict):
    """``show RUN --json (no grades)``: a run that was imported or is not finished."""

    run: str
    units: Annotated[list[Any], "empty"]
    tables: list[str]
    provenance: RunProvenance


class ShowTableDocument(TypedDict):
    """``show RUN TABLE --json``: the rows of one table."""

    run: str
    table: str
    rows: Annotated[list[dict[str, Any]], "value by column"]


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


class AllanChannel(TypedDict):
    """The overlapping Allan deviation of a channel."""

    channel: str
    tau_s: list[float]
    deviation: Annotated[list[float], "in `unit`"]
    low: list[float]
    high: list[float]
    fitted: Annotated[list[float] | None, "deviation of the fitted terms; null: no mixture explains the curve"]


class NoiseTermRow(TypedDict):
    """A noise term of a channel."""

    channel: str
    term: Literal["Q", "N", "B", "K", "R"]
    name: str
    value: Annotated[float | None, "null: not identified"]
    low: float
    high: Annotated[float, "upper end of the interval, or the upper limit"]
    identified: bool
    unit: str


class AllanDocument(TypedDict):
    """``allan --json``: the overlapping Allan deviation of a record and its noise terms."""

    source: str
    unit: Annotated[str, "of the output; empty if not given"]
    rate_hz: float
    samples: int
    confidence: Annotated[float, "of the intervals of the curve"]
    term_confidence: Annotated[float, "of the intervals and limits of the terms"]
    curves: list[AllanChannel]
    terms: list[NoiseTermRow]
    notes: list[str]


class SpectrumChannel(TypedDict):
    """The spectrum of a channel, and the Allan deviation that follows from it."""

    channel: str
    density: Annotated[list[float], "one-sided, unit²/Hz"]
    median_amplitude: Annotated[float, "median noise density, unit/√Hz"]
    tau_s: list[float]
    deviation_from_density: list[float]
    deviation: Annotated[list[float], "of the samples"]


class PsdDocument(TypedDict):
    """``psd --json``: the one-sided power spectral density of a record."""

    source: str
    unit: str
    rate_hz: float
    samples: int
    segment: Annotated[int, "samples of a segment"]
    frequency_hz: list[float]
    spectra: list[SpectrumChannel]


class CertifiedBy(TypedDict):
    """Who certified a calibration."""

    who: str
    where: str
    when: str
    reason: str


class EndedBy(TypedDict):
    """The ledger entry that ends a calibration."""

    action: str
    sequence: int
    who: str
    when: str
    reason: str


Validity = TypedDict(
    "Validity", {"from": Annotated[str, "first day"], "until": Annotated[str, "the day after the last"]}
)


class CertifiedCalibration(Validity):
    """A calibration in the ledger, whatever its coefficients."""

    certificate: str
    serial: str
    device: str
    state: Literal["valid", "superseded", "revoked"]
    run: str
    grade: str
    station: str
    recipe: str
    stated_until: NotRequired[Annotated[str, "`until` as it was certified"]]
    certified: NotRequired[CertifiedBy]
    ended: NotRequired[EndedBy | None]


class CalibrationDocument(CertifiedCalibration):
    """A calibration in the ledger."""

    coefficients: Annotated[str, "hash of the table"]


class ValidCalibration(CertifiedCalibration):
    """The calibration that is valid, with its coefficients."""

    coefficients: Annotated[list[dict[str, Any]] | None, "rows of the unit; null if the run is not in the archive"]
    made: NotRequired[Annotated[dict[str, Any] | None, "stage, code, libraries and inputs of the coefficients"]]


class ShowValidityDocument(TypedDict):
    """``show UNIT --at DATE --json``: the calibration of a unit that is valid on a date."""

    unit: str
    at: str
    valid: bool
    calibration: ValidCalibration | None
    history: Annotated[list[CalibrationDocument], "every calibration of the unit, oldest first"]


class SlotStatus(TypedDict):
    """A slot of the fixture."""

    slot: int
    serial: str
    unit_C: float | None
    supply_V: float | None


class LeaseStatus(TypedDict):
    """The process that drives a station."""

    run: str
    pid: int
    host: str
    since: str
    role: str
    tripped: Any
    heard_s: Annotated[float, "time since its last sign, s"]


class StationStatusDocument(TypedDict):
    """``station status --json``: angles, temperatures, states, slots and lease of a station."""

    ok: Annotated[bool, "true if there are no faults"]
    station: str
    kind: str
    angles_deg: Annotated[dict[str, float], "by axis, outer and inner"]
    axes: Annotated[dict[str, str], "state by axis"]
    chamber_C: float | None
    set_point_C: float | None
    door: str
    emergency_stop: str
    sampling: str
    slots: list[SlotStatus]
    lease: Annotated[LeaseStatus | None, "null: no process drives it"]
    faults: Annotated[dict[str, str], "message by part; `safe state`: a run ended without the safe state"]
    chamber: NotRequired[str]
    vibration_g: NotRequired[Annotated[float | None, "rms"]]
    time_s: NotRequired[Annotated[float, "clock of the station"]]


class WaitingRun(TypedDict):
    """A run that waits for the operator."""

    id: str
    name: str
    question: str


class OperatorDocument(TypedDict):
    """``operator --json``: the runs that wait for the operator, and the answer that was given."""

    waiting: list[WaitingRun]
    answered: Annotated[Literal["go", "stop"] | None, "null: none was answered"]


class QueryDocument(TypedDict):
    """``query --json``: the rows of an SQL query."""

    columns: list[str]
    rows: Annotated[list[dict[str, Any]], "value by column"]


class RegisterReading(TypedDict):
    """A register with its present value."""

    device: str
    device_id: int
    register: str
    address: int
    value: str
    unit: str
    fault: Annotated[str, "reason why it cannot be read; empty otherwise"]


class CheckedPart(TypedDict):
    """A test of the self-test."""

    check: str
    part: str
    ok: bool
    value: float | str
    unit: str
    low: Annotated[float | None, "smallest value allowed"]
    high: Annotated[float | None, "largest value allowed"]
    message: Annotated[str, "empty if it is good"]


class StationCheckDocument(TypedDict):
    """``station check --json``: the self-test of a station."""

    ok: bool
    failed: Annotated[list[str], "a sentence for each failure"]
    registers: list[RegisterReading]
    checks: NotRequired[Annotated[list[CheckedPart], "missing with `--registers`"]]


class StationEvent(TypedDict):
    """An event of a run or a station."""

    when: Annotated[str, "ISO date and time, UTC"]
    where: Annotated[str, "run or station"]
    kind: str
    reason: str
    action: str
    record: NotRequired[Annotated[int, "−1: none"]]
    time_s: NotRequired[Annotated[float, "clock of the station"]]


class StationLogDocument(TypedDict):
    """``station log --json``: events that paused or ended runs, and events of stations, in order of time."""

    events: list[StationEvent]


class CertificateFiles(TypedDict):
    """The files of one certificate."""

    certificate: str
    serial: str
    run: str
    pdf: str
    xml: str
    signature: Annotated[str | None, "detached signature of the XML; null: not signed"]


class CertificateDocument(TypedDict):
    """``certificate --json``: the files of the certificates that were written."""

    certificates: list[CertificateFiles]
    left_out: Annotated[dict[str, str], "units of a run that have no certificate, with the reason"]


class KeysDocument(TypedDict):
    """``keys [SUBJECT] --json``: the keys of a file, or the names that an option takes."""

    subject: Annotated[str, "empty: the list of subjects"]
    rows: Annotated[list[dict[str, str]], "one for each key or name, by the heads of the printed table"]
