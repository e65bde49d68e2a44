"""A run that is held to a recording: its links answer what was recorded, in order, and its clock shows what it showed.

Everything that a run gets from outside is in a recording of it, so a run with the same recipe gives the same tables, bit for bit.
A run that asks for anything else ends and says where it departs.
"""

from collections import deque
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from schemas.errors import DataRejected
from stations.links.frames import Malformed
from stations.links.wires import Broken, Silence
from stations.recordings.frame_file import BROKEN, SILENCE, Exchange, FrameFile, Item, Reading, Remark, read_frames

MALFORMED = "malformed: "


@dataclass
class Held:
    """The part of a recording that is not replayed yet."""

    recording: FrameFile
    _left: deque[Item] = field(default_factory=deque["Item"])
    _last: float = 0.0

    def __post_init__(self) -> None:
        self._left.extend(item for item in self.recording.items if not isinstance(item, Remark))

    def wire(self, link: str, where: str) -> "HeldWire":
        """The Modbus wire of a link."""
        return HeldWire(self, link, where)

    def lines(self, link: str, where: str) -> "HeldLines":
        """The text connection of a link."""
        return HeldLines(self, link, where)

    def exchange(self, link: str, device_id: int, request: bytes) -> bytes:
        """The recorded answer to the next request, which must be the recorded one."""
        item = self._left[0] if self._left else None
        if not isinstance(item, Exchange) or (item.link, item.device_id, item.request) != (link, device_id, request):
            raise self._departed(f"{link} device {device_id} is asked {request.hex(' ')}", item)
        self._left.popleft()
        self._last = item.at_s
        if item.reply is not None:
            return item.reply
        if item.failed == SILENCE:
            raise Silence
        if item.failed.startswith(MALFORMED):
            raise Malformed(item.failed.removeprefix(MALFORMED))
        raise Broken(item.failed.removeprefix(f"{BROKEN}: "))

    def reading(self) -> float:
        """The next recorded reading of the clock."""
        item = self._left[0] if self._left else None
        if not isinstance(item, Reading):
            raise self._departed("the clock is read", item)
        self._left.popleft()
        return item.seconds

    @property
    def left(self) -> int:
        """Exchanges that were recorded and not asked for."""
        return sum(isinstance(item, Exchange) for item in self._left)

    def _departed(self, found: str, item: Item | None) -> DataRejected:
        """Not an error of a station: what repeats or pauses after those must not do so after this one."""
        if isinstance(item, Exchange):
            device = self.recording.name_of(item)
            needed = f"{item.what} of {device} at {item.at_s:.3f} s ({item.request.hex(' ')})"
        else:
            needed = "a reading of the clock" if item is not None else "nothing more"
        return DataRejected(
            f"replay: {found} after {self._last:.3f} s of {self.recording.name}, which continues with {needed}; use the recipe, "
            "units, station file and version of the recorded run"
        )


@dataclass
class _HeldLink:
    held: Held
    link: str
    where: str
    timeout_s: float = 0.0

    def close(self) -> None:
        """Nothing is open."""


class HeldWire(_HeldLink):
    """A wire that answers from a recording."""

    def exchange(self, device_id: int, request: bytes, before: Callable[[], None] | None = None) -> bytes:
        """The recorded answer."""
        return self.held.exchange(self.link, device_id, request)


class HeldLines(_HeldLink):
    """A connection for lines that answers from a recording."""

    def exchange(self, line: str, what: str, before: Callable[[], None] | None = None) -> str:
        """The recorded answer."""
        return self.held.exchange(self.link, 0, line.encode("ascii")).decode("ascii", errors="replace")


@dataclass(frozen=True)
class HeldClock:
    """A clock that shows what the recorded one showed; nobody waits for it."""

    held: Held

    def now(self) -> float:
        """Seconds since the zero of the recorded clock."""
        return self.held.reading()

    def sleep(self, seconds: float) -> None:
        """Returns at once."""


_active: list[Held] = []


def active_replay() -> Held | None:
    """The recording that this process is held to."""
    return _active[-1] if _active else None


@contextmanager
def held_to(path: Path | None) -> Generator[Held | None]:
    """A block in which every station that this process opens answers from a recording; nothing without a path."""
    if path is None:
        yield None
        return
    held = Held(read_frames(path))
    _active.append(held)
    try:
        yield held
    finally:
        _active.remove(held)
