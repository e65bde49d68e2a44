"""The lineage graph: nodes (files, runs, settings) and the steps that made nodes from other nodes."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated, Any

STATED = ("code", "key", "schema", "reason", "taken_from")  # of a step, in exchange formats


@dataclass(frozen=True)
class Node:
    """A node of the graph, also in the JSON document.

    id : unique; for a file of the archive its path below the root
    kind : ``certificate``, ``table``, ``report``, ``samples``, ``source``, ``run``, ``recipe``, ``limits``, ``station`` or
    ``reference``; label : the name in trees and pages; sha256 : hash of the file; about : further properties
    """

    id: str
    kind: str
    label: str
    file: Annotated[str, "below the archive's folder; empty: none"] = ""
    sha256: str = ""
    about: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class ProvActivity:
    """A step that made nodes from other nodes, also in the JSON document.

    name : the stage, or ``certify``, ``revoke``
    about : who, where and when, code, libraries, parameters: the manifest without hashes of inputs
    """

    id: str
    name: str
    used: Annotated[tuple[str, ...], "ids"]
    made: Annotated[tuple[str, ...], "ids"]
    about: dict[str, Any] = field(default_factory=dict[str, Any])

    @property
    def person(self) -> str:
        """Who took the step, and where."""
        return f"{self.about['who']}@{self.about.get('where', '')}"


@dataclass
class Graph:
    """Nodes and steps by id."""

    nodes: dict[str, Node] = field(default_factory=dict[str, Node])
    steps: dict[str, ProvActivity] = field(default_factory=dict[str, ProvActivity])

    def add(self, node: Node) -> str:
        """Add a node unless it exists; return its id."""
        self.nodes.setdefault(node.id, node)
        return node.id

    def put(self, step: ProvActivity) -> None:
        """Add a step."""
        self.steps[step.id] = step

    def made_by(self) -> dict[str, list[ProvActivity]]:
        """The steps that made a node, by its id; a calibration that another step ended has several."""
        return self._steps_of("made")

    def used_by(self) -> dict[str, list[ProvActivity]]:
        """The steps that used a node, by its id."""
        return self._steps_of("used")

    def _steps_of(self, end: str) -> dict[str, list[ProvActivity]]:
        steps_of: dict[str, list[ProvActivity]] = {}
        for step in self.steps.values():
            for node in getattr(step, end):
                steps_of.setdefault(node, []).append(step)
        return steps_of

    def around(self, start: Iterable[str]) -> "Graph":
        """The part of the graph with the origin of these nodes and the results made from them."""
        start = list(start)
        up, steps_up = self._reached(start, forward=False)
        down, steps_down = self._reached(start, forward=True)
        beside = {node for name in steps_down for node in self.steps[name].used} & self.nodes.keys()
        names = up | down | {node for node in beside if self.nodes[node].kind in {"recipe", "limits", "station"}}
        part = Graph({name: node for name, node in self.nodes.items() if name in names})
        reached = steps_up | steps_down
        for step in (step for name, step in self.steps.items() if name in reached):
            used, made = (tuple(node for node in nodes if node in names) for nodes in (step.used, step.made))
            part.put(replace(step, used=used, made=made))
        return part

    def results(self, start: Iterable[str]) -> set[str]:
        """Ids of all nodes made from these nodes, without these nodes themselves."""
        start = list(start)
        return self._reached(start, forward=True)[0] - set(start)

    def _reached(self, start: list[str], *, forward: bool) -> tuple[set[str], set[str]]:
        """Ids of the nodes, and of the steps to them, from these nodes on towards results or origin."""
        links = self.used_by() if forward else self.made_by()
        nodes, steps, open_ids = set(start), set[str](), list(start)
        while open_ids:
            for step in links.get(open_ids.pop(), []):
                steps.add(step.id)
                new = {node for node in (step.made if forward else step.used) if node in self.nodes} - nodes
                nodes |= new
                open_ids += new
        return nodes, steps
