"""The lineage graph: nodes (files, runs, settings) and the steps that made nodes from other nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any


@dataclass(frozen=True)
class Node:
    """A node of the graph.

    Parameters
    ----------
    id : unique; for a file of the archive its place below the root.
    kind : ``certificate``, ``table``, ``report``, ``samples``, ``source``, ``run``, ``recipe``, ``limits``, ``station`` or
        ``reference``.
    label : the name in trees and pages.
    file : place of its file below the archive's root; empty for a node without a file.
    sha256 : hash of the file.
    about : further properties.
    """

    id: str
    kind: str
    label: str
    file: str = ""
    sha256: str = ""
    about: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class ProvActivity:
    """A step that made nodes from other nodes.

    Parameters
    ----------
    id : unique.
    name : the stage, or ``certify``, ``revoke``.
    used, made : ids of nodes.
    about : who, where and when, code, libraries, parameters: the manifest without hashes of inputs.
    """

    id: str
    name: str
    used: tuple[str, ...]
    made: tuple[str, ...]
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
        return _by_node((node, step) for step in self.steps.values() for node in step.made)

    def used_by(self) -> dict[str, list[ProvActivity]]:
        """The steps that used a node, by its id."""
        return _by_node((node, step) for step in self.steps.values() for node in step.used)

    def around(self, start: Iterable[str]) -> Graph:
        """The part of the graph with the origin of these nodes and the results made from them."""
        start = list(start)
        made, used = self.made_by(), self.used_by()
        up, steps_up = self._reached(start, made, forward=False)
        down, steps_down = self._reached(start, used, forward=True)
        steps = steps_up | steps_down
        beside = {node for name in steps_down for node in self.steps[name].used} & self.nodes.keys()
        kept = up | down | {node for node in beside if self.nodes[node].kind in {"recipe", "limits", "station"}}
        return Graph(
            {name: node for name, node in self.nodes.items() if name in kept},
            {name: _within(step, kept) for name, step in self.steps.items() if name in steps},
        )

    def results(self, start: Iterable[str]) -> set[str]:
        """Ids of all nodes made from these nodes, without these nodes themselves."""
        start = list(start)
        return self._reached(start, self.used_by(), forward=True)[0] - set(start)

    def _reached(
        self, start: list[str], links: dict[str, list[ProvActivity]], *, forward: bool
    ) -> tuple[set[str], set[str]]:
        nodes, steps, open_ids = set(start), set[str](), list(start)
        while open_ids:
            for step in links.get(open_ids.pop(), []):
                steps.add(step.id)
                for other in step.made if forward else step.used:
                    if other not in nodes and other in self.nodes:
                        nodes.add(other)
                        open_ids.append(other)
        return nodes, steps


def _by_node(pairs: Iterable[tuple[str, ProvActivity]]) -> dict[str, list[ProvActivity]]:
    steps_of: dict[str, list[ProvActivity]] = {}
    for node, step in pairs:
        steps_of.setdefault(node, []).append(step)
    return steps_of


def _within(step: ProvActivity, kept: set[str]) -> ProvActivity:
    used, made = (tuple(node for node in nodes if node in kept) for nodes in (step.used, step.made))
    return replace(step, used=used, made=made)
