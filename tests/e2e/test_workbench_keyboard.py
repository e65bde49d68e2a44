"""Stories by keyboard alone, in both themes, on a screen and on a phone: what has the focus is seen, and every key leads on."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Served, Tab, served, tab, until
from capture_double import recipe_file
from lots import lot

from benchmarks.generated_archive import write_archive

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]
SIZES = {"screen": (1440, 900), "phone": (390, 844)}
MOST_KEYS = 250
FOCUS = """() => {
    const e = document.activeElement, r = e.getBoundingClientRect(), s = getComputedStyle(e);
    const x = Math.min(Math.max(r.left + Math.min(r.width / 2, 40), 1), innerWidth - 1);
    const y = Math.min(Math.max((Math.max(r.top, 0) + Math.min(r.bottom, innerHeight)) / 2, 1), innerHeight - 1);
    const top = document.elementFromPoint(x, y);
    const drawn = s.outlineStyle !== "none" && parseFloat(s.outlineWidth) >= 2;
    const inside = r.bottom > 0 && r.top < innerHeight && r.right > 0 && r.left < innerWidth && r.width > 0 && r.height > 0;
    return { html: e.outerHTML.slice(0, 120), body: e === document.body, outline: drawn, inside, order: e.tabIndex,
             covered: inside && !(e.contains(top) || top?.contains(e) || e.labels?.[0]?.contains(top)) };
}"""


@pytest.fixture(
    params=[(size, dark) for size in SIZES for dark in (False, True)],
    ids=lambda p: f"{p[0]}-{'dark' if p[1] else 'light'}",
)
def look(request: pytest.FixtureRequest) -> dict[str, Any]:
    size, dark = request.param
    return {"size": SIZES[size], "dark": dark}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """A workbench with the calibrations of two years, a recipe, and nothing uploaded."""
    top = tmp_path_factory.mktemp("keyboard")
    write_archive(top / "archive", 16, years=2.0, seed=7, workers=1)
    (top / "bench").mkdir()
    recipe_file(top / "bench")
    with served(top / "archive", top / "bench") as one:
        yield one


def is_seen(now: dict[str, Any]) -> bool:
    """Whether the place with the focus has an outline, lies in the window, under nothing else, in the order of the page."""
    return now["body"] or (now["outline"] and now["inside"] and not now["covered"] and now["order"] <= 0)


def to(one: Tab, selector: str, key: str = "Tab") -> None:
    """Press Tab until a place has the focus; on the way everything that has it is seen and in the order of the page."""
    for _ in range(MOST_KEYS):
        one.page.keyboard.press(key)
        until(lambda: is_seen(one.page.evaluate(FOCUS)), f"what has the focus is seen: {one.page.evaluate(FOCUS)}", 3.0)
        if one.page.evaluate("(s) => document.activeElement.matches(s)", selector):
            return
    raise AssertionError(f"{MOST_KEYS} keys do not lead to {selector} on {one.href}")


def enter(one: Tab, selector: str) -> None:
    to(one, selector)
    one.page.keyboard.press("Enter")


def seen(one: Tab, selector: str) -> None:
    one.sees(selector)
    one.ready()


def test_a_file_is_uploaded_diagnosed_and_its_effect_added(
    bench: Served, browser: Any, look: dict[str, Any], tmp_path: Path
) -> None:
    dwells = lot(np.random.default_rng(5), units=2, temperatures=(25.0,), hidden=lambda force, *_: 2e-4 * force**3)
    dwells.to_parquet(tmp_path / "cubic.parquet")
    with tab(browser, bench.address, **look) as one:
        choosers: list[Any] = []

        def kept(chooser: Any) -> None:
            choosers.append(chooser)

        one.page.on("filechooser", kept)  # before the key: a dialog that nobody listens for is closed at once
        one.open("/upload")
        to(one, "[data-drop]")
        one.page.keyboard.press("Space")
        until(lambda: one.page.evaluate("() => 1") and choosers, "the files can be chosen")
        choosers[0].set_files(str(tmp_path / "cubic.parquet"))
        seen(one, "a.button.main[href^='/missing']")
        enter(one, "a.button.main[href^='/missing']")
        seen(one, ".verdict")
        assert "third_order" in one.page.inner_text(".verdict")
        enter(one, "[data-add=third_order]")
        until(lambda: one.page.inner_text(".verdict").startswith("ADEQUATE"), "the model with the effect is judged")
        one.ready()
        to(one, "[data-name='effect-0']")
        one.page.keyboard.press("ArrowRight")
        until(lambda: one.page.locator("[data-name='effect-0'] .hovertext").count() > 0, "the point says what it is")
        one.page.keyboard.press("Escape")
        until(lambda: one.page.locator("[data-name='effect-0'] .hovertext").count() == 0, "Escape lets it go")
        to(one, "select[name=against]")
        before = one.page.evaluate("() => document.activeElement.selectedIndex")
        one.page.keyboard.press("ArrowDown")
        until(lambda: "against=" in one.href, "the quantity is in the address")
        one.ready()
        assert one.page.evaluate("() => document.activeElement.name") == "against"  # the next key goes on from here
        assert one.page.evaluate("() => document.activeElement.selectedIndex") == before + 1
        enter(one, "[data-undo] + a, [data-undo] ~ a")
        seen(one, "[data-changes]")
        to(one, "[aria-label='Coefficients that differ']")
        to(one, "[aria-label='Verdicts']", "Shift+Tab")  # and back: nothing traps the keys
        assert one.findings() == []
        assert one.errors == [] == one.outside


def test_tab_leads_to_what_an_operator_and_an_auditor_press(bench: Served, browser: Any, look: dict[str, Any]) -> None:
    with tab(browser, bench.address, **look) as one:
        one.open("/operator")
        assert one.page.evaluate("() => document.activeElement.id") == "slot-0"
        to(one, "select[name=recipe]", "Shift+Tab")
        to(one, "form[data-scan] button.main")
        one.open("/audit")
        enter(one, "[data-finding]:has(a[href^='/run']) > summary")
        enter(one, "[data-finding][open] a[href^='/run']")
        until(lambda: "/run?" in one.href, "the run of the finding is shown")
        assert one.errors == [] == one.outside
