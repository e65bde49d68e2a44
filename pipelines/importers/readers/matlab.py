"""MATLAB files of version 5 as columns.

What they compress is unpacked here, where it can be bounded, and the library is given the plain file. Source of the format:
MATLAB MAT-File Format, R2021a, "Level 5 MAT-File Format": a header of 128 bytes, then elements of type, count of bytes, data.
The library takes types of elements as places in a list without looking whether it is that long, and goes down by recursion:
corrupted bytes end the process. So every element is looked at first.
"""

import io
import struct
from collections.abc import Iterator
from dataclasses import dataclass
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
MATRIX, COMPRESSED = 14, 15
DEEPEST = 16
"""Cells and structures inside one another."""
_INT8, _INT32, _UINT32, _MATRIX = (frozenset({kind}) for kind in (1, 5, 6, MATRIX))
_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
_LETTERS = frozenset({1, 2, 3, 4, 16, 17, 18})
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE = 1, 2, 3, 4, 5
_NUMERIC = frozenset(range(6, 16))
_COMPLEX = 0x0800


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
    """The file without compression; every variable is checked against its form, and variables of other classes are left out."""
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
        if _Form(variable, order, name).check():
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


class _OtherClass(Exception):
    """A class of variables that is not read: function handles, and what newer versions keep apart (tables, strings)."""


@dataclass
class _Form:
    """A walk through the elements of one variable of the file ``name``.

    data : the variable, beginning with its tag; order : of bytes, ``<`` or ``>``
    """

    data: bytes
    order: str
    name: str
    at: int = 0

    def check(self) -> bool:
        """Whether it holds numbers, texts, cells and structures only; a variable of another form is refused."""
        try:
            self._matrix(len(self.data), 0)
        except _OtherClass:
            return False
        return True

    def _matrix(self, end: int, depth: int) -> None:
        start, count, after = self._element(end, _MATRIX)
        if depth > DEEPEST:
            self._refuse(f"more than {DEEPEST} structures in one another", "none needs so many")
        self.at = start
        if count:
            self._content(start + count, depth)
        self.at = after

    def _content(self, end: int, depth: int) -> None:
        flags, size = self._flags(end), self._dimensions(end)
        self._take(end, _INT8)  # the name
        kind, parts = flags & 0xFF, 2 if flags & _COMPLEX else 1
        if kind in _NUMERIC:
            for _ in range(parts):
                self._take(end, _NUMBERS)
        elif kind == _CHAR:
            self._take(end, _LETTERS)
        elif kind == _SPARSE:
            for allowed in (_INT32, _INT32, *[_NUMBERS] * parts):
                self._take(end, allowed)
        elif kind in {_CELL, _STRUCT, _OBJECT}:
            for _ in range(size * self._fields(kind, end)):
                self._matrix(end, depth + 1)
        else:
            raise _OtherClass

    def _flags(self, end: int) -> int:
        start, count, after = self._element(end, _UINT32)
        if count != 8:
            self._refuse(f"flags of {count} bytes", "8 are needed")
        self.at = after
        return struct.unpack_from(f"{self.order}I", self.data, start)[0]

    def _dimensions(self, end: int) -> int:
        """Number of values by the dimensions of a variable; refused where they do not fit into the file."""
        start, count, after = self._element(end, _INT32)
        if count % 4 or not 8 <= count <= 4 * 32:
            self._refuse(f"dimensions of {count} bytes", "4 for each of 2 to 32 are needed")
        size = 1
        for length in struct.unpack_from(f"{self.order}{count // 4}i", self.data, start):
            size *= length
            if not 0 <= size <= len(self.data):
                self._refuse("dimensions beyond the variable", "they must fit")
        self.at = after
        return size

    def _fields(self, kind: int, end: int) -> int:
        """Variables for each value of a cell or structure."""
        if kind == _CELL:
            return 1
        if kind == _OBJECT:
            self._take(end, _INT8)
        start, count, after = self._element(end, _INT32)
        longest = struct.unpack_from(f"{self.order}i", self.data, start)[0] if count == 4 else 0
        if longest <= 0:
            self._refuse("names of fields without a length", "one is needed")
        self.at = after
        _, count, after = self._element(end, _INT8)
        if count % longest:
            self._refuse(f"{count} bytes of names of {longest} each", "whole names are needed")
        self.at = after
        return count // longest

    def _take(self, end: int, allowed: frozenset[int]) -> None:
        self.at = self._element(end, allowed)[2]

    def _element(self, end: int, allowed: frozenset[int]) -> tuple[int, int, int]:
        """Offset and length of an element's bytes, and the offset of the next element."""
        if self.at + _TAG > end:
            self._refuse("an element beyond its variable", "it must end inside")
        kind, count = struct.unpack_from(f"{self.order}II", self.data, self.at)
        start, after = self.at + _TAG, self.at + _TAG + count
        if kind >> 16:  # a small element: up to four bytes, in the tag itself
            kind, count, start, after = kind & 0xFFFF, kind >> 16, self.at + 4, self.at + _TAG
            if count > 4:
                self._refuse(f"a small element of {count} bytes", "4 at most are possible")
        elif kind != MATRIX:
            after += -count % _TAG
        if kind not in allowed:
            self._refuse(f"an element of type {kind}", f"one of {', '.join(map(str, sorted(allowed)))} is needed there")
        if start + count > end:
            self._refuse(f"an element of {count} bytes beyond its variable", "it must end inside")
        return start, count, min(after, end)

    def _refuse(self, found: str, needed: str) -> None:
        raise DataRejected(
            f"{self.name}: a MATLAB file with {found}, {needed} (byte {self.at} of a variable); {REMEDY}"
        )
