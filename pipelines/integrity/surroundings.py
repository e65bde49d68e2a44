"""Checks for foreign content in an archive: links, private keys, files that the archive did not write."""

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path

from pipelines.archive import Archive, files
from pipelines.archive.store import Place
from pipelines.integrity.findings import CHANGED, FOREIGN, MISSING, SIGNATURE, UNREADABLE, VerifiedPart

OURS = re.compile(
    r"archive\.json|(index|orchestrator)/.*|.*\.parquet"
    r"|captures/[^/]+/(lock|complete\.json|events/\d+\.json|state/\d+\.bin|\d+/record\.json)"
    r"|runs/[^/]+/(lock|report\.html|[^/.]+\.json)"
    r"|programming/(lock|station/[0-9a-f]+\.bin|[0-9a-f]{2}/[0-9a-f]{16}/\d+\.json)"
    r"|calibrations/lock|calibrations/[0-9a-f]{2}/[0-9a-f]{16}/\d+\.json|chain/\d+/\d+\.json"
    r"|packed/(lock|\d{6}-[0-9a-z-]+\.(zip|toc))"
    r"|(releases|whatif)/(lock|[0-9a-f-]+\.json)|attributes/(lock|\d{6}\.json)"
    r"|recordings/[^/]+\.jsonl"
    r"|discovery/(lock|scores/\d{6}\.scores|[^/]+/(lock|found|state|nights/\d{6}\.json))"
)
KEY_MARK, KEY_BYTES = b"PRIVATE KEY-----", 16_384
SHOWN = 10


def check_mark(archive: Archive, checked: VerifiedPart) -> None:
    """The file ``archive.json``, which the chain does not name, must have its constant content."""
    path, expected = archive.root / "archive.json", archive.mark
    try:
        if path.read_bytes() != expected:
            checked.wrong(CHANGED, path, f"is not the content of every archive, which is {expected.decode().split()}")
    except FileNotFoundError:
        checked.wrong(MISSING, path, "is missing, every archive has it")
    except OSError:
        checked.wrong(UNREADABLE, path, "cannot be read")


def check_surroundings(archive: Archive, checked: VerifiedPart) -> None:
    """Every file of a local archive that is not the archive's own."""
    if not isinstance(archive.root, Path):  # an object store has no links, and its listing is slow
        return
    strangers: list[str] = []
    for name, path in _all(archive.root):
        if not path.is_symlink() and not OURS.fullmatch(name) and files.TEMPORARY not in name:
            with suppress(OSError):
                if path.stat().st_size <= KEY_BYTES and KEY_MARK in path.read_bytes():
                    what = "is a private key: who can edit the archive could sign with it; move it out"
                    checked.wrong(SIGNATURE, path, what)
            strangers.append(name)
    if strangers:
        more = f" and {len(strangers) - SHOWN} more" if len(strangers) > SHOWN else ""
        checked.remarks.append(f"{', '.join(strangers[:SHOWN])}{more}: not written by the archive")


def check_links(archive: Archive, folders: Iterable[Place], checked: VerifiedPart) -> None:
    """Links in the given folders of a local archive: nothing behind them is read, so this is the first of all checks."""
    for folder in folders:
        if not isinstance(folder, Path):  # an object store has no links
            continue
        top = folder.parent == archive.root  # may be a link to another disk
        for link in (str(folder),) if folder.is_symlink() and not top else _links(str(folder)):
            # a link is no file of the archive: its target can be changed elsewhere
            what = f"is a link to {os.readlink(link)}: replace it by the content"  # noqa: PTH115 - as it was written
            checked.wrong(FOREIGN, Path(link), what)


def _links(folder: str) -> Iterator[str]:
    """Symbolic links below a folder; they are not followed."""
    try:
        inside = list(os.scandir(folder))
    except OSError:  # a file, or told by the other checks
        return
    for entry in inside:
        if entry.is_symlink():
            yield entry.path
        elif entry.is_dir(follow_symlinks=False):
            yield from _links(entry.path)


def _all(root: Path) -> Iterator[tuple[str, Path]]:
    for folder, _, names in os.walk(root):
        for name in sorted(names):
            path = Path(folder) / name
            yield path.relative_to(root).as_posix(), path
