"""Pages in a real browser, from a file and without a network: nothing is clipped, dark is dark, figures are drawn and printed."""

import io
import re
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pypdfium2
import pytest
from browser import until
from capture_double import recipe_file, small_run
from in_process import text_of
from long_suites import mostly_slow
from lots import lot

from pipelines.archive import Run
from pipelines.report import make_report, render
from pipelines.report.context import ReportContext
from pipelines.report.panels import unit_by_unit

CLIPPED = """() => {
    const wide = document.documentElement.clientWidth;
    const cut = (e) => !e.closest('svg') && e.clientWidth > 0 && e.scrollWidth > e.clientWidth + 2
        && getComputedStyle(e).overflowX !== 'visible';
    return [...document.querySelectorAll('body *')].filter((e) => {
        const r = e.getBoundingClientRect();
        return r.width > 0 && !e.closest('svg *') && (r.right > wide + 1 || cut(e));
    }).map((e) => `${e.tagName} ${e.className} ${(e.textContent || '').trim().slice(0, 60)}`);
}"""
"""Elements that reach beyond the window, or that hide a part of their own content."""

FAINT = """() => {
    const part = (v) => { const c = v / 255; return c <= .04045 ? c / 12.92 : ((c + .055) / 1.055) ** 2.4; };
    const light = (colour) => {
        const [r, g, b] = colour.match(/[\\d.]+/g).slice(0, 3).map(part);
        return .2126 * r + .7152 * g + .0722 * b;
    };
    const behind = (e) => {
        for (; e; e = e.parentElement) {
            const colour = getComputedStyle(e).backgroundColor;
            if (!/, 0\\)$/.test(colour)) return colour;
        }
        return 'rgb(255, 255, 255)';
    };
    const says = (e) => [...e.childNodes].some((n) => n.nodeType === 3 && n.textContent.trim());
    return [...document.querySelectorAll('body *')].filter((e) => !e.closest('svg') && says(e)).filter((e) => {
        const a = light(getComputedStyle(e).color), b = light(behind(e));
        return (Math.max(a, b) + .05) / (Math.min(a, b) + .05) < 4.5;
    }).map((e) => `${e.tagName} ${e.className} ${e.textContent.trim().slice(0, 60)}`);
}"""
"""Texts with less contrast than 4.5 (WCAG 2.2, 1.4.3)."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run with two units that passed, and one between them that was refused."""
    made = small_run(tmp_path_factory.mktemp("run"), {"A2": "dead"})
    make_report(made)
    return made


class Pages(dict[str, Path]):
    """The pages of the product, each written by its command when it is first asked for."""

    def __init__(self, run: Run, folder: Path) -> None:
        super().__init__(report=Path(str(run.report)))
        self.run, self.folder = run, folder

    def __missing__(self, name: str) -> Path:
        dwells = self.folder / "dwells.csv"
        lot(np.random.default_rng(20), units=3, temperatures=(25.0,)).to_csv(dwells, index=False)
        words = {
            "plan": lambda: ("plan", recipe_file(self.folder), "--output"),
            "audit": lambda: ("audit", "--archive", self.run.archive.root, "--output"),
            "diagnosis": lambda: ("diagnose", dwells, "--output"),
        }[name]()
        self[name] = self.folder / f"{name}.html"
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("pipelines.diagnosis.diagnose.proposed", lambda _: SimpleNamespace(rows=list))
            text_of(*words, self[name])
        return self[name]


@pytest.fixture(scope="module")
def pages(run: Run, tmp_path_factory: pytest.TempPathFactory) -> Pages:
    return Pages(run, tmp_path_factory.mktemp("pages"))


@pytest.mark.parametrize("name", mostly_slow(["report", "plan", "audit", "diagnosis"], "report"))
def test_nothing_is_clipped_and_all_text_can_be_read_light_and_dark(browser: Any, pages: Pages, name: str) -> None:
    for scheme, brightest in (("light", 300), ("dark", 40)):
        page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme=scheme)
        page.goto(pages[name].as_uri())
        page.evaluate("() => document.querySelectorAll('details').forEach((e) => { e.open = true; })")
        assert page.evaluate(CLIPPED) == []
        assert page.evaluate(FAINT) == []
        page.add_style_tag(content="h1 { width: 1400px } p { color: #808080; background: #909090 }")
        assert page.evaluate(CLIPPED)  # both checks find what they look for
        assert page.evaluate(FAINT)
        back = page.evaluate("() => getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
        assert max(back) < brightest
        assert scheme == "dark" or min(back) > 240
        page.close()


def test_every_unit_is_printed_on_pages_of_its_own(browser: Any, run: Run, pages: Pages, tmp_path: Path) -> None:
    printed = pdf(browser, pages["report"], tmp_path)
    begun = [[unit for unit in ("A1", "A2", "A3") if f"{unit} · slot" in text] for text in printed]
    assert sorted(unit for units in begun for unit in units) == ["A1", "A2", "A3"]
    assert max(map(len, begun)) == 1
    starts = [number for number, units in enumerate(begun) if units]
    # two pages each at most, of figures over their whole width and of tables: then the next unit begins
    assert max(later - earlier for earlier, later in pairwise(starts)) <= 2
    whole = "\n".join(printed)
    for serial in ("A1", "A3"):
        first = next(k for k, units in enumerate(begun) if units == [serial])
        own = "\n".join(printed[first : first + 2])
        assert "Model and measurement" in printed[first]
        assert "Figures and limits" in own
        assert "Noise of the static record" in own
    assert "Why it was refused" in whole


def test_failed_and_refused_units_are_first_and_open_and_say_why(browser: Any, run: Run, pages: Pages) -> None:
    page = browser.new_page()
    page.goto(pages["report"].as_uri())
    units = page.evaluate("() => [...document.querySelectorAll('details.unit')].map((e) => [e.id, e.open])")
    assert units == [["A2", True], ["A1", False], ["A3", False]]
    page.close()
    report = ReportContext(run, {})
    report.units[2].outcome, report.units[2].reasons = "fail", ["scale over temperature 900 ppm/K, 500 is allowed"]
    html = unit_by_unit.render(report)
    found = re.findall(r'<details class="unit" id="(\w+)"( open)?>', html)
    assert found == [("A2", " open"), ("A3", " open"), ("A1", "")]
    text = pages["diagnosis"].read_text(encoding="utf-8")  # a run of one soak has no caption without a picture
    assert "ADEQUATE" in text
    assert re.search(r"Why it failed</h3>\s*<ul[^>]*><li>scale over temperature 900 ppm/K", html)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plan", "audit", "diagnosis"])
def test_a_page_fits_a4(browser: Any, pages: Pages, name: str, tmp_path: Path) -> None:
    page = browser.new_page(viewport={"width": 710, "height": 1000})  # the printed width of A4 in CSS pixels
    page.emulate_media(media="print")
    page.goto(pages[name].as_uri())
    assert page.evaluate(CLIPPED) == []
    page.close()
    longer = """() => { const t = document.querySelector('table'), r = t.rows[1]; t.rows[0].cells[1].textContent = 'the head';
        for (let k = 0; k < 99; k++) r.after(r.cloneNode(true)); }"""
    printed = pdf(browser, pages[name], tmp_path, longer)
    assert sum("the head" in text for text in printed) >= 2  # a table that goes on has its heads on every page


def pdf(browser: Any, path: Path, folder: Path, before: str = "() => 0") -> list[str]:
    """The text of every printed page, after a function in the page."""
    page = browser.new_page()
    page.goto(path.as_uri())
    page.evaluate(before)
    target = folder / f"{path.stem}.pdf"
    page.pdf(path=str(target), prefer_css_page_size=True)
    page.close()
    document = pypdfium2.PdfDocument(str(target))
    return [one.get_textpage().get_text_range() for one in document]


SHOWN = """() => [...document.querySelectorAll(".figure")].filter((e) => e.checkVisibility()).map((e) => [
    e.querySelector(":scope > svg").checkVisibility(), Boolean(e.querySelector(".live .main-svg")?.checkVisibility())])"""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    path = folder / "report.html"
    path.write_text(render(small_run(folder)), encoding="utf-8")
    return path


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


@pytest.mark.slow
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


@pytest.mark.slow
def test_without_scripts_the_pictures_stay(browser: Any, report: Path) -> None:
    one = Opened(browser, report, java_script_enabled=False)
    first = one.page.locator(".figure > svg").first
    assert first.is_visible()
    image = pytest.importorskip("PIL.Image").open(io.BytesIO(first.screenshot()))
    colours = {colour for _, colour in image.convert("RGB").getcolors(maxcolors=1 << 24)}
    assert (0x00, 0x72, 0xB2) in colours  # points are there, not axes alone
    assert one.page.locator(".figure > .live").first.is_hidden()


@pytest.mark.slow
def test_a_script_that_is_slipped_in_does_not_run(browser: Any, report: Path, tmp_path: Path) -> None:
    changed = tmp_path / "changed.html"
    text = report.read_text(encoding="utf-8")
    changed.write_text(
        text.replace("<body>", "<body><script>window.ran = true</script><img src=x onerror='window.ran = true'>", 1)
    )
    one = Opened(browser, changed)
    until(lambda: one.shown() and all(live for _, live in one.shown()), "the figures are drawn all the same")
    assert one.page.evaluate("() => window.ran === undefined")
