"""How a simulated station is made: spread of its devices, hidden effects, faults, errors of its references."""

from typing import Annotated, Any

from pydantic import AfterValidator, Field, SerializerFunctionWrapHandler, model_serializer

from schemas.bounds import Celsius, NotNegative, Number, Seconds, Seed
from schemas.fault import FaultOrder
from schemas.strict import Strict


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if bounds[0] > bounds[1]:
        raise ValueError(f"{bounds[0]:g} is above {bounds[1]:g}; give the lower bound first")
    return bounds


class Hidden(Strict):
    """A hidden effect of the simulated station, with figures other than its usual ones."""

    kind: str
    figures: dict[str, Number] = Field(default_factory=dict[str, float])


class ReferenceErrors(Strict):
    """Standard deviations of the simulated station's own errors; each station draws its errors from its seed, once.

    ``pose_urad`` is drawn at every move, the thermometer's for the station, ``soak_K`` at every soak, ``slot_gradient_K`` of the
    element against its thermometer for each slot.
    """

    gravity_ppm: NotNegative = 0.0
    level_urad: NotNegative = 0.0
    orthogonality_urad: NotNegative = 0.0
    outer_offset_urad: NotNegative = 0.0
    inner_offset_urad: NotNegative = 0.0
    harmonics_urad: NotNegative = 0.0
    pose_urad: NotNegative = 0.0
    thermometer_offset_K: NotNegative = 0.0
    thermometer_slope_percent: NotNegative = 0.0


class Turning(Strict):
    """What the simulated table does while an axis turns, besides turning at the ordered rate.

    cogging_deg, cogging_per_turn : ripple of the angle by the motor's poles; unbalance_deg : by the load, once a turn
    wobble_urad : tilt of the axis in its bearings, twice a turn
    radius_mm : of the circle of the slots about the inner axis
    latency_ms, jitter_ms : age of an encoder reading when it is answered, and its standard deviation
    """

    cogging_deg: NotNegative = 0.002
    cogging_per_turn: Annotated[int, Field(ge=1, le=1000)] = 50
    unbalance_deg: NotNegative = 0.01
    wobble_urad: NotNegative = 0.0
    radius_mm: NotNegative = 40.0
    latency_ms: NotNegative = 5.0
    jitter_ms: NotNegative = 0.5


class Simulation(Strict):
    """How the simulated station is made."""

    seed: Seed = 1
    room_C: Celsius = 23.0
    local_gravity_m_s2: Annotated[Number, Field(gt=9.7, lt=9.9)] = 9.80665
    slot_rotation_mrad: NotNegative = 1.0
    slot_lag_s: Annotated[tuple[Seconds, Seconds], AfterValidator(_ordered)] = (90.0, 200.0)
    slot_gradient_K: NotNegative = 0.1
    supply_spread: NotNegative = 1e-3
    supply_drift: NotNegative = 1e-4
    supply_reading_ppm: NotNegative = 20.0
    preset_overrides: dict[str, Number] = Field(default_factory=dict[str, float])
    hidden: list[Hidden] = Field(default_factory=list[Hidden])
    faults: list[FaultOrder] = Field(default_factory=list[FaultOrder])
    reference_errors: ReferenceErrors | None = None
    turning: Turning = Field(default_factory=Turning)

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without what is not stated: captures of earlier versions keep their names."""
        content = handler(self)
        later = {"supply_drift", "supply_reading_ppm", "reference_errors", "turning"}
        return {name: value for name, value in content.items() if name not in later or name in self.model_fields_set}
