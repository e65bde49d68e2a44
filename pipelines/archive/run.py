"""One run of the archive: tables with a manifest beside each, the report, and the seal that names them all."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from pipelines.archive import files, hash_chain
from pipelines.archive.parquet import columns_of, encoded, read_table
from pipelines.archive.provenance import provenance
from pipelines.archive.records import COMPLETE, PARTS, Records
from pipelines.archive.store import Place
from schemas.errors import ArchiveUnusable, WrongUse, did_you_mean
from schemas.version import refuse_newer

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

SEALED = "sealed.json"


def stages_of(folder: Place, names: set[str] | None = None) -> list[str]:
    """The stages that made the run's tables."""
    names = names_in(folder) if names is None else names
    manifests = sorted(f"{name.removesuffix('.parquet')}.json" for name in names if name.endswith(".parquet"))
    made = (str(files.read_json(folder / name).get("stage", "")) for name in manifests if name in names)
    return list(dict.fromkeys(made))


def names_in(folder: Place) -> set[str]:
    """Names of the files in a folder; an empty set where the folder does not exist."""
    return {path.name for path in folder.iterdir()} if folder.is_dir() else set()


START = "run.json"
OF_LIMITS = ("budget", "budget_covariance", "figures", "grades", "lot_risks", "uncertainties")
"""Tables that a fit of an import makes only against limits."""


def lost_files(folder: Place, names: set[str]) -> list[str]:
    """Files of a run that its seal names and that are not there; none of a run without a seal, which is not finished.

    names : of the files in the folder
    """
    if SEALED not in names:
        return []
    named = {name.rpartition("/")[2] for name in files.read_json(folder / SEALED)["files"] if name.startswith("runs/")}
    alone = [
        name for name in (named & names) - {START, "report.json"} if name.replace(".json", ".parquet") not in names
    ]
    # a manifest states the stage that made its table; the document of an inquiry has no table
    tables = {name.replace(".json", ".parquet") for name in alone if "stage" in files.read_json(folder / name)}
    return sorted((named - names) | tables)


class Rooted(Protocol):
    """What a run needs of its archive: the root."""

    @property
    def root(self) -> Place:
        """Folder, or path in an object store."""
        ...


class Run:
    """One run: its tables, their manifests, and what it was started with."""

    def __init__(self, archive: Rooted, run_id: str) -> None:
        self.archive, self.id = archive, run_id
        self.path = archive.root / "runs" / run_id

    @property
    def about(self) -> dict[str, Any]:
        """The start of the run: recipe, limits, lot, station, capture; and who, where, when."""
        return files.read_json(self.path / START)

    @property
    def origin(self) -> dict[str, str]:
        """Entries of ``run.json`` of a re-analysis: this run, and when its data were measured."""
        about = self.about
        return {"rerun_of": self.id, "measured": str(about.get("measured") or about["when"])}

    @property
    def records(self) -> Records | None:
        """Records of the capture of this run; None for a run on imported tables."""
        capture = self.about.get("capture")
        return Records(self.archive.root / "captures" / capture) if capture else None

    @property
    def report(self) -> Place:
        """Path of the report."""
        return self.path / "report.html"

    def has(self, names: tuple[str, ...], key: str) -> bool:
        """Whether all these tables are there, made by the stage with this key."""
        return all(self._is_made_by(name, key) for name in names)

    def save(self, stage: str, key: str, outputs: "Mapping[str, pd.DataFrame]", about: Mapping[str, Any]) -> None:
        """Publish the tables of a stage with a manifest beside each.

        about : the stage's inputs, parameters and code, as they went into the key.
        """
        from schemas import table_check, tables  # slow to import, and only writers of tables need it

        by, follows = provenance(), self._manifests(about.get("inputs", {}))
        for name, frame in outputs.items():
            checked = table_check.check(name, frame, where=f"{stage} → {name}")
            data = self._put_table(name, columns_of(name, checked, tables.VERSION))
            content = {"stage": stage, "key": key, "sha256": files.hash_of(data), "rows": len(frame)}
            manifest = {**by, **content, **about, "schema": tables.VERSION, "manifests": follows}
            self._put(f"{name}.json", files.manifest_bytes(manifest))

    def adopt(self, other: "Run", names: tuple[str, ...]) -> None:
        """Copy tables from another run of the same archive, byte for byte, with their provenance."""
        for name in names:
            path, manifest = other.path / f"{name}.parquet", other.manifest(name)
            data = path.read_bytes()
            if files.hash_of(data) != manifest["sha256"]:
                raise ArchiveUnusable(
                    f"archive: {path} has changed since it was written (its hash is not its manifest's); restore it from a "
                    "copy before the run is run again"
                )
            self._put(f"{name}.parquet", data)
            follows = self._manifests(manifest.get("inputs", {}))
            # manifest_bytes replaces the signature
            content = {**manifest, "taken_from": manifest.get("taken_from", other.id), "manifests": follows}
            self._put(f"{name}.json", files.manifest_bytes(content))

    def save_report(self, key: str, html: str, about: Mapping[str, Any]) -> None:
        """Publish the report for people with its manifest."""
        data = html.encode()
        files.publish(self.report, data)
        content = {"stage": "report", "key": key, "sha256": files.hash_of(data)}
        manifest = {**provenance(), **content, **about, "manifests": self._manifests(about.get("inputs", {}))}
        files.publish(self.path / "report.json", files.manifest_bytes(manifest))
        self.seal()

    def seal(self) -> int:
        """The number of the entry in the archive's chain that names all manifests of the run as they are."""
        mark = self.path / SEALED
        names = [path for path in self.path.glob("*.json") if path.name != mark.name]
        sealed = {
            f"runs/{self.id}/{path.name}": files.sha256(path) for path in sorted(names, key=lambda name: name.name)
        }
        if self.records is not None and self.records.is_complete():
            end = self.records.path / COMPLETE
            sealed[f"captures/{end.parent.name}/{end.name}"] = files.sha256(end)
        before = files.read_json(mark) if mark.is_file() else {}
        if before.get("files") == sealed:
            return int(before["entry"])
        entry = hash_chain.append(self.archive.root, "run", sealed, {**provenance(), "run": self.id})
        files.publish(mark, files.json_bytes({"entry": entry, "files": sealed, "stages": stages_of(self.path)}))
        return entry

    def refuse_edited(self) -> None:
        """Refuse a run that is not as the chain sealed it: its start and its manifests; ``verify`` looks at everything."""
        own, number = f"runs/{self.id}/", files.read_json(self.path / SEALED).get("entry")
        entry = hash_chain.path_of_entry(self.archive.root, number if isinstance(number, int) else 0)
        sealed = files.read_json(entry)["files"]
        for name in (own + START, *sealed):
            if name.startswith(own) and self._hash_of(name.removeprefix(own)) != sealed.get(name):
                raise ArchiveUnusable(
                    f"archive: {name} differs from what the chain of the archive sealed, a run as it was sealed is needed; "
                    f"restore it from a copy, see 'tumbleline verify {self.id}'"
                )

    def has_report(self, key: str) -> bool:
        """Whether the report is there, made with this key."""
        return self.report.is_file() and self._manifest_key("report") == key

    def table(self, name: str, columns: Sequence[str] = ()) -> "pd.DataFrame":
        """A table of the run, whole and unchanged since it was written.

        columns : those that the caller reads; the table may have more. All where none is named
        """
        path = self.path / f"{name}.parquet"
        if name in PARTS and not path.is_file() and self.records is not None:
            return self.records.gathered(name)
        from schemas import tables

        if name not in tables.TABLES:
            raise WrongUse(f"archive: no table is called '{name}'; {did_you_mean(name, tables.TABLES)}")
        if self.about.get("lot") and not self.about.get("capture") and not path.is_file():
            there, limits = self.tables(), " --limits FILE" if name in OF_LIMITS else ""
            made = f"which a fit of its dwells makes; fit it with 'tumbleline fit {self.id}{limits}' and name that run"
            known = "dwells" not in there or ("coefficients" in there and not limits)
            raise ArchiveUnusable(
                f"archive: run {self.id} was imported and has no table '{name}'{'; it has ' if known else ', '}"
                f"{', '.join(there) if known else made}"
            )
        return read_table(path, name, self.manifest(name)["sha256"] if path.is_file() else None, columns)

    def manifest(self, name: str) -> dict[str, Any]:
        """The manifest of a table."""
        path = self.path / f"{name}.json"
        content = files.read_json(path)
        refuse_newer(content.get("schema"), str(path))
        return content

    def tables(self) -> list[str]:
        """Names of the tables that are there."""
        return sorted(path.stem for path in self.path.glob("*.parquet"))

    def _manifests(self, inputs: Mapping[str, str]) -> dict[str, str]:
        """Hashes of the manifests of the inputs of a stage, of the run and of its records: a manifest names those before it."""
        hashes = {name: self._hash_of(f"{name}.json") for name in ("run", *inputs)}
        records = self.records
        if records is not None and (records.path / COMPLETE).is_file():
            hashes["records"] = files.sha256(records.path / COMPLETE)
        return {name: value for name, value in sorted(hashes.items()) if value}

    def _put_table(self, name: str, table: "pa.Table") -> bytes:
        """The bytes of a table, which is published."""
        data = encoded(table)
        self._put(f"{name}.parquet", data)
        return data

    def _put(self, name: str, data: bytes) -> None:
        files.publish(self.path / name, data)

    def _hash_of(self, name: str) -> str:
        """Hash of a file of the run; empty where it is not there."""
        path = self.path / name
        return files.sha256(path) if path.is_file() else ""

    def _is_made_by(self, name: str, key: str) -> bool:
        path = self.path / f"{name}.parquet"
        if not path.is_file() or self._manifest_key(name) != key:
            return False
        if files.sha256(path) != self.manifest(name)["sha256"]:
            raise ArchiveUnusable(
                f"archive: {path} ({path.stat().st_size} bytes) is truncated or has changed since it was written; "
                "restore it from a copy, or remove it and its manifest to have the stage run again"
            )
        return True

    def _manifest_key(self, name: str) -> str:
        path = self.path / f"{name}.json"
        return files.read_json(path)["key"] if path.is_file() else ""
