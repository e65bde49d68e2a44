"""Every kind of audit finding has a function that yields it, somebody who must act, evidence, and a row in the guide."""

import ast
import re
from itertools import product
from pathlib import Path

from each import each

from pipelines.audit.finding import WHO

ROOT = Path(__file__).resolve().parents[2]
GUIDE = (ROOT / "docs" / "how-to" / "audit.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| `(\w+)` \| (\w+) \| (.+) \|$", re.MULTILINE)
DOCUMENTED = {kind: who for kind, who, _ in ROW.findall(GUIDE.partition("## Findings")[2])}
FILLINGS = {"odd.kind": ("lot", "unit"), "difference.by": ("station", "slot")}  # values of a kind that is put together
WITHOUT_EVIDENCE = {"due", "unreadable", "ledger"}  # the message and the subject say all that there is
ROOM = {path.stem: ast.parse(path.read_text("utf-8")) for path in (ROOT / "pipelines" / "audit").glob("*.py")}


def calls(part: ast.AST, name: str = "") -> list[ast.Call]:
    """Calls of a function by its name, or of any."""
    found = [node for node in ast.walk(part) if isinstance(node, ast.Call) and isinstance(node.func, ast.Name)]
    return [call for call in found if getattr(call.func, "id", "") == (name or getattr(call.func, "id", ""))]


MADE = [
    (stem, function, call)
    for stem, tree in ROOM.items()
    for function in ast.walk(tree)
    if isinstance(function, ast.FunctionDef)
    for call in calls(function, "AuditFinding")
]


def kinds(stem: str, function: ast.FunctionDef, node: ast.expr) -> set[str]:
    """The kinds that a constant, a text that is put together or a parameter of the function can be."""
    if isinstance(node, ast.Name):
        place = [one.arg for one in function.args.args].index(node.id)
        return {kind for call in calls(ROOM[stem], function.name) for kind in kinds(stem, function, call.args[place])}
    parts = [
        (part.value,) if isinstance(part, ast.Constant) else FILLINGS[ast.unparse(part.value)]  # pyright: ignore[reportAttributeAccessIssue]
        for part in getattr(node, "values", [node])
    ]
    return {"".join(one) for one in product(*parts)}


def test_every_kind_of_finding_has_a_row_in_the_guide_and_every_row_a_finding_that_is_called() -> None:
    assert {kind for stem, function, call in MADE for kind in kinds(stem, function, call.args[1])} == set(DOCUMENTED)
    called = {(stem, getattr(call.func, "id", "")) for stem, tree in ROOM.items() for call in calls(tree)}
    assert {(stem, function.name) for stem, function, _ in MADE} - called == set()
    asked = {node.module for node in ast.walk(ROOM["findings"]) if isinstance(node, ast.ImportFrom)}
    assert {f"pipelines.audit.{stem}" for stem, _, _ in MADE} - {"pipelines.audit.findings"} <= asked


@each(MADE, lambda one: f"{one[0]}:{one[2].lineno}")
def test_a_finding_says_who_must_act_and_shows_its_evidence(one: tuple[str, ast.FunctionDef, ast.Call]) -> None:
    who, own = one[2].args[0], kinds(one[0], one[1], one[2].args[1])
    assert own
    assert len(one[2].args) >= 6 or own <= WITHOUT_EVIDENCE
    assert {DOCUMENTED[kind] for kind in own} <= ({who.value} if isinstance(who, ast.Constant) else set(WHO)) & set(WHO)
