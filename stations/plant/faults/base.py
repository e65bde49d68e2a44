"""A fault of a simulated station, and what defines its kind."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from inspect import signature

from schemas.fault import FaultOrder
from stations.plant.faults.proxy import ActionKind
from stations.plant.table import Axis
from stations.plant.world import World

UNIT = "unit"
AXES = ("outer", "inner")
DEVICES = (*AXES, "chamber", "reader")
MUTE = -1  # instead of an exception code: the device sends no answer

Effect = Iterator[None]
WriteWords = Callable[[list[int]], None]


@dataclass(frozen=True)
class Kind:
    """A kind of fault. What it does must depend on the plant's time and on writes only, never on reads.

    A resumed plant replays the writes alone.

    meaning : what happens, in one sentence
    targets : what the fault can be given for: ``unit`` (by its serial number) or the station's devices by name; empty for none
    figures : its figures with their defaults
    effect : changes the world when the fault begins; a generator that yields undoes it when the fault ends
    exception : code with which the device answers every request, 0 for a normal answer; a figure ``code`` replaces it
    on_read : the words that the device reports, from the fault, the time in µs, the address and the true words
    on_write : carries out a write as the faulty device does; the exception code of its answer, from the words of the write, those
        that the registers hold (None where they cannot be read), and the function that writes words to the registers
    action : what happens to the next ``frames`` answers of the station, whichever device sends them
    """

    name: str
    meaning: str
    targets: tuple[str, ...] = ()
    figures: Mapping[str, float] = field(default_factory=dict[str, float])
    effect: "Callable[..., Effect | None] | None" = None
    exception: int = 0
    on_read: "Callable[[Fault, int, int, list[int]], list[int]] | None" = None
    on_write: Callable[[list[int], list[int] | None, WriteWords], int] | None = None
    action: ActionKind | None = None


KINDS: dict[str, Kind] = {}  # the kinds by name; each module of this folder adds its own when it is imported


def add(*kinds: Kind) -> None:
    """Adds kinds to the known kinds."""
    KINDS.update({kind.name: kind for kind in kinds})


def fault(*targets: str) -> Callable[[Callable[..., Effect | None]], None]:
    """Adds the kind of a function ``effect(fault, world, figure=default, …)``, with its name and docstring."""

    def added(effect: Callable[..., Effect | None]) -> None:
        figures = {
            name: p.default for name, p in signature(effect).parameters.items() if name not in {"fault", "world"}
        }
        add(Kind(effect.__name__, (effect.__doc__ or "").strip(), targets, figures, effect))

    return added


@dataclass
class Fault:
    """A fault of a plant, with the figures of its order or their defaults."""

    order: FaultOrder
    kind: Kind
    figures: Mapping[str, float]
    device_id: int = 0
    unit: int = 0
    _effect: Effect | None = None

    def begins(self, world: World) -> None:
        """Changes the world when the fault begins."""
        if self.kind.effect is not None:
            self._effect = self.kind.effect(self, world, **self.figures)
            self._next_part()

    def ends(self, world: World) -> None:
        """Undoes the change when the fault ends, where its kind says how."""
        self._next_part()

    def _next_part(self) -> None:
        if self._effect is not None:
            next(self._effect, None)

    def answers(self) -> int:
        """The exception code with which the device answers every request; 0 where it answers normally."""
        return int(self.figures.get("code", self.kind.exception))

    def on_read(self, now_us: int, address: int, words: list[int]) -> list[int]:
        """The words that the device reports instead of ``words``."""
        return words if self.kind.on_read is None else self.kind.on_read(self, now_us, address, words)

    def on_write(self, words: list[int], held: list[int] | None, write: WriteWords) -> int:
        """Carries out a write as the faulty device does, and returns the exception code of its answer."""
        if self.kind.on_write is not None:
            return self.kind.on_write(words, held, write)
        write(words)
        return 0

    def axis(self, world: World) -> Axis:
        """The axis that has the fault."""
        return world.outer if self.order.device == "outer" else world.inner
