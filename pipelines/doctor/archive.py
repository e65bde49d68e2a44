"""The archive: there, of the format of this version, writable, with room, in time, and its signing key outside it."""

import os
import shutil
import stat
import time
from pathlib import Path

from pipelines.archive import Archive, files
from pipelines.archive.archive import FORMAT
from pipelines.archive.signatures import VARIABLE as KEY_VARIABLE
from pipelines.archive.signatures import key_file, name_of, private_key
from pipelines.archive.store import first_line
from pipelines.doctor.check import LARGEST_OFFSET_S, clock_check, judged, of_error, unwritable, write_probe
from pipelines.doctor.documents import Check
from schemas.errors import TumblelineError

PART, KEY = "archive", "signing key"
VARIABLE = "TUMBLELINE_ARCHIVE"
GIGA = 1e9
OTHERS = 0o077


def archive_checks(address: str | None, free_gb: float) -> list[Check]:
    """The checks of the archive of an address, or of the default one.

    free_gb : needed free space, GB; not known of an object store
    """
    named = address or os.environ.get(VARIABLE)
    try:
        archive = Archive(address)
        return _checks(archive, named=bool(named), free_gb=free_gb)
    except TumblelineError as problem:
        return [of_error(PART, "reachable", problem)]
    except OSError as problem:
        found = f"{named or 'archive'} cannot be looked into ({first_line(problem)})"
        remedy = "give this user the right to read it, or name another with --archive or TUMBLELINE_ARCHIVE"
        return [Check(PART, "reachable", "fault", found, "a folder that this user may read", remedy)]


def _checks(archive: Archive, *, named: bool, free_gb: float) -> list[Check]:
    root = archive.root
    mark = root / "archive.json"
    if not mark.is_file():
        return [_missing(archive, named=named)]
    out = [Check(PART, "reachable", "good", str(root))]
    form = files.read_json(mark).get("format")
    remedy, needed = "use the version that wrote it, or name another archive", f"{FORMAT}, which this version writes"
    out.append(judged(PART, "format", f"{form}", needed, remedy, good=form == FORMAT))
    try:
        ahead_s = write_probe(root)
    except OSError as problem:
        remedy = "give this user the right to write, or make room; nothing was left behind"
        out.append(unwritable(PART, root, problem, remedy))
    else:
        out.append(Check(PART, "writable", "good", "1 MiB was written, read back and removed"))
        out.append(clock_check(PART, ahead_s, "the archive"))
    if isinstance(root, Path):
        free = shutil.disk_usage(root).free / GIGA
        remedy, needed = "make room on its disk, or give it a larger one", f"at least {free_gb:g} GB"
        out.append(judged(PART, "free space", f"{free:.1f} GB", needed, remedy, good=free >= free_gb))
        out += _later_than_now(root)
    return out


def _missing(archive: Archive, *, named: bool) -> Check:
    """No archive: a fault where one is named, as a disk that is not mounted leaves an empty folder."""
    found = f"{archive.root} holds no archive"
    if not named:
        remedy = "the first run makes it here; or name one with --archive or TUMBLELINE_ARCHIVE"
        return Check(PART, "reachable", "not configured", found, "", remedy)
    remedy = "mount its disk or correct the address; the first run makes an archive in an empty folder"
    return Check(PART, "reachable", "fault", found, "an archive", remedy)


def _later_than_now(root: Path) -> list[Check]:
    """A fault where something was archived later than now: the clock of the host went back, or was wrong then."""
    stamps = [path.stat().st_mtime for name in ("runs", "captures", "chain") if (path := root / name).is_dir()]
    later_s = max(stamps, default=0.0) - time.time()
    if later_s <= LARGEST_OFFSET_S:
        return []
    found = f"last entry {later_s:.0f} s later than now"
    remedy = "correct the clock of the host before the next run: the order of runs follows it"
    return [Check(PART, "last entry", "fault", found, "an earlier time than now", remedy)]


def key_checks(address: str | None) -> list[Check]:
    """The checks of the key that signs manifests and certificates."""
    try:
        path = key_file()
        if path is None:
            remedy = f"make one with 'tumbleline archive key', and name its file in {KEY_VARIABLE}"
            return [Check(KEY, "present", "warning", "none: manifests are not signed", "an Ed25519 key", remedy)]
        name = name_of(private_key(path).public_key())
    except TumblelineError as problem:
        return [of_error(KEY, "present", problem)]
    mode = stat.S_IMODE(path.stat().st_mode)
    private = not mode & OTHERS
    return [
        Check(KEY, "present", "good", f"{name} in {path}"),
        judged(KEY, "private", f"mode {mode:04o}", "0600 or less", f"run: chmod 600 {path}", good=private),
        _outside(path, address),
    ]


def _outside(path: Path, address: str | None) -> Check:
    try:
        root = Archive(address).root
    except TumblelineError:
        return Check(KEY, "outside the archive", "not configured", "the archive cannot be reached")
    inside = isinstance(root, Path) and path.resolve().is_relative_to(root.resolve())
    found, remedy = "yes", "move it elsewhere: who can change the archive could sign with it"
    if inside:
        found = f"{path} lies in the archive"
    return judged(KEY, "outside the archive", found, "a place outside", remedy, good=not inside)
