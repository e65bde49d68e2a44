"""The JSON documents of runs, of the maintenance of the archive, of versions of a model and of the demonstration."""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from pipelines.archive import RunInfo
from pipelines.capture.interruptions import Interruptions
from pipelines.jobs.references import ReferencesDocument
from pipelines.schedule.early_end import EarlyEnd
from pipelines.stages.judge import AdequacyDocument
from pipelines.tables.prior import PriorDocument


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
    grade_risk: NotRequired[
        Annotated[
            float | None,
            "probability that the RMS error of any axis exceeds the limit of the grade at the end of the period; null: not known",
        ]
    ]
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
        "prior": NotRequired[Annotated[PriorDocument | None, "null: no [prior] in the recipe"]],
        "early_end": NotRequired[Annotated[EarlyEnd | None, "null: no [stop] in the recipe"]],
        "interruptions": NotRequired[Annotated[Interruptions | None, "null: the archive has no record of them"]],
        "adequacy": NotRequired[Annotated[AdequacyDocument | None, "null: no multi-position test; not in `show`"]],
        "references": NotRequired[
            Annotated[ReferencesDocument | None, "null: nothing is stated, or no table turned the units; not in `show`"]
        ],
    },
)
RunDocument.__doc__ = "``run --json``: the decisions of a lot. ``fit`` prints the same."


class FillingsDocument(TypedDict):
    """``run --json (several fillings)``: the runs of a lot that is larger than the fixture."""

    fillings: Annotated[list[RunDocument], "one per filling"]


class ListDocument(TypedDict):
    """``list --json``: the runs of the archive, the oldest first."""

    archive: str
    runs: list[RunInfo]


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


class QueryDocument(TypedDict):
    """``archive query --json``: the rows of an SQL query."""

    columns: list[str]
    rows: Annotated[list[dict[str, Any]], "value by column"]


class ReportDocument(TypedDict):
    """``show RUN --report --json``: the report of a run."""

    run: str
    report: Annotated[str, "path of the HTML report"]


class ArchiveCleanDocument(TypedDict):
    """``archive clean --json``: temporary files of killed writers, and finished runs added to the chain."""

    archive: str
    only_looked: Annotated[bool, "`--dry-run`: nothing was changed"]
    removed: list[str]
    bytes: int
    busy: Annotated[list[str], "folders that another process writes to"]
    sealed: Annotated[list[str], "runs added to the chain"]
    anchored: Annotated[int, "calibrations added to the chain"]


class ArchiveKeyDocument(TypedDict):
    """``archive key --json``: the key that signs manifests."""

    name: str
    public: Annotated[str, "hexadecimal"]
    private_file: str


class ArchiveCompactDocument(TypedDict):
    """``archive compact --json``: files of finished runs put into packs."""

    archive: str
    packs: Annotated[list[str], "names of the new packs, below `packed/`"]
    packed: Annotated[int, "files that are in a pack now and were in none before"]
    bytes: Annotated[int, "size of these files"]
    freed: Annotated[int, "single files that were removed"]
    kept: Annotated[list[str], "folders that changed, or that another process used; the next compaction packs them"]
    unfinished: Annotated[list[str], "runs that are not finished; they stay as they are"]


class Copied(TypedDict):
    """Files of a copy."""

    files: Annotated[int, "copied"]
    bytes: int
    present: Annotated[int, "files that were there already"]


class ArchiveBackupDocument(Copied):
    """``archive backup --json``: a copy of the archive."""

    archive: str
    copy: str
    database: Annotated[str | None, "the copy of the orchestrator's database; null: not copied"]


class ArchiveRestoreDocument(Copied):
    """``archive restore --json``: an archive restored from a copy, and verified."""

    archive: str
    copy: str
    whole: Annotated[bool, "whether the verification has no findings"]
    head: Annotated[str | None, "hash at the end of the chain"]


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
    """``demo --yes --json``: the hidden effect, the diagnosis, and the errors before and after."""

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


class DemoStationDocument(TypedDict):
    """``demo --station --json``: the station that is served, printed when it is ready."""

    station: Annotated[str, "its file"]
    host: str
    port: int
    speed: Annotated[float, "seconds of the station per second"]
    units: Annotated[list[str], "serial numbers in its slots"]


class DemoFilesDocument(TypedDict):
    """``demo --by-hand --json``: the files of the two runs."""

    folder: str
    files: list[str]
    effects: Annotated[list[str], "the model to begin with"]
