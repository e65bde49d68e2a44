"""A lineage as a tree for the terminal: every node with the step that made it, and below the nodes that this step used."""

from rich.text import Text
from rich.tree import Tree

from pipelines.lineage.graph import Graph, Node, ProvActivity
from pipelines.lineage.targets import Lineage

SHORT = 12
ABOVE = "  ↑ see above"
RESULTS = {"certificate", "revocation", "report", "run"}
STYLES = {
    "certificate": "bold green",
    "revocation": "bold red",
    "samples": "bold cyan",
    "run": "bold",
    "reference": "magenta",
}


def tree_of(traced: Lineage) -> Tree:
    """The tree: origin of the target, and the results made from it."""
    top = Tree(Text(f"{traced.kind} {traced.target}", style="bold"))
    drawer = _Drawer(traced.graph)
    came = top.add(Text("made from", style="dim")) if traced.kind != "unit" else top
    for name in _ends(traced):
        drawer.up(came, name)
    results = sorted(name for name in traced.graph.results(traced.focus) if traced.graph.nodes[name].kind in RESULTS)
    if results:
        went = top.add(Text("used for", style="dim"))
        for name in results:
            went.add(_thing(traced.graph.nodes[name]))
    return top


def _ends(traced: Lineage) -> list[str]:
    """The nodes of the target, without those that other nodes of the target were made from: these appear below them."""
    used = traced.graph.used_by()
    target = set(traced.focus)
    within = {n for n in traced.focus for step in used.get(n, []) if target & set(step.made)}
    return [name for name in traced.focus if name not in within] or list(traced.focus)


class _Drawer:
    def __init__(self, graph: Graph) -> None:
        self.graph, self.made = graph, graph.made_by()
        self.shown: set[str] = set()
        self.versions = ""

    def up(self, branch: Tree, name: str) -> None:
        """A node, the step that made it, and the nodes that the step used; each step appears once in full."""
        steps = self.made.get(name, [])
        if steps and all(step.id in self.shown for step in steps):
            branch.add(_thing(self.graph.nodes[name]).append(ABOVE, style="dim"))
            return
        child = branch.add(_thing(self.graph.nodes[name]))
        for step in steps:
            self._step(child, step)

    def _step(self, branch: Tree, step: ProvActivity) -> None:
        """A step that was not shown before, with the nodes that it used."""
        if step.id not in self.shown:
            self.shown.add(step.id)
            self._used(branch.add(_step(step, self._versions(step))), step)

    def _versions(self, step: ProvActivity) -> str:
        """Versions of program and libraries; empty where they are those shown last."""
        known = {**step.about.get("software", {}), **step.about.get("libraries", {})}
        text = " ".join(f"{name} {number}" for name, number in known.items())
        before, self.versions = self.versions, text or self.versions
        return text if text != before else ""

    def _used(self, branch: Tree, step: ProvActivity) -> None:
        raw = [name for name in step.used if name.startswith("captures/")]
        for name in step.used:
            shown = all(maker.id in self.shown for maker in self.made.get(name, []))
            if name not in raw and not (shown and self.graph.nodes[name].kind == "run"):
                self.up(branch, name)
        if raw:
            self._raw(branch, raw)

    def _raw(self, branch: Tree, names: list[str]) -> None:
        """The records of a capture in one line, as there may be thousands."""
        steps, first = self.made.get(names[0], []), self.graph.nodes[names[0]]
        records = {name.split("/")[2] for name in names}
        words = f"raw samples  {len(records)} records of capture {names[0].split('/')[1]}, {len(names)} files"
        known = bool(steps) and all(step.id in self.shown for step in steps)
        rest = ABOVE if known else f"  ({'/'.join(names[0].split('/')[2:])} {first.sha256[:SHORT]} …)"
        child = branch.add(Text(words, style=STYLES["samples"]).append(rest, style="dim"))
        for step in steps:
            self._step(child, step)


def _thing(node: Node) -> Text:
    text = Text(f"{node.kind} ", style="dim").append(node.label, style=STYLES.get(node.kind, ""))
    return text.append(_details(node))


def _details(node: Node) -> Text:
    about = node.about
    more = {
        "certificate": lambda: f"  {about['state']}, {about['from']} until {about['until']}, grade {about['grade']}",
        "revocation": lambda: f"  {about['reason']}",
        "reference": lambda: f"  {about.get('what', '')} certificate {about['certificate']}, due {about['due']}",
        "run": lambda: f"  {str(about.get('when', ''))[:19].replace('T', ' ')}",
        "source": lambda: f"  {node.sha256[:SHORT]}",
        "table": lambda: f"  {about.get('rows', '')} rows  {node.sha256[:SHORT]}",
        "report": lambda: f"  {node.sha256[:SHORT]}",
        "recipe": lambda: f"  model {', '.join(about.get('effects', []))}",
        "station": lambda: f"  {about.get('kind', '')} {about.get('description', '')}",
    }.get(node.kind, lambda: "")
    return Text(more().rstrip(), style="dim")


def _step(step: ProvActivity, versions: str) -> Text:
    about = step.about
    text = Text("by ", style="dim").append(step.name, style="italic")
    parts = (
        str(about.get("when") or "")[:19].replace("T", " "),
        f"{about['who']} on {about.get('where', '')}" if about.get("who") else "",
        f"code {str(about['code'])[:SHORT]}" if about.get("code") else "",
        versions,
        str(about.get("reason") or ""),
        f"taken from run {about['taken_from']}" if about.get("taken_from") else "",
    )
    return text.append("  " + ", ".join(filter(None, parts)), style="dim")
