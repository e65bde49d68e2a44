"""Whether the tests notice changes of the product: `python -m benchmarks.mutations --places 60 --seed 1`.

The product is changed at drawn places (a sign, a comparison, a constant, a removed statement), one at a time, in a work tree of
its own, and the fast tests of the mirror folder of its module are run, or those that import it where there is none. With
`--before REV` the places are drawn where the tests of that revision differ from those of HEAD, and both suites are tried at each:
first the test files that differ, then, for a suite that has not noticed the change by them, the files that both have.
"""

from __future__ import annotations

import argparse
import ast
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
ROOMS = ("inertial", "schemas", "stations", "pipelines")
SIGNS: dict[type[ast.operator], str] = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
COMPARISONS: dict[type[ast.cmpop], str] = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==", ast.In: "not in", ast.NotIn: "in",
    ast.Is: "is not", ast.IsNot: "is",
}  # fmt: skip


NOT_STARTED, NOT_ENDED = "the tests do not start", "not known: the tests do not end"


class Place(NamedTuple):
    """A piece of a module, from byte to byte, and what stands there instead."""

    path: str
    line: int
    start: int
    end: int
    text: str

    @property
    def name(self) -> str:
        """The place and its change in one line."""
        return f"{self.path}:{self.line} {self.text}"


def places_in(path: str, source: str) -> Iterator[Place]:
    """Every change that a module can have."""
    data = source.encode()
    starts = [0]
    for line in data.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))

    def place(node: ast.expr | ast.stmt, text: str) -> Place:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        first, last = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset
        return Place(path, node.lineno, first, last, text)

    def written(node: ast.expr) -> str:
        return f"({ast.unparse(node)})"

    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.BinOp) and type(node.op) in SIGNS:
            yield place(node, f"({written(node.left)} {SIGNS[type(node.op)]} {written(node.right)})")
        elif isinstance(node, ast.Compare) and len(node.ops) == 1:
            yield place(node, f"({written(node.left)} {COMPARISONS[type(node.ops[0])]} {written(node.comparators[0])})")
        elif isinstance(node, ast.Constant) and type(node.value) in {int, float}:
            yield place(node, f"({node.value!r} * 2 + 1)")
        elif isinstance(node, ast.AugAssign) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            yield place(node, "pass")


def drawn(seed: int) -> list[Place]:
    """Every place in an order of its own for each seed."""
    paths = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    every = [
        one for path in paths for one in places_in(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    ]
    random.Random(seed).shuffle(every)
    return every


@cache
def texts_of(tree: Path) -> dict[str, str]:
    """The test files of a work tree."""
    return {
        one.relative_to(tree).as_posix(): one.read_text(encoding="utf-8") for one in (tree / "tests").rglob("test_*.py")
    }


@cache
def tests_of(tree: Path, path: str) -> set[str]:
    """The test files of the mirror folder of a module; without one those that import it, else those that import its package."""
    mirror = f"tests/unit/{Path(path).parent.as_posix()}/"
    if own := {file for file in texts_of(tree) if file.startswith(mirror)}:
        return own
    texts = texts_of(tree)
    package, _, stem = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".").rpartition(".")
    of_module = rf"from {package}.{stem} import|import {package}.{stem}\b|from {package} import .*\b{stem}\b"
    for pattern in (of_module, rf"from {package}[. ]"):
        if found := {file for file, text in texts.items() if re.search(rf"^\s*(?:{pattern})", text, re.MULTILINE)}:
            return found
    return set()


def failing(tree: Path, place: Place, tests: set[str], limit_s: float) -> str | None:
    """The test that notices the change, or None, or why that is not known."""
    if not tests:
        return None
    path = tree / place.path
    sound = path.read_bytes()
    path.write_bytes(sound[: place.start] + place.text.encode() + sound[place.end :])
    call = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:randomly", "-m", "not slow", "--tb=no"]
    try:
        done = subprocess.run(
            [*call, *sorted(tests)], cwd=tree, capture_output=True, text=True, timeout=limit_s, check=False
        )
    except subprocess.TimeoutExpired:
        return NOT_ENDED
    finally:
        path.write_bytes(sound)
    if found := re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE):
        return found[1]
    return None if done.returncode in {0, 5} else NOT_STARTED  # 5: all of these tests are slow


class Suite(NamedTuple):
    """The tests of a revision, in a work tree with the product of this one."""

    name: str
    tree: Path


@contextmanager
def suite(revision: str) -> Iterator[Suite]:
    """A work tree that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="mutations-") as top:
        tree = Path(top) / "tree"
        subprocess.run(["git", "worktree", "add", "--detach", "-q", tree, revision], cwd=ROOT, check=True)
        try:
            for room in ROOMS:
                shutil.rmtree(tree / room)
                shutil.copytree(ROOT / room, tree / room)
            yield Suite(revision, tree)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)


def differing(suites: list[Suite], tests: list[set[str]]) -> set[str]:
    """Test files that are not the same in all suites; none where there is one suite."""
    every = set().union(*tests)
    kept = [{file: texts_of(one.tree)[file] for file in own} for one, own in zip(suites, tests, strict=True)]
    return {file for file in every if any(own.get(file) != kept[0].get(file) for own in kept)}


def tried(suites: list[Suite], place: Place, limit_s: float, *, whole: bool) -> list[str | None] | None:
    """What each suite makes of a change; None where the suites have the same tests of the module, or none."""
    tests = [tests_of(one.tree, place.path) for one in suites]
    apart = differing(suites, tests)
    if not any(tests) or (len(suites) > 1 and not apart):
        return None
    found = [failing(one.tree, place, own & apart, limit_s) for one, own in zip(suites, tests, strict=True)]
    if None in found and whole:
        shared = failing(suites[0].tree, place, tests[0] - apart, limit_s)
        found = [shared if one is None else one for one in found]
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--before", help="a revision whose tests are compared with those of HEAD")
    parser.add_argument("--differing", action="store_true", help="run the test files that differ alone")
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for the tests of one place")
    given = parser.parse_args()
    noticed, known = Counter[str](), 0
    with ExitStack() as within:
        suites = [within.enter_context(suite(one)) for one in filter(None, (given.before, "HEAD"))]
        compared = (
            (place, tried(suites, place, given.limit, whole=not given.differing)) for place in drawn(given.seed)
        )
        for place, found in islice(((place, found) for place, found in compared if found is not None), given.places):
            for one, test in zip(suites, found, strict=True):
                print(f"{one.name}: {test or 'NOT NOTICED'}  <- {place.name}", flush=True)
            if NOT_ENDED not in found:
                known += 1
                noticed.update(one.name for one, test in zip(suites, found, strict=True) if test)
    for one in suites:
        print(f"{one.name}: {noticed[one.name]} of {known} changes noticed")
    return 0


if __name__ == "__main__":
    sys.exit(main())
