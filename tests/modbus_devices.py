"""Servers that are not ours, with registers laid out by a profile: libmodbus (by ctypes) and a plain pymodbus data store."""

import asyncio
import ctypes
import ctypes.util
import socket
import threading
from contextlib import contextmanager

import pytest
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from stations.codec import encode

VALUES = {
    "part_number": "F4T1A2-REAL", "temperature": 22.4, "set_point": 25.0, "working_set_point": 25.0, "set_point_low": -70.0,
    "set_point_high": 180.0, "power": 12.5, "ramp_rate": 3.0, "mode": "automatic", "actual_mode": "automatic",
    "alarm_1": "inactive", "temperature_unit": "celsius", "program_state": "off", "ramp_action": "set_point",
    "ramp_scale": "per_minute", "event_1": "off", "event_2": "off", "event_3": "off", "event_4": "on",
}  # fmt: skip
"""What a controller of the F4T's register map holds at rest."""


def words_of(profile, values=VALUES):
    """Address and words of every register of a profile that can be read."""
    content = {}
    for register in profile.registers:
        value = values.get(register.name, 0)
        value = register.enumeration.get(value, value) if isinstance(value, str) and register.enumeration else value
        for k, word in enumerate(
            encode(register.model_copy(update={"minimum": None, "maximum": None}), profile.order(register), value)
        ):
            content[register.address + k] = word
    return content


@contextmanager
def libmodbus_server(words, device_id=1):
    """A server of libmodbus, whose own reply function answers from its mapping; gives its port."""
    try:
        library = ctypes.CDLL(ctypes.util.find_library("modbus") or "libmodbus.so.5")
    except OSError:
        pytest.skip("libmodbus is not installed; 'make debian' as root installs it with mbpoll")
    for name in ("modbus_new_tcp", "modbus_mapping_new_start_address"):
        getattr(library, name).restype = ctypes.c_void_p
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    first, last = min(words), max(words)
    context = ctypes.c_void_p(library.modbus_new_tcp(b"127.0.0.1", port))
    mapping = ctypes.c_void_p(library.modbus_mapping_new_start_address(0, 0, 0, 0, first, last - first + 1, 0, 0))

    class Mapping(ctypes.Structure):
        _fields_ = [(f"n{k}", ctypes.c_int) for k in range(8)] + [(f"p{k}", ctypes.c_void_p) for k in range(4)]

    pointers = ctypes.cast(mapping, ctypes.POINTER(Mapping)).contents
    registers = ctypes.cast(pointers.p3, ctypes.POINTER(ctypes.c_uint16))
    for address, word in words.items():
        registers[address - first] = word
    library.modbus_set_slave(context, device_id)
    listening = library.modbus_tcp_listen(context, 4)
    stop = threading.Event()

    def serve():
        query = (ctypes.c_uint8 * 260)()
        handle = ctypes.c_int(listening)
        while not stop.is_set():
            if library.modbus_tcp_accept(context, ctypes.byref(handle)) < 0:
                return
            while (size := library.modbus_receive(context, query)) >= 0:
                if size > 0:
                    library.modbus_reply(context, query, size, mapping)
            library.modbus_close(context)

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    try:
        yield port
    finally:
        stop.set()
        with socket.create_connection(("127.0.0.1", port), timeout=5.0):
            pass
        thread.join(5.0)
        socket.socket(fileno=listening).close()


@contextmanager
def pymodbus_server(words, device_id=1):
    """A server of pymodbus with a plain data store, as in its own examples; gives its port."""
    runs = []
    for address in sorted(words):
        if runs and runs[-1][0] + len(runs[-1][1]) == address:
            runs[-1][1].append(words[address])
        else:
            runs.append((address, [words[address]]))
    blocks = [SimData(address, values=values, datatype=DataType.REGISTERS) for address, values in runs]
    ready, ports, loops = threading.Event(), [], []

    async def serve():
        loops.append(asyncio.get_running_loop())
        server = ModbusTcpServer([SimDevice(device_id, simdata=blocks)], address=("127.0.0.1", 0))
        await server.serve_forever(background=True)
        ports.extend((server.transport.sockets[0].getsockname()[1], server))
        ready.set()
        await server.serving

    thread = threading.Thread(target=lambda: asyncio.run(serve()), daemon=True)
    thread.start()
    assert ready.wait(20.0)
    try:
        yield ports[0]
    finally:
        asyncio.run_coroutine_threadsafe(ports[1].shutdown(), loops[0]).result(10.0)
        thread.join(10.0)
