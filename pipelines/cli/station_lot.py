"""Shared options for simulated stations, and the lot in a simulated station."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from pipelines.cli.options import option

if TYPE_CHECKING:
    from schemas.lot import Lot

DeviceOption = Annotated[str, option("--device", "Preset of the simulated devices under test.")]
UnitsOption = Annotated[int, option("--units", "Number of simulated devices in the slots.", min=1, max=32)]


def made_up(device: str, units: int, seed: int, repeat: int = 0) -> Lot:
    """A lot with generated serial numbers, one per slot."""
    from schemas.lot import Lot, Unit

    sitting = [Unit(serial=f"SIM{i:04d}", slot=i) for i in range(units)]
    return Lot(units=sitting, device=device, seed=seed, repeat=repeat)
