"""Whether the tests notice changes of the product: `python -m benchmarks.mutations --places 60 --seed 1`.

The product is changed at drawn places (a sign, a comparison, a constant, a removed statement), one at a time, in a work tree of
its own, and the fast tests of the mirror folder of its module are run, or those that import it where there is none. A result
file (`--results`) keeps what became of each place; `--revision REV` takes the tests of another revision, and tries at each place
of the file the test first that failed there, so that two suites are compared on the same places.
"""

from __future__ import annotations

import argparse
import ast
import json
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
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


def drawn(count: int, seed: int) -> list[Place]:
    """So many places, each module with the weight of its number of places."""
    paths = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
    every = [
        one for path in paths for one in places_in(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8"))
    ]
    return random.Random(seed).sample(every, count)


def tests_of(tree: Path, path: str) -> list[str]:
    """The mirror folder of a module; without one, the test files that import it, else those that import its package."""
    mirror = tree / "tests" / "unit" / Path(path).parent
    if mirror.is_dir():
        return [str(mirror)]
    texts = {str(file): file.read_text(encoding="utf-8") for file in sorted((tree / "tests").rglob("test_*.py"))}
    package, _, stem = path.removesuffix(".py").removesuffix("/__init__").replace("/", ".").rpartition(".")
    of_module = rf"from {package}.{stem} import|import {package}.{stem}\b|from {package} import .*\b{stem}\b"
    for pattern in (of_module, rf"from {package}[. ]"):
        if found := [file for file, text in texts.items() if re.search(rf"^\s*(?:{pattern})", text, re.MULTILINE)]:
            return found
    return []


def failing(tree: Path, place: Place, first: str | None, limit_s: float) -> str | None:
    """The test that notices the change, or None, or why that is not known."""
    path = tree / place.path
    sound = path.read_bytes()
    path.write_bytes(sound[: place.start] + place.text.encode() + sound[place.end :])
    call = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "-p", "no:randomly", "-m", "not slow", "--tb=no"]
    try:
        for tests in filter(None, ([first] if first else [], tests_of(tree, place.path))):
            done = subprocess.run(
                [*call, *tests], cwd=tree, capture_output=True, text=True, timeout=limit_s, check=False
            )
            if found := re.search(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE):
                return found[1]
            if done.returncode not in {0, 4, 5}:  # a test that is no more, or no test at all
                return NOT_STARTED
    except subprocess.TimeoutExpired:
        return NOT_ENDED
    finally:
        path.write_bytes(sound)
    return None


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--places", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--revision", default="HEAD", help="whose tests are run; the product is that of the working tree"
    )
    parser.add_argument(
        "--results", type=Path, help="a file of an earlier call, which gets the results of this revision"
    )
    parser.add_argument("--limit", type=float, default=600.0, help="seconds for the tests of one place")
    given = parser.parse_args()
    kept = json.loads(given.results.read_text(encoding="utf-8")) if given.results and given.results.exists() else {}
    first = {name: test for suite in kept.values() for name, test in suite.items() if test and "::" in test}
    found: dict[str, str | None] = {}
    with tempfile.TemporaryDirectory(prefix="mutations-") as top:
        tree = Path(top) / "tree"
        subprocess.run(["git", "worktree", "add", "--detach", "-q", tree, given.revision], cwd=ROOT, check=True)
        try:
            for room in ROOMS:
                shutil.rmtree(tree / room)
                shutil.copytree(ROOT / room, tree / room)
            for place in drawn(given.places, given.seed):
                found[place.name] = failing(tree, place, first.get(place.name), given.limit)
                print(f"{found[place.name] or 'NOT NOTICED'}  <- {place.name}", flush=True)
        finally:
            subprocess.run(["git", "worktree", "remove", "--force", tree], cwd=ROOT, check=True)
    known = {name: test for name, test in found.items() if test != NOT_ENDED}
    noticed = sum(test is not None for test in known.values())
    print(f"{given.revision}: {noticed} of {len(known)} changes noticed")
    if given.results:
        given.results.write_text(json.dumps(kept | {given.revision: found}, indent=1), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
