"""Stations: devices behind register-map profiles, the links to them, and the simulated plant that stands in for them."""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from schemas.lot import Lot
    from schemas.station import StationConfig
    from stations.station import Station


def open_station(
    config: "StationConfig", lot: "Lot", resume: bytes | None = None, *, run: str = "a run", roles: Sequence[str] = ()
) -> "AbstractContextManager[Station]":
    """A station ready to be driven, as a context; see :func:`stations.opening.open_station`."""
    from stations.opening import open_station as opened  # noqa: PLC0415 - light until a station is really opened

    return opened(config, lot, resume, run=run, roles=roles)
