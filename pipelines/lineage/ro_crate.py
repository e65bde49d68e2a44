"""A lineage as an RO-Crate 1.1: a folder with all its files, and a description for other tools."""

import json
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pipelines.archive import Archive, files
from pipelines.archive.names import is_below
from pipelines.lineage.graph import STATED, Graph, Node, ProvActivity
from pipelines.lineage.targets import Lineage
from schemas.errors import ArchiveUnusable, WrongUse

VERSION = "https://w3id.org/ro/crate/1.1"
METADATA = "ro-crate-metadata.json"
OWN_TERMS = {"sha256": "https://schema.org/sha256"}
ENCODINGS = {".parquet": "application/vnd.apache.parquet", ".json": "application/json", ".html": "text/html"}
SETTINGS = ("recipe", "limits", "station")


def write_crate(archive: Archive, traced: Lineage, folder: Path) -> int:
    """Write a crate into a new folder; return the number of copied files."""
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise WrongUse(
            f"lineage: {folder} exists and is not empty, a new or empty one is needed for the crate; give it with --output"
        )
    contents = _contents(archive, traced.graph)
    for name in contents:
        if not is_below(name):  # readable manifests never name such a path
            raise ArchiveUnusable(
                f"lineage: {name!r} is a path outside the crate's folder, a path inside it is needed; do not use this archive"
            )
    for name, data in contents.items():
        files.publish(folder / name, data, "lineage", "give another folder with --output")
    document = json.dumps(crate_of(traced, contents), indent=1, ensure_ascii=False, sort_keys=True) + "\n"
    files.publish(folder / METADATA, document.encode(), "lineage", "give another folder with --output")
    return len(contents)


def crate_of(traced: Lineage, contents: dict[str, bytes]) -> dict[str, Any]:
    """The description of the crate.

    contents : the other files of the crate, by name.
    """
    graph = traced.graph
    described = {_id(node): node for node in graph.nodes.values()}
    parts = [_file(name, data, described) for name, data in sorted(contents.items())]
    actions = [_action(step, graph) for step in graph.steps.values()]
    people, programs = _agents(graph)
    published = max((str(step.about.get("when", "")) for step in graph.steps.values()), default="")[:10] or "1970-01-01"
    root = {
        "@id": "./", "@type": "Dataset", "name": f"Lineage of {traced.kind} {traced.target}",
        "description": f"From certificate to raw samples: all sources and all results of {traced.kind} {traced.target}.",
        "datePublished": published, "license": {"@id": "#license"}, "publisher": {"@id": "#owner"},
        "author": _one_or_all([{"@id": person["@id"]} for person in people]),
        "hasPart": _one_or_all([{"@id": part["@id"]} for part in parts]),
        "mentions": _one_or_all([{"@id": action["@id"]} for action in actions]),
    }  # fmt: skip
    licence = {
        "@id": "#license", "@type": "CreativeWork", "name": "Not licensed",
        "description": "No licence is stated for these data; ask the owner of the archive before you pass them on.",
    }  # fmt: skip
    owner = {"@id": "#owner", "@type": "Organization", "name": "Owner of the archive"}
    descriptor = {"@id": METADATA, "@type": "CreativeWork", "about": {"@id": "./"}, "conformsTo": {"@id": VERSION}}
    others = [_other(node) for node in graph.nodes.values() if _id(node).startswith("#")]
    return {
        "@context": [f"{VERSION}/context", OWN_TERMS],
        "@graph": [descriptor, root, licence, owner, *parts, *others, *actions, *people, *programs],
    }


def _contents(archive: Archive, graph: Graph) -> dict[str, bytes]:
    """The files of a lineage: tables, reports, samples, manifests, events of the ledger, and the settings on their own."""
    names: set[str] = set()
    for node in graph.nodes.values():
        names |= {name for name in (node.file, str(node.about.get("manifest") or "")) if name}
        if node.file.startswith("captures/"):
            capture, record = node.file.split("/")[1:3]
            names |= {f"captures/{capture}/{record}/record.json", f"captures/{capture}/complete.json"}
    traced = {name: (archive.root / name).read_bytes() for name in sorted(names) if (archive.root / name).is_file()}
    for node in graph.nodes.values():
        if node.kind in SETTINGS:
            traced[_crate_path(node)] = files.json_bytes(node.about)
    return traced


def _file(name: str, data: bytes, described: dict[str, Node]) -> dict[str, Any]:
    node = described.get(quote(name))
    suffix = Path(name).suffix
    return {
        "@id": quote(name),
        "@type": "File",
        "name": f"{node.kind} {node.label}" if node is not None else f"manifest {name}",
        "description": _described(node) if node is not None else "Manifest: inputs, author, time and program.",
        "encodingFormat": ENCODINGS.get(suffix, "application/octet-stream"),
        "contentSize": str(len(data)),
        "sha256": sha256(data).hexdigest(),
    }


def _described(node: Node) -> str:
    about = node.about
    if node.kind == "certificate":
        return (
            f"Calibration {about['certificate']} of a {about['device']}, valid from {about['from']} until {about['until']}, "
            f"{about['state']}."
        )
    if node.kind == "revocation":
        return f"Revoked: {about['reason']}"
    return {"samples": "Raw samples of one record.", "report": "The report as a page."}.get(
        node.kind, f"A {node.kind} of the archive."
    )


def _other(node: Node) -> dict[str, Any]:
    """A node without a file in the crate: a reference standard, or the source of an import."""
    if node.kind == "reference":
        about = node.about
        text = f"{about.get('what', '')}: certificate {about['certificate']} of {about.get('laboratory', '')}, due {about['due']}"
        return {"@id": _id(node), "@type": "IndividualProduct", "name": node.label, "description": text.strip(": ")}
    return {
        "@id": _id(node),
        "@type": "CreativeWork",
        "name": node.label,
        "description": f"A {node.kind}, sha256 {node.sha256}.",
    }


def _action(step: ProvActivity, graph: Graph) -> dict[str, Any]:
    about = step.about
    action: dict[str, Any] = {
        "@id": f"#{quote(step.id)}",
        "@type": "CreateAction",
        "name": step.name,
        "object": _one_or_all([{"@id": _id(graph.nodes[name])} for name in step.used]),
        "result": _one_or_all([{"@id": _id(graph.nodes[name])} for name in step.made]),
    }
    known = [f"{key} {about[key]}" for key in STATED if about.get(key)]
    known += [f"{name} {number}" for name, number in sorted(about.get("libraries", {}).items())]
    if known:
        action["description"] = ", ".join(known)
    if about.get("when"):
        action["endTime"] = about["when"]
    if about.get("who"):
        action["agent"] = {"@id": f"#{quote(step.person)}"}
    if about.get("software"):
        action["instrument"] = {"@id": _program(about["software"])}
    return action


def _one_or_all(values: list[dict[str, str]]) -> Any:
    """A single value alone, as RO-Crate 1.1 recommends for JSON-LD; several values as a list."""
    return values[0] if len(values) == 1 else values


def _agents(graph: Graph) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    people: dict[str, dict[str, Any]] = {}
    programs: dict[str, dict[str, Any]] = {}
    for step in graph.steps.values():
        if step.about.get("who"):
            name = f"#{quote(step.person)}"
            people[name] = {"@id": name, "@type": "Person", "name": step.person, "affiliation": {"@id": "#owner"}}
        software = step.about.get("software")
        if software:
            name, text = _program(software), f"Run by Python {software.get('python', '')}"
            programs[name] = {
                "@id": name, "@type": "SoftwareApplication", "name": "Tumbleline",
                "softwareVersion": str(software.get("tumbleline", "")), "description": text,
            }  # fmt: skip
    return list(people.values()), list(programs.values())


def _program(software: dict[str, Any]) -> str:
    return "#" + quote("-".join(f"{name}-{number}" for name, number in sorted(software.items())))


def _crate_path(node: Node) -> str:
    """Path of a node in the crate; empty for a node without a file there."""
    if node.kind in SETTINGS:
        return f"settings/{quote(node.id.replace(':', '-', 1), safe=' @')}.json"  # names of settings may have any character
    return node.file


def _id(node: Node) -> str:
    return quote(_crate_path(node)) or f"#{quote(node.id)}"
