"""Faults of the wire: what they share, and the script by which the proxy in front of a plant's server carries them out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from stations.plant.faults.base import DEVICES, UNIT, Fault
from stations.plant.faults.proxy import ChaosProxy, Meddling

if TYPE_CHECKING:
    from stations.plant.faults.proxy import Script, Way
    from stations.plant.plant import Plant


@dataclass
class WireFault(Fault):
    """Fault with the next ``frames`` answers of the station, whoever gives them."""

    frames: float = 1.0


@contextmanager
def on_the_wire(plant: Plant, host: str, port: int) -> Generator[tuple[str, int]]:
    """Where clients of a plant's server connect: a proxy that spoils frames, or the server itself where its wire is sound."""
    script = script_of(plant)
    if script is None:
        yield host, port
        return
    with ChaosProxy(host, port, script) as proxy:
        yield proxy.host, proxy.port


def script_of(plant: Plant) -> Script | None:
    """What happens to the frames of a plant's server; None where its wire is sound.

    What lies in the past of a plant that was resumed has happened already.
    """
    begun = plant.now
    wires = [one for one in plant.troubles if isinstance(one, WireFault) and (one.fault.at_s > begun or begun == 0.0)]
    if not wires:
        return None
    spent: Counter[int] = Counter()

    def script(way: Way, _frame: bytes) -> Meddling | None:
        for number, wire in enumerate(wires):
            meddling = wire.wire_action()
            due = wire.fault.at_s <= plant.now < wire.fault.until_s and spent[number] < wire.frames
            if meddling is not None and due and meddling.way == way:
                spent[number] += 1
                return meddling
        return None

    return script


@dataclass
class ByteGarbage(WireFault):
    """Some bytes of an answer change on their way; Modbus TCP has no checksum of its own."""

    kind: ClassVar[str] = "byte_garbage"

    size: float = 2.0

    def wire_action(self) -> Meddling:
        """Changed."""
        return Meddling("garble", size=int(self.size))


@dataclass
class Delay(WireFault):
    """An answer takes ``delay_s`` of wall time, with everything behind it."""

    kind: ClassVar[str] = "delay"

    delay_s: float = 0.2

    def wire_action(self) -> Meddling:
        """Held."""
        return Meddling("delay", delay_s=self.delay_s)


@dataclass
class Garbage(Fault):
    """A device tells random words in frames that are whole: a memory gone wrong behind a sound interface."""

    kind: ClassVar[str] = "garbage"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Words that depend on the time and the address."""
        rng = np.random.default_rng([now_us, address, self.device_id])
        return rng.integers(0, 65536, len(words)).tolist()


@dataclass
class HalfOpen(WireFault):
    """The connection stays open and swallows everything: the device lost its power without a word."""

    kind: ClassVar[str] = "half_open"

    def wire_action(self) -> Meddling:
        """Swallowed."""
        return Meddling("half_open")


@dataclass
class LateReply(WireFault):
    """An answer is held back until the next one comes, and arrives in front of it under its own, older transaction id."""

    kind: ClassVar[str] = "late_reply"

    def wire_action(self) -> Meddling:
        """Held back."""
        return Meddling("late")


@dataclass
class OtherTransaction(WireFault):
    """An answer arrives under a transaction id that nobody asked with."""

    kind: ClassVar[str] = "other_transaction"

    def wire_action(self) -> Meddling:
        """Its number is another."""
        return Meddling("retag", size=1)


@dataclass
class Reset(WireFault):
    """The connection is reset in place of an answer: a switch restarts, a cable is moved."""

    kind: ClassVar[str] = "reset"

    def wire_action(self) -> Meddling:
        """Reset."""
        return Meddling("reset")


@dataclass
class SwappedWords(Fault):
    """A device tells numbers of 32 bits with their words the other way round; its set-up was changed."""

    kind: ClassVar[str] = "swapped_words"
    about: ClassVar[tuple[str, ...]] = (UNIT, *DEVICES)

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """Pairs of words exchanged."""
        del now_us, address
        even = len(words) // 2 * 2
        return [word for i in range(0, even, 2) for word in (words[i + 1], words[i])] + words[even:]


@dataclass
class Truncated(WireFault):
    """An answer ends too early, and the connection with it."""

    kind: ClassVar[str] = "truncated"

    size: float = 3.0

    def wire_action(self) -> Meddling:
        """Cut off."""
        return Meddling("truncate", size=int(self.size))
