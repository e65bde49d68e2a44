"""Universal files, dataset 58: functions at nodal degrees of freedom, time records among them.

Source: SDRC Universal File Formats, Universal Dataset Number 58. Function type 1 is a time response; abscissa type 17 is time, 18
frequency; ordinate type 12 is acceleration.
"""

import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from schemas.errors import DataRejected
from schemas.foreign import foreign, shown
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "uff58", "Universal File Format, dataset 58", "uff", 50
REMEDY = "export the record again, or as CSV"
TIME_RECORD, TIME, ACCELERATION = 1, 17, 12
ORDINATES = {
    8: "displacement", 9: "force", 11: "velocity", 12: "acceleration", 13: "excitation force", 5: "temperature", 15: "pressure",
    2: "stress", 3: "strain", 16: "mass", 18: "frequency", 19: "revolutions per minute",
}  # fmt: skip
HANDLES = Path("/proc/self/fd")
_DIRECTIONS = {1: "+X", -1: "-X", 2: "+Y", -2: "-Y", 3: "+Z", -3: "-Z"}


def recognised(data: bytes) -> bool:
    """Whether the first line is the delimiter −1 and the second names a dataset."""
    head = data[:400].split(b"\n")
    filled = [line.strip() for line in head if line.strip()][:2]
    return len(filled) == 2 and filled[0] == b"-1" and filled[1][:6].strip(b"b ").isdigit()


def read(name: str, data: bytes, group: str) -> Content:
    """Time records of one interval and length as columns, beside `time` in s."""
    pyuff = library("pyuff", EXTRA, f"{name}: a universal file (UFF)")
    with as_file(data) as path, foreign(f"{name}: a universal file that cannot be read", REMEDY):
        file = pyuff.UFF(str(path))
        numbers = [k for k, kind in enumerate(file.get_set_types()) if int(kind) == 58]
        sets: list[dict[str, Any]] = [dict(file.read_sets(k)) for k in numbers]
        records = [_record(dataset) for dataset in sets if int(dataset.get("func_type", 0)) == TIME_RECORD]
    if not records:
        raise DataRejected(
            f"{name}: {len(sets)} sets of UFF58, none is a time record (function type 1), one is needed; export time records"
        )
    clocks = {record[1]: len(record[2]) for record in records}
    names = [(_clock_name(clock), count) for clock, count in clocks.items()]
    group_name = chosen(names, group, name)
    clock = next(clock for clock in clocks if _clock_name(clock) == group_name)
    of_clock = [record for record in records if record[1] == clock]
    if clock[3] != TIME:
        raise DataRejected(
            f"{name}: the abscissa of these records is of type {clock[3]}, time (type {TIME}) is needed; export time records"
        )
    columns: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    remarks: list[str] = []
    for label, _, values, unit, kind in of_clock:
        column = label if label not in columns else f"{label} ({len(columns) + 1})"
        columns[column], units[column] = values, unit
        if kind != ACCELERATION:
            what = ORDINATES.get(kind, "not a known quantity")
            remarks.append(
                f"{shown(column)}: ordinate type {kind} ({what}, unit '{shown(unit)}'), an acceleration is type {ACCELERATION}; "
                "check that this channel is one"
            )
    count = len(next(iter(columns.values())))
    table = pd.DataFrame({"time": clock[0] + clock[1] * np.arange(count), **columns})
    return Content(table, tuple(remarks), {"time": "s", **units}, clock[1])


@contextmanager
def as_file(data: bytes) -> Generator[Path]:
    """The path of a temporary file with the bytes: the library reads from a path only.

    Where the system gives open files a path, it has no other: nothing is left of it, also when the process is killed.
    """
    if HANDLES.is_dir():
        with tempfile.TemporaryFile(prefix="tumbleline-") as file:
            file.write(data)
            file.flush()
            yield HANDLES / str(file.fileno())
        return
    with tempfile.TemporaryDirectory(prefix="tumbleline-") as folder:
        path = Path(folder) / "recording.uff"
        path.write_bytes(data)
        yield path


def _record(dataset: dict[str, Any]) -> tuple[str, tuple[float, float, int, int], np.ndarray, str, int]:
    """Label, clock (first instant, interval, count, abscissa type), values, unit and ordinate type of a set."""
    values = np.asarray(dataset["data"])
    if values.dtype.kind == "c":
        values = np.real(values)
    x = np.asarray(dataset["x"], dtype=np.float64)
    interval = float(dataset.get("abscissa_inc") or 0.0)
    if not dataset.get("abscissa_spacing") or interval <= 0.0:
        interval = float(np.median(np.diff(x))) if x.size > 1 else 0.0
    direction = _DIRECTIONS.get(int(dataset.get("rsp_dir") or 0), "")
    parts = [str(part).strip() for part in (dataset.get("id1") or "", dataset.get("rsp_node") or "", direction)]
    label = " ".join(filter(None, parts)) or "record"
    unit = str(dataset.get("ordinate_axis_units_lab") or "").strip()
    clock = (float(x[0]) if x.size else 0.0, interval, values.size, int(dataset.get("abscissa_spec_data_type") or 0))
    return label, clock, values, "" if unit == "NONE" else unit, int(dataset.get("ordinate_spec_data_type") or 0)


def _clock_name(clock: tuple[float, float, int, int]) -> str:
    return f"{clock[2]} samples every {clock[1]:g} s from {clock[0]:g} s"
