"""The devices and the test equipment of a station's file."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Annotated, Any

from pydantic import (
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from schemas.bounds import Positive
from schemas.carrier import Carried
from schemas.strict import Strict
from schemas.toml_files import parse_toml

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
