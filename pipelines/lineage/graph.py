"""The graph of what was made from what: things, and the steps that made them from others."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Iterable


@dataclass(frozen=True)
class Node:
    """A thing.

    Parameters
    ----------
    id : unique; for a file of the archive its place below the root.
    kind : ``certificate``, ``table``, ``report``, ``samples``, ``source``, ``run``, ``recipe``, ``limits``, ``station`` or
        ``reference``.
    label : the name for people.
    file : place of its file below the archive's root; empty where it has none of its own.
    sha256 : hash of the file.
    about : whatever else is known.
    """

    id: str
    kind: str
    label: str
    file: str = ""
    sha256: str = ""
    about: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass(frozen=True)
class Activity:
    """What made things from others.

    Parameters
    ----------
    id : unique.
    name : the stage, or ``certify``, ``revoke``.
    used, made : ids of things.
    about : who, where and when, code, libraries, parameters: the manifest without hashes of inputs.
    """

    id: str
    name: str
    used: tuple[str, ...]
    made: tuple[str, ...]
    about: dict[str, Any] = field(default_factory=dict[str, Any])


@dataclass
class Graph:
    """Things and steps by id."""

    nodes: dict[str, Node] = field(default_factory=dict[str, Node])
    steps: dict[str, Activity] = field(default_factory=dict[str, Activity])

    def add(self, node: Node) -> str:
        """Put a thing in, unless it is there; its id."""
        self.nodes.setdefault(node.id, node)
        return node.id

    def put(self, step: Activity) -> None:
        """Put a step in."""
        self.steps[step.id] = step

    def made_by(self) -> dict[str, list[Activity]]:
        """The steps that made a thing, by its id; several where a calibration was ended by another step."""
        found: dict[str, list[Activity]] = {}
        for step in self.steps.values():
            for node in step.made:
                found.setdefault(node, []).append(step)
        return found

    def used_by(self) -> dict[str, list[Activity]]:
        """The steps that used a thing, by its id."""
        found: dict[str, list[Activity]] = {}
        for step in self.steps.values():
            for node in step.used:
                found.setdefault(node, []).append(step)
        return found

    def around(self, start: Iterable[str]) -> Graph:
        """Only what the things named came from, and what came from them."""
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
        """Ids of all that came from the things named, without these."""
        start = list(start)
        return self._reached(start, self.used_by(), forward=True)[0] - set(start)

    def _reached(
        self, start: list[str], links: dict[str, list[Activity]], *, forward: bool
    ) -> tuple[set[str], set[str]]:
        nodes, steps, left = set(start), set[str](), list(start)
        while left:
            for step in links.get(left.pop(), []):
                steps.add(step.id)
                for other in step.made if forward else step.used:
                    if other not in nodes and other in self.nodes:
                        nodes.add(other)
                        left.append(other)
        return nodes, steps


def _within(step: Activity, kept: set[str]) -> Activity:
    used = tuple(node for node in step.used if node in kept)
    made = tuple(node for node in step.made if node in kept)
    return Activity(step.id, step.name, used, made, step.about)
