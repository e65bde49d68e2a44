"""Build the lineage graph from the manifests, captures and calibrations of an archive."""

from typing import Any

from pipelines.archive import Archive, Run, files
from pipelines.archive.keys import digest
from pipelines.archive.listing import SEALED
from pipelines.archive.records import COMPLETE
from pipelines.certificates.entries import LedgerEntry, folder_of
from pipelines.certificates.ledger import Ledger
from pipelines.certificates.validity import Calibration
from pipelines.lineage.graph import Graph, Node, ProvActivity

MADE = ("who", "where", "when", "code", "key", "software", "libraries", "schema", "parameters", "taken_from")
RAW = "records"
ELSEWHERE = {"recipe", "limits", "station", "signature"}  # parts of ``run.json`` with separate nodes, or none


class Gatherer:
    """The lineage graph of selected runs of an archive."""

    def __init__(self, archive: Archive) -> None:
        self.archive, self.graph = archive, Graph()
        self._runs: set[str] = set()
        self._captures: dict[str, list[str]] = {}

    def run(self, run: Run) -> None:
        """Add a run, its capture, and the earlier runs that it is based on."""
        if run.id in self._runs:
            return
        self._runs.add(run.id)
        about = run.about
        settings = self._settings(about)
        content = {key: value for key, value in about.items() if key not in ELSEWHERE}
        start = self.graph.add(Node(f"runs/{run.id}", "run", run.id, f"runs/{run.id}/run.json", about=content))
        earlier = [str(name) for name in (about.get("rerun_of"), *about.get("parents", ())) if name]
        earlier = [name for name in dict.fromkeys(earlier) if name != run.id]
        raw = self._capture(str(about.get("capture") or ""), about, settings)
        for name in earlier:
            other = self._other(name)
            if other is not None:
                self.run(other)
        used = (*settings, *(f"runs/{name}" for name in earlier if f"runs/{name}" in self.graph.nodes))
        step = {key: about[key] for key in (*MADE[:3], "because", "software", "libraries") if key in about}
        what = "run again" if about.get("rerun_of") else "start"
        self.graph.put(ProvActivity(f"start of {run.id}", what, used, (start,), step))
        self._tables(run, raw, start)

    def calibrations(self, serial: str) -> list[str]:
        """Add the certificates of a unit with their runs; return the ids of the certificates."""
        ids: list[str] = []
        for calibration in Ledger(self.archive).calibrations(serial):
            run = self._other(calibration.run)
            if run is not None:
                self.run(run)
            ids.append(self._certificate(calibration))
        return ids

    def certificates_of(self, run: Run) -> list[str]:
        """Add the certificates of the units of a run; return their ids."""
        serials = [unit["serial"] for unit in run.about.get("lot", {}).get("units", [])]
        calibrations = (
            calibration
            for serial in serials
            for calibration in Ledger(self.archive).calibrations(serial)
            if calibration.run == run.id
        )
        return [self._certificate(calibration) for calibration in calibrations]

    def _other(self, name: str) -> Run | None:
        return self.archive.run(name) if name in self.archive.run_ids() else None

    def _settings(self, about: dict[str, Any]) -> list[str]:
        """Add recipe, limits, station and reference standards of a run as nodes; return their ids."""
        ids: list[str] = []
        for kind in ("recipe", "limits", "station"):
            content = about.get(kind)
            if isinstance(content, dict):
                name = f"{kind}:{content.get('name', '')}@{digest(content)[:12]}"
                ids.append(self.graph.add(Node(name, kind, str(content.get("name", kind)), about=content)))
        for standard in (about.get("station") or {}).get("reference", []):
            name = f"reference:{standard['id']}@{digest(standard)[:12]}"
            ids.append(self.graph.add(Node(name, "reference", standard["id"], about=standard)))
        return ids

    def _capture(self, capture: str, about: dict[str, Any], settings: list[str]) -> list[str]:
        """Add the files of raw samples of a capture and the step that measured them; return the ids of the files."""
        if not capture or capture in self._captures:
            return self._captures.get(capture, [])
        top = self.archive.root / "captures" / capture
        ids: list[str] = []
        for folder in sorted(top.iterdir(), key=lambda path: path.name) if top.is_dir() else []:
            if not folder.name.isdigit() or not (folder / "record.json").is_file():
                continue
            content = files.read_json(folder / "record.json").get("content", {})
            for name, value in sorted(content.items()):
                file = f"captures/{capture}/{folder.name}/{name}"
                kind = "samples" if name.startswith("samples") else "table"
                ids.append(self.graph.add(Node(file, kind, f"record {int(folder.name)} {name}", file, str(value))))
        self._captures[capture] = ids
        step = {key: about[key] for key in ("who", "where", "when") if key in about} | {"capture": capture}
        if (top / COMPLETE).is_file():
            step["complete"] = files.sha256(top / COMPLETE)
        self.graph.put(ProvActivity(f"capture {capture}", "capture", tuple(settings), tuple(ids), step))
        return ids

    def _tables(self, run: Run, raw: list[str], start: str) -> None:
        places = sorted(run.path.glob("*.json"), key=lambda path: path.name)
        manifests = {path.stem: files.read_json(path) for path in places if path.name not in {"run.json", SEALED}}
        steps: dict[str, list[str]] = {}
        for name, content in manifests.items():
            kind, ending = ("report", "html") if name == "report" else ("table", "parquet")
            file = f"runs/{run.id}/{name}.{ending}"
            about = {key: content.get(key) for key in ("rows", "schema")} | {"manifest": f"runs/{run.id}/{name}.json"}
            self.graph.add(Node(file, kind, name, file, str(content.get("sha256", "")), about))
            steps.setdefault(f"{content.get('stage')} {content.get('key')} of {run.id}", []).append(file)
        for step, made in steps.items():
            content = manifests[made[0].rpartition("/")[2].rpartition(".")[0]]
            used = [start]
            for name, value in content.get("inputs", {}).items():
                used += raw if name == RAW else [self._input(run, name, str(value), manifests)]
            about = {key: content[key] for key in MADE if key in content}
            self.graph.put(ProvActivity(step, str(content.get("stage")), tuple(used), tuple(made), about))

    def _input(self, run: Run, name: str, value: str, manifests: dict[str, Any]) -> str:
        if name in manifests:
            return f"runs/{run.id}/{name}.parquet"
        source = run.about.get("source") or {}
        label = str(source.get("path") or name)
        return self.graph.add(Node(f"source:{value}", "source", label, sha256=value, about=dict(source)))

    def _certificate(self, calibration: Calibration) -> str:
        event = calibration.event
        path = f"{folder_of(event.serial)}/{event.sequence:06d}.json"
        name = self.graph.add(
            Node(path, "certificate", calibration.certificate, path, about=dict(calibration.document()))
        )
        rests = tuple(f"runs/{event.run}/{table}.parquet" for table, _ in event.evidence)
        used = tuple(node for node in (*rests, f"runs/{event.run}") if node in self.graph.nodes)
        self.graph.put(ProvActivity(f"{event.action} {event.certificate}", event.action, used, (name,), _by(event)))
        ended = calibration.ended_by
        if ended is not None and ended.action == "revoke":
            file, label = f"{folder_of(ended.serial)}/{ended.sequence:06d}.json", f"revocation {ended.certificate}"
            revocation = self.graph.add(Node(file, "revocation", label, file, about={"reason": ended.reason}))
            self.graph.put(ProvActivity(f"revoke {ended.certificate}", "revoke", (name,), (revocation,), _by(ended)))
        return name


def _by(event: LedgerEntry) -> dict[str, Any]:
    return {"who": event.who, "where": event.where, "when": event.when, "reason": event.reason}
