"""Faults of the wire, and the script by which a proxy in front of the plant's server carries them out."""

from collections import Counter
from collections.abc import Generator, Sequence
from contextlib import contextmanager

from stations.plant.faults.base import Fault, Kind, add
from stations.plant.faults.proxy import ActionKind, ChaosProxy, Script, Way, WireAction
from stations.plant.world import World


def _on_answers(name: str, action: ActionKind, meaning: str, **figures: float) -> Kind:
    """A fault of the next ``frames`` answers of the station, whichever device sends them."""
    return Kind(name, meaning, figures={"frames": 1.0, **figures}, action=action)


add(
    _on_answers(
        "byte_garbage",
        "garble",
        "Some bytes of an answer change in transit; Modbus TCP has no checksum of its own.",
        size=2.0,
    ),
    _on_answers(
        "delay", "delay", "An answer, and all that follow it, are delayed by ``delay_s`` of wall time.", delay_s=0.2
    ),
    _on_answers(
        "half_open",
        "half_open",
        "The connection stays open and passes nothing: the device lost its power and could not close it.",
    ),
    _on_answers(
        "late_reply", "late", "An answer arrives late, in front of the next one, with its own older transaction id."
    ),
    _on_answers("other_transaction", "retag", "An answer arrives with a transaction id that no request had."),
    _on_answers(
        "reset", "reset", "The connection is reset in place of an answer: a switch restarts, a cable is moved."
    ),
    _on_answers(
        "time_out", "drop", "The answer to a request is lost: the device has acted, and the client cannot know it."
    ),
    _on_answers("truncated", "truncate", "An answer ends too early, and the connection is closed.", size=3.0),
)


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
    wires = [(f, _action(f.kind.action, f)) for f in faults if f.kind.action and (f.order.at_s > begun or begun == 0.0)]
    if not wires:
        return None
    spent: Counter[int] = Counter()

    def script(way: Way, _frame: bytes) -> WireAction | None:
        for number, (fault, action) in enumerate(wires):
            due = fault.order.at_s <= world.now < fault.order.until_s and spent[number] < fault.figures["frames"]
            if due and action.way == way:
                spent[number] += 1
                return action
        return None

    return script


def _action(kind: ActionKind, fault: Fault) -> WireAction:
    return WireAction(kind, delay_s=fault.figures.get("delay_s", 0.0), size=int(fault.figures.get("size", 1.0)))
