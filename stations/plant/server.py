"""The plant's Modbus TCP server, in a thread of its own, on loopback.

Nothing is awaited inside an action: pymodbus would answer one request under the next one's number.
"""

from __future__ import annotations

import asyncio
import logging
import threading
from functools import partial
from typing import TYPE_CHECKING, Self

from pymodbus.constants import ExcCodes
from pymodbus.exceptions import NoSuchIdException
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from schemas.errors import StationRefused
from stations.codec import NotEncodable
from stations.plant.bank import Busy
from stations.plant.faults.base import MUTE

if TYPE_CHECKING:
    from types import TracebackType

    from schemas.profile import Profile
    from stations.plant.plant import Plant

LOOPBACK = "127.0.0.1"
START_S = 20.0


def sim_device(device_id: int, profile: Profile, plant: Plant) -> SimDevice:
    """What pymodbus needs to serve a bank: every register of its profile, none beside them."""
    data = [
        SimData(r.address, count=r.words, values=0, datatype=DataType.REGISTERS, readonly=r.access == "read")
        for r in profile.registers
    ]
    if profile.fifo is not None:
        fifo = profile.fifo
        data.append(SimData(fifo.address, count=fifo.registers, datatype=DataType.REGISTERS, readonly=True))
    return SimDevice(device_id, simdata=data, action=partial(_answer, plant, device_id))


async def _answer(
    plant: Plant,
    device_id: int,
    _function: int,
    start: int,
    address: int,
    count: int,
    registers: list[int],
    written: list[int] | list[bool] | None,
) -> ExcCodes | None:
    """Fills the registers that are read, or hands on those that are written."""
    with plant.lock:
        code = plant.answer_of(device_id)
        if code == MUTE:
            raise NoSuchIdException  # the server, told to ignore missing devices, sends nothing
        try:
            if code == 0 and written is not None:
                code = plant.write(device_id, address, [int(word) for word in written])
            if code != 0:
                return ExcCodes(code)
            if written is None:
                for first, words in plant.read(device_id, address, count):
                    registers[first - start : first - start + len(words)] = words
        except NotEncodable:
            return ExcCodes.ILLEGAL_VALUE
        except Busy:
            return ExcCodes.DEVICE_BUSY
    return None


class PlantServer:
    """Serves a plant while the context is open; ``port`` is the one it got."""

    def __init__(self, plant: Plant, host: str = LOOPBACK, port: int = 0) -> None:
        self._plant = plant
        self.host = host
        self.port = port
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: ModbusTcpServer | None = None
        self._thread = threading.Thread(target=self._run, name="plant-server", daemon=True)

    def __enter__(self) -> Self:
        """Starts, and waits until the port listens."""
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # its errors reach the client as answers
        self._thread.start()
        if not self._ready.wait(START_S) or self._server is None:
            message = f"simulated station: {self.host}:{self.port} does not listen; give a free port"
            raise StationRefused(message)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stops the server and its thread."""
        if self._loop is not None and self._server is not None and self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(START_S)
        self._thread.join(START_S)

    def _run(self) -> None:
        asyncio.run(self._serve())

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        devices = [sim_device(i, bank.profile, self._plant) for i, bank in self._plant.banks.items()]
        server = ModbusTcpServer(devices, address=(self.host, self.port), ignore_missing_devices=True)
        try:
            await server.serve_forever(background=True)
        except (RuntimeError, OSError):  # the port is taken: told by the thread that waits
            self._ready.set()
            return
        self.port = _port(server)
        self._server = server
        self._ready.set()
        await server.serving


def _port(server: ModbusTcpServer) -> int:
    """The port that a listening server has got."""
    transport = server.transport
    if not isinstance(transport, asyncio.Server):
        message = "simulated station: the server does not listen; give a free port"
        raise StationRefused(message)
    return int(transport.sockets[0].getsockname()[1])
