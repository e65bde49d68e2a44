"""An archive of many lots with something hidden in one wafer, for the demonstration of discoveries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pandas as pd

from pipelines.archive import Archive, code_hash, stage_key
from pipelines.archive.keys import digest
from pipelines.demo.archive_lots import STATIONS, Line

EFFECTS = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
DEVICE = "DEMO"
A_NIGHT = 20
BEGIN = datetime(2026, 1, 5, 6, tzinfo=UTC)


@dataclass(frozen=True)
class DemoArchive:
    """What was written: the archive, and the table of what is known of its units."""

    folder: Path
    units: Path
    lots: int


def write_lots(folder: Path, line: Line, lots: int, progress: Callable[[int], None] = lambda _: None) -> DemoArchive:
    """Write lots of a line as runs of an archive, and ``units.csv`` with the wafer of each unit beside it.

    Parameters
    ----------
    progress : is told the number of lots that are written
    """
    archive = Archive(str(folder / "archive"))
    archive.prepare()
    known: list[pd.DataFrame] = []
    for number in range(lots):
        station = STATIONS[number % len(STATIONS)]
        dwells, about = line.lot(station)
        known.append(about[["unit", "wafer"]].rename(columns={"unit": "serial"}))
        write_run(archive, number, station, dwells, about)
        progress(number + 1)
    units = folder / "units.csv"
    pd.concat(known, ignore_index=True).to_csv(units, index=False)
    return DemoArchive(folder / "archive", units, lots)


def write_run(archive: Archive, number: int, station: str, dwells: pd.DataFrame, about: pd.DataFrame) -> None:
    """One run: its dwells, as an import of a simulated lot."""
    when = BEGIN + timedelta(days=number // A_NIGHT, minutes=40 * (number % A_NIGHT))
    units = [{"serial": str(s), "slot": int(k)} for s, k in zip(about["unit"], about["slot"], strict=True)]
    described = {
        "when": when.isoformat(timespec="seconds"),
        "name": f"simulated lot {number}",
        "lot": {"device": DEVICE, "units": units},
        "station": {"name": station, "kind": "simulated"},
        "recipe": {"name": "line", "effects": list(EFFECTS), "formulas": [], "model_name": "", "model_version": 0},
    }
    inputs, code = {"source": digest({"lot": number, "units": units})}, code_hash("import")
    key = stage_key("import", inputs, {"simulated": number}, code)
    run = archive.open_run("line", described, {"key": key})
    run.save("import", key, {"dwells": dwells}, {"inputs": inputs, "parameters": {"simulated": number}, "code": code})
    run.seal()
