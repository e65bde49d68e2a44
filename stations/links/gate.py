"""The gate: the check of every write before it is sent.

Writes go only to devices in the station file, and only to registers that their profiles declare writable. On hardware that a
run drives, the run must hold the lease of the station; this is the last check before each write is sent.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from schemas.errors import StationRefused, StationTimeout
from schemas.profile import Command, Profile, Space, limits_of
from stations.clock import steady
from stations.links.lines import LineLink
from stations.links.modbus import WireLink


@dataclass(frozen=True)
class Permit:
    """Conditions for a write to hardware in a run: the lease, and at most ``patience_s`` seconds after the reading.

    alive : checks the age of the own heartbeat only; it is fast and is called before each reading
    held : checks the heartbeat and the files of the lease; called before each write. Both raise
        :class:`schemas.errors.LeaseLost` where this process may not drive the station
    """

    alive: Callable[[], None]
    held: Callable[[], None]
    patience_s: float

    def require(self, order: str, since: float | None) -> None:
        """Refuses a command that must not be sent now, before it is sent.

        Raises LeaseLost: this process may not drive the station.
        Raises StationTimeout: the reading that the command depends on is too old.
        """
        self.held()
        late = 0.0 if since is None else steady() - since
        if not late <= self.patience_s:
            raise StationTimeout(
                f"{order}: {late:.1f} s after the reading that it depends on, at most {self.patience_s:g} s is allowed; it was "
                "not sent, as this process or machine stopped for a while; reduce the load, or raise timeout_s in [link]"
            )


class GatedLink:
    """A link that checks each write against the profile of its device, by device id."""

    def __init__(
        self, link: WireLink, where: str, profiles: Mapping[int, Profile], permit: Permit | None = None
    ) -> None:
        self._link = link
        self._where = where
        self._profiles = dict(profiles)
        self._permit = permit

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words of registers, or bits; a run that has lost its lease is refused before the read.

        Raises LeaseLost: the run may not drive the station; nothing was sent.
        Raises StationTimeout, LinkLost, StationRefused: from the link: no answer, no connection or no valid answer after all
            attempts, or a refusal of the device.
        """
        if self._permit is not None:
            self._permit.alive()
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
        """Writes whole writable registers of a known device, once; any other write is refused before it is sent.

        since : time of the reading that the command depends on; a command that is too late is refused
        Raises StationRefused: there is no such device or no such writable registers, and nothing was sent; or the device
            refused.
        Raises LeaseLost: the run may not drive the station; nothing was sent.
        Raises StationTimeout: the command is too late, and was not sent; or no answer came, and whether the device acted is
            unknown.
        Raises LinkLost: from the link: no connection, a lost one, or no valid answer.
        """
        profile = self._profiles.get(device_id)
        if profile is None:
            raise StationRefused(
                f"{self._where} device {device_id}: write {what}, the station file has no such device; add it there"
            )
        if not profile.may_write(space, address, len(words)):
            request = f"write {what} ({len(words)} of {space} from {address})"
            message = (
                f"{self._where} device {device_id}: {request}, profile {profile.name} has no such writable registers"
            )
            raise StationRefused(f"{message}; correct the caller, or the profile")
        if self._permit is None:
            self._link.write(device_id, address, words, what, space)
            return
        before = partial(self._permit.require, f"{self._where} device {device_id}: write {what}", since)
        before()  # no connection is made for a command that must not be sent
        self._link.write(device_id, address, words, what, space, before=before)

    def close(self) -> None:
        """Ends the connection."""
        self._link.close()


class GatedLines:
    """A text connection to one device that checks each command against its profile."""

    def __init__(self, link: LineLink, where: str, profile: Profile, permit: Permit | None = None) -> None:
        self._link = link
        self._where = where
        self._commands = [command for command in profile.commands if command.writable]
        self._queries = {command.ask for command in profile.commands}
        self._name = profile.name
        self._permit = permit

    def ask(self, question: str, what: str) -> str:
        """The answer to a query that the profile contains.

        Raises StationRefused: the profile has no such query, and nothing was sent; or the device refused.
        Raises LeaseLost: the run may not drive the station; nothing was sent.
        Raises StationTimeout, LinkLost: from the link: no answer, or no connection, after all attempts.
        """
        if question not in self._queries:
            raise self._refusal(question, what)
        if self._permit is not None:
            self._permit.alive()
        return self._link.ask(question, what)

    def tell(self, order: str, what: str) -> str:
        """Sends a command that the profile contains, once.

        Raises StationRefused: the profile has no such command or value, and nothing was sent; or the device refused.
        Raises LeaseLost: the run may not drive the station; nothing was sent.
        Raises StationTimeout, LinkLost: from the link: no answer, or a lost connection; whether the device acted is unknown.
        """
        if not any(_fits(command, order) for command in self._commands):
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


_NUMBER = re.compile(r"[+-]?\d+(\.\d*)?([eE][+-]?\d+)?")


def _fits(command: Command, order: str) -> bool:
    """Whether a line is this command with an allowed value; a command that is only asked has none."""
    if not command.writable:
        return False
    head, tail = command.tell.split("{", 1)[0], command.tell.rpartition("}")[2]
    if not (order.startswith(head) and order.endswith(tail) and len(order) > len(head) + len(tail)):
        return False
    value = order[len(head) : len(order) - len(tail)]
    if command.type == "text":
        return value in command.values
    if not _NUMBER.fullmatch(value):  # float() also reads "inf", "1_000" and spaces, which controllers read otherwise
        return False
    low, high = limits_of(command)
    return low <= float(value) <= high
