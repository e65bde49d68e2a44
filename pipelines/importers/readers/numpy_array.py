"""NumPy arrays, one in a file: the columns of a matrix, or the named fields of records."""

import io

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, begins_with
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign

NAME, TITLE, EXTRA, ORDER = "numpy", "NumPy .npy", "", 95
recognised = begins_with(b"\x93NUMPY")
REMEDY = "save an array of numbers, samples by columns, with numpy.save(…, allow_pickle=False)"
_KINDS = frozenset("fiubUM")


def read(name: str, data: bytes, group: str) -> Content:
    """Fields under their names; columns of a matrix as 1, 2, …, the longer side being that of the samples."""
    with foreign(f"{name}: a NumPy array that cannot be read", REMEDY):
        array = np.asarray(np.load(io.BytesIO(data), allow_pickle=False))
    refuse_larger(array.nbytes, len(data), name)
    fields = array.dtype.names
    if fields and array.ndim == 1:
        columns = {str(field): array[field] for field in fields}
    elif array.ndim in {1, 2}:
        matrix = array[:, None] if array.ndim == 1 else array
        tall = matrix.T if matrix.shape[0] < matrix.shape[1] else matrix
        columns = {str(k + 1): tall[:, k] for k in range(tall.shape[1])}
    else:
        columns = {}
    # the table needs the byte order of this machine
    vectors = {
        label: column.astype(column.dtype.newbyteorder("=")) for label, column in columns.items() if column.ndim == 1
    }
    if not vectors or any(column.dtype.kind not in _KINDS for column in vectors.values()):
        found = f"{array.ndim} dimensions of type {array.dtype}"
        raise DataRejected(f"{name}: an array of {found}, a matrix or records of numbers are needed; {REMEDY}")
    return Content(pd.DataFrame(vectors))
