"""Recording of everything on the links of a station: one line of JSON for each exchange, written as it happens.

The first line holds the devices with their profiles, so that a recording is understood without the station's file. It has no
host, path, key or certificate, and what a register or command for a password holds is withheld. A recording never ends a run:
where it cannot be continued (full disk, its largest size), it says so once and ends itself.
"""

import json
import os
import re
import threading
from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Generic, TypeVar

from schemas.errors import WrongUse
from schemas.log_lines import tell
from schemas.profile import Profile, Register
from stations.clock import Clock, steady
from stations.links.frames import READ, WRITE_COIL, WRITE_COILS, WRITE_REGISTERS, Malformed
from stations.links.wires import Broken, LineWire, Silence, Wire

FORMAT = "tumbleline frames 1"
LARGEST = 512_000_000  # bytes of a recording: the exchanges of some days
SPACE_OF = {
    **{code: space for space, code in READ.items()},
    WRITE_COIL: "coil",
    WRITE_COILS: "coil",
    WRITE_REGISTERS: "holding",
}
SECRET = re.compile(
    r"(?<![a-z])(pass(word|phrase|code)?|secret|pin(_?code)?|credentials?|token)(?![a-z])", re.IGNORECASE
)
"""Whole words: "damping" and "spin" are no secrets."""
WITHHELD = "withheld"

AnyWire = TypeVar("AnyWire", Wire, LineWire)
Answer = TypeVar("Answer", bytes, str)


@dataclass
class FrameRecorder:
    """A recording that is being made; ``path`` must not be there yet."""

    path: Path
    purpose: str
    largest: int = LARGEST
    _file: int = -1
    _size: int = 0
    _zero: float = field(default_factory=steady)
    _alone: Any = field(default_factory=threading.Lock)
    _profiles: dict[tuple[str, int], Profile] = field(default_factory=dict[tuple[str, int], Profile])
    _meanings: dict[tuple[str, int, bytes], str] = field(default_factory=dict[tuple[str, int, bytes], str])

    def __post_init__(self) -> None:
        """Makes the file, for its owner alone, with its head."""
        try:
            self._file = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC, 0o600)
        except FileExistsError:
            raise WrongUse(
                f"recording: {self.path} is there already, a new file is needed; give another name"
            ) from None
        except OSError as problem:
            raise WrongUse(
                f"recording: {self.path} cannot be written ({problem.strerror}); name a file in a folder that is there"
            ) from None
        made = datetime.now(UTC).isoformat(timespec="seconds")
        self._write({"format": FORMAT, "made": made, "purpose": self.purpose})

    def device(self, link: str, device_id: int, name: str, profile: Profile) -> None:
        """A device behind a link, before its first exchange."""
        if (link, device_id) in self._profiles:
            return
        self._profiles[link, device_id] = profile
        content = profile.model_dump(mode="json", exclude_defaults=True)
        self._write({"device": name, "link": link, "id": device_id, "profile": content})

    def note(self, text: str) -> None:
        """A remark between the exchanges, such as a step of a bring-up or what a person has typed."""
        self._write({"t": self._now(), "note": text})

    def clock(self, reading: float) -> None:
        """A reading of the station's clock, which a replayed run gets again."""
        self._write({"c": reading})

    def exchange(
        self, link: str, device_id: int, request: bytes, begun: float, reply: bytes | None, failed: str
    ) -> None:
        """A Modbus request and its answer; ``failed`` says why there is none."""
        what = self._meaning(link, device_id, request)
        entry: dict[str, Any] = {**self._head(begun), "link": link, "id": device_id, "what": what}
        if SECRET.search(what):
            self._write({**entry, "q": request[:5].hex(), "x": WITHHELD})
        else:
            self._write({**entry, "q": request.hex(), **({"x": failed} if reply is None else {"a": reply.hex()})})

    def line(self, link: str, text: str, what: str, begun: float, answer: str | None, failed: str) -> None:
        """A line of text and its answer."""
        entry: dict[str, Any] = {**self._head(begun), "link": link, "id": 0, "what": what}
        if SECRET.search(f"{what} {text}"):
            self._write({**entry, "line": WITHHELD, "x": WITHHELD})
        else:
            self._write({**entry, "line": text, **({"x": failed} if answer is None else {"answer": answer})})

    def close(self) -> None:
        """Ends the recording."""
        with self._alone:
            if self._file >= 0:
                os.close(self._file)
                self._file = -1

    def _now(self) -> float:
        return round(steady() - self._zero, 6)

    def _head(self, begun: float) -> dict[str, float]:
        return {"t": round(begun - self._zero, 6), "s": round(steady() - begun, 6)}

    def _meaning(self, link: str, device_id: int, request: bytes) -> str:
        """The names of the registers of a request, such as ``read temperature``."""
        key = link, device_id, request[:5]
        if key not in self._meanings:
            profile = self._profiles.get((link, device_id))
            self._meanings[key] = meaning(request, () if profile is None else profile.registers)
        return self._meanings[key]

    def _write(self, entry: Mapping[str, Any]) -> None:
        data = json.dumps(entry, ensure_ascii=False, separators=(",", ":")).encode() + b"\n"
        with self._alone:
            if self._file < 0:
                return
            trouble = ""
            try:
                if self._size + len(data) > self.largest:
                    trouble = f"it has {self._size} of at most {self.largest} bytes"
                    data = json.dumps({"t": self._now(), "end": trouble}).encode() + b"\n"
                os.write(self._file, data)  # one call, so that a kill leaves whole lines
                self._size += len(data)
            except OSError as problem:
                trouble = str(problem.strerror)
            if trouble:
                os.close(self._file)
                self._file = -1
                tell(f"recording: {self.path} ends here ({trouble}); what it records goes on", level="warning")


def meaning(request: bytes, registers: Sequence[Register]) -> str:
    """A Modbus request in words, with the names of the registers that it touches, in the order of their addresses."""
    function = request[0]
    if function not in SPACE_OF or len(request) < 5:
        return f"function {function}"
    verb = "read" if function in READ.values() else "write"
    first = int.from_bytes(request[1:3], "big")
    count = 1 if function == WRITE_COIL else int.from_bytes(request[3:5], "big")
    touched = sorted(
        (r for r in registers if r.space == SPACE_OF[function] and r.address < first + count and r.end > first),
        key=lambda register: register.address,
    )
    names = ", ".join(register.name for register in touched)
    return f"{verb} {names or f'{count} of {SPACE_OF[function]} from {first}'}"


class _Recorded(Generic[AnyWire, Answer]):
    """A wire whose exchanges are recorded; ``link`` is its name in the recording."""

    def __init__(self, wire: AnyWire, recorder: FrameRecorder, link: str) -> None:
        self._wire, self._recorder, self._link = wire, recorder, link
        self.where, self.timeout_s = wire.where, wire.timeout_s

    def close(self) -> None:
        """Ends the connection."""
        self._wire.close()

    def _answer(self, exchange: Callable[[], Answer], record: Callable[[float, Answer | None, str], None]) -> Answer:
        """The answer of an exchange, recorded. One that was never sent, because its ``before`` raised, is not recorded."""
        begun = steady()
        try:
            answer = exchange()
        except (Silence, Broken, Malformed) as problem:
            kind = "broken" if isinstance(problem, Broken) else "malformed"
            record(begun, None, "silence" if isinstance(problem, Silence) else f"{kind}: {problem}")
            raise
        record(begun, answer, "")
        return answer


class RecordedWire(_Recorded[Wire, bytes]):
    """A Modbus wire whose exchanges are recorded."""

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The answer to a request."""
        record = partial(self._recorder.exchange, self._link, device_id, request)
        return self._answer(lambda: self._wire.exchange(device_id, request, before), record)


class RecordedLines(_Recorded[LineWire, str]):
    """A text connection whose lines are recorded."""

    def exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The answer to a line."""
        record = partial(self._recorder.line, self._link, line, what)
        return self._answer(lambda: self._wire.exchange(line, what, before), record)


@dataclass(frozen=True)
class RecordedClock:
    """A clock whose readings are recorded."""

    wrapped: Clock
    recorder: FrameRecorder

    def now(self) -> float:
        """Seconds since the zero of the clock."""
        reading = self.wrapped.now()
        self.recorder.clock(reading)
        return reading

    def sleep(self, seconds: float) -> None:
        """Returns ``seconds`` later."""
        self.wrapped.sleep(seconds)


_active: list[FrameRecorder] = []


def active_recorder() -> FrameRecorder | None:
    """The recorder of this process; every link that is made while it is there is recorded."""
    return _active[-1] if _active else None


@contextmanager
def recorded(path: Path | None, purpose: str) -> Generator[FrameRecorder | None]:
    """A block in which every link that this process makes is recorded into a new file; nothing without a path."""
    if path is None:
        yield None
        return
    recorder = FrameRecorder(path, purpose)
    _active.append(recorder)
    try:
        yield recorder
    finally:
        _active.remove(recorder)
        recorder.close()
