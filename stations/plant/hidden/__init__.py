"""Hidden effects: physical effects of a station or device that no register reports.

Each effect is modelled from its mechanism, independently of the columns in ``inertial.effects``: a truth made of the columns of
the fit would prove nothing. A new effect is a subclass of :class:`HiddenEffect`, listed here.
"""

from collections.abc import Mapping
from dataclasses import fields

from schemas.errors import RecipeInvalid, did_you_mean
from stations.plant.hidden import device, package, spring, table
from stations.plant.hidden.base import Block, HiddenEffect

__all__ = ["HIDDEN", "Block", "HiddenEffect", "hidden_effect"]

HIDDEN: Mapping[str, type[HiddenEffect]] = {
    "cubic_transfer": device.CubicTransfer,
    "pendulous_mass": device.PendulousMass,
    "hysteresis_play": device.HysteresisPlay,
    "element_lag": device.ElementLag,
    "creep": device.Creep,
    "level_error": table.LevelError,
    "encoder_harmonic": table.EncoderHarmonic,
    "slot_rotation": table.SlotRotation,
    "vibration_rectification": device.VibrationRectification,
    "warm_up": device.WarmUp,
    "moisture_swelling": device.MoistureSwelling,
    "stress_relaxation": device.StressRelaxation,
    "step_change": device.StepChange,
    "yielding_adhesive": package.YieldingAdhesive,
    "moisture_diffusion": package.MoistureDiffusion,
    "leaky_lid": package.LeakyLid,
    "gas_film": spring.GasFilm,
    "softening_spring": spring.SofteningSpring,
}


def hidden_effect(kind: str, figures: Mapping[str, float]) -> HiddenEffect:
    """The hidden effect of a kind with its figures; unknown kinds and figures are refused."""
    if kind not in HIDDEN:
        raise RecipeInvalid(
            f"simulation.hidden: no effect '{kind}'; {did_you_mean(kind, HIDDEN)}", key="simulation.hidden"
        )
    make = HIDDEN[kind]
    known = [f.name for f in fields(make) if f.init]  # pyright: ignore[reportArgumentType] - all are dataclasses
    for name in figures:
        if name not in known:
            raise RecipeInvalid(
                f"simulation.hidden: {kind} has no '{name}'; {did_you_mean(name, known)}",
                key=f"simulation.hidden.{name}",
            )
    return make(**figures)
