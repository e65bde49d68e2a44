"""What README and guides tell people to type exists: commands, their options, targets of make, benchmarks, files."""

import re
import tomllib
from pathlib import Path

import pytest
from typed_commands import unknown_options

from pipelines.demo.scenes import SCENES
from pipelines.jobs.recipes import load_limits, load_recipe
from schemas.recipe import parse_recipe

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def typed(page: Path) -> list[str]:
    """Every `tumbleline …` of a page: lines of code blocks and code within a sentence."""
    text = re.sub(r" *\\\n *", " ", page.read_text(encoding="utf-8"))  # a backslash joins the next line to the command
    lines = re.findall(r"^[ $]*(tumbleline +[a-z].*)$", text, re.MULTILINE)
    inline = re.findall(r"(?<!`)`(tumbleline +[a-z][^`\n]*)`(?!`)", text)
    return [line.split("  #")[0].strip() for line in (*lines, *inline)]


CASES = [pytest.param(line, id=f"{page.stem}: {line[:50]}") for page in PAGES for line in dict.fromkeys(typed(page))]


def test_the_pages_show_commands() -> None:
    assert len(typed(ROOT / "README.md")) >= 5
    assert len(CASES) > 20


@pytest.mark.parametrize("line", CASES)
def test_a_command_that_is_shown_exists_with_its_options(line: str) -> None:
    assert unknown_options(line) == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_targets_of_make_exist(page: Path) -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    used = set(re.findall(r"(?:^ {4}|`)make ([a-z-]+)", page.read_text(encoding="utf-8"), re.MULTILINE))
    assert used - targets == set()


def test_the_readme_shows_the_two_commands() -> None:
    assert "make run" in README
    assert "make test" in README


@pytest.mark.parametrize("page", [*PAGES, ROOT / "benchmarks" / "README.md"], ids=lambda p: f"{p.parent.name}/{p.stem}")
def test_benchmarks_that_are_named_exist_with_their_options(page: Path) -> None:
    for name, arguments in re.findall(
        r"benchmarks/(\w+)\.py((?: --?[\w-]+(?: [\w.]+)?)*)", page.read_text(encoding="utf-8")
    ):
        source = (ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")
        assert [word for word in re.findall(r"--[\w-]+", arguments) if f'"{word}"' not in source] == []


def test_files_of_the_project_that_are_named_are_there() -> None:
    for page in PAGES:
        named = re.findall(
            r"`((?:inertial|stations|schemas|pipelines|deploy|tests|docs)/[\w./-]+\.\w+)`",
            page.read_text(encoding="utf-8"),
        )
        assert [name for name in named if not (ROOT / name).exists()] == [], page.name


def test_the_recipe_of_the_guide_is_a_recipe(tmp_path: Path) -> None:
    text = (ROOT / "docs" / "how-to" / "run-a-lot.md").read_text(encoding="utf-8")
    block = re.search(r"```toml\n(.*?)```", text, re.DOTALL)
    assert block is not None
    assert parse_recipe(block[1], "guide").units == ["SN1", "SN2"]
    file = tmp_path / "my.toml"
    file.write_text(block[1], encoding="utf-8")
    assert load_limits(load_recipe(str(file)), tmp_path).name == "consumer"


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_what_the_pages_hide_can_be_hidden(page: Path) -> None:
    hidden = set(re.findall(r"demo .*--effect (\w+)", page.read_text(encoding="utf-8")))
    assert hidden <= {"random"} | {scene.kind for scene in SCENES} | {scene.effect for scene in SCENES}


def test_the_version_of_the_changelog_is_not_behind() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"## [{version}]" in text or "## [Unreleased]" in text
    assert "### Changed numbers" in text
