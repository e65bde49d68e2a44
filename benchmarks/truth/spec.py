"""What a blind run is asked to hold, and what is sealed about it."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from typing import Any

STATIC_BASE = ("bias", "scale", "misalignment")
THERMAL_BASE = (*STATIC_BASE, "bias_temperature", "scale_temperature")
THERMAL_SPAN_K = 5.0  # above this span the starting model gets its two temperature terms


@dataclass(frozen=True)
class Spec:
    """One blind run: the plan, the lot, the noise, and what hides in it.

    `effects` names hidden physics: a catalogue id, `covariate:<column>` or `withheld:<name>`; `sizes` holds one wanted size per
    effect (RMS of the unabsorbed part over the floor). `flicker` and `walk` are the rms of 1/f wander and of random walk in the
    dwell means, over their white standard error.
    """

    effects: tuple[str, ...] = ()
    sizes: tuple[float, ...] = ()
    plan: str = "fibonacci24"
    soaks: str = "nine"
    repeats: int = 1
    units: int = 8
    device: str = "mems"
    flicker: float = 0.0
    walk: float = 0.0
    shuffled_poses: bool = True
    power_cycles: bool = False
    varied_waits: bool = True
    reference: str = "angles"
    decoys: tuple[str, ...] = ()
    covariate_shape: str = "line"
    faults: tuple[str, ...] = ()
    base: tuple[str, ...] | None = None
    history: bool = True

    def __post_init__(self) -> None:
        if len(self.sizes) != len(self.effects):
            raise ValueError(
                f"Spec: {len(self.effects)} effects and {len(self.sizes)} sizes, needs one size per effect"
            )


@dataclass(frozen=True)
class Hidden:
    """One hidden effect as it came out: sizes over the floor, magnitudes in µg, whether the plan can see it."""

    id: str
    scope: str
    size: float
    amplitude_ug: float
    raw_ug: float
    share: float
    visible: bool
    plausible: bool
    variant: str = ""
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Fault:
    """One injected data fault: the units and dwells it touches, and the names that count as having caught it."""

    fault: str
    units: tuple[str, ...]
    dwells: tuple[int, ...]
    accepted: tuple[str, ...]


@dataclass(frozen=True)
class Truth:
    """Everything the diagnosis may not see. Error figures in µg."""

    seed: int
    spec: Spec
    base: tuple[str, ...]
    effects: tuple[Hidden, ...]
    separation: float
    floor_ug: float
    fresh_floor_ug: float
    oracle_fresh_ug: float
    output_per_g: float
    driver: str | None = None
    accepted_drivers: tuple[str, ...] = ()
    faults: tuple[Fault, ...] = ()

    def document(self) -> dict[str, Any]:
        """The truth as plain JSON types."""
        return asdict(self)
