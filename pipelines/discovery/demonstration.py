"""The demonstration of discoveries: an effect hidden in one wafer of a simulated line is found, and added to the model."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from pipelines.archive import Archive
from pipelines.demo.archive_lots import DemoArchive, Hidden, Line, write_lots
from pipelines.discovery.attributes import added_from
from pipelines.discovery.discover import Look, discovered
from pipelines.discovery.documents import DiscoveryDemo
from schemas.errors import WrongUse

HARDENING = 12e-6  # 1/g²: the output of 1 g falls behind by 12 µg; what a lot's model leaves of it is a tenth of a dwell's noise


def made(folder: Path, seed: int, lots: int, progress: Callable[[int], None]) -> tuple[DemoArchive, Hidden]:
    """Write the archive of a simulated line to a new folder; returns it with the hidden effect.

    Raises
    ------
    WrongUse
        The folder has files.
    """
    if folder.exists() and any(folder.iterdir()):
        raise WrongUse(f"demo: {folder} has files already, a new or empty folder is needed; give another with --folder")
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng([seed, 61])
    hidden = Hidden(wafer=f"W{rng.integers(1, 13):02d}", hardening=float(rng.choice([-1.0, 1.0])) * HARDENING)
    return write_lots(folder, Line(seed, hidden=hidden), lots, progress), hidden


def played(made_: DemoArchive, hidden: Hidden, workers: int, seed: int) -> DiscoveryDemo:
    """The demonstration as a document: the discoveries, and the archive with the found effect in the model of every lot."""
    archive = Archive(str(made_.folder))
    added_from(archive, made_.units, "serial")
    first = discovered(archive, Look(workers=workers)).document
    rows = first["discoveries"]
    found = next((row for row in rows if row["driver"] == "wafer"), None)
    after = discovered(archive, Look(effects=(found["recommended"],))).document if found is not None else None
    return {
        "seed": seed,
        "hidden": {
            "wafer": hidden.wafer,
            "physics": "a spring that hardens" if hidden.hardening > 0 else "a spring that softens",
            "effect": "third_order",
        },
        "discoveries": rows,
        "found": found is not None and "third_order" in found["effects"],
        "wafer_named": found is not None and bool(found["levels"]) and found["levels"][0]["level"] == hidden.wafer,
        "compared": [] if after is None else after["compared"],
        "left": [] if after is None else [row["id"] for row in after["discoveries"]],
        "folder": str(made_.folder.parent),
        "lots": made_.lots,
    }
