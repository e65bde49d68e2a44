"""The JSON documents of stations: state, self-test, log, charts, server; and the keys of the files that describe them."""

from typing import Annotated, Any, Literal, NotRequired

from typing_extensions import TypedDict

from stations.overview import SlotNow
from stations.self_test import CheckResult
from stations.serving import RegisterReading


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
    slots: list[SlotNow]
    lease: Annotated[LeaseStatus | None, "null: no process drives it"]
    faults: Annotated[dict[str, str], "message by part; `safe state`: a run ended without the safe state"]
    chamber: NotRequired[str]
    vibration_g: NotRequired[Annotated[float | None, "rms"]]
    time_s: NotRequired[Annotated[float, "clock of the station"]]


class StationCheckDocument(TypedDict):
    """``station check --json``: the self-test of a station."""

    ok: bool
    failed: Annotated[list[str], "a sentence for each failure"]
    registers: list[RegisterReading]
    checks: NotRequired[Annotated[list[CheckResult], "missing with `--read-only`"]]


class StationEvent(TypedDict):
    """An event of a run or a station."""

    when: Annotated[str, "ISO date and time, UTC"]
    where: Annotated[str, "run or station"]
    kind: str
    reason: str
    action: str
    record: NotRequired[Annotated[int, "−1: none"]]
    time_s: NotRequired[Annotated[float, "clock of the station"]]
    figures: NotRequired[Annotated[dict[str, float], "numerical values of the event, named with their unit"]]


class StationLogDocument(TypedDict):
    """``station log --json``: events that paused or ended runs, and events of stations, in order of time."""

    events: list[StationEvent]


class WaitingRun(TypedDict):
    """A run that waits for the operator."""

    id: str
    name: str
    question: str


class OperatorDocument(TypedDict):
    """``station operator --json``: the runs that wait for the operator, and the answer that was given."""

    waiting: list[WaitingRun]
    answered: Annotated[Literal["go", "stop"] | None, "null: none was answered"]


class StationWatchDocument(TypedDict):
    """``station watch --json``: temperatures and angles over the time of the station, pairs of s and °C or degrees."""

    title: str
    over: Annotated[bool, "whether the run has ended"]
    chamber: list[list[float]]
    coldest: Annotated[list[list[float]], "coldest unit"]
    warmest: Annotated[list[list[float]], "warmest unit"]
    outer: list[list[float]]
    inner: list[list[float]]


class ServedDevice(TypedDict):
    """A device of a simulated station."""

    name: str
    device_id: int
    profile: str


class StationServeDocument(TypedDict):
    """``station serve --json``: the address of a simulated station, printed when it is ready."""

    host: str
    port: int
    devices: list[ServedDevice]


class StationProfilesDocument(TypedDict):
    """``station profiles --json``: the register-map profiles, without registers; with a name the whole profile."""

    profiles: Annotated[list[dict[str, Any]], "keys of a [profile](../how-to/add-a-device.md)"]


class OrderDocument(TypedDict):
    """``plan order --json``: the order of soaks with which a recipe is known first."""

    recipe: str
    file: Annotated[str, "recipe file that was written"]
    temperatures_C: Annotated[list[float], "soaks in their new order, °C"]
    minutes: Annotated[float, "station time of the whole plan without the static record, min"]
    given_minutes: Annotated[float, "the same of the given recipe"]
    known_minutes: Annotated[
        float | None,
        "expected station time until the uncertainties are those asked for, min; null: the whole plan has larger ones",
    ]
    given_known_minutes: Annotated[float | None, "the same of the given recipe"]


class KeysDocument(TypedDict):
    """``plan keys [SUBJECT] --json``: the keys of a file, or the names that an option takes."""

    subject: Annotated[str, "empty: the list of subjects"]
    rows: Annotated[list[dict[str, str]], "one for each key or name, by the heads of the printed table"]
