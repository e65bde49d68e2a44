"""A recording as it is read: devices, exchanges in order of time, and the readings of the clock between them.

The format is that of :mod:`stations.links.recorder`. A last line that a killed process left incomplete is dropped; any other line
that is not of the format is refused with its number.
"""

import json
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from schemas.errors import DataRejected
from schemas.foreign import foreign, shown
from schemas.profile import Profile
from stations.links.frames import WRITES
from stations.links.recorder import FORMAT, WITHHELD

BROKEN = "broken"
SILENCE = "silence"


@dataclass(frozen=True)
class RecordedDevice:
    """A device of a recording; without a ``profile`` where another program made it."""

    link: str
    device_id: int
    name: str
    profile: Profile | None = None


@dataclass(frozen=True)
class Exchange:
    """A request and what came back.

    at_s : seconds since the start of the recording · seconds : until the answer, or until none was waited for any longer
    request : Modbus function and data, without address and checksum; a line of text where ``text``
    reply : likewise; None without an answer · failed : why there is none: ``silence``, ``broken: …``, ``malformed: …``
    """

    at_s: float
    seconds: float
    link: str
    device_id: int
    what: str
    request: bytes
    reply: bytes | None
    failed: str = ""
    text: bool = False

    @property
    def writes(self) -> bool:
        """Whether the exchange is an order; a line of text is an order unless it is a query."""
        return not self.request.endswith(b"?") if self.text else self.request[:1] != b"" and self.request[0] in WRITES

    @property
    def key(self) -> tuple[str, int, bytes]:
        """Link, device and request, by which a replay finds the answer."""
        return self.link, self.device_id, self.request


@dataclass(frozen=True)
class Reading:
    """A reading of the station's clock, s."""

    seconds: float


@dataclass(frozen=True)
class Remark:
    """A remark between the exchanges."""

    at_s: float
    text: str


Item = Exchange | Reading | Remark


@dataclass
class FrameFile:
    """A recording."""

    name: str
    made: str = ""
    purpose: str = ""
    devices: list[RecordedDevice] = field(default_factory=list[RecordedDevice])
    items: list[Item] = field(default_factory=list[Item])
    remark: str = ""

    @property
    def exchanges(self) -> list[Exchange]:
        """The exchanges, in order of time."""
        return [item for item in self.items if isinstance(item, Exchange)]

    def device_of(self, exchange: Exchange) -> RecordedDevice | None:
        """The device of an exchange, where the recording names it."""
        matching = [
            d for d in self.devices if d.link == exchange.link and (exchange.text or d.device_id == exchange.device_id)
        ]
        return matching[0] if matching else None

    def name_of(self, exchange: Exchange) -> str:
        """The name of the device of an exchange."""
        device = self.device_of(exchange)
        return f"device {exchange.device_id}" if device is None else device.name


@contextmanager
def readable(path: Path) -> Generator[None]:
    """A block that reads a recording; :class:`DataRejected` where the system refuses."""
    try:
        yield
    except OSError as problem:
        raise DataRejected(
            f"recording: {path} cannot be read ({problem.strerror}); name a file that is there"
        ) from None


def read_frames(path: Path) -> FrameFile:
    """The recording in a file.

    Raises DataRejected: it is no recording, or a line other than the last is damaged.
    """
    with readable(path):
        lines = path.read_bytes().split(b"\n")
    complete, torn = lines[:-1], lines[-1]
    content = FrameFile(
        path.name, remark=f"the last line is incomplete ({len(torn)} bytes) and left out" if torn else ""
    )
    for number, entry in _entries(path, complete):
        if number == 1:
            if entry.get("format") != FORMAT:
                raise DataRejected(
                    f"recording: {path} is not of format '{FORMAT}'; give a file of '--record', a pcap or a CSV log"
                )
            content.made, content.purpose = str(entry.get("made", "")), str(entry.get("purpose", ""))
            continue
        with foreign(
            f"recording: {path.name}, line {number}", "a line of the recorder is needed; give another recording"
        ):
            _add(content, entry)
    if not complete:
        raise DataRejected(f"recording: {path} has no line, a recording is needed; give another file")
    return content


def _entries(path: Path, lines: list[bytes]) -> Iterator[tuple[int, dict[str, Any]]]:
    for number, line in enumerate(lines, 1):
        try:
            entry = json.loads(line)
        except (ValueError, RecursionError):
            raise DataRejected(
                f"recording: {path}, line {number} is {shown(line[:60])}, an object of JSON is needed; give another recording"
            ) from None
        if not isinstance(entry, dict):
            raise DataRejected(f"recording: {path}, line {number} is no object of JSON; give another recording")
        yield number, entry


def _add(content: FrameFile, entry: dict[str, Any]) -> None:
    if "c" in entry:
        content.items.append(Reading(float(entry["c"])))
    elif "profile" in entry:
        profile = Profile.model_validate(entry["profile"])
        content.devices.append(RecordedDevice(str(entry["link"]), int(entry["id"]), str(entry["device"]), profile))
    elif "note" in entry:
        content.items.append(Remark(float(entry["t"]), str(entry["note"])))
    elif "end" in entry:
        content.remark = f"it ends early: {entry['end']}"
    else:
        text = "line" in entry
        request = str(entry["line"]).encode() if text else bytes.fromhex(entry["q"])
        answer = entry.get("answer") if text else entry.get("a")
        reply = None if answer is None else str(answer).encode() if text else bytes.fromhex(answer)
        failed = str(entry.get("x", "")) if reply is None else ""
        if failed != WITHHELD:
            content.items.append(
                Exchange(
                    float(entry["t"]), float(entry["s"]), str(entry["link"]), int(entry["id"]), str(entry["what"]),
                    request, reply, failed, text,
                )
            )  # fmt: skip
