"""A row of the world table: a world, what is done to its dwells, and what has to be said."""

from collections.abc import Callable
from dataclasses import dataclass

import pandas as pd
from world_changes import Check

# found by way of the changes
from continued_run import Blind  # isort: skip
from world import World  # isort: skip


@dataclass(frozen=True)
class Case:
    """A run of a scenario of `truth`."""

    scenario: str
    index: int


@dataclass(frozen=True)
class Row:
    """A world, what is done to its dwells, and what has to be said; None: anything may be.

    first : the first effect of each class, in any order; alone : classes have no other member
    named : effects that a class contains
    told : of each fault "names" (a class has its name), "units", "near" (within one dwell), "dwells"
    physics : whether an effect, and not only errors of data, may be named
    unexplained : drivers of which one is told; empty: nothing is unexplained
    """

    world: World | Blind | Case
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

    def __str__(self) -> str:
        return f"{self.label}-{self.seed}"
