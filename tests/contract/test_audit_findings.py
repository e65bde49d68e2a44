"""Every kind of audit finding has a function that yields it, somebody who must act, evidence, and a row in the guide."""

from __future__ import annotations

import ast
import re
from itertools import product
from pathlib import Path
from typing import NamedTuple

from each import each

from pipelines.audit.finding import WHO

ROOT = Path(__file__).resolve().parents[2]
ROOM = ROOT / "pipelines" / "audit"
GUIDE = (ROOT / "docs" / "how-to" / "audit.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| `(\w+)` \| (\w+) \| (.+) \|$", re.MULTILINE)
DOCUMENTED = {kind: (who, text) for kind, who, text in ROW.findall(GUIDE.partition("## Findings")[2])}
FILLINGS = {"odd.kind": ("lot", "unit"), "difference.by": ("station", "slot")}  # values of a kind that is put together
WITHOUT_EVIDENCE = {"due", "unreadable", "ledger"}  # the message and the subject say all that there is


class Yielded(NamedTuple):
    """A place in the code at which a finding is made."""

    where: str
    kinds: tuple[str, ...]
    who: tuple[str, ...]
    arguments: int


def made() -> list[Yielded]:
    """Every call of ``AuditFinding`` in the room, with the kinds that it can give."""
    calls: list[Yielded] = []
    for path in sorted(ROOM.glob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        for function in [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]:
            for call in [node for node in ast.walk(function) if isinstance(node, ast.Call)]:
                if isinstance(call.func, ast.Name) and call.func.id == "AuditFinding":
                    who, kind = call.args[0], call.args[1]
                    kinds = texts(kind) or handed_in(tree, function, kind)
                    calls.append(Yielded(f"{path.name}:{call.lineno}", kinds, texts(who), len(call.args)))
    return calls


def texts(node: ast.expr) -> tuple[str, ...]:
    """The values of a constant or of a text that is put together; none for a variable."""
    if isinstance(node, ast.Constant):
        return (str(node.value),)
    if isinstance(node, ast.JoinedStr):
        parts = [
            (str(part.value),) if isinstance(part, ast.Constant) else FILLINGS[ast.unparse(part.value)]
            for part in node.values
            if isinstance(part, ast.Constant | ast.FormattedValue)
        ]
        return tuple("".join(one) for one in product(*parts))
    return ()


def handed_in(tree: ast.Module, function: ast.FunctionDef, kind: ast.expr) -> tuple[str, ...]:
    """The constants that callers in the same module give for the parameter that is the kind."""
    assert isinstance(kind, ast.Name), f"{function.name}: the kind of a finding is a constant or a parameter"
    place = [one.arg for one in function.args.args].index(kind.id)
    calls = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == function.name
    ]
    return tuple(text for call in calls for text in texts(call.args[place]))


MADE = made()
KINDS = sorted({kind for one in MADE for kind in one.kinds})


def test_every_kind_of_finding_has_a_row_in_the_guide_and_every_row_a_finding() -> None:
    assert len(KINDS) >= 20
    assert sorted(DOCUMENTED) == KINDS


@each(MADE, lambda one: one.where)
def test_a_finding_says_who_must_act_and_shows_its_evidence(one: Yielded) -> None:
    assert one.kinds
    assert set(one.who) <= set(WHO)
    assert one.arguments >= 6 or set(one.kinds) <= WITHOUT_EVIDENCE
    for kind in one.kinds:
        who, text = DOCUMENTED[kind]
        assert who in WHO
        assert not one.who or who in one.who, f"{kind}: the guide says {who}, the code {one.who}"
        assert len(text) > 10


def test_every_function_that_yields_findings_is_reached_from_the_list() -> None:
    sources = {path.stem: ast.parse(path.read_text(encoding="utf-8")) for path in ROOM.glob("*.py")}
    yielding = {
        (stem, node.name)
        for stem, tree in sources.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and any(_is_finding(call) for call in ast.walk(node))
    }
    called = {
        (stem, node.func.id)
        for stem, tree in sources.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
    }
    assert yielding - called == set()
    heads = {
        node.module.rpartition(".")[2]
        for node in ast.walk(sources["findings"])
        if isinstance(node, ast.ImportFrom) and node.module
    }
    assert {stem for stem, _ in yielding} - {"findings"} <= heads


def _is_finding(node: ast.AST) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "AuditFinding"
