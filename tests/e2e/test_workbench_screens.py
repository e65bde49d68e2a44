"""Pages at a look: on narrow screens nothing is cut, dots are reached by keyboard, a serial is checked at its scan."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser import Served, Tab, served, tab, until
from capture_double import recipe_file, small_run
from in_process import text_of

PHONE, SCREEN = (390, 844), (1440, 900)
PAGES = (
    "/units", "/run", "/unit", "/missing", "/two-models", "/upload", "/operator", "/models", "/plan?only=unseen", "/station",
    "/audit",
)  # fmt: skip
OUTSIDE = """() => [...document.querySelectorAll("main *, header *")]
    .filter((e) => e.checkVisibility() && !e.closest(".scroll, svg, .hidden, .skip"))
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .map((e) => `${e.tagName} ${e.className} ${e.textContent.trim().slice(0, 40)}`)"""
DOMAINS = """(name) => { const l = document.querySelector(`[data-name="${name}"]`)._fullLayout;
    return [l.xaxis.domain[0], l.xaxis2.domain[0], l.yaxis.domain[0], l.yaxis2.domain[1]]; }"""


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
def test_plots_beside_each_other_stand_one_under_the_other_on_a_narrow_screen(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address, size=PHONE) as one:
        one.open("/two-models?source=latest&added=third_order")
        one.sees("[data-changes]")  # all of its work is done
        one.page.locator("[data-name=residuals]").scroll_into_view_if_needed()
        one.sees("[data-name=residuals][data-drawn]")
        left, second, bottom, top = one.page.evaluate(DOMAINS, "residuals")
        assert left == second == 0
        assert bottom > top
        one.page.set_viewport_size({"width": SCREEN[0], "height": SCREEN[1]})
        until(lambda: one.page.evaluate(DOMAINS, "residuals")[1] > 0.2, "a wide screen has them beside each other")


@pytest.mark.slow
def test_dots_are_reached_and_chosen_by_keyboard(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address, size=SCREEN) as one:
        one.open("/unit?run=latest&unit=A1&against=force")
        place = one.page.locator("[data-name=residuals]")
        place.focus()
        one.page.keyboard.press("ArrowRight")
        until(lambda: place.locator(".hovertext").count() > 0, "the dot says what it is")
        first = one.page.evaluate("() => document.querySelector('[data-name=residuals] ~ [role=status]').textContent")
        one.page.keyboard.press("ArrowRight")
        said = "() => document.querySelector('[data-name=residuals] ~ [role=status]').textContent"
        until(lambda: one.page.evaluate(said) != first, "the next dot is another one")
        one.page.keyboard.press("Enter")
        until(lambda: "dwell=A1" in one.href, "the dwell is in the address")
        one.sees("[data-name=samples][data-drawn]")
        assert one.errors == []


@pytest.mark.slow
def test_a_run_tells_verdict_results_and_reasons_before_its_tables(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address, size=SCREEN) as one:
        one.open("/run")
        text = one.page.inner_text("main")
        order = [text.index(word) for word in ("ADEQUATE", "refused", "Why units did not pass", "fit residual")]
        assert order == sorted(order)
        assert "A2" in one.page.inner_text("[data-reasons]")
        one.open("/units?runs=all+passed")
        assert "No run is all passed." in one.page.inner_text("main")
        one.page.select_option("select[name=runs]", "not all passed")
        until(lambda: "2 of 3" in one.page.inner_text("main"), "the run with a refused unit is listed")


@pytest.mark.slow
def test_a_serial_is_checked_when_it_is_scanned_and_the_slot_keeps_the_focus(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address) as one:
        one.open("/operator")
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
        assert [error for error in one.errors if "422" not in error] == []


def colour_of(one: Tab, role: str) -> str:
    return str(
        one.page.evaluate(f"() => getComputedStyle(document.documentElement).getPropertyValue('--role-{role}').trim()")
    )


@pytest.mark.slow
@pytest.mark.parametrize("size", [SCREEN, PHONE], ids=["screen", "phone"])
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_story_the_first_picture_of_a_diagnosis_shows_what_is_missing_and_that_it_is_gone(
    tmp_path: Path, browser: Any, size: tuple[int, int], theme: str
) -> None:
    folder = tmp_path / "bench"
    text_of("demo", "--by-hand", "--folder", folder, "pendulous_mass", "--seed", 11)
    with (
        served(tmp_path / "archive", folder) as server,
        tab(browser, server.address, dark=theme == "dark", size=size) as one,
    ):
        one.open("/missing")
        one.press("a.button.main >> text=The newest")  # a page without a source offers one
        one.sees("[data-name=effect-0][data-drawn]")
        order = one.page.evaluate(
            """() => [".verdict", "[data-name=effect-0]", "[data-add]", ".command"].map(
                (s) => document.querySelector(s).getBoundingClientRect().top)"""
        )
        assert order == sorted(order)
        until(
            lambda: one.page.evaluate("() => Boolean(document.querySelector('[data-name=effect-0]')?._fullLayout)"),
            "it is drawn",
        )
        drawn = one.page.evaluate(
            """() => { const l = document.querySelector("[data-name=effect-0]")._fullLayout;
                return [l.xaxis.title.text, l.xaxis2.domain[0]]; }"""
        )
        assert drawn[0] == "fz·fx / g²"
        assert (drawn[1] == 0) == (size == PHONE)
        assert colour_of(one, "before") not in {colour_of(one, axis) for axis in "xyz"}
        one.page.locator("[data-add=cross_coupling]").focus()
        one.page.keyboard.press("Enter")  # by keyboard
        one.sees(".verdict.good")
        one.sees("[data-name=effect-0][data-drawn]")
        assert one.page.evaluate(OUTSIDE) == []
        assert one.findings() == []
        assert one.errors == []


@pytest.mark.slow
def test_story_a_bell_calls_the_operator_and_the_running_lot_is_drawn(tmp_path: Path, browser: Any) -> None:
    (tmp_path / "bench").mkdir()
    recipe_file(tmp_path / "bench")
    with served(tmp_path / "archive", tmp_path / "bench") as server, tab(browser, server.address) as one:
        one.open("/operator")
        one.press("[data-bell]")
        assert one.page.evaluate("() => document.body.dataset.rung") == "1"  # so that one hears how it sounds
        one.page.select_option("select[name=recipe]", index=1)
        one.page.fill("#slot-0", "Z1")
        one.press("text=Start the lot")
        one.sees(".question")
        until(lambda: one.page.evaluate("() => document.body.dataset.rung") == "2", "the bell rings")
        assert one.page.title().startswith("Your turn")
        one.press("[data-answer='go']")
        one.sees("[data-name=station][data-drawn]")
        assert not one.page.title().startswith("Your turn") or one.page.locator(".question").count()
