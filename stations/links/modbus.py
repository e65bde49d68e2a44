"""Modbus TCP through pymodbus' synchronous client.

pymodbus re-sends writes on a time-out by default, so that a slow device acts several times: retries are off here.
Reads are repeated by this module, which is safe: reading changes nothing in any device of this project.
"""

from __future__ import annotations

import logging
from typing import TYPE_CHECKING

from pymodbus.client import ModbusTcpClient
from pymodbus.exceptions import ConnectionException, ModbusIOException

from schemas.errors import LinkLost, StationRefused, StationTimeout

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from pymodbus.pdu import ModbusPDU

LONGEST_READ = 125  # registers in one request (Modbus Application Protocol 1.1b3, 6.3)
GATEWAY = {10, 11}
BUSY = 6
REASONS = {
    1: "function not supported",
    2: "no such register, or read-only",
    3: "value refused",
    4: "device failure",
    6: "busy",
    10: "gateway without a path",
    11: "no answer behind the gateway",
}


class ModbusLink:
    """One connection, made when it is first needed and again after it broke."""

    def __init__(self, host: str, port: int, *, timeout_s: float, read_attempts: int) -> None:
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # its errors are raised here, with names
        self._where = f"{host}:{port}"
        self._attempts = read_attempts
        self._client = ModbusTcpClient(host, port=port, timeout=timeout_s, retries=0, reconnect_delay_max=5)

    def read(self, device_id: int, address: int, count: int, what: str) -> list[int]:
        """Words of ``count`` holding registers; a time-out is tried again on a fresh connection."""
        asked = f"read {what} ({count} registers from {address})"
        for attempt in range(self._attempts):
            try:
                answer = self._ask(
                    lambda: self._client.read_holding_registers(address, count=count, device_id=device_id),
                    device_id,
                    asked,
                )
            except (StationTimeout, LinkLost) as problem:
                if attempt + 1 == self._attempts or isinstance(problem, _BehindGateway):
                    raise
            else:
                return self._checked(list(answer.registers), count, device_id, asked)
        message = f"{self._where} device {device_id}: no attempt to {asked} was allowed; set read_attempts to 1 or more"
        raise StationTimeout(message)

    def write(self, device_id: int, address: int, words: Sequence[int], what: str) -> None:
        """Writes holding registers in one request, sent once: after a failure nobody knows whether it acted."""
        asked = f"write {what} ({len(words)} registers from {address})"
        self._ask(lambda: self._client.write_registers(address, list(words), device_id=device_id), device_id, asked)

    def close(self) -> None:
        """Ends the connection."""
        self._client.close()

    def _ask(self, request: Callable[[], ModbusPDU], device_id: int, asked: str) -> ModbusPDU:
        where = f"{self._where} device {device_id}"
        try:
            answer = request()
        except ModbusIOException:
            self._client.close()  # an answer that comes late must not meet the next question
            message = f"{where}: no answer to '{asked}' in {self._client.comm_params.timeout_connect:g} s; check device and cable"
            raise StationTimeout(message) from None
        except ConnectionException:
            self._client.close()
            message = (
                f"{where}: connection lost at '{asked}', a listening device is needed; check power, network and port"
            )
            raise LinkLost(message) from None
        if answer.isError():
            _refuse(where, asked, int(answer.exception_code))
        return answer

    def _checked(self, words: list[int], count: int, device_id: int, asked: str) -> list[int]:
        if len(words) != count:
            message = (
                f"{self._where} device {device_id}: {len(words)} registers answered '{asked}', {count} are needed; "
                "check the profile"
            )
            raise StationRefused(message)
        return words


class _BehindGateway(StationTimeout):
    """The gateway answered that the device behind it does not: asking again gains nothing."""


def _refuse(where: str, asked: str, code: int) -> None:
    reason = REASONS.get(code, f"exception {code}")
    message = f"{where}: '{asked}' was answered with exception {code} ({reason}); check the device and its profile"
    if code in GATEWAY:
        raise _BehindGateway(message)
    raise StationRefused(message)
