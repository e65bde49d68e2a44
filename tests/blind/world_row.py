"""A row of the world table: a world of any generator, what is done to its dwells, and what has to be said."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
from made_worlds import World, make

from benchmarks.hand_turned import make as turned_by_hand
from benchmarks.made_recordings import Recording
from benchmarks.made_recordings import make as recorded
from benchmarks.strangers import make as made_by_strangers
from benchmarks.truth import case

# found by way of the worlds
from continued_run import Blind, Continued  # isort: skip
from faults import Told  # isort: skip


@dataclass(frozen=True)
class Case:
    """A run of a scenario of `truth`."""

    scenario: str
    index: int


@dataclass(frozen=True)
class Strange:
    """A lot of the generator that knows nothing of the judge: its kind, and the size of what is hidden in noises of a dwell."""

    kind: str
    size: float = 2.0


@dataclass(frozen=True)
class Hand:
    """One unit turned by hand, with an effect of ten times the noise."""

    effect: str
    rests: bool = False


AnyWorld = World | Blind | Case | Strange | Hand | Recording


@dataclass(frozen=True)
class MadeLot:
    """Dwells of any generator, with what was done to them."""

    dwells: pd.DataFrame
    history: pd.DataFrame | None = None
    faults: tuple[Told, ...] = ()
    floor_ug: float = float("nan")


def made(world: AnyWorld, seed: int) -> MadeLot:
    if isinstance(world, World):
        lot = make(world, seed)
        return MadeLot(lot.dwells, lot.history, lot.faults, lot.floor_ug)
    if isinstance(world, Blind):
        return MadeLot(*Continued(world, seed).tables())
    if isinstance(world, Case):
        run = case(world.scenario, world.index, seed)
        return MadeLot(run.dwells, run.history if run.sealed.spec.history else None)
    if isinstance(world, Strange):
        strange = made_by_strangers(world.kind, seed, size=world.size)
        told = Told((), tuple(strange.truth.get("units", ())), tuple(strange.truth.get("dwells", ())))
        return MadeLot(strange.dwells, strange.history, (told,))
    if isinstance(world, Hand):
        return MadeLot(turned_by_hand(world.effect, seed, rests=world.rests))
    recording = recorded(world, seed)
    return MadeLot(recording.dwells, None, (Told(("bad_dwell",), (), recording.spoilt),))


Check = Callable[[dict, MadeLot], bool]


@dataclass(frozen=True)
class Row:
    """A world, what is done to its dwells, and what has to be said; None: anything may be.

    first : the first effect of each class, in any order; alone : classes have no other member
    named : effects that a class contains
    told : of each fault "names" (a class has its name), "units", "near" (within one dwell), "dwells"
    physics : whether an effect, and not only errors of data, may be named
    unexplained : drivers of which one is told; empty: nothing is unexplained
    not_reached : what the present judge says in place of this; the row fails, and a judge that reaches it is told
    """

    world: AnyWorld
    seed: int
    label: str
    first: tuple[str, ...] | None = None
    alone: bool = False
    named: tuple[str, ...] = ()
    told: str = ""
    physics: bool = False
    adequate: tuple[bool | None, ...] = (True, False, None)
    recommended: tuple[str, ...] | None = None
    unexplained: frozenset[str] | None = None
    blocked: tuple[str, ...] = ()
    also: Check | None = None
    change: Callable[[pd.DataFrame], pd.DataFrame] | None = None
    fast: bool = False
    not_reached: str = ""

    def __str__(self) -> str:
        return f"{self.label}-{self.seed}"
