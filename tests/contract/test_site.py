"""The site of the documents: every page is in it, links hold, nothing is loaded from elsewhere, a wrong link stops the build."""

import json
import re
import shutil
from importlib.util import find_spec
from pathlib import Path

import pytest
import yaml

from docs import build_site
from docs.build_site import CONFIGURATION, NEEDED, ROOT, modules, navigation, stage

ELSEWHERE = re.compile(r"<(?:script|img|link|iframe|source)\b[^>]*?\b(?:src|href)=[\"']?(?:https?:)?//[^>]*>")
BUILT = pytest.mark.skipif(any(find_spec(name) is None for name in NEEDED), reason="the extra 'docs' is not installed")


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    stage(folder)
    return folder


def test_every_page_and_module_is_in_the_site_which_loads_nothing_of_others_and_checks_its_links(staged: Path) -> None:
    listed = re.findall(r"'([^']+\.md)'", str(navigation(staged)))
    assert len(listed) == len(set(listed))
    pages = [str(path.relative_to(ROOT)) for path in (*ROOT.glob("docs/**/*.md"), *ROOT.glob("deploy/*.md"))]
    assert set(pages) <= set(listed)
    assert [name for name in listed if not (staged / name).is_file()] == []
    for package in ("inertial", "tumbleline"):  # every module of the science and of the package for Python has one
        own = {path.stem for path in (staged / "docs" / "reference" / package).glob(f"{package}*.md")}
        assert own == set(modules(package))
    assert {"inertial.effects.third_order", "inertial.noise", "inertial.dynamics.spectra"} <= set(modules("inertial"))
    content = yaml.safe_load(CONFIGURATION.read_text(encoding="utf-8"))
    assert content["theme"]["font"] is False  # the site loads no fonts of others and checks its links
    assert {"search", "offline"} <= {name for name in content["plugins"] if isinstance(name, str)}
    assert set(content["validation"]["links"].values()) == {"warn"}  # an error with --strict


@BUILT
@pytest.mark.slow
def test_the_site_is_built_is_searched_without_a_server_and_loads_nothing_from_elsewhere(tmp_path: Path) -> None:
    assert build_site.build(tmp_path) == 0
    pages = list(tmp_path.rglob("*.html"))
    assert len(pages) > len(modules("inertial")) + 60
    assert [str(page) for page in pages if ELSEWHERE.search(page.read_text(encoding="utf-8"))] == []
    script = (tmp_path / "search" / "search_index.js").read_text(encoding="utf-8")
    index = json.loads(script[script.index("{") : script.rindex("}") + 1])
    words = " ".join(entry["text"] for entry in index["docs"])
    assert "specific force" in words
    assert results_of("hysteresis", tmp_path / "index.html") >= 5
    effect = tmp_path / "docs" / "reference" / "inertial" / "inertial.effects.third_order.html"
    assert "doc-heading" in effect.read_text(encoding="utf-8")


def results_of(word: str, page: Path) -> int:
    """Number of pages that the search of the site gives in a browser without a network, on files without a server."""
    program = shutil.which("chromium")
    if program is None:
        pytest.skip("chromium is not installed; the index was read above")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=program, args=["--no-sandbox"])
        opened = browser.new_page()
        asked: list[str] = []
        opened.on("request", lambda request: asked.append(request.url))
        opened.goto(page.as_uri())
        opened.fill("input.md-search__input", word, timeout=120_000)
        opened.wait_for_selector(".md-search-result__item", timeout=120_000)
        count = opened.locator(".md-search-result__item").count()
        browser.close()
    assert [address for address in asked if not address.startswith(("file:", "data:", "blob:"))] == []
    return count


@BUILT
@pytest.mark.slow
@pytest.mark.parametrize("link", ["[gone](gone.md)", "[no anchor](units.md#gone)"])
def test_a_link_that_leads_nowhere_stops_the_build(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, link: str) -> None:
    linked = build_site._linked
    wrong = {"docs/decisions/README.md": f"\n{link}\n"}
    monkeypatch.setattr(
        build_site, "_linked", lambda page, folder: linked(page, folder) + wrong.get(str(page.relative_to(ROOT)), "")
    )
    monkeypatch.setattr(build_site, "modules", lambda: ["inertial.frames"])
    assert build_site.build(tmp_path) != 0
