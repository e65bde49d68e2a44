"""Where a device is: the ``--link`` of a bring-up, and its values once it is found."""

import re
from dataclasses import dataclass

from schemas.errors import RecipeInvalid, WrongUse
from schemas.profile import TEXT_CARRIERS, Profile, WordOrder
from schemas.station_devices import Device
from stations.devices.commands import Commands, Values
from stations.devices.registers import Registers
from stations.links.making import SingleLink

NAME = "device"
FORMS = "tcp://HOST[:PORT], serial:DEVICE[,BAUD[,PARITY[,STOP]]] or visa:RESOURCE"
PORT = 502


def device_at(link: str, profile: Profile, device_id: int) -> Device:
    """The device that a link names.

    Raises
    ------
    WrongUse
        It is not of one of the forms, or the profile is carried otherwise.
    """
    kind, _, rest = link.partition(":")
    content: dict[str, object] = {"profile": profile.name, "device_id": device_id}
    text = set(profile.links) <= TEXT_CARRIERS
    if kind == "tcp" and (match := re.fullmatch(r"//(\[[^\]]+\]|[^:/]+)(?::(\d{1,5}))?/?", rest)):
        content |= {"link": "ascii" if text else "tcp", "host": match[1].strip("[]"), "port": int(match[2] or PORT)}
    elif kind == "serial" and rest:
        path, *more = rest.split(",")
        content |= {"link": "rtu", "serial": path}
        content |= dict(
            zip(("baud", "parity", "stop_bits"), [int(v) if v.isdigit() else v for v in more], strict=False)
        )
    elif kind == "visa" and rest:
        content |= {"link": "visa", "resource": rest.removeprefix("//")}
    else:
        raise WrongUse(f"bring-up: link '{link[:80]}', one of {FORMS} is needed; correct --link")
    if content["link"] not in profile.links:
        raise WrongUse(
            f"bring-up: link {content['link']}, profile {profile.name} is carried by {' or '.join(profile.links)}; correct --link"
        )
    try:
        return Device.model_validate(content)
    except ValueError as problem:
        reason = str(problem).splitlines()[2].strip() if len(str(problem).splitlines()) > 2 else str(problem)
        raise WrongUse(f"bring-up: link '{link[:80]}': {reason}; {FORMS} is needed") from None


@dataclass
class Target:
    """The device of a bring-up: how it is reached, and the profile as it answers."""

    link: SingleLink
    profile: Profile

    @property
    def text(self) -> bool:
        """Whether it speaks in lines of text."""
        return self.link.device.link in TEXT_CARRIERS

    def values(self, attempts: int = 1) -> Values:
        """Its values by name, on a new connection."""
        self.link.profile = self.profile
        if self.text:
            return Commands(NAME, self.link.lines(attempts), self.profile)
        return Registers(NAME, self.link.registers(attempts), self.link.device.device_id, self.profile)

    def registers(self, attempts: int = 1) -> Registers:
        """Its registers, on a new connection."""
        values = self.values(attempts)
        if not isinstance(values, Registers):
            raise RecipeInvalid(f"profile {self.profile.name}: registers are needed, it has commands", key="links")
        return values

    def ordered(self, order: WordOrder) -> None:
        """Takes another word order for every register."""
        kept = [register.model_copy(update={"word_order": None}) for register in self.profile.registers]
        self.profile = self.profile.model_copy(update={"word_order": order, "registers": kept})

    def moved(self, shift: int, space: str) -> None:
        """Takes addresses that are ``shift`` further, in another space where it is given."""

        def changed(address: int) -> dict[str, object]:
            return {"address": address + shift, **({"space": space} if space else {})}

        kept = [r.model_copy(update=changed(r.address)) for r in self.profile.registers]
        self.profile = self.profile.model_copy(update={"registers": kept})
