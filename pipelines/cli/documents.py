"""The JSON documents that commands compose themselves: keys that other programs read. A NotRequired key may be missing."""

from __future__ import annotations

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.capture.interruptions import Interruptions


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
    basis: NotRequired[Annotated[str, "what the uncertainties rest on: `budget` or `noise only`"]]


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


class ListDocument(TypedDict):
    """``list --json``: the runs of the archive, the oldest first."""

    archive: str
    runs: list[ListedRun]


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


class CertifiedBy(TypedDict):
    """Who certified a calibration."""

    who: str
    where: str
    when: str
    reason: str


class EndedBy(TypedDict):
    """The ledger entry that ended a calibration."""

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


class RerunOutcome(TypedDict):
    """What became of one run."""

    run: str
    new: Annotated[str, "id of the re-run; the run's own if nothing changed, empty if it failed"]
    because: Annotated[list[dict[str, str]], "what changed: data, model, limits, code, library"]
    stages: Annotated[dict[str, str], "`computed` or `reused` by stage"]
    seconds: float
    error: str


class RerunDocument(TypedDict):
    """``rerun --json``: the re-runs of the selected runs."""

    archive: str
    runs: list[RerunOutcome]
    selected: int
    rerun: int
    failed: int
    unchanged: NotRequired[int]


class ReproducedRun(TypedDict):
    """Whether the tables of one run are reproduced."""

    run: str
    same: bool
    tables: NotRequired[Annotated[dict[str, str], "`same bytes`, `other bytes` or `not checked` by table"]]
    differences: NotRequired[Annotated[list[str], "what differs and by how much, one sentence per table"]]
    changed: NotRequired[Annotated[list[str], "code and libraries that changed since the run"]]
    error: NotRequired[str]


class RerunCheckDocument(TypedDict):
    """``rerun --check --json``: whether every table is reproduced byte for byte."""

    selected: int
    same: int
    runs: list[ReproducedRun]
    archive: NotRequired[str]


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
    faults: Annotated[dict[str, str], "message by part; `safe state`: a run left the station without making it safe"]
    chamber: NotRequired[str]
    vibration_g: NotRequired[Annotated[float | None, "rms"]]
    time_s: NotRequired[Annotated[float, "clock of the station"]]
