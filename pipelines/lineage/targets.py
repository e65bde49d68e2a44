"""The target of a lineage: a unit, a run, a file of the archive, or a copy of such a file."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from pipelines.archive import Archive, Run, files
from pipelines.certificates.ledger import Ledger
from pipelines.lineage.gather import Gatherer
from pipelines.lineage.graph import Graph
from schemas.errors import ArchiveUnusable, WrongUse, did_you_mean


@dataclass(frozen=True)
class Lineage:
    """A lineage graph and its target.

    kind : ``unit``, ``certificate``, ``run`` or ``file``.
    focus : ids of the nodes of the target.
    """

    target: str
    kind: str
    focus: tuple[str, ...]
    graph: Graph

    def document(self) -> dict[str, Any]:
        """The lineage for JSON."""
        return {
            "target": self.target,
            "kind": self.kind,
            "focus": list(self.focus),
            "things": [asdict(node) for node in self.graph.nodes.values()],
            "steps": [asdict(step) for step in self.graph.steps.values()],
        }


def lineage(archive: Archive, target: str) -> Lineage:
    """Origin of the certificates of a unit, of a run or of a file, and the results made from them.

    target : a serial number, the name of a run or the beginning of it, or a file.
    """
    if Path(target).is_file() or (archive.root / target).is_file():
        return _of_file(archive, target)
    gatherer = Gatherer(archive)
    graph = gatherer.graph

    def traced(kind: str, names: list[str]) -> Lineage:
        return Lineage(target, kind, tuple(names), graph.around(names))

    if Ledger(archive).events(target):
        return traced("unit", gatherer.calibrations(target))
    serial, _, number = target.rpartition("/")
    if number.isdecimal() and Ledger(archive).events(serial):
        names = [name for name in gatherer.calibrations(serial) if name.endswith(f"/{int(number):06d}.json")]
        if names:
            return traced("certificate", names)
    ids = archive.run_ids()
    if target == "latest" or any(target and name.startswith(target) for name in ids):
        return _of_run(archive, archive.run(target))
    runs = [info.id for info in archive.runs() if target in info.units]
    if runs:
        for name in runs:
            gatherer.run(archive.run(name))
        names = [name for name in graph.nodes if name in {f"runs/{run}/grades.parquet" for run in runs}]
        return traced("unit", names or [f"runs/{run}" for run in runs])
    message = f"lineage: '{target}' is neither a unit, a certificate, a run nor a file of archive {archive.root}"
    message += f"; {archive.units_like(target, ids) or did_you_mean(target, ids)}"
    raise WrongUse(message if ids else f"archive {archive.root}: no run exists; make one with 'tumbleline run'")


def _of_run(archive: Archive, run: Run) -> Lineage:
    gatherer = Gatherer(archive)
    gatherer.run(run)
    gatherer.certificates_of(run)
    for name in _runs_where(archive, lambda about: run.id in (about.get("rerun_of"), *about.get("parents", ()))):
        gatherer.run(archive.run(name))
    focus = [name for name in gatherer.graph.nodes if name.startswith(f"runs/{run.id}/")]
    return Lineage(run.id, "run", tuple(focus or [f"runs/{run.id}"]), gatherer.graph.around([*focus, f"runs/{run.id}"]))


def _of_file(archive: Archive, target: str) -> Lineage:
    """A file by its path in the archive, else by its content."""
    gatherer = Gatherer(archive)
    path = _below(archive, target)
    for name in _runs_of(archive, path):
        run = archive.run(name)
        gatherer.run(run)
        gatherer.certificates_of(run)
    focus = [node.id for node in gatherer.graph.nodes.values() if path in {node.file, node.about.get("manifest")}]
    if not focus:
        digest = files.sha256(Path(target)) if Path(target).is_file() else files.sha256(archive.root / target)
        for name in archive.run_ids():
            gatherer.run(archive.run(name))
            gatherer.certificates_of(archive.run(name))
        focus = [node.id for node in gatherer.graph.nodes.values() if node.sha256 == digest]
    if not focus:
        raise ArchiveUnusable(
            f"lineage: the content of {target} is no table and no source of archive {archive.root}; name another file"
        )
    return Lineage(target, "file", tuple(focus), gatherer.graph.around(focus))


def _below(archive: Archive, target: str) -> str:
    """Place of the file below the archive's root; empty for a file outside the archive."""
    if not Path(target).is_file():
        return target
    if not isinstance(archive.root, Path):
        return ""
    path, root = Path(target).resolve(), archive.root.resolve()
    return path.relative_to(root).as_posix() if path.is_relative_to(root) else ""


def _runs_of(archive: Archive, path: str) -> list[str]:
    """The runs of a file of the archive: its own run, or all runs of its capture."""
    match path.split("/"):
        case ["runs", run, _, *_]:
            return [run]
        case ["captures", capture, _, *_]:
            return _runs_where(archive, lambda about: about.get("capture") == capture)
        case ["calibrations", _, _, *_]:
            return [str(files.read_json(archive.root / path).get("run"))]
        case _:
            return []


def _runs_where(archive: Archive, condition: Callable[[dict[str, Any]], bool]) -> list[str]:
    return [name for name in archive.run_ids() if condition(archive.run(name).about)]
