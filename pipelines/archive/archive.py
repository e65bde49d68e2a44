"""The archive's folders: captures, and runs that work on them.

``captures/<id>/<record>/`` holds what the station delivered, ``runs/<id>/<table>.parquet`` what stages made of it, with
``<table>.json`` beside each. A run is named for its recipe and the hash of all that decides its result, so the
same command finds the same run.
"""

from __future__ import annotations

import getpass
import os
import platform
import re
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipelines.archive import chain, files
from pipelines.archive.keys import digest, libraries
from pipelines.archive.listing import stages_of
from pipelines.archive.records import COMPLETE, PARTS, Records
from pipelines.archive.signatures import ENTRY, key_place
from pipelines.archive.store import address_of, place_of
from schemas.errors import ArchiveUnusable, WrongUse, did_you_mean
from schemas.version import refuse_newer

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd

    from pipelines.archive.listing import RunInfo
    from pipelines.archive.store import Place

FORMAT = 1
START = "run.json"
PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")  # a name that cannot lead elsewhere


def default_root() -> Place:
    """The archive's place where none is given: the environment's TUMBLELINE_ARCHIVE, else ./archive."""
    return place_of(os.environ.get("TUMBLELINE_ARCHIVE") or "archive")


class Run:
    """One run: its tables, their manifests, and what it was started with."""

    def __init__(self, archive: Archive, run_id: str) -> None:
        self.archive, self.id = archive, run_id
        self.path = archive.root / "runs" / run_id

    @property
    def about(self) -> dict[str, Any]:
        """What the run was started with: recipe, limits, lot, station, capture; and who, where, when."""
        return files.read_json(self.path / "run.json")

    @property
    def records(self) -> Records | None:
        """What was captured for this run; None for a run on imported tables."""
        capture = self.about.get("capture")
        return Records(self.archive.root / "captures" / capture) if capture else None

    @property
    def report(self) -> Place:
        """Where the report for people lies."""
        return self.path / "report.html"

    def has(self, names: tuple[str, ...], key: str) -> bool:
        """Whether all these tables are there, made by the stage with this key."""
        return all(self._is_made_by(name, key) for name in names)

    def save(
        self,
        stage: str,
        key: str,
        outputs: Mapping[str, pd.DataFrame],
        about: Mapping[str, Any],
    ) -> None:
        """Publish the tables of a stage with a manifest beside each.

        Parameters
        ----------
        about : the stage's inputs, parameters and code, as they went into the key.
        """
        from schemas import tables  # slow to import, and only writers of tables need it

        by, follows = provenance(), self._manifests(about.get("inputs", {}))
        for name, frame in outputs.items():
            data = files.table_bytes(
                name,
                tables.check(name, frame, where=f"{stage} → {name}"),
                tables.VERSION,
            )
            self._put(f"{name}.parquet", data)
            content = {
                "stage": stage,
                "key": key,
                "sha256": sha256(data).hexdigest(),
                "rows": len(frame),
            }
            manifest = {**by, **content, **about, "schema": tables.VERSION, "manifests": follows}
            self._put(f"{name}.json", files.manifest_bytes(manifest))

    def adopt(self, other: Run, names: tuple[str, ...]) -> None:
        """Take tables over from another run of the same archive, byte for byte, with who made them, when and with what."""
        for name in names:
            path, manifest = other.path / f"{name}.parquet", other.manifest(name)
            data = path.read_bytes()
            if sha256(data).hexdigest() != manifest["sha256"]:
                message = (
                    f"archive: {path} has changed since it was written (its hash is not its manifest's); restore it from a "
                    "copy before the run is run again"
                )
                raise ArchiveUnusable(message)
            self._put(f"{name}.parquet", data)
            follows = self._manifests(manifest.get("inputs", {}))
            kept = {key: value for key, value in manifest.items() if key != ENTRY}  # what is told anew is signed anew
            content = {**kept, "taken_from": manifest.get("taken_from", other.id), "manifests": follows}
            self._put(f"{name}.json", files.manifest_bytes(content))

    def save_report(self, key: str, html: str, about: Mapping[str, Any]) -> None:
        """Publish the report for people with its manifest."""
        data = html.encode()
        files.publish(self.report, data)
        content = {"stage": "report", "key": key, "sha256": sha256(data).hexdigest()}
        manifest = {**provenance(), **content, **about, "manifests": self._manifests(about.get("inputs", {}))}
        files.publish(self.path / "report.json", files.manifest_bytes(manifest))
        self.seal()

    def seal(self) -> int:
        """The number of the entry in the archive's chain that names all manifests of the run as they are."""
        mark = self.path / "sealed.json"
        names = [path for path in self.path.glob("*.json") if path.name != mark.name]
        sealed = {f"runs/{self.id}/{path.name}": files.sha256(path) for path in sorted(names, key=lambda one: one.name)}
        if self.records is not None and self.records.is_complete():
            end = self.records.path / COMPLETE
            sealed[f"captures/{end.parent.name}/{end.name}"] = files.sha256(end)
        before = files.read_json(mark) if mark.is_file() else {}
        if before.get("files") == sealed:
            return int(before["entry"])
        entry = chain.append(self.archive.root, "run", sealed, {**provenance(), "run": self.id})
        files.publish(mark, files.json_bytes({"entry": entry, "files": sealed, "stages": stages_of(self)}))
        return entry

    def has_report(self, key: str) -> bool:
        """Whether the report is there, made with this key."""
        return self.report.is_file() and self._manifest_key("report") == key

    def table(self, name: str) -> pd.DataFrame:
        """A table of the run, whole and unchanged since it was written."""
        path = self.path / f"{name}.parquet"
        if name in PARTS and not path.is_file() and self.records is not None:
            return self.records.gathered(name)
        from schemas import tables

        if name not in tables.TABLES:
            message = f"archive: no table is called '{name}'; {did_you_mean(name, tables.TABLES)}"
            raise WrongUse(message)
        return files.read_table(path, name, self.manifest(name)["sha256"] if path.is_file() else None)

    def manifest(self, name: str) -> dict[str, Any]:
        """The manifest of a table."""
        place = self.path / f"{name}.json"
        content = files.read_json(place)
        refuse_newer(content.get("schema"), str(place))
        return content

    def tables(self) -> list[str]:
        """Names of the tables that are there."""
        return sorted(path.stem for path in self.path.glob("*.parquet"))

    def _manifests(self, inputs: Mapping[str, str]) -> dict[str, str]:
        """Hashes of the manifests of a stage's inputs, and of what the run was started with: each names those before it."""
        found = {name: self._hash_of(f"{name}.json") for name in ("run", *inputs)}
        records = self.records
        if records is not None and (records.path / COMPLETE).is_file():
            found["records"] = files.sha256(records.path / COMPLETE)
        return {name: value for name, value in sorted(found.items()) if value}

    def _put(self, name: str, data: bytes) -> None:
        """Publish a file of the run."""
        files.publish(self.path / name, data)

    def _hash_of(self, name: str) -> str:
        """Hash of a file of the run; empty where it is not there."""
        place = self.path / name
        return files.sha256(place) if place.is_file() else ""

    def _is_made_by(self, name: str, key: str) -> bool:
        path = self.path / f"{name}.parquet"
        if not path.is_file() or self._manifest_key(name) != key:
            return False
        if files.sha256(path) != self.manifest(name)["sha256"]:
            message = (
                f"archive: {path} ({path.stat().st_size} bytes) is truncated or has changed since it was written; "
                "restore it from a copy, or remove it and its manifest to have the stage run again"
            )
            raise ArchiveUnusable(message)
        return True

    def _manifest_key(self, name: str) -> str:
        path = self.path / f"{name}.json"
        return files.read_json(path)["key"] if path.is_file() else ""


class Archive:
    """A folder of captures and runs, or a place in an object store that is used as one."""

    def __init__(self, root: Place | str | None = None) -> None:
        self.root: Place = place_of(root) if root is not None else default_root()

    @property
    def address(self) -> str:
        """By what another process opens the same archive."""
        return address_of(self.root)

    def prepare(self) -> None:
        """Make sure that the folder is an archive that can be written; refuse a folder of something else."""
        self._refuse_key_within()
        mark = self.root / "archive.json"
        if mark.is_file():
            self._refuse_other_format(files.read_json(mark))
            with files.writing(self.root):
                probe = self.root / f"{files.TEMPORARY}probe-{os.getpid()}"
                probe.write_bytes(b"")
                probe.unlink()
            return
        files.sweep(self.root)  # a first command that was killed leaves a name of ours, not files of others
        if self.root.is_dir() and any(self.root.iterdir()):
            message = f"archive: {self.root} holds other files and no archive; give an empty or new folder"
            raise ArchiveUnusable(message)
        files.publish(mark, files.json_bytes({"product": "tumbleline", "format": FORMAT}))

    def refuse_none(self) -> None:
        """Refuse a place that holds no archive, or one of another format."""
        mark = self.root / "archive.json"
        if not mark.is_file():
            message = (
                f"archive: {self.root} holds no archive, one is needed; name it with --archive or TUMBLELINE_ARCHIVE"
            )
            raise ArchiveUnusable(message)
        self._refuse_other_format(files.read_json(mark))

    def open_run(self, name: str, about: Mapping[str, Any], decisive: object) -> Run:
        """The run named for ``name`` and the hash of what decides its result: found, or begun.

        Parameters
        ----------
        about : what is kept for readers in ``run.json``.
        decisive : JSON-able; everything that the result depends on.
        """
        run = Run(self, f"{name}-{digest(decisive)[:10]}")
        if not (run.path / "run.json").is_file():
            self.prepare()
            files.publish(run.path / "run.json", files.manifest_bytes({**provenance(), **about}))
        return run

    def capture(self, capture_id: str) -> Records:
        """The records of a capture, to be read or gone on with."""
        return Records(self.root / "captures" / capture_id)

    def run(self, name: str) -> Run:
        """The run of this id, of this unambiguous beginning, or ``latest``."""
        self._refuse_newer_format()
        if PLAIN.fullmatch(name) and (self.root / "runs" / name / START).is_file():
            return Run(self, name)
        if name == "latest" and (infos := self.runs()):
            return Run(self, infos[-1].id)
        ids = [one for one in self.run_ids() if (self.root / "runs" / one / START).is_file()]
        found = [one for one in ids if name and one.startswith(name)]
        if len(found) == 1:
            return Run(self, found[0])
        where = f"archive {self.root}"
        if found:
            message = f"{where}: '{name}' begins {len(found)} runs ({', '.join(found)}); write more of the name"
        elif ids:
            message = f"{where}: no run is called '{name}'; {did_you_mean(name, ids)}"
        else:
            message = f"{where}: there is no run yet; make one with 'tumbleline run'"
        raise WrongUse(message)

    def table(self, run: str, name: str) -> pd.DataFrame:
        """A table of a run."""
        return self.run(run).table(name)

    def runs(self) -> list[RunInfo]:
        """Every run, the one started first first."""
        from pipelines.archive.noted import infos_of

        infos = infos_of(self.root, [Run(self, run_id) for run_id in self.run_ids()])
        return sorted(infos, key=lambda info: (info.started, info.id))

    def run_ids(self) -> list[str]:
        """Names of the runs, in the order of the alphabet; among them may be one that is just being begun."""
        self._refuse_newer_format()
        folder = self.root / "runs"
        return sorted(place.name for place in folder.iterdir()) if folder.is_dir() else []

    def _refuse_newer_format(self) -> None:
        mark = self.root / "archive.json"
        if mark.is_file():
            self._refuse_other_format(files.read_json(mark))

    def _refuse_key_within(self) -> None:
        """Refuse a signing key that lies in the archive: whoever edits the one could use the other."""
        key = key_place()
        if key is not None and isinstance(self.root, Path) and key.resolve().is_relative_to(self.root.resolve()):
            message = (
                f"archive: signing key {key} lies in archive {self.root}, one outside is needed; move it elsewhere"
            )
            raise ArchiveUnusable(message)

    def _refuse_other_format(self, mark: Mapping[str, Any]) -> None:
        if mark.get("format") != FORMAT:
            message = (
                f"archive: {self.root} has format {mark.get('format')}, this version writes {FORMAT}; "
                "use the version that wrote it, or another folder"
            )
            raise ArchiveUnusable(message)


@cache
def _software() -> dict[str, str]:
    """Versions of the product and of what runs it; reading them takes a look into the installation."""
    return {"tumbleline": version("tumbleline"), "python": platform.python_version()}


def provenance() -> dict[str, Any]:
    """Who, where, when and with which libraries: kept beside results, never inside them nor in keys."""
    return {
        "who": getpass.getuser(),
        "where": platform.node(),
        "when": datetime.now(UTC).isoformat(timespec="milliseconds"),
        "software": _software(),
        "libraries": libraries(),
    }
