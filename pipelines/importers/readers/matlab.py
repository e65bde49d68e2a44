"""MATLAB files of version 5 as columns.

What they compress is unpacked here, where it can be bounded, and the library is given the plain file. Source of the format:
MATLAB MAT-File Format, R2021a, "Level 5 MAT-File Format": a header of 128 bytes, then elements of type, count of bytes, data.
Corrupted types of elements can end the process of the library: it is that of :mod:`pipelines.importers.limited`.
"""

import io
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with
from pipelines.importers.unpacking import inflated, refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign

NAME, TITLE, EXTRA, ORDER = "matlab", "MATLAB 5 to 7", "", 20
recognised = begins_with(b"MATLAB 5.0")
REMEDY = "save it again with save(…, '-v7')"
_HEADER = 128
_TAG = 8
COMPRESSED = 15


def read(name: str, data: bytes, group: str) -> Content:
    """Numeric variables as columns: a vector under its name, a matrix under name_1, name_2, …, structures with dots."""
    from scipy.io import loadmat  # a third of a second

    plain = _plain(name, data)
    with foreign(f"{name}: a MATLAB file that cannot be read", REMEDY):
        content = loadmat(io.BytesIO(plain), squeeze_me=True, struct_as_record=False)
    columns = {
        label: column
        for key, value in content.items()
        if not key.startswith("__")
        for label, column in _flat(key, value)
    }
    longest = max(map(len, columns.values()), default=0)
    columns = {label: column for label, column in columns.items() if len(column) == longest}
    refuse_larger(8 * sum(map(len, columns.values())), len(data), name)
    return Content(pd.DataFrame(columns))


def _plain(name: str, data: bytes) -> bytes:
    """The file without compression."""
    order = "<" if data[_HEADER - 2 : _HEADER] == b"IM" else ">"
    at, parts, size = _HEADER, [data[:_HEADER]], 0
    while at + _TAG <= len(data):
        kind, count = struct.unpack_from(f"{order}II", data, at)
        body = data[at + _TAG : at + _TAG + count]
        if len(body) < count:
            raise DataRejected(
                f"{name}: a MATLAB file that ends inside a variable ({len(body)} of {count} bytes are there); {REMEDY}"
            )
        variable = inflated(body, size, len(data), name) if kind == COMPRESSED else data[at : at + _TAG + count]
        size += len(variable)
        refuse_larger(size, len(data), name)
        parts.append(variable)
        at += _TAG + count
    return b"".join(parts)


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
