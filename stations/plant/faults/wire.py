"""Faults of the wire, and the script by which a proxy in front of the plant's server carries them out."""

from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from stations.plant.faults.base import DEVICES, UNIT, Fault
from stations.plant.faults.proxy import ActionKind, ChaosProxy, Script, Way, WireAction
from stations.plant.world import World


@dataclass
class WireFault(Fault):
    """A fault of the next ``frames`` answers of the station, whichever device sends them; ``action`` is what happens to each."""

    action: ClassVar[ActionKind]

    frames: float = 1.0

    def wire_action(self) -> WireAction:
        """What happens to an answer; a kind with figures adds them."""
        return WireAction(self.action)


@contextmanager
def on_the_wire(world: World, faults: Sequence[Fault], host: str, port: int) -> Generator[tuple[str, int]]:
    """Host and port for the clients of a plant's server: a proxy where ``faults`` has faults of the wire, else the server."""
    script = script_of(world, faults)
    if script is None:
        yield host, port
        return
    with ChaosProxy(host, port, script) as proxy:
        yield proxy.host, proxy.port


def script_of(world: World, faults: Sequence[Fault]) -> Script | None:
    """The proxy's script for the faults of the wire; None where there are none.

    Faults that began before a resumed world's time are over: their frames were sent in the earlier session.
    """
    begun = world.now
    wires = [f for f in faults if isinstance(f, WireFault) and (f.order.at_s > begun or begun == 0.0)]
    if not wires:
        return None
    spent: Counter[int] = Counter()

    def script(way: Way, _frame: bytes) -> WireAction | None:
        for number, wire in enumerate(wires):
            action = wire.wire_action()
            due = wire.order.at_s <= world.now < wire.order.until_s and spent[number] < wire.frames
            if due and action.way == way:
                spent[number] += 1
                return action
        return None

    return script


@dataclass
class ByteGarbage(WireFault):
    """Some bytes of an answer change in transit; Modbus TCP has no checksum of its own."""

    kind: ClassVar[str] = "byte_garbage"
    action: ClassVar[ActionKind] = "garble"

    size: float = 2.0

    def wire_action(self) -> WireAction:
        """Its action with its figure."""
        return WireAction(self.action, size=int(self.size))


@dataclass
class Delay(WireFault):
    """An answer, and all that follow it, are delayed by ``delay_s`` of wall time."""

    kind: ClassVar[str] = "delay"
    action: ClassVar[ActionKind] = "delay"

    delay_s: float = 0.2

    def wire_action(self) -> WireAction:
        """Its action with its figure."""
        return WireAction(self.action, delay_s=self.delay_s)


@dataclass
class Garbage(Fault):
    """A device reports random words in valid frames: its memory is corrupt and its interface works."""

    kind: ClassVar[str] = "garbage"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Random words, seeded by time, address and device."""
        rng = np.random.default_rng([now_us, address, self.device_id])
        return rng.integers(0, 65536, len(words)).tolist()


@dataclass
class HalfOpen(WireFault):
    """The connection stays open and passes nothing: the device lost its power and could not close it."""

    kind: ClassVar[str] = "half_open"
    action: ClassVar[ActionKind] = "half_open"


@dataclass
class LateReply(WireFault):
    """An answer arrives late, in front of the next one, with its own older transaction id."""

    kind: ClassVar[str] = "late_reply"
    action: ClassVar[ActionKind] = "late"


@dataclass
class OtherTransaction(WireFault):
    """An answer arrives with a transaction id that no request had."""

    kind: ClassVar[str] = "other_transaction"
    action: ClassVar[ActionKind] = "retag"


@dataclass
class Reset(WireFault):
    """The connection is reset in place of an answer: a switch restarts, a cable is moved."""

    kind: ClassVar[str] = "reset"
    action: ClassVar[ActionKind] = "reset"


@dataclass
class SwappedWords(Fault):
    """A device reports 32-bit numbers with their words exchanged: its word order was changed."""

    kind: ClassVar[str] = "swapped_words"
    targets: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Exchanges the words of each pair."""
        even = len(words) // 2 * 2
        return [word for i in range(0, even, 2) for word in (words[i + 1], words[i])] + words[even:]


@dataclass
class TimeOut(WireFault):
    """The answer to a request is lost: the device has acted, and the client cannot know it."""

    kind: ClassVar[str] = "time_out"
    action: ClassVar[ActionKind] = "drop"


@dataclass
class Truncated(WireFault):
    """An answer ends too early, and the connection is closed."""

    kind: ClassVar[str] = "truncated"
    action: ClassVar[ActionKind] = "truncate"

    size: float = 3.0

    def wire_action(self) -> WireAction:
        """Its action with its figure."""
        return WireAction(self.action, size=int(self.size))
