"""Hidden effects of the demonstration, each with a measurement plan that can detect it."""

from dataclasses import dataclass, field

import numpy as np

from schemas.errors import WrongUse, did_you_mean
from schemas.station import Soak

PLAIN = ("bias", "scale", "misalignment")
THERMAL = (
    *PLAIN,
    "bias_temperature",
    "bias_temperature_quadratic",
    "scale_temperature",
    "scale_temperature_quadratic",
    "misalignment_temperature",
)
LOOP = (25.0, 55.0, 70.0, 54.0, 24.0, -4.0, -20.0, -5.0, 26.0)
"""Soaks with rising and falling temperature; the falling ones are near the rising ones."""

SWINGS = (25.0, 45.0, 24.0, 5.0, 26.0)
HURRIED = Soak(band_K=60.0, rate_K_per_min=30.0, window_s=10.0)
"""Settling time so short that dwells begin while the temperature still changes."""


@dataclass(frozen=True)
class Scene:
    """A hidden effect, and a measurement plan that can detect it.

    effect : its id in the catalogue
    figures : parameters of the hidden physics
    plan, repeats, temperatures, settle_s : of the recipe
    """

    kind: str
    effect: str
    truth: str
    figures: dict[str, float] = field(default_factory=dict[str, float])
    plan: str = "fibonacci24"
    repeats: int = 2
    temperatures: tuple[float, ...] = (25.0,)
    settle_s: float = 2.0
    soak: Soak = field(default_factory=Soak)

    @property
    def model(self) -> tuple[str, ...]:
        """The starting model."""
        return THERMAL if len(self.temperatures) > 1 else PLAIN


SCENES: tuple[Scene, ...] = (
    Scene(
        "cubic_transfer",
        "third_order",
        "a spring that hardens: the mass moves by x with f = x + h·x³",
        {"hardening": 60e-6},
    ),
    Scene(
        "pendulous_mass",
        "cross_coupling",
        "a mass on an arm that load turns, so that its axis looks along its neighbour",
        {"compliance": 30e-6},
    ),
    Scene(
        "hysteresis_play",
        "thermal_hysteresis",
        "stress of the package that follows temperature with play",
        {"gain": 6e-6},
        plan="nine",
        repeats=1,
        temperatures=LOOP,
    ),
    Scene(
        "element_lag",
        "thermal_lag",
        "a bias made in a part that follows the thermometer with a lag",
        {"tempco": 20e-6, "tau": 90.0},
        plan="nine",
        repeats=2,
        temperatures=SWINGS,
        soak=HURRIED,
    ),
    Scene("creep", "creep_after_move", "a suspension of which a part comes late", {"size": 50e-6, "tau": 30.0}),
    Scene(
        "level_error",
        "level_error",
        "a table whose base is tilted in the laboratory",
        {"about_x": 40e-6, "about_y": -30e-6},
    ),
    Scene("encoder_harmonic", "encoder_harmonic", "an encoder disc mounted off its centre", {"size": 50e-6}),
    Scene(
        "vibration_rectification",
        "vibration_rectification",
        "an asymmetric spring that turns vibration into a steady force",
        {"coefficient": 2.5e4},
        plan="nine",
        repeats=1,
        temperatures=LOOP,
    ),
    Scene(
        "warm_up", "warm_up", "a device that heats itself after power-on", {"size": 150e-6, "tau": 1500.0}, repeats=3
    ),
    Scene(
        "step_change",
        "step_change",
        "a stress that lets go once, in the middle of the run",
        {"size": 30e-6, "at": 1250.0},
    ),
    Scene("slot_rotation", "slot_rotation", "a fixture that was knocked, every slot by a little", {"size": 1e-3}),
)
HIDDEN_FROM_ONE_RUN = ("slot_rotation",)
"""Never drawn at random: for one unit in one slot it is identical to the misalignment."""


def scene(name: str, seed: int) -> Scene:
    """The scene of a kind of hidden physics or of an effect's id; ``random``: a random scene."""
    if name == "random":
        able = [s for s in SCENES if s.kind not in HIDDEN_FROM_ONE_RUN]
        return able[int(np.random.default_rng([seed, 1293]).integers(len(able)))]
    for candidate in SCENES:
        if name in {candidate.kind, candidate.effect}:
            return candidate
    known = {s.kind for s in SCENES} | {s.effect for s in SCENES}
    raise WrongUse(f"demo: no hidden effect is called '{name}'; {did_you_mean(name, [*known, 'random'])}")
