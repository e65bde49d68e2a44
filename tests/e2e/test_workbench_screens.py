"""Pages at a look: on narrow screens nothing is cut, dots are reached by keyboard, a serial is checked at its scan."""

from collections.abc import Iterator
from typing import Any

import pytest
from browser import Served, served, tab, until
from capture_double import recipe_file, small_run

PHONE, SCREEN = (390, 844), (1440, 900)
PAGES = (
    "/units", "/run", "/unit", "/missing", "/two-models", "/upload", "/operator", "/models", "/plan?only=unseen", "/station",
    "/audit",
)  # fmt: skip
OUTSIDE = """() => [...document.querySelectorAll("main *, header *")]
    .filter((e) => e.checkVisibility() && !e.closest(".scroll, svg, .hidden, .skip"))
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .map((e) => `${e.tagName} ${e.className} ${e.textContent.trim().slice(0, 40)}`)"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    top = tmp_path_factory.mktemp("screens")
    small_run(top, {"A2": "dead"})
    (top / "bench").mkdir()
    recipe_file(top / "bench")
    with served(top / "archive", top / "bench") as one:
        yield one


@pytest.mark.slow
def test_on_a_narrow_screen_nothing_is_cut_and_the_whole_menu_is_seen(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address, size=PHONE) as one:
        for path in PAGES:
            one.open(path)
            assert one.page.evaluate(OUTSIDE) == [], path
            assert one.page.evaluate("() => document.documentElement.scrollWidth") <= PHONE[0], path
            links = one.page.locator(".bar nav a")
            assert links.count() >= 9
            assert all(link.bounding_box()["x"] + link.bounding_box()["width"] <= PHONE[0] for link in links.all())
        assert one.errors == []


@pytest.mark.slow
def test_a_serial_is_checked_at_its_scan_and_a_bell_calls_the_operator_of_a_lot_that_is_drawn(
    bench: Served, browser: Any
) -> None:
    with tab(browser, bench.address) as one:
        one.open("/operator")
        one.press("[data-bell]")
        assert one.page.evaluate("() => document.body.dataset.rung") == "1"  # so that one hears how it sounds
        for slot, serial in ((0, "S1"), (1, "S1")):
            one.page.fill(f"#slot-{slot}", serial)
            one.page.press(f"#slot-{slot}", "Enter")
            until(
                lambda: one.page.evaluate("() => document.activeElement.id") == "slot-1",
                "the second slot has the focus",
            )
        until(
            lambda: "'S1' is in slot 0 already" in one.page.inner_text(".tile:nth-child(2)"),
            "the slot says what is wrong",
        )
        assert one.page.get_attribute("#slot-1", "aria-invalid") == "true"
        one.page.fill("#slot-1", "S2")
        one.page.press("#slot-1", "Enter")
        until(lambda: one.page.evaluate("() => document.activeElement.id") == "slot-2", "the next slot has the focus")
        assert one.page.locator(".tile [role=alert]:visible").count() == 0
        assert one.page.locator("#faults option[value^=door]").count() == 1
        one.page.select_option("select[name=recipe]", index=1)
        one.press("text=Start the lot")
        one.sees(".question")
        until(lambda: one.page.evaluate("() => document.body.dataset.rung") == "2", "the bell rings")
        assert one.page.title().startswith("Your turn")
        one.press("[data-answer='go']")
        one.sees("[data-name=station][data-drawn]")
        assert [error for error in one.errors if "422" not in error] == []
