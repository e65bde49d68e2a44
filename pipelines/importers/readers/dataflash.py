"""DataFlash logs (.bin) of ArduPilot: the fields of one message, with time from its clock and the units that the log states."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with, chosen
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "dataflash", "DataFlash log of ArduPilot (.bin)", "autopilot", 74
recognised = begins_with(b"\xa3\x95\x80")  # every log begins with the format of its formats
REMEDY = "download it again from the vehicle, or export the message with mavlogdump.py"
CLOCKS = {"TimeUS": 1e-6, "TimeMS": 1e-3}
"""The time of a message and its unit, s; milliseconds before ArduPilot 3.4."""
UNITS = {"m/s/s": "m/s^2", "rad/s": "rad/s", "degC": "degC", "deg/s": "deg/s", "m": "m", "V": "V"}
STATED = {"Acc": "m/s^2", "Gyr": "rad/s", "T": "degC"}
"""Units of the fields of IMU and ACC where a log of an older firmware states none, by how their names begin."""


def read(name: str, data: bytes, group: str) -> Content:
    """The fields of one message; one group for each of its instances, such as `IMU 0`; `time` in s since power-on."""
    reader = library("pymavlink.DFReader", EXTRA, f"{name}: a DataFlash log")
    with tempfile.TemporaryDirectory() as folder:  # the library maps a file
        path = Path(folder) / "log.bin"
        path.write_bytes(data)
        with foreign(f"{name}: a DataFlash log that cannot be read", REMEDY):
            log = reader.DFReader_binary(str(path))
            try:
                rows, units = _messages(log)
            finally:
                log.data_map.close()
                log.filehandle.close()
    if f"{group} 0" in rows:
        group = f"{group} 0"
    counts = [(label, len(samples)) for label, samples in rows.items()]
    title = chosen(counts, group, name, "no message with a time and numbers in this DataFlash log")
    table = pd.DataFrame(rows[title])
    clock = next(column for column in CLOCKS if column in table)
    table.insert(0, "time", table.pop(clock).to_numpy(float) * CLOCKS[clock])
    return Content(table, (), {"time": "s", **units[title.partition(" ")[0]]})


def _messages(log: Any) -> tuple[dict[str, list[dict[str, float]]], dict[str, dict[str, str]]]:
    """Rows of every message with numbers by name and instance, and the units of the fields by name."""
    rows: dict[str, list[dict[str, float]]] = {}
    units: dict[str, dict[str, str]] = {}
    while (message := log.recv_msg()) is not None:
        kind = message.get_type()
        fields = message.to_dict()
        if not CLOCKS.keys() & fields.keys():
            continue
        numbers = {
            key: float(value)
            for key, value in fields.items()
            if isinstance(value, int | float) and np.isfinite(float(value))
        }
        instance = numbers.pop("I", None)
        if len(numbers) > 1:
            rows.setdefault(kind if instance is None else f"{kind} {instance:.0f}", []).append(numbers)
        if kind not in units:
            units[kind] = _units_of(log, kind, list(numbers))
    return rows, units


def _units_of(log: Any, kind: str, fields: list[str]) -> dict[str, str]:
    """The units of a message's fields, as the log states them; those of inertial sensors where it does not."""
    form = next((layout for layout in log.formats.values() if layout.name == kind), None)
    stated: dict[str, str] = {}
    for field in fields:
        unit = str(form.get_unit(field)) if form is not None and hasattr(form, "get_unit") else ""
        if unit in UNITS:
            stated[field] = UNITS[unit]
        elif kind.startswith(("IMU", "ACC")) and (known := STATED.get(field, STATED.get(field[:-1], ""))):
            stated[field] = known
    return stated
