"""Files of other systems as tables of columns; the first bytes decide on the format, not the name."""

import hashlib
import stat
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import pandas as pd

from pipelines.importers.content import Content
from pipelines.importers.documents import SourceDocument
from pipelines.importers.limited import in_reader, limits_for
from pipelines.importers.unpacking import MOST_BYTES, gunzipped, refuse_cells
from schemas.errors import DataRejected, WrongUse
from schemas.foreign import is_file as is_there
from schemas.foreign import shown

_GZIP = b"\x1f\x8b"
LONGEST_NAME = 200
"""Characters of the name of a column."""
MOST_COLUMNS = 10_000


@dataclass(frozen=True)
class SourceFile:
    """The source of a table, for the archive; the files of a recording in several."""

    path: str
    sha256: str
    size: int
    form: str
    parts: "tuple[SourceFile, ...]" = ()

    def as_dict(self) -> SourceDocument:
        """JSON-able."""
        about: SourceDocument = {"path": self.path, "sha256": self.sha256, "bytes": self.size, "form": self.form}
        return {**about, "files": [part.as_dict() for part in self.parts]} if self.parts else about


def digest_of(sources: Sequence[SourceFile]) -> str:
    """The hash of several files that are read as a single source; one recording twice is refused, it would count twice."""
    hashes = [source.sha256 for source in sources]
    if twice := dict.fromkeys(source.path for source in sources if hashes.count(source.sha256) > 1):
        raise DataRejected(f"{' and '.join(twice)}: the same bytes, each recording is needed once; leave out one")
    return hashlib.sha256("".join(hashes).encode()).hexdigest()


def is_file(source: str | Path) -> bool:
    """Whether a source is a file, not a run of the archive."""
    return is_there(source) or isinstance(source, Path) or "/" in source or Path(source).suffix != ""


def read(path: Path) -> tuple[pd.DataFrame, SourceFile]:
    """Columns of a file, named as there (a text file without a header: "1", "2", …), and their source."""
    content, source = read_content(path)
    return content.table, source


def read_content(path: Path, group: str = "") -> tuple[Content, SourceFile]:
    """The content of a file, or of a group of channels where it has several, and its source; read by the process of the reader.

    Raises
    ------
    DataRejected
        The file is damaged, empty, or of an unknown format.
    WrongUse
        There is no such file, a library is missing, or a group must be chosen.
    """
    try:
        about = path.stat()
        special = not stat.S_ISREG(about.st_mode) or path.is_relative_to("/dev") or path.is_relative_to("/proc")
    except (OSError, ValueError):
        return content_here(path, group)  # which says why it cannot be read
    given = _bytes(path, MOST_BYTES) if special else None  # a pipe, or a file that only this process has open
    limits = limits_for(about.st_size if given is None else len(given))
    return in_reader(limits, path.name, content_here, path, group, given)


def content_here(path: Path, group: str = "", given: bytes | None = None) -> tuple[Content, SourceFile]:
    """The content of a file, and its source, read by this process."""
    from pipelines.importers.readers import reader_of

    packed = _bytes(path) if given is None else given
    data = gunzipped(packed, path.name) if packed.startswith(_GZIP) else packed
    refuse_cells(data, len(packed), path.name)
    reader = reader_of(data)
    content = reader.read(path.name, data, group)
    if content.table.empty:
        raise DataRejected(f"{path.name}: no rows of data were found, at least one is needed; check the file")
    table = content.table.set_axis([str(name) for name in content.table.columns], axis=1)
    _refuse_odd_names(table, path.name)
    source = SourceFile(str(path), hashlib.sha256(packed).hexdigest(), len(packed), reader.NAME)
    return replace(content, table=table), source


def _bytes(path: Path, most: int = -1) -> bytes:
    try:
        with path.open("rb") as file:
            content = file.read(most if most < 0 else most + 1)
        if most < 0 or len(content) <= most:
            return content
        message = f"{path}: more than {most} bytes of a pipe, at most these are read; write them to a file"
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
    for name in table.columns:
        if len(name) > LONGEST_NAME or not name.isprintable():
            needed = f"at most {LONGEST_NAME} printable characters are needed"
            raise DataRejected(f"{where}: a column is called {shown(name)!r}, {needed}; rename it")
