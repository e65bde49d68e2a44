"""What the demonstrations measure and write, once in a session."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from once import once

from pipelines.archive import Archive
from pipelines.demo.archive_lots import DemoArchive, Hidden, Line, write_lots
from pipelines.demo.measure import DemoLot, measure
from pipelines.demo.scenes import Scene
from pipelines.discovery.lot_source import DiscoveryArchive


def demonstration(scene: Scene, seed: int, *_: object) -> DemoLot:
    """What the demonstration measures of a scene."""
    return once(f"demo-{scene.kind}-{seed}", lambda _: measure(scene, seed))


def demonstrations_measured_once(patch: pytest.MonkeyPatch) -> None:
    """From now on demonstrations have what was measured before."""
    patch.setattr("pipelines.demo.measure.measure", demonstration)


def wafer_line(folder: Path) -> DemoArchive:
    """A copy of a line of 44 lots whose archive hides a softening spring in one wafer, scored, without attributes."""

    def made(place: Path) -> DemoArchive:
        line = write_lots(place, Line(9, hidden=Hidden("W02", -60e-6), wafers=4), 44)
        DiscoveryArchive(Archive(str(line.folder))).score(1)
        return line

    kept = once("wafer-line", made)
    shutil.copytree(kept.folder, folder / "archive")
    shutil.copy(kept.units, folder)
    return replace(kept, folder=folder / "archive", units=folder / kept.units.name)
