"""A lineage as W3C PROV-O (Recommendation of 30 April 2013) in JSON-LD; the context is included, so that no network is needed."""

from typing import Any
from urllib.parse import quote

from pipelines.lineage.graph import STATED, Graph, Node, ProvActivity
from pipelines.lineage.targets import Lineage

BASE = "urn:x-tumbleline:"
SETTINGS = {"run", "recipe", "limits", "station", "reference"}  # used, but no result is derived from them
LINKS = (
    "used", "wasGeneratedBy", "wasDerivedFrom", "wasRevisionOf", "wasAssociatedWith", "wasInvalidatedBy", "agent", "hadPlan",
    "wasAttributedTo",
)  # fmt: skip
TIMES = ("endedAtTime", "generatedAtTime", "invalidatedAtTime")
CONTEXT: dict[str, Any] = {
    "prov": "http://www.w3.org/ns/prov#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "tl": f"{BASE}term/",
    "label": "rdfs:label",
    **{name: {"@id": f"prov:{name}", "@type": "@id"} for name in LINKS},
    **{name: {"@id": f"prov:{name}", "@type": "xsd:dateTime"} for name in TIMES},
    "qualifiedAssociation": "prov:qualifiedAssociation",
}


def prov_of(traced: Lineage) -> dict[str, Any]:
    """The document: entities, activities and agents of a lineage."""
    graph = traced.graph
    agents: dict[str, dict[str, Any]] = {}
    activities = [_activity(step, graph, agents) for step in graph.steps.values()]
    made, used = graph.made_by(), graph.used_by()
    entities = [_entity(node, graph, made.get(node.id, []), used.get(node.id, [])) for node in graph.nodes.values()]
    return {"@context": CONTEXT, "@graph": [*entities, *activities, *agents.values()]}


def iri(kind: str, name: str) -> str:
    """The identifier of a node or agent, equal in every part of a document."""
    return f"{BASE}{kind}/{quote(name, safe='/:@._-~')}"


def _entity(node: Node, graph: Graph, made: list[ProvActivity], used: list[ProvActivity]) -> dict[str, Any]:
    """A node with the steps that made it and those that used it."""
    kinds = {"recipe": ["prov:Plan"], "limits": ["prov:Plan"]}.get(node.kind, [])
    entity: dict[str, Any] = {
        "@id": iri("thing", node.id),
        "@type": ["prov:Entity", *kinds, f"tl:{node.kind.capitalize()}"],
        "label": node.label,
    }
    if node.sha256:
        entity["tl:sha256"] = node.sha256
    if node.file:
        entity["tl:file"] = node.file
    entity |= {f"tl:{key}": str(value) for key, value in _properties(node).items() if value not in {None, ""}}
    if made:
        entity["wasGeneratedBy"] = [iri("step", step.id) for step in made]
        sources = [name for step in made for name in step.used]
        entity["wasDerivedFrom"] = [iri("thing", n) for n in sources if graph.nodes[n].kind not in SETTINGS]
        entity["wasRevisionOf"] = [iri("thing", n) for n in sources if graph.nodes[n].kind == node.kind == "run"]
        if made[0].about.get("when"):
            entity["generatedAtTime"] = made[0].about["when"]
        if made[0].about.get("who"):
            entity["wasAttributedTo"] = iri("agent", made[0].person)
    for step in used:
        if step.name == "revoke":
            entity["wasInvalidatedBy"], entity["invalidatedAtTime"] = iri("step", step.id), step.about["when"]
    return {key: value for key, value in entity.items() if value != []}


def _properties(node: Node) -> dict[str, Any]:
    """Properties of a node beside its name, without nesting."""
    keys = {
        "certificate": ("serial", "device", "from", "until", "state", "grade", "station"),
        "reference": ("what", "certificate", "laboratory", "due"),
        "table": ("rows", "schema"),
        "station": ("kind", "description"),
        "revocation": ("reason",),
    }
    return {key: node.about.get(key) for key in keys.get(node.kind, ())}


def _activity(step: ProvActivity, graph: Graph, agents: dict[str, dict[str, Any]]) -> dict[str, Any]:
    activity: dict[str, Any] = {
        "@id": iri("step", step.id),
        "@type": "prov:Activity",
        "label": step.name,
        "used": [iri("thing", name) for name in step.used],
    }
    about = step.about
    if about.get("when"):
        activity["endedAtTime"] = about["when"]
    activity |= {f"tl:{key}": str(about[key]) for key in STATED if about.get(key)}
    activity |= {f"tl:library_{name}": number for name, number in sorted(about.get("libraries", {}).items())}
    plans = [iri("thing", name) for name in step.used if graph.nodes[name].kind in {"recipe", "limits"}]
    who = _agents(step, agents)
    if who:
        activity["wasAssociatedWith"] = who
        activity["qualifiedAssociation"] = [
            {"@type": "prov:Association", "agent": who[0], **({"hadPlan": plans} if plans else {})}
        ]
    return activity


def _agents(step: ProvActivity, agents: dict[str, dict[str, Any]]) -> list[str]:
    software = step.about.get("software", {})
    labels = {"Person": step.person} if step.about.get("who") else {}
    if software:
        labels["SoftwareAgent"] = " ".join(f"{key} {value}" for key, value in sorted(software.items(), reverse=True))
    for kind, label in labels.items():
        name = iri("agent", label)
        agents[name] = {"@id": name, "@type": ["prov:Agent", f"prov:{kind}"], "label": label}
    return [iri("agent", label) for label in labels.values()]
