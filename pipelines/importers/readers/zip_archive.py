"""Zip archives, also .npz: recognised, so that the refusal says what they are."""

from pipelines.importers.content import Content
from pipelines.importers.readers import spreadsheet, wearable
from schemas.errors import DataRejected

NAME, TITLE, EXTRA, ORDER = "zip", "zip archive (refused)", "", 30
MAGIC = b"PK\x03\x04"


def recognised(data: bytes) -> bool:
    """Whether the file begins as a zip archive does."""
    return data.startswith(MAGIC) and not (spreadsheet.recognised(data) or wearable.recognised(data))


def read(name: str, data: bytes, group: str) -> Content:
    """Nothing: always refused."""
    raise DataRejected(f"{name}: a zip archive (also .npz), which is not read; unpack it, or export the table as CSV")
