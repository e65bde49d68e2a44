"""Every command that a message, a page or a line under "Next" names: it exists, with its options, wherever it stands."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from each import each
from typed_commands import code_spans, options_below, unknown_options, unknown_settings

from pipelines.cli import COMMANDS
from pipelines.cli.former import COMMANDS as FORMER

ROOT = Path(__file__).resolve().parents[2]
PRODUCT = [
    path for room in ("pipelines", "stations", "schemas", "inertial") for path in sorted((ROOT / room).rglob("*.py"))
]
TEMPLATES = sorted((ROOT / "pipelines").rglob("*.html"))


def texts(tree: ast.Module) -> Iterator[str]:
    """The texts of a module, values within them as X; documentation is left out."""
    inside = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
    documentation = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)
        and node.body
        and isinstance(node.body[0], ast.Expr)
    }
    elsewhere = inside | documentation
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(part.value if isinstance(part, ast.Constant) else "X" for part in node.values)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in elsewhere:
            yield node.value


def quoted(text: str) -> list[str]:
    """The commands within a text: between quotes, or from the name of the program to the end of the line."""
    pattern = rf"'(tumbleline (?:{NAMES})\b[^'\n]*)'|^ *(tumbleline (?:{NAMES})\b.*)$"
    return [groups[0] or groups[1] for groups in re.findall(pattern, text, re.MULTILINE)]


NAMES = "|".join(re.escape(name) for name in (*COMMANDS, *FORMER))


@cache
def messages() -> list[tuple[str, str]]:
    """Module and text of every message of the product that can name a command or an option."""
    sources = {path: path.read_text(encoding="utf-8") for path in PRODUCT}
    return [
        (path.relative_to(ROOT).as_posix(), text)
        for path, source in sources.items()
        if "tumbleline " in source or " --" in source
        for text in texts(ast.parse(source))
    ]


@cache
def commands() -> dict[str, list[str]]:
    """The commands that a module or a page names, by its path."""
    named: dict[str, list[str]] = {}
    for place, text in messages():
        named.setdefault(place, []).extend(quoted(text))
    for path in TEMPLATES:
        lines = re.findall(rf"<code>(tumbleline (?:{NAMES})\b[^<]*)</code>", path.read_text(encoding="utf-8"))
        named[path.relative_to(ROOT).as_posix()] = [re.sub(r"{{.*?}}", "X", line) for line in lines]
    return {place: lines for place, lines in named.items() if lines}


@each(lambda: sorted(commands()))
def test_a_command_in_a_message_exists_with_its_options(path: str) -> None:
    for line in commands()[path]:
        closed = line if line.count('"') % 2 == 0 else line.replace('"', "")
        assert unknown_options(closed.replace("{", "").replace("}", "")) == set(), line


DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    *sorted((ROOT / "docs").rglob("*.md")),
    *(ROOT / "deploy").rglob("*.md"),
]
NOT_OURS = {
    "docs/decisions/command-names.md",  # names former options
    "deploy/README.md", "deploy/plant.md",  # options of docker
}  # fmt: skip
BY_EVERY_COMMAND = {"--log", "--version", "--help", "--show-completion"}


def test_code_in_a_page_names_commands_options_and_settings_that_exist() -> None:
    """In prose and tables as in blocks; a span may leave out the name of the program."""
    known = set().union(*(options_below(name) for name in COMMANDS)) | BY_EVERY_COMMAND
    wrong: set[tuple[str, str, str]] = set()
    count = 0
    for path in DOCUMENTS:
        place = path.relative_to(ROOT).as_posix()
        for code in code_spans(path.read_text(encoding="utf-8")):
            line = re.sub(r"\s[#|>&].*$", "", code.strip())
            if re.match(rf"tumbleline +[a-z]|(?:{'|'.join(COMMANDS)})(?: |$)", line):
                count += 1
                whole = line if line.startswith("tumbleline ") else f"tumbleline {line}"
                wrong |= {(place, code, word) for word in unknown_options(whole) | unknown_settings(whole)}
            elif line.startswith("--") and place not in NOT_OURS:
                options = re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", line)
                wrong |= {(place, code, word) for word in options if word not in known}
    assert wrong == set()
    assert count > 600


def test_a_command_on_a_line_of_its_own_is_made_of_quoted_words() -> None:
    """By one function: a name with a blank in it would otherwise break the line that is pasted."""
    assert sum(len(lines) for place, lines in commands().items() if place.endswith(".py")) > 80
    raw = {
        (path.stem, text)
        for path in (ROOT / "pipelines" / "cli").glob("*.py")
        for text in texts(ast.parse(path.read_text(encoding="utf-8")))
        if re.match(rf" +tumbleline (?:{NAMES})\b", text)
    }
    assert raw == set()


FOREIGN = {
    "inertial/",  # its constants name the commands that print their characteristics
    "pipelines/orchestrator/", "pipelines/flows/", "pipelines/drawing/", "pipelines/doctor/software.py",
    "schemas/installed.py", "schemas/locks.py",
}  # fmt: skip
"""Rooms that name the options of other programs, or start these."""


def test_an_option_in_a_message_is_one_of_a_command() -> None:
    known = {name for line in sorted(COMMANDS) for name in options_below(line)} | {"--log", "--version", "--help"}
    wrong = {
        (place, word)
        for place, text in messages()
        if not place.startswith(tuple(FOREIGN)) and not place.endswith("cli/former.py")
        for word in re.findall(r"(?<![\w-])--[a-z][a-z-]*[a-z]", text)
        if word not in known
    }
    assert wrong == set()
