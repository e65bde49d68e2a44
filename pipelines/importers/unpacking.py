"""Limits of unpacking: 3 MB can unpack to 10 GB without notice.

The limit applies to the unpacked size, in total and as a multiple of the packed size, for gzip, for the compressed variables
of MATLAB, and for Parquet, whose dictionaries and runs of equal values unpack as well.
"""

import gzip
import io
import zlib

from schemas.errors import DataRejected
from schemas.foreign import foreign

MOST_BYTES = 2**30
"""Of a file, unpacked."""
MOST_TIMES = 100
"""What is unpacked over what is brought; measured records reach 10, with columns that never change 30."""
FREE_BYTES = 2**26
"""Size up to which any multiple is allowed: tables of constants are small."""
PIECE = 2**20
MOST_CELLS, FREE_CELLS, CELLS_PER_BYTE = 2**27, 2**22, 16
"""Of a text: at most, at any size of its file, and of a packed byte. A cell takes 8 bytes or more, whatever its text takes."""


def refuse_larger(size: int, packed: int, where: str) -> None:
    """Refuse a file of ``packed`` bytes that unpacks to too much; ``size``: bytes unpacked so far, or as the file states them."""
    if size <= min(MOST_BYTES, max(FREE_BYTES, MOST_TIMES * packed)):
        return
    raise DataRejected(
        f"{where}: {packed} bytes unpack to {size} or more, at most {MOST_BYTES} and {MOST_TIMES} times the file are read; "
        "divide the recording into several files, or unpack and look at it"
    )


def refuse_cells(data: bytes, packed: int, where: str) -> None:
    """Refuse a text with too many cells; bytes of a binary format have few of the signs that divide cells."""
    cells = data.count(b"\n") + max(data.count(sign) for sign in (b",", b";", b"\t", b"|", b" "))
    most = min(MOST_CELLS, max(FREE_CELLS, CELLS_PER_BYTE * packed))
    if cells > most:
        raise DataRejected(
            f"{where}: {packed} bytes hold about {cells} cells, at most {most} are read; divide the recording into several "
            "files, or leave out columns"
        )


def gunzipped(data: bytes, where: str) -> bytes:
    """The content of a gzip file.

    Raises
    ------
    DataRejected
        It does not unpack, or to too much.
    """
    pieces: list[bytes] = []
    size = 0
    found = f"{where}: a gzip file of {len(data)} bytes that does not unpack"
    with foreign(found, "copy it again"), gzip.GzipFile(fileobj=io.BytesIO(data)) as stream:
        while piece := stream.read(PIECE):
            size += len(piece)
            refuse_larger(size, len(data), where)
            pieces.append(piece)
    return b"".join(pieces)


def inflated(data: bytes, room: int, packed: int, where: str) -> bytes:
    """The content of a zlib stream.

    Parameters
    ----------
    room : bytes of the same file that were unpacked before.
    """
    stream, pieces, size = zlib.decompressobj(), list[bytes](), 0
    with foreign(f"{where}: a compressed variable that does not unpack", "copy it again"):
        while data and not stream.eof:
            piece = stream.decompress(data, PIECE)
            data = stream.unconsumed_tail
            size += len(piece)
            refuse_larger(room + size, packed, where)
            pieces.append(piece)
    return b"".join(pieces)
