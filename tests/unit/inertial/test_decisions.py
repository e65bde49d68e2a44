"""Every number that decides a diagnosis says how it was derived or measured, and its command knows it."""

import ast
import re
import sys
from pathlib import Path

from each import each

from inertial import decisions

ROOT = Path(__file__).resolve().parents[3]
sys.path.append(str(ROOT / "benchmarks"))  # last: tests have modules of the same names

from characteristics import COMMANDS, how


def stated() -> dict[str, str]:
    """The text below each number of the decisions, by its name."""
    body, texts = ast.parse(Path(decisions.__file__).read_text(encoding="utf-8")).body, {}
    for node, after in zip(body, [*body[1:], None], strict=True):
        if not isinstance(node, ast.Assign):
            continue
        (target,) = node.targets
        names = target.elts if isinstance(target, ast.Tuple) else [target]
        text = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
        texts |= {name.id: str(text) for name in names if isinstance(name, ast.Name)}
    return texts


STATED = stated()


@each(sorted(STATED))
def test_every_number_has_a_derivation_or_a_characteristic_with_its_command(name: str) -> None:
    text = " ".join(STATED[name].split())
    derived = re.search(r"Derived: .{30,}", text)
    measured = re.search(r"\d+ of \d+|\d+·10⁻|\d+ %|median", text)
    command = re.search(r"`python benchmarks/(\w+)(?:\.py)?[^`]*`", text)
    assert derived or (measured and command), text
    assert command, text
    assert (ROOT / "benchmarks" / command.group(1)).exists() or (
        ROOT / "benchmarks" / f"{command.group(1)}.py"
    ).exists()


def test_the_numbers_are_all_found_with_the_commands_that_they_state() -> None:
    assert set(STATED) == {name for name in vars(decisions) if name.isupper()}
    assert set(how()) == set(STATED)
    for name, (command, *_) in COMMANDS.items():
        assert f"benchmarks/{command}" in " ".join(STATED[name].split()), name
