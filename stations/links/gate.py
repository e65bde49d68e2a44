"""The gate that every write passes: only to devices that the station's file names, only to what their profiles let be written."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from schemas.errors import StationRefused

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from schemas.profile import Command, Profile, Space
    from stations.links.link import Link, TextLink


class GatedLink:
    """A link whose writes are held against the profiles of the devices behind it, by device id."""

    def __init__(self, link: Link, where: str, profiles: Mapping[int, Profile]) -> None:
        self._link = link
        self._where = where
        self._profiles = dict(profiles)

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words of registers, or bits."""
        return self._link.read(device_id, address, count, what, space)

    def write(self, device_id: int, address: int, words: Sequence[int], what: str, space: Space = "holding") -> None:
        """Writes once, whole writable registers of a known device; anything else is refused and never sent."""
        profile = self._profiles.get(device_id)
        if profile is None:
            raise StationRefused(
                f"{self._where} device {device_id}: write {what}, the station's file names no such device; name it there"
            )
        if not profile.may_write(space, address, len(words)):
            found = f"write {what} ({len(words)} of {space} from {address})"
            message = (
                f"{self._where} device {device_id}: {found}, profile {profile.name} lists no such writable registers"
            )
            raise StationRefused(f"{message}; correct the caller, or the profile")
        self._link.write(device_id, address, words, what, space)

    def close(self) -> None:
        """Ends the connection."""
        self._link.close()


class GatedLines:
    """A line to one device whose orders are held against its profile."""

    def __init__(self, link: TextLink, where: str, profile: Profile) -> None:
        self._link = link
        self._where = where
        self._orders = [command for command in profile.commands if command.writable]
        self._questions = {command.ask for command in profile.commands}
        self._name = profile.name

    def ask(self, question: str, what: str) -> str:
        """The answer to a question that the profile has."""
        if question not in self._questions:
            raise self._refusal(question, what)
        return self._link.ask(question, what)

    def tell(self, order: str, what: str) -> str:
        """Gives an order, once, that the profile has."""
        if not any(_fits(command, order) for command in self._orders):
            raise self._refusal(order, what)
        return self._link.tell(order, what)

    def close(self) -> None:
        """Ends the connection."""
        self._link.close()

    def _refusal(self, line: str, what: str) -> StationRefused:
        message = f"{self._where}: {what} '{line}', profile {self._name} has no such command; correct the caller, or the profile"
        return StationRefused(message)


def _fits(command: Command, order: str) -> bool:
    """Whether an order is this command with a value that it may have."""
    head = command.tell.split("{", 1)[0]
    value = order.removeprefix(head)
    if value == order:
        return False
    if command.type == "text":
        return value in command.values
    try:
        number = float(value)
    except ValueError:
        return False
    low = -math.inf if command.minimum is None else command.minimum
    high = math.inf if command.maximum is None else command.maximum
    return low <= number <= high
