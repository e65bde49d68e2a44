"""The archive's folders: captures, and runs that work on them.

``captures/<id>/<record>/`` holds the samples of the station, ``runs/<id>/<table>.parquet`` the tables of the stages, each with
its manifest ``<table>.json``. The name of a run has the name of its recipe and the hash of everything that decides its result, so
that the same command finds the same run.
"""

import os
import re
import sys
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import files
from pipelines.archive.keys import digest
from pipelines.archive.listing import RunInfo, infos_of
from pipelines.archive.packed_path import with_packs
from pipelines.archive.provenance import provenance
from pipelines.archive.records import Records
from pipelines.archive.run import START, Run, names_in
from pipelines.archive.signatures import key_file
from pipelines.archive.store import Place, address_of, path_of
from schemas.errors import ArchiveUnusable, WrongUse, close_matches, did_you_mean
from schemas.foreign import shown

if TYPE_CHECKING:
    import pandas as pd

FORMAT = 1
PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")  # a name that cannot lead elsewhere


FEW = 5  # names in a message


def _few(names: Sequence[str]) -> str:
    more = f" and {len(names) - FEW} more ('tumbleline list')" if len(names) > FEW else ""
    return ", ".join(names[:FEW]) + more


def default_root() -> Place:
    """The default root of the archive: the environment's TUMBLELINE_ARCHIVE, else ./archive."""
    return with_packs(path_of(os.environ.get("TUMBLELINE_ARCHIVE") or "archive"))


class Archive:
    """A folder of captures and runs, on a disk or in an object store."""

    def __init__(self, root: Place | str | None = None) -> None:
        self.root: Place = with_packs(path_of(root)) if root is not None else default_root()

    @property
    def address(self) -> str:
        """The address by which another process opens this archive."""
        return address_of(self.root)

    @property
    def mark(self) -> bytes:
        """Content of the file that makes a folder an archive."""
        return files.json_bytes({"product": "tumbleline", "format": FORMAT})

    def prepare(self) -> None:
        """Make sure that the folder is an archive that can be written; refuse a folder of something else."""
        self._refuse_key_within()
        self._refuse_name_without_text()
        mark = self.root / "archive.json"
        if mark.is_file():
            self._refuse_other_format()
            with files.writing(self.root):
                probe = self.root / f"{files.TEMPORARY}probe-{os.getpid()}"
                probe.write_bytes(b"")
                probe.unlink()
            return
        files.sweep(self.root)  # a first command that was killed may have left temporary files of this program
        if self.root.is_dir() and any(self.root.iterdir()):
            raise ArchiveUnusable(f"archive: {self.root} holds other files and no archive; give an empty or new folder")
        files.publish(mark, self.mark)

    def refuse_none(self) -> None:
        """Refuse a root that holds no archive, or an archive of another format."""
        if not (self.root / "archive.json").is_file():
            raise ArchiveUnusable(
                f"archive: folder '{self.root}' holds no archive, one with runs is needed; name it with --archive or "
                "TUMBLELINE_ARCHIVE, or make one with 'tumbleline run'"
            )
        self._refuse_other_format()

    def refuse_misnamed(self, given: str | None) -> None:
        """Refuse a root that somebody named and that holds no archive; the usual folder has none before the first run."""
        if given is not None or self.root.is_dir():
            self.refuse_none()

    def open_run(self, name: str, about: Mapping[str, Any], decisive: object) -> Run:
        """The run of this name and of the hash of what decides its result; it is created where it does not exist.

        about : what ``run.json`` says about the run.
        decisive : JSON-able; everything that the result depends on.
        """
        run = Run(self, self.run_name(name, decisive))
        if not (run.path / START).is_file():
            self.prepare()
            files.publish(run.path / START, files.manifest_bytes({**provenance(), **about}))
        return run

    @staticmethod
    def run_name(name: str, decisive: object) -> str:
        """The id of a run: its name and the hash of what decides its result."""
        return f"{name}-{digest(decisive)[:10]}"

    def first_run_of(self, capture_id: str, units: Sequence[str]) -> Run | None:
        """The run that measured a capture; None where no run of these units is of it. Later ones analyse the same data again."""
        ids = (info.id for info in self.runs() if not info.rerun_of and info.units == tuple(units))
        return next((run for run_id in ids if (run := Run(self, run_id)).about.get("capture") == capture_id), None)

    def capture(self, capture_id: str) -> Records:
        """The records of a capture, for reading or for continuing."""
        return Records(self.root / "captures" / capture_id)

    def run(self, name: str, *, or_unit: bool = False) -> Run:
        """The run of this id, of this unambiguous beginning, or ``latest``.

        or_unit : the name may have been meant as a serial number, for the message where there is no such run
        """
        self._refuse_other_format()
        if PLAIN.fullmatch(name) and (self.root / "runs" / name / START).is_file():
            return Run(self, name)
        if name == "latest" and (infos := self.runs()):
            return Run(self, infos[-1].id)
        ids = [run_id for run_id in self.run_ids() if (self.root / "runs" / run_id / START).is_file()]
        matches = [run_id for run_id in ids if name and run_id.startswith(name)]
        if len(matches) == 1:
            return Run(self, matches[0])
        where = f"archive {self.root}"
        if not matches and (
            lost := [run_id for run_id in self.without_start(set(ids)) if name and run_id.startswith(name)]
        ):
            raise ArchiveUnusable(
                f"{where}: folder runs/{lost[0]} has no {START}; restore it from a copy, see 'tumbleline verify'"
            )
        if matches:
            begun = f"'{name}' begins {len(matches)} runs ({_few(matches)})"
            message = f"{where}: {begun}, one is needed; write more of it"
        elif ids:
            close = close_matches(name, ("latest", *ids))
            hint = did_you_mean(name, close) if close else f"known: {_few(ids)}"
            message = f"{where}: no run is called '{name}'; {hint}"
            if or_unit:
                message = f"{where}: '{name}' is no run, and no unit with a certificate; {self.units_like(name, close) or hint}"
        else:
            self.refuse_none()
            message = f"{where}: there is no run yet; make one with 'tumbleline run'"
        raise WrongUse(message)

    def table(self, run: str, name: str) -> "pd.DataFrame":
        """A table of a run."""
        return self.run(run).table(name)

    def units_like(self, serial: str, others: Sequence[str] = ()) -> str:
        """The end of a message that no unit of this serial has a certificate, else empty.

        others : names that may have been meant besides
        """
        runs = self.runs()
        measured = [info.id for info in runs if serial in info.units]
        if measured:
            return f"it was measured in {_few(measured)}: 'tumbleline certificate issue RUN' certifies what passed"
        close = close_matches(serial, {unit for info in runs for unit in info.units} | {*others})
        return did_you_mean(serial, close) if close else ""

    def runs(self) -> list[RunInfo]:
        """Every run, in the order of their start."""
        infos = infos_of(self.root, [Run(self, run_id) for run_id in self.run_ids()])
        return sorted(infos, key=lambda info: (info.started, info.id))

    def without_start(self, known: Collection[str]) -> list[str]:
        """Folders with files of a run, whose ``run.json`` is gone: no command can read them; ``known`` are runs that have it."""
        found = ((run_id, names_in(self.root / "runs" / run_id)) for run_id in self.run_ids() if run_id not in known)
        return [
            run_id
            for run_id, names in found
            if START not in names and any(n.endswith((".json", ".parquet")) for n in names)
        ]

    def run_ids(self) -> list[str]:
        """Names of the runs in alphabetical order; a run that is being created at the moment may be among them."""
        self._refuse_other_format()
        folder = self.root / "runs"
        return sorted(entry.name for entry in folder.iterdir()) if folder.is_dir() else []

    def _refuse_name_without_text(self) -> None:
        """Refuse a folder whose name has bytes that are no text: the archive's documents hold its address."""
        try:
            self.address.encode()
        except UnicodeEncodeError:
            raise ArchiveUnusable(
                f"archive: the name of folder '{shown(self.address)}' is not in the encoding of this system "
                f"({sys.getfilesystemencoding()}); rename it, or give another one with --archive"
            ) from None

    def _refuse_key_within(self) -> None:
        """Refuse a signing key inside the archive: who can edit the archive could sign with it."""
        key = key_file()
        if key is not None and isinstance(self.root, Path) and key.resolve().is_relative_to(self.root.resolve()):
            raise ArchiveUnusable(
                f"archive: signing key {key} lies in archive {self.root}, one outside is needed; move it elsewhere"
            )

    def _refuse_other_format(self) -> None:
        mark = self.root / "archive.json"
        if mark.is_file() and (found := files.read_json(mark).get("format")) != FORMAT:
            raise ArchiveUnusable(
                f"archive: {self.root} has format {found}, this version writes {FORMAT}; "
                "use the version that wrote it, or another folder"
            )
