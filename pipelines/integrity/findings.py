"""Findings of the checks, and counts of what was checked."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.names import NameLeadsOut
from pipelines.archive.packed_path import member_of
from pipelines.archive.signatures import BAD, UNKNOWN, UNSIGNED, check
from pipelines.archive.store import ObjectPath, Place, first_line
from schemas.errors import ArchiveUnusable

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

CHANGED, MISSING, EDITED, FOREIGN, NEWER, UNREADABLE, SIGNATURE, UNCHAINED = (
    "changed", "missing", "edited", "foreign", "newer", "unreadable", "signature", "unchained",
)  # fmt: skip


@dataclass(frozen=True)
class IntegrityFinding:
    """A difference between the archive and what was written.

    kind : ``changed``, ``missing``, ``edited``, ``foreign``, ``newer``, ``unreadable``, ``signature`` or ``unchained``.
    path : the file, below the archive's root.
    consequences : sentences about further findings with this cause.
    because : a file that this file disagrees with; where only that file was edited, the finding is a consequence of it.
    """

    kind: str
    path: str
    message: str
    consequences: tuple[str, ...] = ()
    because: str = ""


@dataclass
class VerifiedPart:
    """Findings in a part of the archive, and the amount of data read.

    remarks : information that is no finding.
    signatures : number of manifests by state of the signature (good, unknown key, bad, unsigned).
    untrusted : names of the manifests without a signature or with that of an unknown key, by state.
    """

    root: Place
    keys: "Mapping[str, Ed25519PublicKey]"
    findings: list[IntegrityFinding] = field(default_factory=list[IntegrityFinding])
    remarks: list[str] = field(default_factory=list[str])
    signatures: Counter[str] = field(default_factory=Counter[str])
    untrusted: dict[str, list[str]] = field(default_factory=lambda: {UNSIGNED: [], UNKNOWN: []})
    tables: int = 0
    manifests: int = 0
    rows: int = 0
    bytes: int = 0

    def blank(self) -> "VerifiedPart":
        """A new part of the same archive with the same keys, without findings."""
        return VerifiedPart(self.root, self.keys)

    def add(self, other: "VerifiedPart") -> None:
        """Add the findings and counts of another part."""
        self.findings += other.findings
        self.remarks += other.remarks
        self.signatures += other.signatures
        for state, names in other.untrusted.items():
            self.untrusted[state] += names
        for name, count in other.counts.items():
            setattr(self, name, getattr(self, name) + count)

    @property
    def counts(self) -> dict[str, int]:
        """The amount of data read, by its name in the document."""
        return {name: getattr(self, name) for name in ("tables", "manifests", "rows", "bytes")}

    def name(self, path: Place) -> str:
        """The path relative to the root of the archive, as text."""
        return str(path)[len(str(self.root)) :].lstrip("/\\")

    def wrong(self, kind: str, path: Place, message: str, because: Place | None = None) -> None:
        """Add a finding; ``because`` is the other file where two files disagree."""
        other = "" if because is None else self.name(because)
        self.findings.append(IntegrityFinding(kind, self.name(path), message, because=other))

    def manifest(self, path: Place, known_schema: int) -> tuple[dict[str, Any], str] | None:
        """Content of a manifest and hash of its file, with the signature checked; None where the manifest is unusable."""
        try:
            data = path.read_bytes()
            content = files.parsed(data, path)
        except OSError as problem:
            self.wrong(MISSING, path, f"is missing or cannot be read ({first_line(problem)})")
            return None
        except NameLeadsOut as problem:
            self.wrong(EDITED, path, str(problem).partition(f"{path} ")[2])
            return None
        except ArchiveUnusable:
            self.wrong(UNREADABLE, path, "is not a readable manifest")
            return None
        self.manifests += 1
        self.bytes += len(data)
        schema = content.get("schema")
        if isinstance(schema, int) and schema > known_schema:
            what = f"has schema {schema}, this version knows up to {known_schema}: use a newer version"
            self.wrong(NEWER, path, what)
            return None
        state = check(content, self.keys)
        self.signatures[state] += 1
        if state in self.untrusted:
            self.untrusted[state].append(self.name(path))
        if state == BAD:
            self.wrong(SIGNATURE, path, "was edited after signing, or was signed with another key than it names")
        return content, files.hash_of(data)

    def named(self, content: Mapping[str, Any], entry: str, path: Place) -> dict[str, str]:
        """Names and hashes in an entry of a manifest; any other type shows that the manifest was edited."""
        names = content.get(entry, {})
        if isinstance(names, dict) and all(isinstance(value, str) for value in names.values()):
            return names
        self.wrong(EDITED, path, f"was edited: '{entry}' is not a table of names and hashes")
        return {}

    def table(self, path: Place, expected: str, rows: int | None = None) -> None:
        """Compare the bytes of a table with a hash, and its rows with a count."""
        try:
            actual, count, size = _read(path)
        except (FileNotFoundError, NotADirectoryError):
            self.wrong(MISSING, path, "is missing, its manifest exists")
            return
        except OSError as problem:
            self.wrong(UNREADABLE, path, f"cannot be read ({first_line(problem)})")
            return
        self.tables += 1
        self.rows += count or 0
        self.bytes += size
        if actual != expected:
            hashes = f"hash {actual[:12]}…, its manifest says {str(expected)[:12]}…"
            self.wrong(CHANGED, path, f"has changed since it was written: {hashes}")
        elif rows is not None and count != rows:
            self.wrong(EDITED, path, f"has {count} rows, its manifest says {rows}")


def _read(path: Place) -> tuple[str, int | None, int]:
    """Hash, rows (of a complete Parquet file) and size of a file."""
    inside = _is_inside(path)
    data = path.read_bytes() if inside else b""
    actual = files.hash_of(data) if inside else files.sha256(path)
    metadata = parquet_metadata(path, data) if path.suffix == ".parquet" else None
    return actual, None if metadata is None else metadata.num_rows, len(data) if inside else path.stat().st_size


def _is_inside(path: Place) -> bool:
    """Whether a file lies in an object store or in a pack, which Arrow does not find by its name."""
    return isinstance(path, ObjectPath) or member_of(path) is not None


def parquet_metadata(path: Place, data: bytes = b"") -> Any:
    """The metadata of a Parquet file, from its bytes where they are known; None for a foreign or damaged file."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    source = pa.BufferReader(data or path.read_bytes()) if _is_inside(path) else str(path)
    try:
        return pq.read_metadata(source)
    except (pa.ArrowInvalid, OSError):
        return None
