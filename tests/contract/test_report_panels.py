"""Every panel of a run's report that is found: it has a place, a heading and documents, and one file adds one."""

import re

import pytest
from each import each
from root_process import ROOT

from pipelines.archive import Run
from pipelines.report import PANELS, render
from pipelines.report.context import ReportContext
from pipelines.report.panel import panels
from pipelines.report.panels.unit_by_unit import UNIT_PANELS

GUIDE = (ROOT / "docs" / "how-to" / "read-a-report.md").read_text(encoding="utf-8")
FOUND = [*panels(PANELS), *panels(UNIT_PANELS)]

NEWER = (".stated_references", *(f"unit_panels.{name}" for name in ("bias", "budget", "procedures", "soak_noise")))
"""Panels of columns and statements that the kept archive has not."""


@pytest.fixture(scope="module")
def report(kept: Run) -> ReportContext:
    return ReportContext(kept, {})


@each(FOUND, lambda module: module.__name__)
def test_a_panel_explains_itself_is_in_the_guide_and_is_whole_html(one, report: ReportContext) -> None:
    assert one.__doc__
    assert one.render.__doc__
    assert not one.TITLE or f"**{one.TITLE}.**" in GUIDE
    for subject in [report] if one in panels(PANELS) else report.calibrated:
        html = one.render(subject)
        assert html or one.__name__.endswith(NEWER)
        assert closed(html or "")


def closed(html: str) -> bool:
    """Whether every table, list and block that is opened is closed."""
    text = re.sub(r"<svg.*?</svg>", "", html, flags=re.DOTALL)
    return all(
        len(re.findall(rf"<{tag}\b", text)) == text.count(f"</{tag}>")
        for tag in ("table", "tr", "td", "p", "div", "details", "ul", "span", "small")
    )


def test_the_page_has_the_panels_in_their_order(report: ReportContext) -> None:
    page = render(report.run)
    headings = re.findall(r"<h2>(.*?)</h2>", page)
    assert headings == [one.TITLE for one in panels(PANELS) if one.TITLE and not one.__name__.endswith(NEWER)]
