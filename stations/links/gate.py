"""The gate that every write passes.

Writes go only to devices that the station's file names, only to what their profiles let be written, and on hardware that a run
drives only while the run holds the station's lease, which is asked as the last thing before each is sent.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Protocol

from schemas.errors import StationRefused, StationTimeout
from stations.clock import steady

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from schemas.profile import Command, Profile, Space
    from stations.links.link import Carrier, TextCarrier


class Lease(Protocol):
    """Whether this process may drive the station; both raise :class:`schemas.errors.LeaseLost` where it may not."""

    def alive(self) -> None:
        """By the age of its own heartbeat alone; costs nothing, and is asked before each reading."""
        ...

    def held(self) -> None:
        """By its heartbeat and by what the lease's files say; asked before each write."""
        ...


@dataclass(frozen=True)
class Permit:
    """What the gate asks on hardware that a run drives: the lease, and that orders are sent ``patience_s`` after a reading."""

    lease: Lease
    patience_s: float

    def require(self, order: str, since: float | None) -> None:
        """Refuses an order that may not be sent now; it is not sent then."""
        self.lease.held()
        late = 0.0 if since is None else steady() - since
        if not late <= self.patience_s:
            raise StationTimeout(
                f"{order}: {late:.1f} s after the reading that it rests on, at most {self.patience_s:g} s is allowed; it was not "
                "sent: this process or machine stood still; look what kept it busy, or raise timeout_s in [link]"
            )


class GatedLink:
    """A link whose writes are held against the profiles of the devices behind it, by device id."""

    def __init__(
        self, link: Carrier, where: str, profiles: Mapping[int, Profile], permit: Permit | None = None
    ) -> None:
        self._link = link
        self._where = where
        self._profiles = dict(profiles)
        self._permit = permit

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words of registers, or bits; a run that has lost its lease is told here, whatever it finds at the station."""
        if self._permit is not None:
            self._permit.lease.alive()
        return self._link.read(device_id, address, count, what, space)

    def write(
        self,
        device_id: int,
        address: int,
        words: Sequence[int],
        what: str,
        space: Space = "holding",
        *,
        since: float | None = None,
    ) -> None:
        """Writes once, whole writable registers of a known device; anything else is refused and never sent.

        Parameters
        ----------
        since : when the reading came that the order rests on; one that is not sent in time is refused
        """
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
        if self._permit is None:
            self._link.write(device_id, address, words, what, space)
            return
        before = partial(self._permit.require, f"{self._where} device {device_id}: write {what}", since)
        before()  # nothing is connected for an order that may not be sent
        self._link.write(device_id, address, words, what, space, before=before)

    def close(self) -> None:
        """Ends the connection."""
        self._link.close()


class GatedLines:
    """A line to one device whose orders are held against its profile."""

    def __init__(self, link: TextCarrier, where: str, profile: Profile, permit: Permit | None = None) -> None:
        self._link = link
        self._where = where
        self._orders = [command for command in profile.commands if command.writable]
        self._questions = {command.ask for command in profile.commands}
        self._name = profile.name
        self._permit = permit

    def ask(self, question: str, what: str) -> str:
        """The answer to a question that the profile has."""
        if question not in self._questions:
            raise self._refusal(question, what)
        if self._permit is not None:
            self._permit.lease.alive()
        return self._link.ask(question, what)

    def tell(self, order: str, what: str) -> str:
        """Gives an order, once, that the profile has."""
        if not any(_fits(command, order) for command in self._orders):
            raise self._refusal(order, what)
        if self._permit is None:
            return self._link.tell(order, what)
        before = partial(self._permit.require, f"{self._where}: {what} '{order}'", None)
        before()
        return self._link.tell(order, what, before=before)

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
