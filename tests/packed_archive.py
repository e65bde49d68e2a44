"""An archive with a finished run whose units are certified, to be compacted, and what its readers see of it."""

import os
import shutil
import time
from collections.abc import Iterator
from pathlib import Path

from capture_double import small_run
from once import once

from pipelines.archive import Archive, packs
from pipelines.certificates.ledger import Ledger
from pipelines.chain.certify import certify


def aged(*places: Path) -> None:
    """Makes files two hours old, as compaction wants them."""
    before = time.time() - 2.0 * 3600.0
    for place in places:
        os.utime(place, (before, before))


def certified_archive(root: Path) -> Archive:
    """A copy, in a folder, of an archive with a finished run whose units are certified, all two hours old."""

    def made(place: Path) -> Path:
        run = small_run(place)
        run.seal()
        certify(Ledger(run.archive), run)
        aged(*(place / "archive").rglob("*"))
        return place / "archive"

    return copied(once("certified-archive", made), root)


def copied(root: Path, to: Path) -> Archive:
    """A copy of an archive's folder."""
    shutil.copytree(root, to)
    return Archive(to)


def logical(archive: Archive) -> dict[str, bytes]:
    """Every file of an archive as its readers see it, but for locks and what is derived."""

    def below(folder: Path, name: str) -> Iterator[tuple[str, bytes]]:
        for place in folder.iterdir():
            here = f"{name}{place.name}"
            if place.is_dir():
                yield from below(place, f"{here}/")
            elif place.name != "lock":
                yield here, place.read_bytes()

    return {k: v for k, v in below(archive.root, "") if k.partition("/")[0] not in {"index", packs.FOLDER}}


def single(archive: Archive) -> list[Path]:
    """The files on the disk but for locks."""
    return [p for p in Path(str(archive.root)).rglob("*") if p.is_file() and p.name != "lock"]


def later(archive: Archive, file: str, data: bytes = b"a later file") -> None:
    """A file that a later command wrote into a folder of which the rest is packed."""
    place = Path(str(archive.root)) / file
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(data)
    aged(place)


def packed_zips(archive: Archive) -> list[str]:
    """Names of the packs."""
    return sorted(place.name for place in Path(str(archive.root / packs.FOLDER)).glob("*.zip"))
