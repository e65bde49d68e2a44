"""HDF5, which MATLAB 7.3 also writes: numeric datasets as columns, by their paths with dots."""

import io
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from pipelines.importers.content import Content, chosen
from pipelines.importers.unpacking import refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

NAME, TITLE, EXTRA, ORDER = "hdf5", "HDF5 and MATLAB 7.3", "hdf5", 40
MAGIC = b"\x89HDF\r\n\x1a\n"
_MATLAB = b"MATLAB 7.3"
_BLOCK = 512  # MATLAB puts its own header before the signature, at a multiple of this
REMEDY = "copy it again, or save it with save(…, '-v7')"
DEEPEST = 16
MOST_DATASETS = 10_000
_OWN = ("#refs#", "#subsystem#")  # of MATLAB: cells and objects


def recognised(data: bytes) -> bool:
    """Whether the signature of HDF5 stands at the beginning, or behind a header of MATLAB 7.3."""
    return data.startswith(MAGIC[:4]) or _MATLAB in data[:128] or data[_BLOCK : _BLOCK + 8] == MAGIC


def read(name: str, data: bytes, group: str) -> Content:
    """Datasets of one length as columns; several lengths are groups to choose from, named by the length.

    A matrix becomes name_1, name_2, …; the interval is read from the attribute ``sample_interval_s`` or ``dt``.
    """
    h5py = library("h5py", EXTRA, f"{name}: an HDF5 file (MATLAB 7.3 among them)")
    broken = f"{name}: an HDF5 file (MATLAB 7.3 among them) that cannot be read"
    columns: dict[str, np.ndarray] = {}
    with foreign(broken, REMEDY), h5py.File(io.BytesIO(data), "r") as file:
        datasets = list(_datasets(h5py, file, "", 0))
        refuse_larger(8 * sum(int(np.prod(dataset.shape)) for _, dataset in datasets), len(data), name)
        for label, dataset in datasets:
            with foreign(f"{broken}: dataset {label}", REMEDY):
                columns |= _columns(label, np.asarray(dataset[()]))
    return Content(_table(columns, group, name))


def _datasets(h5py: Any, folder: Any, path: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Numeric datasets of one or two dimensions, with their paths."""
    if depth > DEEPEST:
        return
    for key in list(folder)[:MOST_DATASETS]:
        if key in _OWN or folder.get(key, getlink=True).__class__ is not h5py.HardLink:
            continue
        item, label = folder[key], f"{path}.{key}" if path else key
        if isinstance(item, h5py.Group):
            yield from _datasets(h5py, item, label, depth + 1)
        elif item.dtype.kind in "fiub" and 1 <= len(item.shape) <= 2 and "MATLAB_empty" not in item.attrs:
            yield label, item


def _columns(label: str, values: np.ndarray) -> dict[str, np.ndarray]:
    if values.ndim == 1:
        return {label: values}
    tall = values if values.shape[0] >= values.shape[1] else values.T
    if tall.shape[1] == 1:
        return {label: tall[:, 0]}
    return {f"{label}_{k + 1}": tall[:, k] for k in range(min(tall.shape[1], MOST_DATASETS))}


def _table(columns: dict[str, np.ndarray], group: str, name: str) -> pd.DataFrame:
    lengths = Counter(len(column) for column in columns.values() if len(column) > 1)
    if not lengths:
        raise DataRejected(f"{name}: no column of numbers was found in this HDF5 file, one is needed; check the file")
    # scalars and short vectors are settings beside the record; only lengths that three channels share are records
    longest = max(lengths)
    groups = sorted((n for n, count in lengths.items() if count >= 3 or n == longest), reverse=True)
    length = int(chosen([(str(n), n) for n in groups], group, name)) if len(groups) > 1 or group else longest
    return pd.DataFrame({label: column for label, column in columns.items() if len(column) == length})
