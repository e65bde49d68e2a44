"""R's files (.rda, .RData, .rds): data frames as columns."""

from __future__ import annotations

import bz2
import lzma
from typing import TYPE_CHECKING

from pipelines.importers.content import Content, chosen
from pipelines.importers.temporary_file import as_file
from pipelines.importers.unpacking import MOST_BYTES, refuse_larger
from schemas.errors import DataRejected
from schemas.foreign import foreign
from schemas.library import library

if TYPE_CHECKING:
    import pandas as pd

NAME, TITLE, EXTRA, ORDER = "rdata", "R data (.rda, .RData, .rds)", "r", 80
_SAVED = (b"RDX2\n", b"RDX3\n", b"RDA2\n", b"RDA3\n")
_SINGLE = (b"X\n\x00\x00\x00", b"A\n2\n", b"A\n3\n")
_BZIP2, _XZ = b"BZh", b"\xfd7zXZ\x00"
REMEDY = "save the data frame again with save(…), or export it with write.csv"


def recognised(data: bytes) -> bool:
    """Whether the file begins as R's saved objects do, also packed by bzip2 or xz (gzip is unpacked before)."""
    return data.startswith((*_SAVED, *_SINGLE)) or (data.startswith((_BZIP2, _XZ)) and _unpacked_head(data) != b"")


def _unpacked_head(data: bytes) -> bytes:
    """First bytes of what bzip2 or xz packed; empty where that is no R data."""
    unpack = bz2.BZ2Decompressor() if data.startswith(_BZIP2) else lzma.LZMADecompressor(memlimit=2**27)
    try:
        head = unpack.decompress(data[: 2**20], 64)
    except (OSError, lzma.LZMAError, EOFError):
        return b""
    return head if head.startswith((*_SAVED, *_SINGLE)) else b""


def read(name: str, data: bytes, group: str) -> Content:
    """The data frame of a file; several are groups to choose from."""
    pyreadr = library("pyreadr", EXTRA, f"{name}: a file of R")
    plain = _plain(name, data)
    suffix = ".rds" if plain.startswith(_SINGLE) else ".rda"
    with as_file(plain, suffix) as path, foreign(f"{name}: a file of R that cannot be read", REMEDY):
        frames: dict[str, pd.DataFrame] = {
            str(key or "frame"): value for key, value in pyreadr.read_r(path).items() if value is not None
        }
    frames = {key: frame for key, frame in frames.items() if len(frame.columns)}
    if not frames:
        raise DataRejected(f"{name}: no data frame in this file of R, one is needed; {REMEDY}")
    frame = frames[chosen([(key, len(one)) for key, one in frames.items()], group, name)]
    return Content(frame.reset_index(drop=True).set_axis([str(c) for c in frame.columns], axis=1))


def _plain(name: str, data: bytes) -> bytes:
    if not data.startswith((_BZIP2, _XZ)):
        return data
    unpack = bz2.BZ2Decompressor() if data.startswith(_BZIP2) else lzma.LZMADecompressor(memlimit=2**28)
    with foreign(f"{name}: a packed file of R that does not unpack", "copy it again"):
        plain = unpack.decompress(data, MOST_BYTES + 1)
    refuse_larger(len(plain), len(data), name)
    return plain
