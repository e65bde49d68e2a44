"""Pages of an audit, of discoveries and of a unit in the workbench: their numbers, figures and tables."""

import itertools
import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from asgi_client import AsgiClient
from capture_double import CaptureDouble, measured_run, small_job, small_run
from demonstrations import wafer_line
from lots import lot

from benchmarks.generated_archive import write_archive
from pipelines.archive import Archive, Run
from pipelines.archive.run import START
from pipelines.discovery.attributes import add_attributes
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.report.run_pictures import follows_most, quantities, residual_chart
from pipelines.workbench.application import create_app
from pipelines.workbench.routes.two_models import _worded
from pipelines.workbench.services import models, requests
from pipelines.workbench.services.jobs import Jobs, key_of
from pipelines.workbench.services.work import done_in_process
from pipelines.workbench.settings import WorkbenchSettings
from pipelines.workbench.state import AuditPage, DiscoverPage, MissingPage, TwoModelsPage
from schemas.errors import WrongUse

TOKEN = "Zq8vXy3nR5tB7wK1mP4sD9"


def client_of(archive: object, folder: Path) -> AsgiClient:
    return AsgiClient(create_app(settings_of(archive, folder)), "http://127.0.0.1:8321")


def settings_of(archive: object, folder: Path) -> WorkbenchSettings:
    return WorkbenchSettings(archive=str(archive), folder=folder / "bench", token=TOKEN)


def test_a_figure_of_too_few_lots_for_a_cpk_is_on_the_page_and_in_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_archive(tmp_path / "archive", 6, years=2.0, seed=3, workers=1)
    _, content = requests.audit(settings_of(tmp_path / "archive", tmp_path), AuditPage())
    end, audited = done_in_process("audit", content, lambda *_: None)
    assert end == "done", audited
    end, said = done_in_process("audit", {**content, "station": "nowhere"}, lambda *_: None)
    assert (end, "the field 'Station' 'nowhere' has no calibration" in said) == ("failed", True)
    capability = audited["document"]["population"]["capability"]
    figure, others = capability[0], capability[1:]
    assert others
    figure["cpk"] = None
    monkeypatch.setattr(Jobs, "result", lambda *_: audited)
    client = client_of(tmp_path / "archive", tmp_path)
    rows = client.get("/audit/capability.csv").text
    assert figure["figure"] in rows
    assert {"ppk_low", "cpk_low"} <= set(rows.splitlines()[0].split(","))
    page = client.get("/audit")
    assert page.status_code == 200
    assert "Capability" in page.text
    assert client.get("/audit/nothing.csv").status_code == 404


def test_a_discovery_is_on_the_page_with_its_levels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = wafer_line(tmp_path)
    _, without = requests.discover(settings_of(made.folder, tmp_path), DiscoverPage())
    add_attributes(Archive(str(made.folder)), pd.read_csv(made.units, dtype=str), "serial", "units.csv")
    client = client_of(made.folder, tmp_path)
    assert client.get("/discover").status_code == 200  # before it was asked for
    _, content = requests.discover(settings_of(made.folder, tmp_path), DiscoverPage())
    assert content != without  # attributes make another result
    end, found = done_in_process("discover", content, lambda *_: None)
    assert end == "done", found
    monkeypatch.setattr(Jobs, "result", lambda *_: found)
    page = client.get("/discover")
    assert page.status_code == 200
    assert "third_order" in page.text
    assert "differs by wafer" in page.text
    for name in ("levels-D1", "grown-D1", "strongest", "reach"):
        assert client.get(f"/discover/figure/{name}.json").status_code == 200, name
    rows = client.get("/discover/levels-D1.csv").text.splitlines()
    assert rows[0].startswith("level,size_ug")
    assert rows[1].startswith("W02,")
    for name in ("figure/nothing.json", "levels-D7.csv"):
        assert client.get(f"/discover/{name}").status_code == 422, name
    document = found["document"]
    found["document"] = {**document, "discoveries": [], "pooled": {**document["pooled"], "lots": 0}}
    assert "No lot can be compared" in client.get("/discover").text


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
    run, read = small_run(tmp_path), Run.table
    own = run.table("verdict").assign(verdict=verdict, reason=reason)
    monkeypatch.setattr(Run, "table", lambda self, name: own if name == "verdict" else read(self, name))
    assert shown in client_of(run.archive.root, tmp_path).get(f"/run?run={run.id}").text


def test_a_unit_has_figures_and_coefficients_with_u_once_and_residuals_against_what_they_depend_on(
    tmp_path: Path,
) -> None:
    run = small_run(tmp_path)
    client = client_of(run.archive.root, tmp_path)
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
    adequate = bool((run.table("verdict")["verdict"] == "adequate").all())
    assert ('<option value="force" selected>' in page) == adequate
    chart = client.get(f"/unit/figure/residuals.json?run={run.id}&unit=A1&against=time").json()
    assert sum("error_y" in trace for trace in chart["data"]) == 3
    assert f"tumbleline show {run.id} residuals --archive" in page
    for path in (run.path / "grades.json", run.path / "grades.parquet", run.report):  # as a fit without limits
        path.unlink(missing_ok=True)
    ungraded = client.get(f"/unit?run={run.id}&unit=A1").text
    assert "No model was fitted" not in ungraded
    assert f"<code>tumbleline fit {run.id} --limits consumer --archive" in ungraded
    page = client.get(f"/run?run={run.id}").text
    assert f"<code>tumbleline show {run.id} --report --archive" in page
    assert f'href="/unit?run={run.id}&amp;unit=A1"' in page
    same = MissingPage(source="latest", fresh=run.id)  # what was the fresh run is chosen as the dwells
    assert requests.settled(settings_of(run.archive.root, tmp_path), same).fresh == ""
    assert "certificate issue" not in ungraded


def cubic_lot(folder: Path) -> WorkbenchSettings:
    """A workbench whose one file of dwells has a cubic that its model lacks."""
    (folder / "bench").mkdir()
    dwells = lot(np.random.default_rng(5), units=2, temperatures=(25.0,), hidden=lambda force, *_: 2e-4 * force**3)
    dwells.to_parquet(folder / "bench" / "cubic.parquet")
    return settings_of(folder / "archive", folder)


@pytest.mark.slow
def test_two_models_stand_side_by_side_with_verdicts_residuals_on_one_scale_and_the_change_of_coefficients(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = cubic_lot(tmp_path)
    models.save(settings, "cubic", ["bias", "scale", "misalignment"], ["third_order"], (), "a test", "cubic.parquet")
    client = AsgiClient(create_app(settings), "http://127.0.0.1:8321")
    state = TwoModelsPage(source=str(settings.folder / "cubic.parquet"), second="cubic")
    results: dict[str, object] = {}
    monkeypatch.setattr(Jobs, "result", lambda _, kind, content: results.get(key_of(kind, content)))
    assert 'data-job-kind="diagnose"' in client.get(state.address()).text
    works = [("diagnose", requests.diagnosis(settings, one)[1]) for one in requests.two_models(settings, state)]
    works.append(("coefficients", requests.coefficients(settings, state)[1]))
    for kind, content in works:
        end, results[key_of(kind, content)] = done_in_process(kind, content, lambda *_: None)
        assert end == "done", results
    text = client.get(state.address()).text
    cells = re.findall(r'<td class="n">([^<]*)</td>', text)
    first, second = (results[key_of(kind, content)].document["error"] for kind, content in works[:2])
    assert first["rms_ug"] > 3.0 * second["rms_ug"]
    assert cells[:4] == ["not adequate", "adequate", significant(first["rms_ug"]), significant(second["rms_ug"])]
    assert "third_order" in cells
    rows = results[key_of(*works[2])]
    scale = next(row for row in rows if row["effect"] == "scale")
    assert abs(scale["over_a"]) > 2.0  # what the cubic gave to the scale factor
    change, expanded = with_uncertainty(scale["change"], 2.0 * scale["u_b"])
    assert f"{change}<br><small>± {expanded}</small>" in text
    assert client.get("/two-models/coefficients.csv?" + state.query()).text.count("\n") == len(rows) + 1
    chart = client.get(state.figure("residuals")).json()
    assert str(chart["layout"]["yaxis"]["range"]) == str(chart["layout"]["yaxis2"]["range"])


def test_the_u_of_a_difference_is_that_of_the_larger_model_and_of_models_beside_each_other_the_sum() -> None:
    row = {"a": 1.0, "u_a": 0.1, "b": 2.0, "u_b": 0.3, "change": 1.0}
    small, large, other = (MissingPage(effects=("bias", *more)) for more in ((), ("third_order",), ("second_order",)))
    for sides, expanded in (((small, large), 0.6), ((large, small), 0.2), ((large, other), 0.8)):
        assert _worded(row, sides)["difference"] == with_uncertainty(1.0, expanded)


@pytest.mark.slow
def test_two_runs_stand_side_by_side_with_k_of_the_first_and_imports_of_two_files_are_two_measurements(
    tmp_path: Path,
) -> None:
    run = small_run(tmp_path)
    again = measured_run(small_job(tmp_path, repeat=1), run.archive, CaptureDouble(noise_g=2e-4))
    client = client_of(run.archive.root, tmp_path)
    text = client.get(f"/run?run={run.id}&beside={again.id}").text
    own, its = (one.table("figures").set_index(["unit", "figure"]).loc["A1", "bias_error_ug"] for one in (run, again))
    change, expanded = with_uncertainty(own["value"] - its["value"], np.hypot(own["uncertainty"], its["uncertainty"]))
    assert f"Δ {change} ± {expanded}</small>" in text
    other = client.get(f"/run?run={run.id}&beside={run.id}").text  # the same noise in both: no U of the difference
    assert "Δ 0</small>" in other or "Δ 0.000</small>" in other
    change = own["value"] - its["value"]
    k = {run: 2.5, again: float(again.about["limits"]["coverage_factor"])}
    standard = np.hypot(own["uncertainty"] / k[run], its["uncertainty"] / k[again])
    told, expanded = with_uncertainty(change, 2.5 * standard)
    limits = {**run.about["limits"], "coverage_factor": k[run]}
    for other, with_u in (("b" * 64, True), ("a" * 64, False)):
        rewritten(run, limits=limits, capture="", source={"sha256": "a" * 64})
        rewritten(again, capture="", source={"sha256": other})
        text = client_of(run.archive.root, tmp_path).get(f"/run?run={run.id}&beside={again.id}").text
        assert "with its U, k = 2.5, for measurements" in text
        assert (f"Δ {told} ± {expanded}</small>" in text) is with_u
        assert ("± " in text[text.index("data-two-runs") :].partition("</table>")[0]) is with_u


def rewritten(run: Run, **entries: object) -> None:
    """A run's ``run.json`` with other entries, as an import or other limits would have written it."""
    path = run.path / START
    path.write_text(json.dumps({**run.about, **entries}), encoding="utf-8")


def test_residuals_follow_the_quantity_that_makes_them() -> None:
    rng = np.random.default_rng(3)
    dwells = pd.DataFrame({"dwell": np.arange(40), "time_s": 600.0 * np.arange(40)})
    for name, values in (("force", np.sin(np.arange(40) * 2.0)), ("time", np.linspace(-1.0, 1.0, 40))):
        residuals = pd.DataFrame({"dwell": np.arange(40), "axis": "x", "force_g": np.sin(np.arange(40) * 2.0)})
        residuals["unit_C"] = rng.normal(25.0, 1.0, 40)
        residuals["residual_ug"] = 50.0 * values**3 + rng.normal(0.0, 1.0, 40)
        assert follows_most(residuals, dwells) == name
    supply = rng.normal(3.3, 0.01, 40)
    recorded = dwells.assign(supply_V=supply, my_column=rng.normal(size=40), n=100, humidity_pct=45.0)
    residuals["residual_ug"] = 2e4 * (supply - 3.3) ** 2 + rng.normal(0.0, 0.1, 40)
    assert follows_most(residuals, recorded) == "supply_V"
    residuals["pose"] = "p1"
    ramp = recorded.assign(unit_C=25.0 + 20.0 * np.sin(np.arange(40) / 6.0))
    assert "temperature_rate" in quantities(residuals, ramp)
    assert list(quantities(residuals, recorded)) == ["force", "time", "supply_V", "my_column", "pose"]
    assert residual_chart("A1", residuals, recorded, "supply_V").plots[0].x.label == "supply / V"
    with pytest.raises(WrongUse, match="did you mean supply_V"):
        residual_chart("A1", residuals, recorded, "suply_V")
