"""The page of a unit in the workbench: numbers as in the report of its run."""

import itertools
import re
from pathlib import Path

from asgi_client import AsgiClient
from capture_double import small_run

from pipelines.report.numbers import significant, with_uncertainty
from pipelines.workbench.application import create_app
from pipelines.workbench.settings import WorkbenchSettings

TOKEN = "Zq8vXy3nR5tB7wK1mP4sD9"


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
