"""A station's file: which devices it has and where, what they may do, and how a simulated one is made."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    model_serializer,
    model_validator,
)

from schemas.bounds import Celsius, Degrees, Name, NotNegative, Number, Positive, Rate, Seconds, Seed, Text, Wait
from schemas.carrier import Carried
from schemas.errors import WrongUse
from schemas.fault import FaultOrder
from schemas.foreign import is_file
from schemas.own_files import own_file
from schemas.reference import Reference
from schemas.safety import Safety, SelfTest, Suspenders
from schemas.strict import Strict
from schemas.toml_files import explain, parse_toml, read_text
from schemas.uncertainty import TO_SI, Uncertainty

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

Bounds = tuple[Number, Number]
Angles = tuple[Degrees, Degrees]
SIMULATED = "simulated.toml"
BUILT_IN = "simulated"
SIMULATED_EQUIPMENT = "simulated_equipment.toml"
MOST_SLOTS = 32  # the reader's registers name that many
LAST_DEVICE_ID = 247  # Modbus over serial line 1.02, 2.2


class Device(Carried):
    """A device at an address.

    ``maximum`` bounds what may be ordered, by the names of the profile's orders, below the profile's own largest values; for an
    exciter also ``displacement_mm``, ``velocity_m_s`` and ``acceleration_g``, all peak values. The absolute maximum of the
    devices' supply is ``maximum.voltage`` of the power supply.
    """

    device_id: Annotated[int, Field(ge=1, le=247)]
    maximum: dict[str, Positive] = Field(default_factory=dict[str, float])

    @model_serializer(mode="wrap")
    def _without_default(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without an empty ``maximum``: captures of earlier versions keep their names."""
        content = handler(self)
        return {name: value for name, value in content.items() if name != "maximum" or value}


class Slots(Carried):
    """The fixture's slots, ``count`` of them: slot n answers at ``device_id`` + n."""

    device_id: Annotated[int, Field(ge=1, le=240)]
    count: Annotated[int, Field(ge=1, le=MOST_SLOTS)] = 8

    @model_validator(mode="after")
    def _addressable(self) -> Slots:
        last = self.device_id + self.count - 1
        if last > LAST_DEVICE_ID:
            raise ValueError(
                f"count: {self.count} slots from device_id {self.device_id} end at {last}, {LAST_DEVICE_ID} is the last id "
                "that Modbus has; begin lower"
            )
        return self


class Devices(Strict):
    """Everything that answers on the station's links."""

    outer: Device
    inner: Device
    chamber: Device
    reader: Device
    slots: Slots


class Equipment(Strict):
    """Equipment for test procedures besides table, chamber and reader, by the role that it has; none where it is left out.

    A simulated station has the built-in equipment besides, unless ``built_in`` is false.
    """

    built_in: bool = True
    exciter: Device | None = None
    shock_machine: Device | None = None
    centrifuge: Device | None = None
    power_supply: Device | None = None
    step_generator: Device | None = None

    def there(self) -> dict[str, Device]:
        """The equipment that the station has, by role."""
        devices = {role: getattr(self, role) for role in type(self).model_fields if role != "built_in"}
        return {role: device for role, device in devices.items() if device is not None}


@cache
def built_in_equipment() -> Equipment:
    """The test equipment of a simulated station whose file has none of its own."""
    source = f"stations/{SIMULATED_EQUIPMENT}"
    content = parse_toml(files("stations").joinpath(SIMULATED_EQUIPMENT).read_text("utf-8"), source)
    return Equipment.model_validate(content["equipment"])


class Limits(Strict):
    """What the station may be asked to do; checked before anything moves."""

    outer_deg: Angles = (-200.0, 200.0)
    inner_deg: Angles = (-380.0, 380.0)
    speed_deg_s: Positive = 30.0
    acceleration_deg_s2: Positive = 30.0
    temperature_C: tuple[Celsius, Celsius] = (-40.0, 85.0)
    rate_hz: Rate = 4000.0
    position_deg: Positive = 0.01

    @model_validator(mode="after")
    def _ordered(self) -> Limits:
        for name, (low, high) in (
            ("outer_deg", self.outer_deg),
            ("inner_deg", self.inner_deg),
            ("temperature_C", self.temperature_C),
        ):
            if low >= high:
                raise ValueError(f"limits.{name}: {low} is not below {high}; give the lower bound first")
        return self


class Soak(Strict):
    """When a soak counts as reached: every unit inside the band and still, for a while.

    It is given up ``limit_s`` after the shortest soak that the recipe asks for.
    """

    band_K: Positive = 1.0
    rate_K_per_min: Positive = 0.1
    window_s: Seconds = 120.0
    limit_s: Seconds = 14400.0
    poll_s: Seconds = 10.0


class Pace(Strict):
    """How long a station needs, for the planning of its time: nothing is driven by these figures.

    ``lag_s`` is that of the slowest device behind the chamber's air; a simulated station has its own in its simulation.
    ``in_position_s`` goes by between the end of a move and the drive's word that it stands.
    """

    ramp_K_per_min: Positive = 3.0
    lag_s: Seconds = 200.0
    in_position_s: Wait = 1.5
    record_s: Wait = 0.0
    room_C: Celsius = 23.0


class LinkSettings(Strict):
    """Patience of the links."""

    timeout_s: Seconds = 3.0
    read_attempts: Annotated[int, Field(ge=1, le=5)] = 2


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


class Simulation(Strict):
    """How the simulated station is made."""

    seed: Seed = 1
    room_C: Celsius = 23.0
    local_gravity_m_s2: Annotated[Number, Field(gt=9.7, lt=9.9)] = 9.80665
    slot_rotation_mrad: NotNegative = 1.0
    slot_lag_s: Bounds = (90.0, 200.0)
    slot_gradient_K: NotNegative = 0.1
    supply_spread: NotNegative = 1e-3
    preset_overrides: dict[str, Number] = Field(default_factory=dict[str, float])
    hidden: list[Hidden] = Field(default_factory=list[Hidden])
    faults: list[FaultOrder] = Field(default_factory=list[FaultOrder])
    reference_errors: ReferenceErrors | None = None

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without what is not stated: captures of earlier versions keep their names."""
        content = handler(self)
        return {name: value for name, value in content.items() if name != "reference_errors" or value is not None}


class StationConfig(Strict):
    """A station."""

    name: Annotated[Name, Field(pattern=r"^[a-z0-9][a-z0-9._-]*$")]
    kind: Literal["simulated", "modbus"]
    description: Text = ""
    devices: Devices
    equipment: Equipment = Equipment()
    limits: Limits = Limits()
    soak: Soak = Soak()
    pace: Pace = Pace()
    link: LinkSettings = LinkSettings()
    suspenders: Suspenders = Suspenders()
    safety: Safety = Safety()
    self_test: SelfTest = SelfTest()
    simulation: Simulation | None = None
    reference: list[Reference] = Field(default_factory=list[Reference])
    uncertainty: Uncertainty | None = None

    @model_validator(mode="after")
    def _budget_is_traced(self) -> StationConfig:
        if self.uncertainty is not None:
            refuse_untraced(self.uncertainty, self.reference, simulated=self.kind == "simulated")
        return self

    @model_serializer(mode="wrap")
    def _as_before(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Without equipment and uncertainty where there is none: captures of earlier versions keep their names."""
        content = handler(self)
        if content.get("uncertainty") is None:
            content.pop("uncertainty", None)
        if content.get("equipment") in ({}, Equipment().model_dump(), None):
            content.pop("equipment", None)
        return content

    def fitted(self) -> dict[str, Device]:
        """The equipment of the station by role; a simulated one has the built-in equipment where its file names none."""
        named = self.equipment.there()
        built_in = built_in_equipment().there() if self.kind == "simulated" and self.equipment.built_in else {}
        return {**built_in, **named}

    @model_validator(mode="after")
    def _can_be_safe(self) -> StationConfig:
        low, high = self.limits.temperature_C
        if self.safety.chamber == "set_point" and not low <= self.safety.temperature_C <= high:
            raise ValueError(
                f"safety.temperature_C: {self.safety.temperature_C:g} °C, {low:g} to {high:g} °C is allowed by [limits]; "
                "choose one inside, or another safety.chamber"
            )
        return self

    @model_validator(mode="after")
    def _complete(self) -> StationConfig:
        if self.kind == "simulated" and self.simulation is None:
            raise ValueError("simulation: missing, a station of kind simulated needs it; add [simulation]")
        if self.kind == "modbus":
            for name in Devices.model_fields:
                if missing := getattr(self.devices, name).missing():
                    raise ValueError(f"devices.{name}.{missing}: empty, a station of kind modbus needs one; add it")
            for role, device in self.equipment.there().items():
                if missing := device.missing():
                    raise ValueError(f"equipment.{role}.{missing}: empty, a station of kind modbus needs one; add it")
            supply = self.equipment.power_supply
            if supply is not None and "voltage" not in supply.maximum:
                raise ValueError(
                    "equipment.power_supply.maximum.voltage: missing, a station of kind modbus needs the absolute maximum of the "
                    "devices' supply; add maximum = { voltage = … }"
                )
        return self


def refuse_untraced(stated: Uncertainty, references: Sequence[Reference], *, simulated: bool) -> None:
    """Refuse a budget that names a reference standard that is not there, claims more than it, or is exact on hardware.

    Raises
    ------
    ValueError
        With the entry.
    """
    known = {one.id: one for one in references}
    for name, entry in stated.entries.items():
        if entry.exact and not simulated:
            raise ValueError(
                f"uncertainty.{name}.exact: true, a station of kind simulated is needed; state its standard uncertainty"
            )
        if not entry.reference:
            continue
        if entry.reference not in known:
            named = ", ".join(known) or "none"
            raise ValueError(
                f"uncertainty.{name}.reference: no [[reference]] is called '{entry.reference}' (there are: {named}); add it"
            )
        own, claimed = known[entry.reference], entry.standard("offset" if name == "thermometer" else "")
        least = own.standard(claimed.unit)
        if least is not None and claimed.unit and least > claimed.u * (1.0 + 1e-9):
            raise ValueError(
                f"uncertainty.{name}: u = {claimed.u / TO_SI[claimed.unit]:.3g} {claimed.unit}, reference {own.id} has "
                f"{least / TO_SI[claimed.unit]:.3g} {claimed.unit}; state at least that"
            )


def with_faults(config: StationConfig, faults: Sequence[FaultOrder]) -> StationConfig:
    """The station with faults beyond its file's; a station of hardware has trouble enough of its own."""
    if not faults:
        return config
    if config.kind != "simulated" or config.simulation is None:
        found = f"fault {faults[0].kind} on kind {config.kind}"
        raise WrongUse(f"station {config.name}: {found}, a simulated station is needed; leave it out")
    simulation = config.simulation.model_copy(update={"faults": [*config.simulation.faults, *faults]})
    return config.model_copy(update={"simulation": simulation})


def load_station(path: Path | None = None) -> StationConfig:
    """The station in a file, or the built-in simulated one; :class:`RecipeInvalid` names the key and what is needed.

    A name that is no file is searched in the user's folders (:mod:`schemas.own_files`).
    """
    if path is None or (
        str(path) == BUILT_IN and not is_file(path) and own_file("stations", BUILT_IN, {BUILT_IN}) is None
    ):
        source = f"stations/{SIMULATED}"
        text = files("stations").joinpath(SIMULATED).read_text("utf-8")
    else:
        file = path if is_file(path) else own_file("stations", str(path), {BUILT_IN}) or path
        source, text = str(file), read_text(file, "station")
    try:
        return StationConfig.model_validate(parse_toml(text, source))
    except ValidationError as problem:
        raise explain(problem, source, StationConfig) from None
