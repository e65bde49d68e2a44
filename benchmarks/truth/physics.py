"""The registry of hidden physics: how one effect acts on table, force, signal or converter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .scene import Scene

Floats = NDArray[np.float64]


@dataclass
class Table:
    """True geometry of the table: angles (n,) rad, up in the laboratory (3,), tilt of the inner axis in rad, gain of gravity."""

    outer: Floats
    inner: Floats
    up: Floats
    skew: float = 0.0
    gravity: float = 1.0
    slot: Floats | None = None  # (U, 3) rotation vectors


TableAct = Callable[[Scene, Table, float], None]
SignalAct = Callable[[Scene, Floats], Floats]
ChainAct = Callable[[Scene, Floats, float], Floats]


@dataclass(frozen=True)
class Physics:
    """One drawn effect. `signal` is in g at amplitude 1; the others take the amplitude. `cap_ug`: largest sane amplitude, µg.

    `generic` is the RMS at amplitude 1 under poses all over the sphere, for effects of pose (0: not one of them): an effect that
    only a misalignment of some mrad lets through is out of the plan's sight.
    """

    id: str
    scope: str
    cap_ug: float
    table: TableAct | None = None
    stress: ChainAct | None = None
    signal: SignalAct | None = None
    converter: ChainAct | None = None
    variant: str = ""
    parameters: dict[str, float] = field(default_factory=dict)
    drivers: tuple[str, ...] = ()
    generic: float = 0.0


@dataclass(frozen=True)
class Draw:
    """Random numbers for one effect in a lot of `units`; `scene` gives ranges only (span of time, of temperature)."""

    rng: np.random.Generator
    units: int
    scene: Scene

    def each(self, *shape: int, loose: bool = False) -> Floats:
        """Coefficients (U, *shape): common to the design with a spread between units, or (loose) each unit its own."""
        common = self.rng.uniform(0.5, 1.5, shape) * self.rng.choice([-1.0, 1.0], shape)
        spread = self.rng.standard_normal((self.units, *shape))
        return 0.4 * common + 0.9 * spread if loose else common * (1.0 + 0.3 * spread)

    def log(self, low: float, high: float) -> float:
        """A number between `low` and `high`, even on a logarithmic scale."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def near(self, value: float, spread: float) -> Floats:
        """`value` with a relative spread between units, (U,)."""
        return value * (1.0 + spread * self.rng.standard_normal(self.units)).clip(0.5, 1.5)


Maker = Callable[[Draw], Physics]
REGISTRY: dict[str, Maker] = {}


def hidden(effect: str) -> Callable[[Maker], Maker]:
    """Enters the maker under the id it hides."""

    def enter(maker: Maker) -> Maker:
        REGISTRY[effect] = maker
        return maker

    return enter


def signal(effect: str, cap_ug: float, act: SignalAct, **extra: object) -> Physics:
    """A sensor effect that adds to the output."""
    return Physics(effect, "sensor", cap_ug, signal=act, **extra)  # type: ignore[arg-type]
