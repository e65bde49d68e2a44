"""What a station's file says for trouble: when a run pauses, how the station is left, and how it is tested before a shift."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from schemas.bounds import Celsius, Degrees, Number, Positive, Rate, Seconds, Wait
from schemas.strict import Strict

Bounds = tuple[Number, Number]
SAFE_WITHIN_S = 60.0  # by then a station without a live run is in its safe state, and its lease is free


class Suspenders(Strict):
    """Conditions that pause a run: what was measured while one held is thrown away and measured again.

    ``chamber_band_K`` is how far the air may be from its target during a record; it is never narrower than the soak's band.
    ``supply_change`` is the part by which a slot's supply may differ from what it was when the run began, ``supply_V`` the
    bounds that always hold. A condition must be gone for ``clear_s`` before the run goes on from its last checkpoint.
    After ``limit_s`` of one pause, or when a record was spoiled ``attempts`` times, the run ends and waits for a person.
    """

    door: bool = True
    chamber_band_K: Positive = 3.0
    vibration_g: Positive = 1e-3
    supply_change: Positive = 0.02
    supply_V: Bounds | None = None
    poll_s: Seconds = 10.0
    clear_s: Wait = 30.0
    limit_s: Seconds = 3600.0
    attempts: Annotated[int, Field(ge=1, le=20)] = 5


class Safety(Strict):
    """The state in which a station is left by whatever ends a run, and how soon a dead run is noticed.

    The chamber goes to ``temperature_C``, is switched off, or holds what it has; the axes stop or are left alone; sampling
    always stops. A run tells every ``heartbeat_s`` that it lives; one that has not for ``lapse_s`` counts as dead.
    """

    chamber: Literal["set_point", "off", "hold"] = "set_point"
    temperature_C: Celsius = 25.0
    axes: Literal["stop", "hold"] = "stop"
    heartbeat_s: Annotated[Number, Field(gt=0.0, le=10.0)] = 2.0
    lapse_s: Annotated[Number, Field(gt=0.0, le=45.0)] = 20.0

    @model_validator(mode="after")
    def _notices_in_time(self) -> "Safety":
        if self.lapse_s < 2.0 * self.heartbeat_s:
            raise ValueError(
                f"lapse_s: {self.lapse_s:g} s, two heartbeats of {self.heartbeat_s:g} s are needed at least; raise lapse_s, "
                "or lower heartbeat_s"
            )
        return self


class SelfTest(Strict):
    """The self-test before a shift: a move there and back, the noise of every slot, and a check standard.

    ``noise_max`` is the largest standard deviation of a sample on any axis, in the output's unit; where it is left out, no slot
    may be three times as noisy as they usually are. ``standard`` is the serial number of the unit that is measured every time;
    its offset and scale on z must lie within ``offset`` and ``scale`` (output's unit, output's unit per g), or where these are
    left out within three sigma of its own history, once that has ``history_min`` entries.
    """

    outer_deg: Degrees = 10.0
    inner_deg: Degrees = 10.0
    settle_s: Wait = 2.0
    sample_s: Seconds = 5.0
    rate_hz: Rate = 100.0
    noise_max: Positive | None = None
    standard: str = ""
    offset: Bounds | None = None
    scale: Bounds | None = None
    history_min: Annotated[int, Field(ge=5, le=100)] = 8
