"""Pages of an audit, of discoveries and of a unit in the workbench: their numbers, figures and tables."""

import itertools
import re
from pathlib import Path

import pandas as pd
import pytest
from asgi_client import AsgiClient
from capture_double import small_run

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive, Run
from pipelines.demo.archive_lots import Hidden, Line, write_lots
from pipelines.discovery.attributes import add_attributes
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.workbench.application import create_app
from pipelines.workbench.services import requests
from pipelines.workbench.services.jobs import Jobs
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import AuditPage, DiscoverPage

TOKEN = "Zq8vXy3nR5tB7wK1mP4sD9"


def test_a_figure_of_too_few_lots_for_a_cpk_is_on_the_page_and_in_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_archive(tmp_path / "archive", 6, years=2.0, seed=3, workers=1)
    settings = WorkbenchSettings(archive=str(tmp_path / "archive"), folder=tmp_path / "bench", token=TOKEN)
    _, content = requests.audit(settings, AuditPage())
    end, audited = done_in_process("audit", content, lambda *_: None)
    assert end == "done", audited
    capability = audited["document"]["population"]["capability"]
    figure, others = capability[0], capability[1:]
    assert others
    figure["cpk"] = None
    monkeypatch.setattr(Jobs, "result", lambda *_: audited)
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    assert figure["figure"] in client.get("/audit/capability.csv").text
    heads = client.get("/audit/capability.csv").text.splitlines()[0].split(",")
    assert {"ppk_low", "cpk_low"} <= set(heads)
    page = client.get("/audit")
    assert page.status_code == 200
    assert "Capability" in page.text
    assert client.get("/audit/nothing.csv").status_code == 404


def test_a_discovery_is_on_the_page_with_its_levels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = write_lots(tmp_path, Line(9, hidden=Hidden("W02", -60e-6), wafers=4), 44)
    add_attributes(Archive(str(made.folder)), pd.read_csv(made.units, dtype=str), "serial", "units.csv")
    settings = WorkbenchSettings(archive=str(made.folder), folder=tmp_path / "bench", token=TOKEN)
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    assert client.get("/discover").status_code == 200  # before it was asked for
    _, content = requests.discover(settings, DiscoverPage())
    end, found = done_in_process("discover", content, lambda *_: None)
    assert end == "done", found
    monkeypatch.setattr(Jobs, "result", lambda *_: found)
    page = client.get("/discover")
    assert page.status_code == 200
    assert "third_order" in page.text
    assert "differs by wafer" in page.text
    for name in ("levels-D1", "grown-D1", "strongest", "reach"):
        assert client.get(f"/discover/figure/{name}.json").status_code == 200, name
    assert client.get("/discover/figure/nothing.json").status_code == 422
    rows = client.get("/discover/levels-D1.csv").text.splitlines()
    assert rows[0].startswith("level,size_ug")
    assert rows[1].startswith("W02,")
    assert client.get("/discover/levels-D7.csv").status_code == 422


@pytest.mark.parametrize(
    ("verdict", "reason", "shown"),
    [
        ("adequate", "", 'verdict good">ADEQUATE: '),
        ("not adequate", "", 'verdict bad">NOT ADEQUATE: '),
        ("not judged", "too few dwells", 'verdict open">CANNOT BE JUDGED: too few dwells'),
    ],
)
def test_the_page_of_a_run_has_the_verdict_of_its_archive(
    verdict: str, reason: str, shown: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = small_run(tmp_path)
    own = run.table("verdict").assign(verdict=verdict, reason=reason)
    read = Run.table
    monkeypatch.setattr(Run, "table", lambda self, name: own if name == "verdict" else read(self, name))
    settings = WorkbenchSettings(archive=str(run.archive.root), folder=tmp_path / "bench", token=TOKEN)
    page = AsgiClient(create_app(settings), "http://127.0.0.1:8321").get(f"/run?run={run.id}")
    assert shown in page.text


def test_figures_and_coefficients_have_their_expanded_uncertainty_once(tmp_path: Path) -> None:
    run = small_run(tmp_path)
    settings = WorkbenchSettings(archive=str(run.archive.root), folder=tmp_path / "bench", token=TOKEN)
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    page = client.get(f"/unit?run={run.id}&unit=A1").text
    figures = run.table("figures")
    own = figures[(figures["unit"] == "A1") & (figures["uncertainty"] > 0.0)]
    shown = re.findall(r'<td class="n">([^<]*)</td>', page)
    pairs = set(itertools.pairwise(shown))
    assert len(own) > 3
    for row in own.to_dict("records"):
        assert (significant(row["value"]), significant(row["uncertainty"], 2)) in pairs, row["figure"]
    factor = run.about["limits"]["coverage_factor"]
    assert f"U, k = {factor:g}" in page
    coefficients = run.table("coefficients")
    first = coefficients[coefficients["unit"] == "A1"].iloc[0]
    value, expanded = with_uncertainty(first["value"], 2.0 * first["standard_error"])
    assert f"{value}<br><small>± {expanded}</small>" in page
