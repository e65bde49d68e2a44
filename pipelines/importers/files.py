"""Files of others as tables of columns: delimited text, Parquet, MATLAB; nothing is guessed about what columns mean."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers import parquet
from pipelines.importers.unpacking import gunzipped
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import foreign, shown

_PARQUET = b"PAR1"
_HDF5 = b"\x89HDF"
_GZIP = b"\x1f\x8b"
_COMMENTS = ("#", "%")
_MORE = "\0more"
_ZIP = b"PK\x03\x04"
LONGEST_NAME = 200
"""Characters of the name of a column."""
MOST_COLUMNS = 10_000


@dataclass(frozen=True)
class SourceFile:
    """Where a table came from, for the archive."""

    path: str
    sha256: str
    size: int
    form: str

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {"path": self.path, "sha256": self.sha256, "bytes": self.size, "form": self.form}


def read(path: Path) -> tuple[pd.DataFrame, SourceFile]:
    """Columns of a file, named as there (a text file without a header: "1", "2", …), and where they came from.

    What the file is, its first bytes say and not its name: gzip is unpacked, Parquet and MATLAB are recognised, anything
    else must be text with one row per line, divided by tabs, commas, semicolons or blanks.
    """
    packed = _bytes(path)
    data = gunzipped(packed, path.name) if packed.startswith(_GZIP) else packed
    if data.startswith(_PARQUET):
        form, table = "parquet", parquet.table_of(path.name, data)
    elif data.startswith(b"MATLAB 5.0"):
        from pipelines.importers import matlab  # scipy.io takes a third of a second

        form, table = "matlab", matlab.table_of(path.name, data)
    elif data.startswith(_ZIP):
        raise DataRejected(
            f"{path.name}: a zip archive (also .xlsx, .npz), which is not read; unpack it, or export the table as CSV"
        )
    elif data.startswith(_HDF5) or b"MATLAB 7.3" in data[:128]:
        raise DataRejected(
            f"{path.name}: a MATLAB 7.3 (HDF5) file, which is not read; save it again with save(…, '-v7')"
        )
    else:
        form, table = "text", _text(path, data)
    if table.empty:
        raise DataRejected(f"{path.name}: no rows of data were found, at least one is needed; check the file")
    _refuse_odd_names(table, path.name)
    return table, SourceFile(str(path), hashlib.sha256(packed).hexdigest(), len(packed), form)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except IsADirectoryError:
        message = f"{path}: a folder, a file is needed; name the file"
    except (OSError, ValueError) as problem:  # a name with a zero byte is a ValueError
        reason = problem.strerror if isinstance(problem, OSError) else str(problem)
        message = f"{shown(str(path))}: cannot be read ({reason}); check the name"
    raise WrongUse(message)


def _refuse_odd_names(table: pd.DataFrame, where: str) -> None:
    """Refuse names of columns that no list, page or message can show."""
    if len(table.columns) > MOST_COLUMNS:
        raise DataRejected(
            f"{where}: {len(table.columns)} columns, at most {MOST_COLUMNS} are read; one row per sample is needed"
        )
    for name in table.columns.astype(str):
        if len(name) > LONGEST_NAME or not name.isprintable():
            needed = f"at most {LONGEST_NAME} printable characters are needed"
            raise DataRejected(f"{where}: a column is called {shown(name)!r}, {needed}; rename it")


def _text(path: Path, data: bytes) -> pd.DataFrame:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        raise DataRejected(
            f"{path.name}: neither text (UTF-8), Parquet, MATLAB nor gzip; export it as one of these"
        ) from None
    lines = text.splitlines()
    first = next((k for k, line in enumerate(lines) if line.strip() and not line.lstrip().startswith(_COMMENTS)), None)
    if first is None:
        raise DataRejected(f"{path.name}: no rows of data were found, at least one is needed; check the file")
    divider = _divider(lines[first])
    names = [
        name.strip().strip('"') for name in (lines[first].split() if divider == r"\s+" else lines[first].split(divider))
    ]
    if len(names) > MOST_COLUMNS:
        found = f"{len(names)} columns in line {first + 1}"
        raise DataRejected(f"{path.name}: {found}, at most {MOST_COLUMNS} are read; one row per sample is needed")
    header = not all(_is_number(name) for name in names)
    if header and len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DataRejected(f"{path.name}: column '{shown(twice)}' is there twice, names must differ; rename one")
    labels = names if header else [str(k + 1) for k in range(len(names))]
    body = "\n".join(line for line in lines[first + int(header) :] if not line.lstrip().startswith(_COMMENTS))
    return _parse(path, body, divider, labels, first + 1 + int(header))


def _parse(path: Path, body: str, divider: str, labels: list[str], first_line: int) -> pd.DataFrame:
    if not body.strip():
        return pd.DataFrame(columns=labels)
    where = f"{path.name}: rows from line {first_line} on do not have the {len(labels)} columns of the first"
    with foreign(where, "repair or remove the broken rows"):
        table = pd.read_csv(
            io.StringIO(body),
            sep=divider,
            header=None,
            names=[*labels, _MORE],
            index_col=False,
            skipinitialspace=True,
            low_memory=False,
        )
    more = np.flatnonzero(table.pop(_MORE).notna())
    if more.size:
        raise DataRejected(_ragged(path, labels, first_line, f"row {int(more[0])} has more"))
    return table


def _ragged(path: Path, labels: list[str], first_line: int, reason: str) -> str:
    return (
        f"{path.name}: rows from line {first_line} on do not have the {len(labels)} columns of the first ({reason}); "
        "repair or remove the broken rows"
    )


def _divider(line: str) -> str:
    for divider in ("\t", ",", ";"):
        if divider in line.strip():
            return divider
    return r"\s+"


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
