"""An uploaded file: stored in the folder, read by its mapping, imported into the archive."""

import filecmp
import os
import re
import tempfile
import threading
from collections import OrderedDict
from collections.abc import Mapping as Mapped
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content
from pipelines.importers.exchange import is_exchange
from pipelines.importers.files import SourceFile
from pipelines.importers.limited import ReadingEnded, ReadingLimits, in_reader
from pipelines.tables.frames import rows_of
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import UploadPage
from schemas.errors import DataRejected, TumblelineError, WrongUse

FOLDER = "uploads"
PART = ".part-"
LOOK = ReadingLimits(560 * 2**20, 60, 90)
"""Of a look at an upload: with the server itself less than 1 GB. What takes more is imported by the command line."""
KEPT_LOOKS = 32
WAIT_S = 120.0
LARGEST = 400_000_000
NAME = re.compile(r"[^A-Za-z0-9._ -]+")
PACKED = (".csv", ".tsv", ".txt", ".parquet")
ENDINGS = (*PACKED, ".dat", ".mat", ".npy", ".h5", ".hdf5", ".xlsx", ".ods", *(f"{ending}.gz" for ending in PACKED))
FIELDS = ("time", "x", "y", "z", "temperature", "unit", "dwell")  # meanings that the page asks for
MOST_ROWS = 8
MOST_LOOKED = 200_000
"""Rows in which columns are recognised: an hour of 50 Hz."""


@dataclass(frozen=True)
class UploadReading:
    """A file as it was read.

    columns : its own · head : the first rows · offered : meanings with the columns that are recognised, as ``inspect`` does
    proposed : values of the form by name, where they are recognised · open : what the file does not state
    data : the result of the mapping, rows of its dwells · problem : the reason why it cannot be read
    """

    file: str
    rows: int
    columns: tuple[str, ...]
    head: list[list[str]]
    offered: dict[str, str]
    is_exchange: bool
    proposed: dict[str, str] = field(default_factory=dict[str, str])
    open: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    out_unit: str = ""
    samples: int = 0
    rate_hz: float = 0.0
    dwells: tuple[dict[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()
    problem: str = ""


_FIELDS_OF: dict[str, dict[str, str]] = {
    "import": {
        "unit-of output": "Unit of the output", "unit-of time": "Unit of time", "unit-of temperature": "Unit of temperature",
        "map": "Meaning of the columns", "rate": "Rate", "units": "Serial number", "set local_gravity_m_s2": "Local gravity",
        "set poses": "Faces", "set rows": "One row is", "fit": "Fit",
    },
    "audit": {"since": "From", "until": "Until", "device": "Device", "station": "Station"},
    "discover": {"device": "Device"},
    "release": {"reason": "Reason"},
}  # fmt: skip
"""By the kind of work, the fields of its page in place of options of its command."""


def in_fields(text: str, kind: str = "import") -> str:
    """A message on work of a page with its fields in place of options; what the page lacks is of the command line."""
    fields = _FIELDS_OF.get(kind, {})
    option = rf"--({'|'.join(fields) or '(?!)'})\b(?:=(?!…)([^\s;,]+)|=…| HZ| SN| TEXT| [a-z_]+=[^\s;,]*)?"
    text = re.sub(option, lambda m: f"the field '{fields[m[1]]}'" + (f" ({m[2]})" if m[2] else ""), text)
    lacking = "; what begins with -- is an option of the command line"
    return text + (lacking if " --" in text and "tumbleline" not in text else "")


_looking = threading.Lock()
_looks: OrderedDict[tuple[str, int, int], UploadReading | TumblelineError] = OrderedDict()


def folder_of(settings: WorkbenchSettings) -> Path:
    """The folder of the uploads."""
    folder = settings.folder / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def part_of(settings: WorkbenchSettings) -> Path:
    """A new file for an upload that arrives."""
    handle, name = tempfile.mkstemp(prefix=PART, dir=folder_of(settings))
    os.close(handle)
    return Path(name)


def keep(settings: WorkbenchSettings, name: str, part: Path) -> str:
    """The path of a dropped file, renamed from where it arrived; another content under the same name gets a number.

    Raises
    ------
    WrongUse
        The ending of its name is unknown.
    """
    plain = NAME.sub("_", Path(name.replace("\\", "/")).name).strip(" .")[-120:]
    if not plain.lower().endswith(ENDINGS):
        raise WrongUse(
            f"upload: '{plain or 'a file without a name'}', one of {', '.join(ENDINGS)} is needed; save it as one of them"
        )
    folder = folder_of(settings)
    stem, dot, ending = plain.partition(".")
    for number in range(1000):
        path = folder / (plain if number == 0 else f"{stem}-{number}{dot}{ending}")
        if path.is_file() and filecmp.cmp(path, part, shallow=False):
            return str(path)
        if not path.exists():
            part.rename(path)
            return str(path)
    raise WrongUse(f"upload: {folder} holds a thousand files called '{plain}'; remove some")


def resolve(settings: WorkbenchSettings, name: str) -> Path:
    """The path of an uploaded file."""
    folder = settings.folder / FOLDER
    path = Path(name)
    if path.parent != folder or not path.is_file() or path.is_symlink():
        raise WrongUse(f"upload: no uploaded file is called '{name[:80]}'; drop it again")
    return path


def reading(settings: WorkbenchSettings, page: UploadPage) -> UploadReading:
    """The file of a page as it is read: by the process of the reader, one file at a time; cached until the file changes."""
    path = resolve(settings, page.file)
    about = path.stat()
    key = (page.model_dump_json(), about.st_size, about.st_mtime_ns)
    if not _looking.acquire(timeout=WAIT_S):
        raise WrongUse("upload: the server reads other files; try again in some minutes")
    try:
        if key not in _looks:
            _looks[key] = _limited(path, page)
        _looks.move_to_end(key)
        while len(_looks) > KEPT_LOOKS:
            _looks.popitem(last=False)
        found = _looks[key]
    finally:
        _looking.release()
    if isinstance(found, TumblelineError):
        raise type(found)(str(found))
    return found


def _limited(path: Path, page: UploadPage) -> UploadReading | TumblelineError:
    """The reading, or the error that refuses the file; both are cached."""
    try:
        return in_reader(LOOK, path.name, look, path, page)
    except ReadingEnded as problem:
        return DataRejected(f"{problem}; or import it with 'tumbleline import {path}'")
    except TumblelineError as problem:
        return problem.with_traceback(None)


def look(path: Path, page: UploadPage) -> UploadReading:
    """The file of a page, read by this process."""
    from pipelines.importers import files

    content, source = files.read_content(path)
    table = content.table
    names = tuple(str(column) for column in table.columns)
    head = [[str(value)[:40] for value in row] for row in table.head(MOST_ROWS).itertuples(index=False)]
    plain = UploadReading(
        file=page.file, rows=len(table), columns=names, head=head, offered={}, is_exchange=is_exchange(names)
    )
    if not page.columns or not page.output:
        return _recognised(plain, replace(content, table=table.head(MOST_LOOKED)), source)
    try:
        return _read_as(plain, table, page)
    except TumblelineError as problem:
        return replace(plain, problem=str(problem))


def _recognised(plain: UploadReading, content: Content, source: SourceFile) -> UploadReading:
    """The file with what is recognised in its first rows; as it is where that fails."""
    from pipelines.importers.recognition import of_content

    try:
        seen = of_content(content, source, [Path(plain.file)])
    except TumblelineError as problem:
        return replace(plain, open=(str(problem),))
    offered = {guess.meaning: name for name, guess in seen.guessed.columns.items() if guess.meaning}
    keys = seen.keys or {}
    units = keys.get("units", {})
    proposed = {
        name: value for name in ("output", "time", "temperature") if (value := units.get(name, "")) not in {"", "UNIT"}
    }
    proposed |= {"rows": str(keys["rows"])} if "rows" in keys else {}
    proposed |= {"rate": f"{keys['rate_hz']:g}"} if isinstance(keys.get("rate_hz"), float) else {}
    left = ", ".join(name for meaning, name in offered.items() if meaning not in FIELDS)
    unread = f"{left}: not read by this page; the import that 'tumbleline inspect' prints reads them"
    return replace(plain, offered=offered, proposed=proposed, open=(*seen.open, *([unread] if left else [])))


def _read_as(plain: UploadReading, table: pd.DataFrame, page: UploadPage) -> UploadReading:
    from pipelines.importers import record

    data = record.imported(table, mapping_of(page.model_dump()), Path(page.file).name)
    time = np.zeros(0) if data.samples is None else data.samples["time_s"].to_numpy()
    span = float(np.sum(time[-1:] - time[:1]))
    return replace(
        plain, units=tuple(data.units), out_unit=data.out_unit, remarks=data.remarks, samples=len(time),
        rate_hz=(len(time) - 1) / span if span > 0.0 else 0.0,
        dwells=() if data.dwells is None else tuple(rows_of(data.dwells)),
    )  # fmt: skip


def mapping_of(request: Mapped[str, Any]) -> Any:
    """The mapping of an import, from the values of the page."""
    from pipelines.importers import mapping

    keys: dict[str, Any] = {
        "columns": mapping.pairs(",".join(request["columns"]), "columns"),
        "units": {name: request[name] for name in ("output", "time", "temperature")},
        "rows": request["rows"],
    }
    stated = {"unit": "serial", "rate_hz": "rate", "local_gravity_m_s2": "gravity"}
    keys |= {key: request[name] for key, name in stated.items() if request[name]}
    keys |= {"poses": mapping.pairs(request["poses"], "poses")} if request["poses"] else {}
    return mapping.build(keys, "upload")


def imported(request: Mapped[str, Any]) -> dict[str, Any]:
    """A file imported into the archive, with the requested fit."""
    from pipelines.diagnosis.imported_norms import judge
    from pipelines.importers import files, keep, record

    path = Path(request["file"])
    how = mapping_of(request)
    content, source = files.read_content(path)
    data = record.imported(content.table, how, path.name, content)
    if data.dwells is None:
        raise DataRejected(
            f"{path.name}: it has no static interval, dwells are needed; record every pose for some seconds"
        )
    judged = judge(request["fit"], data, how) if request["fit"] else None
    run = keep.keep(data, source, how, judged, request["archive"])
    return {
        "run": run.id, "units": data.units, "dwells": len(data.dwells), "adequate": None if judged is None else judged.adequate,
        "lines": [] if judged is None else list(judged.lines), "remarks": list(data.remarks), "fit": request["fit"],
        "coefficients": [] if judged is None else [dict(row) for row in judged.coefficients or []],
    }  # fmt: skip
