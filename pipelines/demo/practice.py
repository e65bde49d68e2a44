"""A served station to practise on: the file by which a run reaches it, and the faults that are typed while it is served."""

import os
import select
import socket
from collections.abc import Callable
from contextlib import suppress
from importlib.resources import files

from pipelines.jobs.recipes import load_recipe, lot_of
from schemas.errors import TumblelineError
from schemas.fault import parse_fault
from schemas.lot import Lot
from schemas.station import StationConfig
from schemas.toml_files import parse_as
from stations.plant.plant import Plant

RECIPE = "practice"
PORT = 5020
LONGEST_LINE = 4096


def practice_lot() -> Lot:
    """The units of the recipe ``practice``, which sit in the slots of the served station."""
    return lot_of(load_recipe(RECIPE), ())


def practice_file(port: int = PORT) -> tuple[str, StationConfig]:
    """The station file of kind modbus for a station served at a port of this machine, as text and read."""
    text = files("stations").joinpath("practice.toml").read_text("utf-8").replace(f"port = {PORT}", f"port = {port}")
    return text, parse_as(StationConfig, text, "stations/practice.toml")


def free_port() -> int:
    """The port of the file, or 0, which means any, where another program has it."""
    with suppress(OSError), socket.create_server(("127.0.0.1", PORT)):
        return PORT
    return 0


class TypedFaults:
    """Faults that a person types as lines ``kind:key=value``, each from now on; ``tell`` gets what became of a line."""

    def __init__(self, tell: Callable[[str], None], source: int = 0) -> None:
        self._tell, self._source, self._rest = tell, source, b""
        self._open = True

    def __call__(self, plant: Plant) -> None:
        """Passes on the lines that have come since the last call; never waits."""
        if not self._open:
            return
        try:
            if not select.select([self._source], [], [], 0.0)[0]:
                return
            read = os.read(self._source, LONGEST_LINE)
        except (OSError, ValueError):  # closed, or a terminal of which this is no longer the foreground program
            read = b""
        self._open = bool(read)
        *lines, self._rest = (self._rest + read).split(b"\n")
        for line in lines:
            if text := line.decode("utf-8", errors="replace").strip():
                self._tell(_begun(plant, text))


def _begun(plant: Plant, text: str) -> str:
    """Begins the fault that a line orders; what the person is told."""
    try:
        order = parse_fault(text)
        plant.inject(order.model_copy(update={"at_s": plant.now}))
    except TumblelineError as problem:
        return str(problem)
    return f"{text}: begins now" + ("" if order.for_s is None else f", ends in {order.for_s:g} s of the station")
