"""Every panel of a run's report that is found: it has a place, a heading and documents, and one file adds one."""

import re
from pathlib import Path

import pytest
from each import each
from made_package import made_package
from root_process import ROOT

from deploy.release import unpack
from pipelines.archive import Archive
from pipelines.report import PANELS, panel, render
from pipelines.report.context import ReportContext
from pipelines.report.panel import IncompletePanel, panels, rendered
from pipelines.report.panels.unit_by_unit import UNIT_PANELS

KEPT = ROOT / "tests" / "archives" / "v1.tar.xz"
GUIDE = (ROOT / "docs" / "how-to" / "read-a-report.md").read_text(encoding="utf-8")
ONE = 'ORDER = {order}\nTITLE = "Own"\n\n\ndef render(report):\n    return f"<p>{{len(report.units)}} units</p>"\n'
FOUND = [*panels(PANELS), *panels(UNIT_PANELS)]

NOT_OF_OLD_RUNS = {  # the kept archive has no such columns, and states no uncertainty
    "pipelines.report.panels.stated_references",
    "pipelines.report.unit_panels.bias",
    "pipelines.report.unit_panels.budget",
    "pipelines.report.unit_panels.procedures",
    "pipelines.report.unit_panels.soak_noise",
}


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> ReportContext:
    folder = tmp_path_factory.mktemp("kept")
    unpack(KEPT, folder)
    return ReportContext(Archive(folder).run("latest"), {})


@each(FOUND, lambda module: module.__name__)
def test_a_panel_explains_itself_is_in_the_guide_and_is_whole_html(one, report: ReportContext) -> None:
    assert one.__doc__
    assert one.render.__doc__
    assert not one.TITLE or f"**{one.TITLE}.**" in GUIDE
    for subject in [report] if one in panels(PANELS) else report.calibrated:
        html = one.render(subject)
        assert html or one.__name__ in NOT_OF_OLD_RUNS
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
    assert headings == [one.TITLE for one in panels(PANELS) if one.TITLE and one.__name__ not in NOT_OF_OLD_RUNS]


def test_one_file_is_a_panel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, report: ReportContext) -> None:
    package, _ = made_package(tmp_path, monkeypatch, own=ONE.format(order=5))
    assert rendered(package, report) == [("Own", "<p>2 units</p>")]
    both = (*panels(package), *panels(PANELS))
    monkeypatch.setattr(panel, "panels", lambda name: both if name == PANELS else panels(name))
    assert "<h2>Own</h2>\n<p>2 units</p>" in render(report.run)
    (tmp_path / "empty").mkdir()
    nothing = ONE.format(order=5).replace('f"<p>{len(report.units)} units</p>"', "None")
    assert rendered(made_package(tmp_path / "empty", monkeypatch, own=nothing)[0], None) == []  # and no heading


WHOLE = ONE.format(order=5)
HALF = {
    "own: a panel without ORDER": {"own": WHOLE.replace("ORDER", "PLACE")},
    "own: a panel without TITLE": {"own": WHOLE.replace("TITLE", "HEAD")},
    "own: a panel without render": {"own": WHOLE.replace("render", "draw")},
    "2 panels have the ORDER 5": {"own": WHOLE, "other": WHOLE},
}


@each(HALF)
def test_a_panel_that_is_half_there_is_refused(message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(IncompletePanel, match=message):
        panels(made_package(tmp_path, monkeypatch, **HALF[message])[0])
