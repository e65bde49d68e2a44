"""The stations that lots are measured on, by the files that the workbench was started with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import WrongUse, did_you_mean
from schemas.station import BUILT_IN, load_station


@dataclass(frozen=True)
class Bench:
    """A station of the operator's page.

    file : None for the built-in one · slots : number of them
    """

    file: Path | None
    name: str
    slots: int
    simulated: bool

    @property
    def address(self) -> str:
        """The station as a lot names it."""
        return str(self.file or "")


def stations(settings: WorkbenchSettings) -> list[Bench]:
    """The stations in the order of the command line; two of one name are told apart by their files.

    Raises
    ------
    RecipeInvalid
        The file of a station was changed and is invalid.
    """
    configs = [(file, load_station(file)) for file in settings.stations or (None,)]
    names = [config.name for _, config in configs]
    return [
        Bench(
            file,
            config.name if names.count(config.name) == 1 else str(file or BUILT_IN),
            config.devices.slots.count,
            config.kind == "simulated",
        )
        for file, config in configs
    ]


def named(known: Sequence[Bench], name: str) -> Bench:
    """The station of this name; the first for none.

    Raises
    ------
    WrongUse
        No station has the name.
    """
    if not name:
        return known[0]
    station = next((one for one in known if one.name == name), None)
    if station is None:
        names = [one.name for one in known]
        raise WrongUse(f"station: none of this workbench is called '{name[:60]}'; {did_you_mean(name, names)}")
    return station


def at(known: Sequence[Bench], address: str) -> Bench:
    """The station of a lot; the first for a lot of a station that this workbench was not started with."""
    return next((one for one in known if one.address == address), known[0])
