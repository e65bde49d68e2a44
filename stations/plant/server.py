"""Servers of the plant on loopback, each in its own thread: Modbus TCP, and lines of text.

An action awaits nothing: pymodbus would otherwise answer one request with the transaction number of the next.
"""

import asyncio
import logging
import socketserver
import threading
from contextlib import AbstractContextManager, suppress
from functools import partial
from typing import Self, get_args

from pymodbus.constants import ExcCodes
from pymodbus.exceptions import NoSuchIdException
from pymodbus.server import ModbusTcpServer
from pymodbus.server.base import ModbusBaseServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice

from schemas.errors import StationRefused
from schemas.profile import BITS, Profile, Space
from stations.codec import NotEncodable
from stations.listening import listening
from stations.plant.bank import Busy
from stations.plant.faults.base import MUTE
from stations.plant.plant import Plant

LOOPBACK = "127.0.0.1"
WORD = 16
SPACES: dict[int, Space] = {
    1: "coil", 5: "coil", 15: "coil", 2: "discrete", 4: "input",
    3: "holding", 6: "holding", 16: "holding", 22: "holding", 23: "holding",
}  # fmt: skip
START_S = 20.0
END = b"\r\n"
LONGEST = 256


def sim_device(device_id: int, profile: Profile, plant: Plant) -> SimDevice:
    """The pymodbus device of a bank: every register of its profile and no other."""
    data = {space: _blocks(profile, space) for space in get_args(Space)}
    if profile.fifo is not None:
        fifo = profile.fifo
        data["holding"].append(SimData(fifo.address, count=fifo.registers, datatype=DataType.REGISTERS, readonly=True))
    action = partial(_answer, plant, device_id)
    if not any(data[space] for space in ("coil", "discrete", "input")):
        return SimDevice(device_id, simdata=data["holding"], action=action)
    empty = {"coil": _bits(0, 1), "discrete": _bits(0, 1), "input": _words(0, 1), "holding": _words(0, 1)}
    filled = [data[space] or [empty[space]] for space in ("coil", "discrete", "holding", "input")]
    return SimDevice(device_id, simdata=(filled[0], filled[1], filled[2], filled[3]), action=action)


def _blocks(profile: Profile, space: Space) -> list[SimData]:
    """The registers of one space; bits form a single block, whose gaps are refused at each request."""
    registers = [r for r in profile.registers if r.space == space]
    if space not in BITS or not registers:
        return [_words(r.address, r.words, readonly=not r.writable) for r in registers]
    first = min(r.address for r in registers)
    return [_bits(first, max(r.end for r in registers) - first)]


def _words(address: int, count: int, *, readonly: bool = True) -> SimData:
    return SimData(address, count=count, values=0, datatype=DataType.REGISTERS, readonly=readonly)


def _bits(address: int, count: int) -> SimData:
    return SimData(address, values=[False] * count, datatype=DataType.BITS)


async def _answer(
    plant: Plant,
    device_id: int,
    function: int,
    start: int,
    address: int,
    count: int,
    registers: list[int],
    written: list[int] | list[bool] | None,
) -> ExcCodes | None:
    """Fills the registers of a read, or passes on the values of a write."""
    space = SPACES[function]
    if not plant.banks[device_id].has(address, space):
        return ExcCodes.ILLEGAL_ADDRESS
    with plant.lock:
        plant.requested.add(device_id)
        code = plant.exception_of(device_id)
        if code == MUTE:
            raise NoSuchIdException  # the server is set to ignore missing devices, so it sends no answer
        try:
            if code == 0 and written is not None:
                code = plant.write(device_id, address, [int(word) for word in written], space)
            if code != 0:
                return ExcCodes(code)
            if written is None:
                _fill(plant, device_id, space, (address, count), (start, registers))
        except NotEncodable:
            return ExcCodes.ILLEGAL_VALUE
        except Busy:
            return ExcCodes.DEVICE_BUSY
    return None


def _fill(plant: Plant, device_id: int, space: Space, span: tuple[int, int], block: tuple[int, list[int]]) -> None:
    """Copies values of a device into the words of pymodbus, which hold sixteen bits each."""
    (address, count), (start, registers) = span, block
    bits = space in BITS
    for first, values in plant.read(device_id, address, count * WORD if bits else count, space):
        if not bits:
            registers[first - start : first - start + len(values)] = values
            continue
        for position, value in enumerate(values, first):
            word, bit = position // WORD - start, position % WORD
            if word < len(registers):
                registers[word] = registers[word] & ~(1 << bit) | value << bit


class _Handler(ServerRequestHandler):
    """A connection whose requests are tasks of the server's own loop.

    pymodbus hands each request over as if it came from another thread, which wakes the loop three more times for a request.
    """

    def handle_later(self) -> None:
        """Answers the request that was decoded."""
        task = self.loop.create_task(self.handle_request())
        _TASKS.add(task)
        task.add_done_callback(_TASKS.discard)


_TASKS: set[asyncio.Task[None]] = set()  # requests under way: a loop itself keeps its tasks only weakly


class _TcpServer(ModbusTcpServer):
    def callback_new_connection(self) -> ServerRequestHandler:
        """The handler of a new connection."""
        return _Handler(self, self.trace_packet, self.trace_pdu, self.trace_connect)


class PlantServer:
    """Serves a plant while the context is open; ``port`` is its port."""

    def __init__(self, plant: Plant, host: str = LOOPBACK, port: int = 0) -> None:
        self._plant = plant
        self.host = host
        self.port = port
        self._ready = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: ModbusBaseServer | None = None
        self._thread = threading.Thread(target=lambda: asyncio.run(self._serve()), name="plant-server", daemon=True)

    def __enter__(self) -> Self:
        """Starts, and waits until the port listens."""
        logging.getLogger("pymodbus").setLevel(logging.CRITICAL)  # the client gets its errors as answers
        self._thread.start()
        if not self._ready.wait(START_S) or self._server is None:
            raise StationRefused(
                f"simulated station: {self.host}:{self.port} cannot listen, a free port is needed; give one"
            )
        return self

    def __exit__(self, *_: object) -> None:
        if self._loop is not None and self._server is not None and self._thread.is_alive():
            asyncio.run_coroutine_threadsafe(self._server.shutdown(), self._loop).result(START_S)
        self._thread.join(START_S)

    async def _serve(self) -> None:
        self._loop = asyncio.get_running_loop()
        devices = [sim_device(i, bank.profile, self._plant) for i, bank in self._plant.banks.items()]
        server = self.make(devices)
        try:
            await server.serve_forever(background=True)
        except (RuntimeError, OSError):  # the port is in use; the waiting thread reports it
            self._ready.set()
            return
        self.port = self.listening_at(server)
        self._server = server
        self._ready.set()
        await server.serving

    def make(self, devices: list[SimDevice]) -> ModbusBaseServer:
        """The server for TCP; servers for other wires override this method."""
        return _TcpServer(devices, address=(self.host, self.port), ignore_missing_devices=True)

    def listening_at(self, server: ModbusBaseServer) -> int:
        """The port of a listening server."""
        transport = server.transport
        if not isinstance(transport, asyncio.Server):
            raise StationRefused("simulated station: the server cannot listen, a free port is needed; give one")
        return int(transport.sockets[0].getsockname()[1])


def serve_lines(plant: Plant, device_id: int, host: str = LOOPBACK, port: int = 0) -> AbstractContextManager[int]:
    """The port of a device with a text protocol, which is served while the context is open."""

    class Lines(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            """Sends one answer for each line; none while the device does not respond."""
            with suppress(OSError):
                while line := self.rfile.readline(LONGEST):
                    answer = plant.send_line(device_id, line.rstrip(END).decode("ascii", errors="replace"))
                    if answer is not None:
                        self.wfile.write(answer.encode("ascii", errors="replace") + END)

    return listening(Lines, host, port, "simulated station")
