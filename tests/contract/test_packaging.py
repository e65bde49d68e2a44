"""Nothing tracked names a machine; links in the documents lead somewhere. What is shipped: ``test_wheel.py``."""

import re
import subprocess
from pathlib import Path

import pytest
from each import each

ROOT = Path(__file__).resolve().parents[2]
SHIPPED = ("inertial", "schemas", "stations", "pipelines", "tumbleline")
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


def test_no_file_names_an_index_or_a_path_of_a_machine() -> None:
    mentions: list[str] = []
    for path in tracked():
        text = text_of(path)
        for pattern in (MACHINE, INDEX):
            for hit in pattern.finditer(text):
                line = text[: hit.start()].count("\n") + 1
                mentions.append(f"{path.relative_to(ROOT)}:{line}: {hit[0]!r}")
    assert mentions == []


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
