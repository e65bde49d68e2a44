"""Opening a station: links, profiles and adapters put together; the one place that knows simulation from hardware."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from stations.clock import Clock, WallClock
from stations.devices.chamber import ThermalChamber
from stations.devices.reader import Reader
from stations.devices.registers import Registers
from stations.devices.slot import Slot
from stations.devices.table import TableAxis, TiltTable
from stations.links.modbus import ModbusLink
from stations.profile_files import load_profile
from stations.station import Station

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schemas.recipe import Lot
    from schemas.station import Device, StationConfig
    from stations.plant.hidden import HiddenEffect
    from stations.plant.plant import Plant

Address = tuple[str, int]


@dataclass
class _Links:
    """Links by address; a simulated station puts all of its devices at one."""

    config: StationConfig
    simulated_at: Address | None = None
    made: dict[Address, ModbusLink] = field(default_factory=dict[Address, ModbusLink])

    def to(self, host: str, port: int) -> ModbusLink:
        """The link to an address, made once."""
        address = self.simulated_at or (host, port)
        if address not in self.made:
            patience = self.config.link
            self.made[address] = ModbusLink(
                *address, timeout_s=patience.timeout_s, read_attempts=patience.read_attempts
            )
        return self.made[address]

    def close(self) -> None:
        """Closes every link."""
        for link in self.made.values():
            link.close()


@contextmanager
def open_station(
    config: StationConfig, lot: Lot, resume: bytes | None = None, *, hidden: Sequence[HiddenEffect] = ()
) -> Generator[Station]:
    """A station ready to be driven; closed when the context ends.

    Parameters
    ----------
    config : what the station is
    lot : the units in it; a simulated station makes their devices
    resume : ``Station.state()`` of an earlier session: a simulated station goes on exactly there; hardware is where it is
    hidden : physics beyond the station's file, for simulated stations
    """
    with ExitStack() as stack:
        if config.kind == "simulated":
            plant = make_plant(config, lot, resume, hidden)
            yield stack.enter_context(serve_plant(config, lot, plant))
            return
        links = _Links(config)
        stack.callback(links.close)
        yield _assemble(config, lot, links, WallClock(), lambda: b"")


def make_plant(
    config: StationConfig, lot: Lot, resume: bytes | None = None, hidden: Sequence[HiddenEffect] = ()
) -> Plant:
    """The plant of a simulated station, taken to where ``resume`` says."""
    from stations.plant.plant import Plant  # noqa: PLC0415 - hardware needs no plant

    plant = Plant(config, lot, hidden)
    if resume:
        plant.journal.replay(resume, plant)
    return plant


@contextmanager
def serve_plant(config: StationConfig, lot: Lot, plant: Plant) -> Generator[Station]:
    """A station whose devices are the plant's, over Modbus TCP on loopback."""
    from stations.plant.clock import PlantClock  # noqa: PLC0415 - hardware needs no plant
    from stations.plant.faults.wire import on_the_wire  # noqa: PLC0415
    from stations.plant.server import PlantServer  # noqa: PLC0415

    with PlantServer(plant) as server, on_the_wire(plant, server.host, server.port) as address:
        links = _Links(config, address)
        try:
            yield _assemble(config, lot, links, PlantClock(plant), lambda: plant.journal.state(plant.now_us))
        finally:
            links.close()


def _assemble(config: StationConfig, lot: Lot, links: _Links, clock: Clock, state: Callable[[], bytes]) -> Station:
    """The station's adapters on their links."""

    def registers(name: str, device: Device) -> Registers:
        return Registers(name, links.to(device.host, device.port), device.device_id, load_profile(device.profile))

    devices, limits = config.devices, config.limits
    low, high = limits.temperature_C
    outer = TableAxis(registers("outer axis", devices.outer), (limits.outer_deg[0], limits.outer_deg[1]), limits)
    inner = TableAxis(registers("inner axis", devices.inner), (limits.inner_deg[0], limits.inner_deg[1]), limits)
    slots = {unit.slot: Slot(_slot_registers(config, links, unit.slot)) for unit in lot.units}
    return Station(
        name=config.name,
        clock=clock,
        table=TiltTable(outer, inner, clock),
        chamber=ThermalChamber(registers("chamber", devices.chamber), low, high),
        reader=Reader(registers("reader", devices.reader), slots, limits.rate_hz),
        soak_limits=config.soak,
        state=state,
    )


def _slot_registers(config: StationConfig, links: _Links, slot: int) -> Registers:
    where = config.devices.slots
    return Registers(
        f"slot {slot}", links.to(where.host, where.port), where.device_id + slot, load_profile(where.profile)
    )
