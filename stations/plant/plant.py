"""The simulated station: its world behind the registers of its devices, with faults and a journal.

Clients change it by writes to registers and by lines of text, and by nothing else.
"""

from collections.abc import Sequence
from functools import partial

from schemas.fault import FaultOrder
from schemas.lot import Lot
from schemas.profile import Space
from schemas.simulation import Simulation
from schemas.station import StationConfig
from stations.plant.banks import build_banks, build_line_devices
from stations.plant.faults.base import Fault
from stations.plant.faults.catalogue import build_fault
from stations.plant.hidden import HiddenEffect
from stations.plant.journal import Injection, Journal, LineOrder, Write, fingerprint
from stations.plant.world import World


class Plant(World):
    """A simulated world and the devices through which a client reads and changes it."""

    def __init__(self, config: StationConfig, lot: Lot, hidden: Sequence[HiddenEffect] = ()) -> None:
        super().__init__(config, lot, hidden)
        self._devices = config.devices
        self.requested: set[int] = set()  # ids of devices that had a request since IdleStop last cleared this
        self.faults: list[Fault] = []
        self.banks = build_banks(self, config.devices, config.fitted())
        self.line_devices = build_line_devices(self, config.devices, config.fitted())
        self.journal = Journal(fingerprint(config, lot))
        for order in (config.simulation or Simulation()).faults:
            self._arrange(order)

    def read(self, device_id: int, address: int, count: int, space: Space = "holding") -> list[tuple[int, list[int]]]:
        """Words, or bits, of every register in a span, each with its address, as the device reports them now."""
        registers = self.banks[device_id].read(address, count, space)
        for fault in self._active(device_id):
            registers = [(first, fault.on_read(self.now_us, first, words)) for first, words in registers]
        return registers

    def write(self, device_id: int, address: int, words: list[int], space: Space = "holding") -> int:
        """Writes to registers at the plant's time and returns the exception code of the answer.

        A write that the device refuses is not journalled.
        """
        with self.lock:
            bank, code = self.banks[device_id], 0
            for fault in self._active(device_id):
                held = [word for _, part in bank.read(address, len(words), space) for word in part]
                present = held if len(held) == len(words) else None
                code = fault.on_write(words, present, partial(bank.write, address, space=space))
                break
            else:
                bank.write(address, words, space)
            self.journal.add(Write(self.now_us, device_id, address, tuple(words), space))
            return code

    def send_line(self, device_id: int, line: str) -> str | None:
        """The answer of a device with a text protocol to a line, at the plant's time; None where it does not answer."""
        with self.lock:
            if self.exception_of(device_id):
                return None
            answer, acted = self.line_devices[device_id].answer(line)
            if acted:
                self.journal.add(LineOrder(self.now_us, device_id, line))
            return answer

    def inject(self, order: FaultOrder) -> None:
        """Arranges a fault and journals it."""
        with self.lock:
            self._arrange(order)
            self.journal.add(Injection(self.now_us, order))

    def resume(self, state: bytes) -> None:
        """Takes this fresh plant through the events of ``state`` to its time; see :meth:`Journal.recorded`."""
        events, now_us = self.journal.recorded(state)
        for event in events:
            self.advance(event.at_us - self.now_us)
            if isinstance(event, Injection):
                self.inject(event.fault)
            elif isinstance(event, LineOrder):
                self.send_line(event.device_id, event.line)
            else:
                self.write(event.device_id, event.address, list(event.words), event.space)
        self.advance(now_us - self.now_us)

    def exception_of(self, device_id: int) -> int:
        """The exception code with which the device answers every request now; 0 where it answers normally."""
        return next((code for fault in self._active(device_id) if (code := fault.answers())), 0)

    def _arrange(self, order: FaultOrder) -> None:
        fault = build_fault(order, self.serials)
        if order.device:
            fault.device_id = int(getattr(self._devices, order.device).device_id)
        if order.serial:
            fault.unit = self.serials.index(order.serial)
            fault.device_id = self._devices.slots.device_id + self.slots[fault.unit]
        self.faults.append(fault)
        number = 2 * len(self.faults)
        self.schedule(order.at_s, number, fault.begins)
        if order.for_s is not None:
            self.schedule(order.until_s, number + 1, fault.ends)
        self.advance(0)

    def _active(self, device_id: int) -> list[Fault]:
        now = self.now
        return [f for f in self.faults if f.device_id == device_id and f.order.at_s <= now < f.order.until_s]


class PlantClock:
    """Time of the simulated world in whole microseconds, so that the division of a sleep into parts has no effect."""

    def __init__(self, world: World) -> None:
        self._world = world

    def now(self) -> float:
        """Seconds since power-on of the plant."""
        return self._world.now + self._world.clock_offset_s

    def sleep(self, seconds: float) -> None:
        """Advances the time of the plant."""
        self._world.advance(max(0, round(seconds * 1e6)))
