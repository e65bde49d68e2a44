"""What differs between two runs: flips first, changes against uncertainty, and the reason named."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import CaptureDouble, measured_run, small_job, small_run

from pipelines.archive import Archive, Run
from pipelines.jobs.model_change import change_from_options
from pipelines.rerun.diff import diff, with_standard_error
from pipelines.rerun.rerun import again
from schemas.errors import DataRejected

LARGER = "bias,scale,misalignment,bias_temperature,scale_temperature,third_order"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("diff"))


@pytest.fixture(scope="module")
def larger(run: Run) -> Run:
    return run.archive.run(again(run.archive, run.id, change_from_options(effects=LARGER)).new)


def whats(document: dict) -> list[tuple[str, str]]:
    return [(row["what"], row["stage"]) for row in document["because"]]


def test_other_limits_flip_grades_and_no_coefficient_and_are_named(run: Run, tmp_path: Path) -> None:
    limits = tmp_path / "hard.toml"
    figures = run.table("figures").query("figure == 'zero_g_offset_mg'").eval("value = abs(value)").sort_values("value")
    bias = figures["value"].tolist()
    limits.write_text(
        f'name = "hard"\nrule = "simple_acceptance"\n[figures]\nzero_g_offset_mg = {{ max = {bias[1] + 0.1}, unit = "mg" }}\n'
    )
    other = run.archive.run(again(run.archive, run.id, change_from_options(limits=str(limits))).new)
    document = diff(run, other)
    worst = figures["unit"].iloc[-1]
    assert document["coefficients"] == []
    assert document["flipped"] == [worst]
    assert document["units"][0]["unit"] == worst
    assert whats(document) == [("limits", ""), ("limits", "")]
    assert "zero_g_offset_mg" in document["because"][0]["name"]
    rule = document["because"][1]
    assert [rule[key] for key in ("name", "a", "b")] == ["rule", run.about["limits"]["rule"], "simple_acceptance"]


def test_another_model_is_named_and_changes_stand_against_both_uncertainties(run: Run, larger: Run) -> None:
    document = diff(run, larger)
    assert whats(document) == [("model", "")]
    assert document["because"][0]["b"] == "5 effects + third_order"
    own, other = (one.table("coefficients") for one in (run, larger))
    row = next(r for r in document["coefficients"] if np.isfinite(r["over_a"]) and r["effect"] == "scale")
    a, b = (
        t.query(f"unit == '{row['unit']}' and axis == '{row['axis']}' and name == '{row['name']}'").iloc[0]
        for t in (own, other)
    )
    assert row["over_a"] == pytest.approx((b["value"] - a["value"]) / a["standard_error"])
    assert row["over_b"] == pytest.approx((b["value"] - a["value"]) / b["standard_error"])
    added = [r for r in document["coefficients"] if r["effect"] == "third_order"]
    assert len(added) == 9  # three units, three axes
    assert all(np.isnan(r["a"]) and np.isfinite(r["b"]) for r in added)
    ratios = [abs(r["over_both"]) for r in document["coefficients"] if np.isfinite(r["over_both"])]
    assert ratios == sorted(ratios, reverse=True)  # the largest against uncertainty first


@pytest.mark.slow
def test_a_fresh_measurement_differs_by_its_data_and_runs_without_a_common_unit_are_refused(
    run: Run, larger: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    archive = Archive(run.archive.root)
    document = diff(run, measured_run(small_job(tmp_path, repeat=1), archive, CaptureDouble(noise_g=2e-4)))
    assert ("data", "") in whats(document)
    assert document["coefficients"]
    read = Run.table
    others = lambda own, name: read(own, name).replace({"unit": {f"A{k}": f"B{k}" for k in (1, 2, 3)}})  # noqa: E731
    with monkeypatch.context() as patch:
        patch.setattr(Run, "table", lambda own, name: (read if own is run else others)(own, name))
        with pytest.raises(DataRejected, match="no unit in common"):
            diff(run, larger)


def test_versions_of_libraries_and_code_are_named(run: Run, larger: Run) -> None:
    before = {path: path.read_bytes() for path in larger.path.glob("verification*.json")}
    for path, content in before.items():
        manifest = json.loads(content)
        path.write_text(
            json.dumps(manifest | {"code": "e" * 64, "libraries": manifest["libraries"] | {"numpy": "0.1"}})
        )
    try:
        document = diff(run, larger)
    finally:
        for path, content in before.items():
            path.write_bytes(content)
    named = {(row["what"], row["name"]) for row in document["because"]}
    assert {("library", "numpy"), ("code", "verify")} <= named


@pytest.mark.parametrize(("columns", "unlimited"), [(("pfa",), 4.0), ((), 5.0)])  # of today, of earlier versions
def test_standard_uncertainties_of_figures_are_found_with_the_factor_that_they_were_expanded_with(
    columns: tuple[str, ...], unlimited: float
) -> None:
    shared = {"unit": "A", "value": 1.0, "uncertainty": 10.0, "unit_text": "µg", **dict.fromkeys(columns, 0.0)}
    figures = pd.DataFrame({"figure": ["f", "g"], "limit": [100.0, np.nan], **shared})
    about = {"limits": {"coverage_factor": 2.5}}
    assert with_standard_error(about, figures)["standard_error"].tolist() == [4.0, unlimited]
