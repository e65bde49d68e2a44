"""A station's file: which devices it has and where, what they may do, and how a simulated one is made."""

from collections.abc import Sequence
from importlib.resources import files
from pathlib import Path
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from schemas.bounds import Celsius, Degrees, Name, Positive, Rate, Seconds, Text, Wait
from schemas.errors import WrongUse
from schemas.fault import FaultOrder
from schemas.foreign import is_file
from schemas.own_files import own_file
from schemas.reference import Reference
from schemas.safety import Safety, SelfTest, Suspenders
from schemas.simulation import Simulation
from schemas.station_devices import Device, Devices, Equipment, built_in_equipment
from schemas.strict import Grown, Strict
from schemas.toml_files import parse_as, read_text
from schemas.uncertainty import TO_SI, Uncertainty

Angles = tuple[Degrees, Degrees]
SIMULATED = "simulated.toml"
BUILT_IN = "simulated"


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
    def _ordered(self) -> "Limits":
        for name in ("outer_deg", "inner_deg", "temperature_C"):
            low, high = getattr(self, name)
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


class LinkSettings(Grown):
    """Patience of the links.

    ``speed``: seconds of the station per second of this machine; 1 on hardware, for a simulated station that
    ``tumbleline station serve --speed`` serves the same number.
    """

    later: ClassVar[frozenset[str]] = frozenset({"speed"})

    timeout_s: Seconds = 3.0
    read_attempts: Annotated[int, Field(ge=1, le=5)] = 2
    speed: Annotated[float, Field(ge=0.001, le=1000.0)] = 1.0


class StationConfig(Grown):
    """A station."""

    later: ClassVar[frozenset[str]] = frozenset({"equipment", "uncertainty"})

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
    def _budget_is_traced(self) -> "StationConfig":
        if self.uncertainty is not None:
            refuse_untraced(self.uncertainty, self.reference, simulated=self.kind == "simulated")
        return self

    def fitted(self) -> dict[str, Device]:
        """The equipment of the station by role; a simulated one has the built-in equipment where its file names none."""
        named = self.equipment.there()
        built_in = built_in_equipment().there() if self.kind == "simulated" and self.equipment.built_in else {}
        return {**built_in, **named}

    @model_validator(mode="after")
    def _can_be_safe(self) -> "StationConfig":
        low, high = self.limits.temperature_C
        if self.safety.chamber == "set_point" and not low <= self.safety.temperature_C <= high:
            raise ValueError(
                f"safety.temperature_C: {self.safety.temperature_C:g} °C, {low:g} to {high:g} °C is allowed by [limits]; "
                "choose one inside, or another safety.chamber"
            )
        return self

    @model_validator(mode="after")
    def _two_drives(self) -> "StationConfig":
        outer, inner = self.devices.outer, self.devices.inner
        if outer == inner:
            raise ValueError(
                f"devices.inner: the same profile and address as devices.outer (device_id {inner.device_id}), so that one drive "
                "would get the orders of both axes; give it its own device_id or address"
            )
        return self

    @model_validator(mode="after")
    def _complete(self) -> "StationConfig":
        if self.kind == "simulated" and self.simulation is None:
            raise ValueError("simulation: missing, a station of kind simulated needs it; add [simulation]")
        if self.kind == "modbus":
            addressed = {f"devices.{name}": getattr(self.devices, name) for name in Devices.model_fields}
            addressed |= {f"equipment.{role}": device for role, device in self.equipment.there().items()}
            for key, device in addressed.items():
                if missing := device.missing():
                    raise ValueError(f"{key}.{missing}: empty, a station of kind modbus needs one; add it")
            supply = self.equipment.power_supply
            if supply is not None and "voltage" not in supply.maximum:
                raise ValueError(
                    "equipment.power_supply.maximum.voltage: missing, a station of kind modbus needs the absolute maximum of the "
                    "devices' supply; add maximum = { voltage = … }"
                )
        return self


def refuse_untraced(stated: Uncertainty, references: Sequence[Reference], *, simulated: bool) -> None:
    """Refuse (ValueError) a budget that names a reference that is not there, claims more than it, or is exact on hardware."""
    known = {reference.id: reference for reference in references}
    for name, entry in stated.every_entry.items():
        if entry.exact and not simulated and name != "reader":  # that of a digital device is in the device
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
        source, claimed = known[entry.reference], entry.standard("offset" if name == "thermometer" else "")
        least = source.standard(claimed.unit)
        if least is not None and claimed.unit and least > claimed.u * (1.0 + 1e-9):
            raise ValueError(
                f"uncertainty.{name}: u = {claimed.u / TO_SI[claimed.unit]:.3g} {claimed.unit}, reference {source.id} has "
                f"{least / TO_SI[claimed.unit]:.3g} {claimed.unit}; state at least that"
            )


def with_faults(config: StationConfig, faults: Sequence[FaultOrder]) -> StationConfig:
    """The station with faults beyond its file's; :class:`WrongUse` for a station of hardware."""
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
    return parse_as(StationConfig, text, source)
