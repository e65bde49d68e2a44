"""The workbench in a real browser: pages that are drawn, on narrow screens, of unusual archives, and of a server that dies."""

import signal
import urllib.parse
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import pytest
from browser import Served, Tab, served, tab, until
from capture_double import recipe_file, small_run
from in_process import document_of
from long_suites import mostly_slow
from unusual_archives import SCRIPT, addresses, unusual_archive

FEW = ("/unit?run=latest", "/station")
PAGES = (*FEW, "/units", "/run?run=latest", "/upload", "/missing", "/operator", "/models", "/plan", "/audit")
"""Those that compute for long, which are of the slow suite, are made of the same parts."""


LOOKS: dict[str, dict[str, Any]] = {"screen": {"size": (1024, 768)}, "dark tablet": {"dark": True, "size": (820, 1180)}}


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    top = tmp_path_factory.mktemp("bench")
    small_run(top)
    folder = top / "bench"
    folder.mkdir()
    with served(top / "archive", folder) as one:
        yield one


@pytest.mark.parametrize(
    ("look", "paths"), mostly_slow([("screen", FEW), *((look, PAGES) for look in LOOKS)], ("screen", FEW)),
    ids=["few", *LOOKS],
)  # fmt: skip
def test_every_page_is_drawn_reaches_nothing_outside_and_can_be_read_by_everybody(
    bench: Served, browser: Any, look: str, paths: tuple[str, ...]
) -> None:
    with tab(browser, bench.address, **LOOKS[look]) as one:
        for path in paths:
            one.open(path)
            assert one.findings() == [], path
            for wide in (
                "document.documentElement",
                "document.querySelector('.bar nav')",
            ):  # nothing is cut at the right
                assert one.page.evaluate(f"() => {wide}.scrollWidth - {wide}.clientWidth") <= 0, (path, wide)
        assert one.outside == []
        assert one.errors == []
        for place in ("http://192.0.2.1/", "http://example.org/"):  # the check of what is outside finds what it is for
            with pytest.raises(Exception, match="ERR_PROXY_CONNECTION_FAILED"):
                one.page.goto(place)
        assert one.outside == ["http://192.0.2.1/", "http://example.org/"]
    with tab(browser, bench.address, token=False) as one:  # who has no token may look and not compute
        one.page.goto(f"{bench.address}/missing?source=latest")
        until(lambda: "has read access only" in one.page.inner_text("main"), "the page says why nothing begins")


def floors_of(one: Tab) -> dict[str, float]:
    """Smallest detected size of every visible effect on the page of a plan, µg."""
    pairs = one.page.evaluate(
        "() => [...document.querySelectorAll('tr[data-effect]')].map((e) => [e.dataset.effect, e.dataset.floor])"
    )
    return {effect: float(floor) for effect, floor in pairs if floor}


@pytest.mark.slow
def test_a_moved_pose_changes_the_floors_as_the_command_says(bench: Served, browser: Any) -> None:
    recipe = recipe_file(bench.folder)
    with tab(browser, bench.address) as one:
        one.open("/plan?" + urllib.parse.urlencode({"recipe": recipe}))
        as_it_stands = floors_of(one)
        place = one.page.locator("[data-name=sphere]")
        place.scroll_into_view_if_needed()
        start, end = one.page.evaluate(
            """() => { const e = document.querySelector('[data-name=sphere]'), t = e._fullData.find((d) => d.customdata);
            const r = e.getBoundingClientRect(), x = e._fullLayout.xaxis, y = e._fullLayout.yaxis;
            const at = (a, b) => [r.left + x._offset + x.l2p(a), r.top + y._offset + y.l2p(b)];
            return [at(t.x[7], t.y[7]), at(0.6, 0.3)]; }"""
        )
        one.page.mouse.move(*start)
        one.page.mouse.down()
        one.page.mouse.move(*end, steps=4)
        one.page.mouse.up()
        until(lambda: "pose=" in one.href, "the dropped pose is in the address")
        until(lambda: one.page.locator("tr[data-effect]").count() > 0, "the plan is computed anew")
        one.ready()
        moved = urllib.parse.parse_qs(urllib.parse.urlsplit(one.href).query)["pose"]
        assert len(moved) == 1
        floors = floors_of(one)
        changed = [
            name for name in as_it_stands if name in floors and abs(floors[name] / as_it_stands[name] - 1.0) > 1e-3
        ]
        assert len(changed) > 5
        document = document_of("plan", recipe, "--pose", moved[0], "--archive", bench.archive)
        told = {row["effect"]: row["floor_size_ug"] for row in document["effects"] if row["seen"]}
        assert floors == pytest.approx(told, rel=1e-6)
        assert one.findings() == []
        assert one.errors == [] == one.outside


@pytest.mark.slow
def test_a_click_on_a_residual_shows_the_samples_of_its_dwell(bench: Served, browser: Any) -> None:
    run = next(path.name for path in (bench.archive / "runs").iterdir() if path.name.startswith("small-"))
    with tab(browser, bench.address) as one:
        one.open(f"/unit?run={run}&unit=A1&against=force")  # the latest run is that of another test
        asked: list[str] = []
        one.page.on("request", lambda request: asked.append(request.url))
        with one.page.expect_response(lambda answer: "/unit?" in answer.url) as part:
            one.click_point("residuals", 1, 3)  # behind the line at zero
        assert 0 < len(part.value.body()) < 3000  # the samples alone, not the page with its tables
        until(lambda: "dwell=A1" in one.page.evaluate("() => location.href"), "the dwell is in the address")
        one.sees("[data-name='samples'][data-drawn]")
        # with the part, and not again after it
        assert len([url for url in asked if "/figure/samples.json" in url]) == 1
        drawn = one.page.evaluate("() => document.querySelector('[data-name=samples]')._fullData[0].x.length")
        assert drawn >= 100  # a dwell of 1 s at 100 Hz
        for word in ("hare", "loud", "Send"):  # "Share chart…" would send the data to the maker of the library
            assert one.page.locator(f".modebar-btn[data-title*='{word}']").count() == 0
        assert one.page.locator(".modebar-btn").count() > 0
        assert one.page.locator(".modebar-btn svg").first.bounding_box()["height"] >= 12  # px, to be seen and hit
        one.page.reload()
        one.ready()
        one.sees("[data-name='samples'][data-drawn]")
        one.page.locator("[data-name=residuals]").focus()  # a dot is reached and chosen by keyboard, too
        one.page.keyboard.press("ArrowRight")
        until(lambda: one.page.locator("[data-name=residuals] .hovertext").count() > 0, "the dot says what it is")
        before = one.href
        one.page.keyboard.press("Enter")
        until(lambda: one.href != before, "the dwell of the dot is in the address")
        assert one.errors == []


@pytest.mark.slow
def test_a_server_that_is_killed_is_said_and_the_page_goes_on(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address) as one:
        one.open("/units")
        bench.end(signal.SIGKILL)
        until(lambda: one.page.locator("[data-lost]").is_visible(), "the page says that nobody answers")
        bench.begin()
        one.page.fill("input[name=search]", "A2")  # stays there when the page comes anew from the server that is back
        until(lambda: not one.page.locator("[data-lost]").is_visible(), "the page goes on")
        one.press("text=Search")
        rows = one.page.locator("[aria-label=Calibrations] tbody tr")
        # a serial or the hash in the name of a run holds what was searched for, in capitals or not
        until(
            lambda: rows.count() >= 1 and all("a2" in row.lower() for row in rows.all_inner_texts()),
            "the search answers",
        )


PHONE = (390, 844)
NARROW_PAGES = (
    "/units", "/run", "/unit", "/missing", "/two-models", "/upload", "/operator", "/models", "/plan?only=unseen", "/station",
    "/audit",
)  # fmt: skip
OUTSIDE = """() => [...document.querySelectorAll("main *, header *")]
    .filter((e) => e.checkVisibility() && !e.closest(".scroll, svg, .hidden, .skip"))
    .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
    .map((e) => `${e.tagName} ${e.className} ${e.textContent.trim().slice(0, 40)}`)"""


@pytest.fixture(scope="module")
def narrow(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    top = tmp_path_factory.mktemp("screens")
    small_run(top, {"A2": "dead"})
    (top / "narrow").mkdir()
    recipe_file(top / "narrow")
    with served(top / "archive", top / "narrow") as one:
        yield one


@pytest.mark.slow
def test_on_a_narrow_screen_nothing_is_cut_and_the_whole_menu_is_seen(narrow: Served, browser: Any) -> None:
    with tab(browser, narrow.address, size=PHONE) as one:
        for path in NARROW_PAGES:
            one.open(path)
            assert one.page.evaluate(OUTSIDE) == [], path
            assert one.page.evaluate("() => document.documentElement.scrollWidth") <= PHONE[0], path
            links = one.page.locator(".bar nav a")
            assert links.count() >= 9
            assert all(link.bounding_box()["x"] + link.bounding_box()["width"] <= PHONE[0] for link in links.all())
        assert one.errors == []


@pytest.mark.slow
def test_a_serial_is_checked_at_its_scan_and_a_bell_calls_the_operator_of_a_lot_that_is_drawn(
    narrow: Served, browser: Any
) -> None:
    with tab(browser, narrow.address) as one:
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


# without a browser, with broken runs and 500 units: tests/unit/pipelines/workbench/test_unusual_archives.py


@pytest.fixture(scope="module")
def unusual(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    top = tmp_path_factory.mktemp("unusual")
    unusual_archive(top / "archive")
    with served(top / "archive", top / "unusual") as one:
        yield one


def run_of(unusual: Served, start: str) -> str:
    return next(path.name for path in (unusual.archive / "runs").iterdir() if path.name.startswith(start))


def main_text(one: Tab) -> str:
    return str(one.page.inner_text("main"))


@pytest.mark.slow
def test_a_finding_of_the_audit_leads_to_the_values_that_it_is_drawn_from(unusual: Served, browser: Any) -> None:
    with tab(browser, unusual.address) as one:
        one.open("/audit?until=2024-01-10")
        one.sees("details.finding")
        with_chart = one.page.locator("details.finding:has([data-figure])")
        assert with_chart.count() >= 1
        chosen = with_chart.first
        name = chosen.get_attribute("data-finding")
        chosen.locator("summary").click()
        until(lambda: chosen.locator("[data-drawn]").count() == 1, "the evidence is drawn")
        chosen.locator("text=Address of this finding").click()
        one.ready()
        opened = one.page.locator("details.finding[open]")
        assert opened.count() == 1  # the address opens this finding, and no other
        assert opened.get_attribute("data-finding") == name
        until(lambda: opened.locator("[data-drawn]").count() == 1, "the evidence is drawn from its address")
        numbers = one.page.request.get(
            unusual.address + str(opened.locator("a:text-is('CSV')").get_attribute("href"))
        ).text()
        subject = str(name).split(".")[1]
        # a chart that the page draws again has no points for a moment
        points = "plot => (plot._fullData ?? []).reduce((n, t) => n + t.x.length, 0)"
        until(lambda: opened.locator("[data-drawn]").evaluate(points) >= 2, "the points of the evidence are drawn")
        assert len(numbers.splitlines()) > 2
        assert subject in main_text(one)
        opened.locator("table a").first.click()  # the run of the finding
        until(lambda: "/run?" in one.href, "the run of the finding is opened")
        one.ready()
        assert one.findings() == []
        assert one.errors == [] == one.outside


@pytest.mark.slow
def test_no_script_in_any_name_runs(unusual: Served, browser: Any) -> None:
    pages = [*addresses(run_of(unusual, "named-")), "/operator?" + urlencode({"station": ""}), "/" + SCRIPT]
    with tab(browser, unusual.address) as one:
        for path in pages:
            one.page.goto(unusual.address + path)
            until(lambda: one.page.evaluate("() => Boolean(document.body.dataset.ready)"), path)
            if path.startswith(("/unit?", "/run?")):
                one.ready()
                assert one.page.evaluate("() => document.documentElement.scrollWidth - innerWidth") <= 0, path
            assert one.page.evaluate("() => window.ran") is None, path
            assert one.page.locator("main img, main script").count() == 0, path
        assert one.outside == []
