"""Available sources: runs of the archive, and files of dwells in the workbench's folder; no other files."""

import os
from dataclasses import dataclass
from pathlib import Path

from pipelines.archive import Archive
from pipelines.archive.keys import digest
from pipelines.workbench.settings import WorkbenchSettings
from schemas.errors import WrongUse, did_you_mean

ENDINGS = (".parquet", ".csv", ".tsv", ".parquet.gz", ".csv.gz")
OWN = ("lots", "models")
NEWEST = 200
MOST_FILES = 500


@dataclass(frozen=True)
class DataSource:
    """Available dwells: ``name`` as on a command line."""

    name: str
    label: str
    is_file: bool
    units: int = 0


def sources(settings: WorkbenchSettings) -> list[DataSource]:
    """Files of dwells, then the newest runs first."""
    return [*_files(settings.folder), *_runs(settings)]


def resolve(settings: WorkbenchSettings, name: str, where: str) -> str:
    """The name of an existing source.

    Raises
    ------
    WrongUse
        It is neither a run of the archive nor a file of the folder.
    """
    files = {file.name for file in _files(settings.folder)}
    if name in files:
        return name
    if "/" in name or "\\" in name or name.endswith(ENDINGS):
        raise WrongUse(f"{where}: no file '{name}' in {settings.folder}; {did_you_mean(name, files)}")
    return Archive(settings.archive).run(name).id


def is_file(settings: WorkbenchSettings, name: str) -> bool:
    """Whether a source is a file of the folder."""
    return name in {file.name for file in _files(settings.folder)}


def stamp(settings: WorkbenchSettings, name: str) -> str:
    """A value that changes with the content of a source."""
    path = Path(name)
    if path.suffix and path.is_file():
        about = path.stat()
        return f"{about.st_size}.{about.st_mtime_ns}"
    run = Archive(settings.archive).run(name)
    return run.id if "dwells" not in run.tables() else str(run.manifest("dwells")["sha256"])


def archive_stamp(settings: WorkbenchSettings) -> str:
    """A value that changes when a run is added, or a stage of one is finished, in a folder or in an object store."""
    archive = Archive(settings.archive)
    runs = archive.root / "runs"
    if not isinstance(runs, Path):
        return digest({"runs": [[run.id, list(run.stages)] for run in archive.runs()]})[:20]
    if not runs.is_dir():
        return ""
    with os.scandir(runs) as entries:
        times = [entry.stat().st_mtime_ns for entry in entries]
    return f"{len(times)}.{max(times, default=0)}"


def twin(settings: WorkbenchSettings, name: str) -> str:
    """The fresh measurement beside a file of dwells; empty if there is none."""
    path = Path(name)
    for stem in (path.stem.replace("dwells", "fresh"), f"{path.stem}-fresh", f"fresh-{path.stem}"):
        beside = path.with_name(stem + path.suffix)
        if beside != path and str(beside) in {file.name for file in _files(settings.folder)}:
            return str(beside)
    return ""


def _files(folder: Path) -> list[DataSource]:
    if not folder.is_dir():
        return []
    files: list[DataSource] = []
    for path in sorted([*folder.iterdir(), *(p for sub in folder.iterdir() if _is_open(sub) for p in sub.iterdir())]):
        usable = path.name.endswith(ENDINGS) and path.is_file() and not path.name.startswith(".")
        if usable and "history" not in path.name and not path.is_symlink():
            files.append(DataSource(str(path), path.name, is_file=True))
    return files[:MOST_FILES]


def _is_open(folder: Path) -> bool:
    """Whether files of a folder inside may be dwells."""
    return folder.is_dir() and folder.name not in OWN and not folder.name.startswith(".") and not folder.is_symlink()


def _runs(settings: WorkbenchSettings) -> list[DataSource]:
    infos = Archive(settings.archive).runs()[-NEWEST:][::-1]
    return [
        DataSource(info.id, f"{info.id} · {info.started[:10]}", is_file=False, units=len(info.units))
        for info in infos
        if {"reduce", "import"} & set(info.stages)
    ]
