"""The JSON document of audit: keys that other programs read. Dates are ISO and UTC; null: never, or not known."""

from typing import Annotated, Any, NotRequired

from typing_extensions import TypedDict


class AuditFindingDocument(TypedDict):
    """One action that is due."""

    who: Annotated[str, "who must act"]
    kind: str
    subject: str
    message: str
    units: list[str]
    evidence: Annotated[dict[str, Any], "the numbers behind the finding"]
    whose: NotRequired[Annotated[str, "`who` as a sentence"]]


class DueUnit(TypedDict):
    """A unit with the date of its next calibration."""

    unit: str
    device: str
    last: str
    due: str
    run: str
    months: float
    because: str
    certificate: str
    valid: bool


class DueDocument(TypedDict):
    """Calibrations that are due."""

    units: int
    overdue: list[DueUnit]
    soon: list[DueUnit]
    interval: NotRequired[str]
    valid: NotRequired[int]
    uncertified: NotRequired[list[DueUnit]]


class DriftDocument(TypedDict):
    """Drift by kind of device and by unit."""

    kinds: list[dict[str, Any]]
    units: list[dict[str, Any]]


PopulationDocument = TypedDict(
    "PopulationDocument",
    {
        "yield": list[dict[str, Any]],
        "capability": list[dict[str, Any]],
        "differences": list[dict[str, Any]],
        "odd": list[dict[str, Any]],
    },
)


class AuditDocument(TypedDict):
    """``audit --json``: re-calibrations due, drift, stations, check standards and population of an archive."""

    since: str
    until: str
    counts: dict[str, int]
    findings: list[AuditFindingDocument]
    due: DueDocument
    drift: DriftDocument
    stations: list[dict[str, Any]]
    slots: list[dict[str, Any]]
    charts: list[dict[str, Any]]
    population: PopulationDocument
    gauge: list[dict[str, Any]]
    schema: NotRequired[int]
    archive: NotRequired[str]
    device: NotRequired[str]
    station: NotRequired[str]
    rules: NotRequired[dict[str, Any]]
