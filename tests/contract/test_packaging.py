"""What is shipped is what is there; nothing tracked names a machine; links in the documents lead somewhere."""

import fnmatch
import re
import subprocess
import tomllib
from pathlib import Path

import pytest
from each import each

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("inertial", "schemas", "stations", "pipelines", "tumbleline")
SETUP = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["setuptools"]

MACHINE = re.compile(r"(?<![\w.~])/(?:work|tmp|root|home)/")
INDEX = re.compile(
    r"\b(?:[\w-]+[.])*(?:pypi|pythonhosted|npmjs|npmmirror|anaconda|crates|debian|ubuntu|artifactory)[.](?:org|com|io)\b"
    r"|--(?:extra-)?index-url[ =]\S|--find-links[ =]\S",
    re.IGNORECASE,
)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def tracked(*patterns: str) -> list[Path]:
    """Files that git tracks and that are there, plus those not ignored that would be added next."""
    done = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "-z", "--", *patterns],
        cwd=ROOT,
        capture_output=True,
        check=False,
    )
    if done.returncode:
        pytest.skip("not a git checkout: what is tracked is not known")
    return [p for name in done.stdout.decode().split("\0") if name and (p := ROOT / name).is_file()]


def text_of(path: Path) -> str:
    """Content of a text file; empty for pictures and other binary files."""
    data = path.read_bytes()
    return "" if b"\0" in data else data.decode("utf-8")


def test_the_packages_listed_are_the_packages_on_disk() -> None:
    on_disk = {
        ".".join(path.parent.relative_to(ROOT).parts) for top in SHIPPED for path in (ROOT / top).rglob("__init__.py")
    }
    assert set(SETUP["packages"]) == on_disk
    assert len(SETUP["packages"]) == len(set(SETUP["packages"]))


def test_every_folder_with_modules_is_a_package() -> None:
    bare = {path.parent for top in SHIPPED for path in (ROOT / top).rglob("*.py")}
    assert [str(folder.relative_to(ROOT)) for folder in bare if not (folder / "__init__.py").is_file()] == []


def is_shipped(path: Path) -> bool:
    """Whether a pattern of the package data covers a file that is no module."""
    for package, patterns in SETUP["package-data"].items():
        folder = ROOT.joinpath(*package.split("."))
        if folder in path.parents:
            name = path.relative_to(folder)
            if any(
                len(name.parts) == pattern.count("/") + 1 and fnmatch.fnmatch(str(name), pattern)
                for pattern in patterns
            ):
                return True
    return False


def test_every_data_file_of_a_package_is_shipped() -> None:
    data = [path for path in tracked(*SHIPPED) if path.suffix != ".py"]
    assert data
    assert [str(path.relative_to(ROOT)) for path in data if not is_shipped(path)] == []


def test_every_pattern_of_package_data_finds_something() -> None:
    for package, patterns in SETUP["package-data"].items():
        folder = ROOT.joinpath(*package.split("."))
        assert [pattern for pattern in patterns if not any(folder.glob(pattern))] == []


def test_no_file_names_an_index_or_a_path_of_a_machine() -> None:
    mentions: list[str] = []
    for path in tracked():
        text = text_of(path)
        for pattern in (MACHINE, INDEX):
            for hit in pattern.finditer(text):
                line = text[: hit.start()].count("\n") + 1
                mentions.append(f"{path.relative_to(ROOT)}:{line}: {hit[0]!r}")
    assert mentions == []


def test_the_patterns_find_what_they_are_for() -> None:
    slash = "/"
    for text in (f"see {slash}work/x", f"'{slash}tmp/x'", f"{slash}root/.venv"):
        assert MACHINE.search(text)
    dot = "."
    for text in (f"https://pypi{dot}org/simple", f"files{dot}pythonhosted{dot}org", "--index-" + "url https://a"):
        assert INDEX.search(text)
    assert not MACHINE.search("docs/work/x")
    assert not INDEX.search("uv pip compile --no-emit-index-url --no-annotate")


def anchors(path: Path) -> set[str]:
    """Anchors of a page's headings, as the usual renderers make them."""
    heads = re.findall(r"^#+ +(.*)$", text_of(path), re.MULTILINE)
    return {
        re.sub(r"[^\w\- ]", "", head.replace("&lt;", "").replace("&gt;", "").lower()).replace(" ", "-")
        for head in heads
    }


@each(tracked("*.md"))
def test_every_link_of_a_page_leads_somewhere(path: Path) -> None:
    text = re.sub(r"^```.*?^```$", "", text_of(path), flags=re.DOTALL | re.MULTILINE)
    for target in LINK.findall(text):
        if target.startswith(("https://", "http://")):
            continue
        name, _, anchor = target.partition("#")
        there = (path.parent / name).resolve() if name else path
        assert there.exists(), f"{target}: nothing is there"
        assert ROOT in there.parents, f"{target}: leaves the project"
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there), f"{target}: {there.name} has no such heading"


def test_every_page_of_the_documents_is_reached_from_their_index() -> None:
    seen, left = set(), [ROOT / "README.md", ROOT / "docs" / "README.md"]
    while left:
        page = left.pop()
        if page in seen or page.suffix != ".md" or not page.is_file():
            continue
        seen.add(page)
        left += [
            (page.parent / target.partition("#")[0]).resolve()
            for target in LINK.findall(text_of(page))
            if "://" not in target
        ]
    lost = [str(p.relative_to(ROOT)) for p in tracked("docs/*.md") if p not in seen]
    assert lost == []
