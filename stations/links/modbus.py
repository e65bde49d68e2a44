"""Modbus on any wire: reads are repeated, as they have no side effects; writes are never repeated.

After a failed write it is unknown whether the device acted: the adapter reads back and reports it.
"""

from collections.abc import Callable, Sequence

from schemas.errors import LinkLost, NoConnection, StationRefused, StationTimeout
from schemas.profile import Space
from stations.links.frames import Malformed, Refused, read_request, values_in, write_request
from stations.links.wires import Broken, Silence, Unreachable, Wire

GATEWAY = {10, 11}
REASONS = {
    1: "function not supported",
    2: "no such register, or read-only",
    3: "value refused",
    4: "device failure",
    6: "busy",
    10: "gateway without a path",
    11: "no answer behind the gateway",
}
NAMES = {"holding": "registers", "input": "input registers", "coil": "coils", "discrete": "discrete inputs"}


class WireLink:
    """Registers and bits of the devices on one wire."""

    def __init__(self, wire: Wire, *, read_attempts: int) -> None:
        self._wire = wire
        self._attempts = read_attempts

    def read(self, device_id: int, address: int, count: int, what: str, space: Space = "holding") -> list[int]:
        """Words of registers, or bits; after a time-out or a lost connection the read is repeated on a new connection."""
        purpose = f"read {what} ({count} {NAMES[space]} from {address})"
        request = read_request(space, address, count)
        for _ in range(self._attempts - 1):
            try:
                return self._ask(device_id, request, purpose)
            except _BehindGateway:
                raise
            except (StationTimeout, LinkLost):
                continue
        return self._ask(device_id, request, purpose)

    def write(
        self,
        device_id: int,
        address: int,
        words: Sequence[int],
        what: str,
        space: Space = "holding",
        *,
        before: Callable[[], None] | None = None,
    ) -> None:
        """Writes registers or bits in one request, sent once; not sent where ``before`` raises."""
        purpose = f"write {what} ({len(words)} {NAMES[space]} from {address})"
        self._ask(device_id, write_request(space, address, words), purpose, before)

    def close(self) -> None:
        """Ends the connection."""
        self._wire.close()

    def _ask(self, device_id: int, request: bytes, purpose: str, before: Callable[[], None] | None = None) -> list[int]:
        where = f"{self._wire.where} device {device_id}"
        try:
            return values_in(request, self._wire.exchange(device_id, request, before))
        except Silence:
            raise StationTimeout(
                f"{where}: no answer to '{purpose}' in {self._wire.timeout_s:g} s; check device and cable"
            ) from None
        except Broken as problem:
            message = f"{where}: connection lost at '{purpose}' ({problem}), a listening device is needed"
            kind = NoConnection if isinstance(problem, Unreachable) else LinkLost
            raise kind(f"{message}; check power, network and port") from None
        except Malformed as problem:
            self._wire.close()
            raise LinkLost(f"{where}: no valid answer to '{purpose}' ({problem}); check gateway and cable") from None
        except Refused as problem:
            code = problem.code
            reason = REASONS.get(code, f"exception {code}")
            kind = _BehindGateway if code in GATEWAY else StationRefused
            raise kind(
                f"{where}: exception {code} ({reason}) in answer to '{purpose}'; check the device and its profile"
            ) from None


class _BehindGateway(StationTimeout):
    """The gateway reports that the device behind it does not answer; a repetition has no use."""
