"""The JSON document of ``doctor``: keys that other programs read."""

from dataclasses import dataclass
from typing import Annotated, Literal

from typing_extensions import TypedDict

State = Literal["good", "warning", "fault", "not configured"]


@dataclass(frozen=True)
class Check:
    """One thing that was checked."""

    part: Annotated[str, "software, archive, signing key, orchestrator, station, state folder or clock"]
    check: str
    state: State
    found: Annotated[str, "value, with its unit"]
    needed: Annotated[str, "empty: nothing else than what was found"] = ""
    remedy: Annotated[str, "empty: nothing has to be done"] = ""


class DoctorDocument(TypedDict):
    """``doctor --json``: the state of the installation and of what it is connected to."""

    ok: Annotated[bool, "no check has the state fault"]
    faults: int
    warnings: int
    when: Annotated[str, "ISO date and time, UTC"]
    host: str
    version: str
    python: str
    samples: Annotated[str | None, "folder of the sample recipes and stations; null: they are not there"]
    checks: list[Check]
