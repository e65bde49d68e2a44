"""Reports in a real browser, from a file and without a network: figures on a screen, pictures in print and without scripts."""

import io
from pathlib import Path
from typing import Any

import pytest
from browser import until
from capture_double import small_run

from pipelines.report import render

SHOWN = """() => [...document.querySelectorAll(".figure")].filter((e) => e.checkVisibility()).map((e) => [
    e.querySelector(":scope > svg").checkVisibility(), Boolean(e.querySelector(".live .main-svg")?.checkVisibility())])"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    place = folder / "report.html"
    place.write_text(render(small_run(folder)), encoding="utf-8")
    return place


class Opened:
    """A report in a page of its own, with what it asked for and what went wrong."""

    def __init__(self, browser: Any, place: Path, **options: Any) -> None:
        self.asked: list[str] = []
        self.errors: list[str] = []
        self.page = browser.new_context(viewport={"width": 1280, "height": 6000}, **options).new_page()
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("pageerror", lambda problem: self.errors.append(str(problem)))
        self.page.on("console", lambda said: self.errors.append(said.text) if said.type == "error" else None)
        self.page.goto(place.as_uri())

    def shown(self) -> list[list[bool]]:
        """Of every visible figure: whether its picture and its drawn figure are seen."""
        return self.page.evaluate(SHOWN)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_figures_are_drawn_on_a_screen_and_pictures_are_printed(browser: Any, report: Path, theme: str) -> None:
    one = Opened(browser, report, color_scheme=theme)
    until(
        lambda: one.shown() and all(live and not still for still, live in one.shown()), "all visible figures are drawn"
    )
    assert one.page.locator(".live .modebar").count() >= 3
    for word in ("hare", "loud", "Send"):
        assert one.page.locator(f".modebar-btn[data-title*='{word}']").count() == 0
    one.page.locator(".live .scatterlayer .point").first.hover(force=True)
    until(lambda: one.page.locator(".hovertext").count() > 0, "a point says what it is")
    one.page.emulate_media(media="print")
    shown = one.shown()
    assert shown
    assert all(still and not live for still, live in shown)
    one.page.emulate_media(media="screen")
    unit = one.page.locator("details.unit:not([open])").first
    unit.locator("summary").click()
    figure = one.page.locator("details.unit[open]").nth(1).locator(".figure").last
    figure.scroll_into_view_if_needed()
    until(figure.locator(".live .main-svg").first.is_visible, "the figures of a unit that is opened are drawn")
    assert one.page.evaluate("() => document.documentElement.scrollWidth") <= 1280
    assert one.asked == [report.as_uri()]
    assert one.errors == []


def test_without_scripts_the_pictures_stay(browser: Any, report: Path) -> None:
    one = Opened(browser, report, java_script_enabled=False)
    first = one.page.locator(".figure > svg").first
    assert first.is_visible()
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(first.screenshot()))
    colours = {colour for _, colour in image.convert("RGB").getcolors(maxcolors=1 << 24)}
    assert (0x00, 0x72, 0xB2) in colours  # points are there, not axes alone
    assert one.page.locator(".figure > .live").first.is_hidden()


def test_a_script_that_is_slipped_in_does_not_run(browser: Any, report: Path, tmp_path: Path) -> None:
    changed = tmp_path / "changed.html"
    text = report.read_text(encoding="utf-8")
    changed.write_text(
        text.replace("<body>", "<body><script>window.ran = true</script><img src=x onerror='window.ran = true'>", 1)
    )
    one = Opened(browser, changed)
    until(lambda: one.shown() and all(live for _, live in one.shown()), "the figures are drawn all the same")
    assert one.page.evaluate("() => window.ran === undefined")
