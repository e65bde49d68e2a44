"""Faults of the wire: what they share, and the script by which the proxy in front of a plant's server carries them out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

from stations.plant.faults.base import Trouble
from stations.plant.faults.proxy import ChaosProxy

if TYPE_CHECKING:
    from stations.plant.faults.proxy import Meddling, Script, Way
    from stations.plant.plant import Plant


@dataclass
class Wire(Trouble):
    """Trouble with the next ``frames`` answers of the station, whoever gives them."""

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
    wires = [one for one in plant.troubles if isinstance(one, Wire) and (one.fault.at_s > begun or begun == 0.0)]
    if not wires:
        return None
    spent: Counter[int] = Counter()

    def script(way: Way, _frame: bytes) -> Meddling | None:
        for number, wire in enumerate(wires):
            meddling = wire.meddles()
            due = wire.fault.at_s <= plant.now < wire.fault.until_s and spent[number] < wire.frames
            if meddling is not None and due and meddling.way == way:
                spent[number] += 1
                return meddling
        return None

    return script
