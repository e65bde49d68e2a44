"""The workbench on an unusual archive in a browser: findings of an audit, and scripts in every name."""

from collections.abc import Iterator
from typing import Any
from urllib.parse import urlencode

import pytest
from browser import Served, Tab, served, tab, until
from unusual_archives import SCRIPT, addresses, unusual_archive

# without a browser, with broken runs and 500 units: tests/unit/pipelines/workbench/test_unusual_archives.py
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    top = tmp_path_factory.mktemp("bench")
    unusual_archive(top / "archive")
    with served(top / "archive", top / "bench") as one:
        yield one


def run_of(bench: Served, start: str) -> str:
    return next(path.name for path in (bench.archive / "runs").iterdir() if path.name.startswith(start))


def main_text(one: Tab) -> str:
    return str(one.page.inner_text("main"))


def test_a_finding_of_the_audit_leads_to_the_values_that_it_is_drawn_from(bench: Served, browser: Any) -> None:
    with tab(browser, bench.address) as one:
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
            bench.address + str(opened.locator("a:text-is('CSV')").get_attribute("href"))
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


def test_no_script_in_any_name_runs(bench: Served, browser: Any) -> None:
    pages = [*addresses(run_of(bench, "named-")), "/operator?" + urlencode({"station": ""}), "/" + SCRIPT]
    with tab(browser, bench.address) as one:
        for path in pages:
            one.page.goto(bench.address + path)
            until(lambda: one.page.evaluate("() => Boolean(document.body.dataset.ready)"), path)
            if path.startswith(("/unit?", "/run?")):
                one.ready()
                assert one.page.evaluate("() => document.documentElement.scrollWidth - innerWidth") <= 0, path
            assert one.page.evaluate("() => window.ran") is None, path
            assert one.page.locator("main img, main script").count() == 0, path
        assert one.outside == []
