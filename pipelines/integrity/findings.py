"""What a check finds, and what it went through."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.names import NameLeadsOut
from pipelines.archive.signatures import BAD, UNKNOWN, UNSIGNED, check
from pipelines.archive.store import ObjectPath, first_line
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    from pipelines.archive.store import Place

CHANGED, MISSING, EDITED, FOREIGN, NEWER, UNREADABLE, SIGNATURE, UNCHAINED = (
    "changed", "missing", "edited", "foreign", "newer", "unreadable", "signature", "unchained",
)  # fmt: skip


@dataclass(frozen=True)
class IntegrityFinding:
    """Something that is wrong.

    Parameters
    ----------
    kind : ``changed``, ``missing``, ``edited``, ``foreign``, ``newer``, ``unreadable``, ``signature`` or ``unchained``.
    path : the file, below the archive's root.
    consequences : in words, what else was found because of it.
    """

    kind: str
    path: str
    message: str
    consequences: tuple[str, ...] = ()


@dataclass
class CheckedPart:
    """What was found in a part of the archive, and how much of it was read.

    Parameters
    ----------
    remarks : what a reader should know and is not wrong.
    signatures : how many manifests have a signature that is good, unknown, bad or not there.
    untrusted : names of the manifests whose signature is unknown or not there, by which of the two.
    """

    root: Place
    keys: Mapping[str, Ed25519PublicKey]
    findings: list[IntegrityFinding] = field(default_factory=list[IntegrityFinding])
    remarks: list[str] = field(default_factory=list[str])
    signatures: Counter[str] = field(default_factory=Counter[str])
    untrusted: dict[str, list[str]] = field(default_factory=lambda: {UNSIGNED: [], UNKNOWN: []})
    tables: int = 0
    manifests: int = 0
    rows: int = 0
    bytes: int = 0

    def blank(self) -> CheckedPart:
        """One of the same archive and keys in which nothing was found yet."""
        return CheckedPart(self.root, self.keys)

    def add(self, other: CheckedPart) -> None:
        """Take in what was found elsewhere."""
        self.findings += other.findings
        self.remarks += other.remarks
        self.signatures += other.signatures
        for state, names in other.untrusted.items():
            self.untrusted[state] += names
        for name in ("tables", "manifests", "rows", "bytes"):
            setattr(self, name, getattr(self, name) + getattr(other, name))

    def name(self, place: Place) -> str:
        """A place's name below the archive's root."""
        return str(place)[len(str(self.root)) :].lstrip("/\\")

    def wrong(self, kind: str, place: Place, message: str) -> None:
        """Note something that is wrong."""
        self.findings.append(IntegrityFinding(kind, self.name(place), message))

    def manifest(self, place: Place, known_schema: int) -> tuple[dict[str, Any], str] | None:
        """A manifest's content and the hash of its file, its signature checked; None where it cannot be used."""
        try:
            data = place.read_bytes()
            content = files.parsed(data, place)
        except OSError as problem:
            self.wrong(MISSING, place, f"is not there or cannot be read ({first_line(problem)})")
            return None
        except NameLeadsOut as problem:
            self.wrong(EDITED, place, str(problem).partition(f"{place} ")[2])
            return None
        except ArchiveUnusable:
            self.wrong(UNREADABLE, place, "is no manifest that can be read")
            return None
        self.manifests += 1
        self.bytes += len(data)
        schema = content.get("schema")
        if isinstance(schema, int) and schema > known_schema:
            self.wrong(
                NEWER, place, f"has schema {schema}, this version knows up to {known_schema}: use a newer version"
            )
            return None
        state = check(content, self.keys)
        self.signatures[state] += 1
        if state in self.untrusted:
            self.untrusted[state].append(self.name(place))
        if state == BAD:
            self.wrong(SIGNATURE, place, "was edited after it was signed, or signed with another key than it names")
        return content, files.hash_of(data)

    def named(self, content: Mapping[str, Any], entry: str, place: Place) -> dict[str, str]:
        """What an entry of a manifest names, with a hash each; one of another shape was edited."""
        found = content.get(entry, {})
        if isinstance(found, dict) and all(isinstance(value, str) for value in found.values()):
            return found
        self.wrong(EDITED, place, f"was edited: '{entry}' are no names with a hash each")
        return {}

    def table(self, place: Place, wanted: str, rows: int | None = None) -> None:
        """Hold a table's bytes against a hash, and its rows against a count."""
        try:
            found, count, size = _read(place)
        except (FileNotFoundError, NotADirectoryError):
            self.wrong(MISSING, place, "is not there, its manifest is")
            return
        except OSError as problem:
            self.wrong(UNREADABLE, place, f"cannot be read ({first_line(problem)})")
            return
        self.tables += 1
        self.rows += count or 0
        self.bytes += size
        if found != wanted:
            self.wrong(
                CHANGED, place, f"is not as it was written: hash {found[:12]}…, its manifest says {str(wanted)[:12]}…"
            )
        elif rows is not None and count != rows:
            self.wrong(EDITED, place, f"has {count} rows, its manifest says {rows}")


def _read(place: Place) -> tuple[str, int | None, int]:
    """Hash, rows (of a Parquet file that is whole) and size of a file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    data = place.read_bytes() if isinstance(place, ObjectPath) else b""
    found = files.hash_of(data) if isinstance(place, ObjectPath) else files.sha256(place)
    size = len(data) if isinstance(place, ObjectPath) else place.stat().st_size
    if place.suffix != ".parquet":
        return found, None, size
    source = pa.BufferReader(data) if isinstance(place, ObjectPath) else str(place)
    try:
        return found, pq.read_metadata(source).num_rows, size
    except (pa.ArrowInvalid, OSError):  # told by the hash
        return found, None, size
