"""Files of others as tables of columns: delimited text, Parquet, MATLAB; nothing is guessed about what columns mean."""

from __future__ import annotations

import gzip
import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
from scipy.io import loadmat

from schemas.errors import DataRejected, WrongUse

if TYPE_CHECKING:
    from collections.abc import Iterator

_PARQUET = b"PAR1"
_HDF5 = b"\x89HDF"
_GZIP = b"\x1f\x8b"
_COMMENTS = ("#", "%")
_MORE = "\0more"


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
    data = _unpacked(path, packed)
    if data.startswith(_PARQUET):
        form, table = "parquet", _parquet(path, data)
    elif data.startswith(b"MATLAB 5.0"):
        form, table = "matlab", _matlab(path, data)
    elif data.startswith(_HDF5) or b"MATLAB 7.3" in data[:128]:
        raise DataRejected(
            f"{path.name}: a MATLAB 7.3 (HDF5) file, which is not read; save it again with save(…, '-v7')"
        )
    else:
        form, table = "text", _text(path, data)
    if table.empty:
        raise DataRejected(f"{path.name}: no rows of data were found, at least one is needed; check the file")
    return table, SourceFile(str(path), hashlib.sha256(packed).hexdigest(), len(packed), form)


def _bytes(path: Path) -> bytes:
    if path.is_dir():
        raise WrongUse(f"{path}: a folder, a file is needed; name the file")
    try:
        return path.read_bytes()
    except OSError as problem:
        raise WrongUse(f"{path}: cannot be read ({problem.strerror}); check the name") from None


def _unpacked(path: Path, data: bytes) -> bytes:
    if not data.startswith(_GZIP):
        return data
    try:
        return gzip.decompress(data)
    except (OSError, EOFError) as problem:
        raise DataRejected(
            f"{path.name}: a gzip file of {len(data)} bytes that does not unpack ({problem}); copy it again"
        ) from None


def _parquet(path: Path, data: bytes) -> pd.DataFrame:
    try:
        return pq.read_table(pa.BufferReader(data)).to_pandas()
    except (pa.ArrowInvalid, OSError) as problem:
        reason = str(problem).splitlines()[0]
        raise DataRejected(
            f"{path.name}: {len(data)} bytes that begin as Parquet but are not a whole file ({reason}); copy it again"
        ) from None


def _matlab(path: Path, data: bytes) -> pd.DataFrame:
    """Numeric variables as columns: a vector under its name, a matrix under name_1, name_2, …, structures with dots."""
    try:
        content = loadmat(io.BytesIO(data), squeeze_me=True, struct_as_record=False)
    except (ValueError, TypeError, NotImplementedError, OSError) as problem:
        raise DataRejected(
            f"{path.name}: a MATLAB file that cannot be read ({problem}); save it again with save(…, '-v7')"
        ) from None
    columns = {
        name: column for key, value in content.items() if not key.startswith("__") for name, column in _flat(key, value)
    }
    lengths = {len(column) for column in columns.values()}
    if len(lengths) > 1:
        longest = max(lengths)
        columns = {name: column for name, column in columns.items() if len(column) == longest}
    return pd.DataFrame(columns)


def _flat(name: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    if hasattr(value, "_fieldnames"):
        for field in value._fieldnames:  # noqa: SLF001 - the only way this library names the fields of a structure
            yield from _flat(f"{name}.{field}", getattr(value, field))
        return
    array = np.asarray(value)
    if array.ndim == 1 and array.dtype.kind in "fiubU":
        yield name, array
    elif array.ndim == 2 and array.dtype.kind in "fiub":
        tall = array if array.shape[0] >= array.shape[1] else array.T
        for k in range(tall.shape[1]):
            yield f"{name}_{k + 1}", tall[:, k]


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
    header = not all(_is_number(name) for name in names)
    if header and len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise DataRejected(f"{path.name}: column '{twice}' is there twice, names must differ; rename one")
    labels = names if header else [str(k + 1) for k in range(len(names))]
    body = "\n".join(line for line in lines[first + int(header) :] if not line.lstrip().startswith(_COMMENTS))
    return _parse(path, body, divider, labels, first + 1 + int(header))


def _parse(path: Path, body: str, divider: str, labels: list[str], first_line: int) -> pd.DataFrame:
    if not body.strip():
        return pd.DataFrame(columns=labels)
    try:
        table = pd.read_csv(
            io.StringIO(body), sep=divider, header=None, names=[*labels, _MORE], index_col=False, skipinitialspace=True
        )
    except (pd.errors.ParserError, ValueError) as problem:
        reason = str(problem).splitlines()[0]
        raise DataRejected(_ragged(path, labels, first_line, reason)) from None
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
