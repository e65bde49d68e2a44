"""The report: complete, offline, and readable."""

import re

import pandas as pd
import pytest
from capture_double import small_run
from hypothesis import given
from hypothesis import strategies as st

from pipelines.archive import Run
from pipelines.drawing import svg_text
from pipelines.report import make_report, render
from pipelines.report.numbers import significant, with_uncertainty
from pipelines.report.run_pictures import lot_chart


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return small_run(tmp_path_factory.mktemp("run"))


@pytest.fixture(scope="module")
def page(run: Run) -> str:
    return render(run)


def test_opens_without_a_network(page: str) -> None:
    assert not re.findall(r'(?:src|href)="(?!#)', page.replace('xlink:href="#', ""))
    assert not re.findall(r"url\((?!#)", page)


def test_shows_every_unit_with_plots_figures_and_coefficients(page: str) -> None:
    for unit in ("A1", "A2", "A3"):
        assert f'id="{unit}"' in page
    assert page.count("<svg") == 2 + 2 * 3
    assert "Allan deviation" in page
    assert "scale_temperature" in page


def test_names_rule_limits_gravity_and_provenance(page: str, run: Run) -> None:
    for words in ("ILAC-G8:09/2019 guarded acceptance", "9.8123 m/s²", run.id, str(run.about["capture"])):
        assert words in page


def test_has_no_number_longer_than_its_uncertainty_supports(page: str) -> None:
    text = re.sub(r"<(svg|style)\b.*?</\1>", "", page, flags=re.DOTALL)
    cells = re.findall(r'<td class="n"[^>]*>(.*?)</td>', text, flags=re.DOTALL)
    assert (
        max(len(re.findall(r"\d", re.sub(r"<[^>]*>", " ", cell).split("±")[0])) for cell in cells if "…" not in cell)
        <= 10
    )


@pytest.mark.parametrize(("mean", "red"), [(300.0, False), (1300.0, True)])
def test_the_limit_is_for_the_mean_of_a_pose_not_for_a_dwell_that_wandered(mean: float, *, red: bool) -> None:
    dwells = pd.DataFrame(
        {"unit": "A1", "pose": ["v01", "v01", "v02"], "error_ug": [1400.0, 2.0 * mean - 1400.0, 10.0]}
    )
    poses = pd.DataFrame({"unit": "A1", "pose": ["v01", "v02"], "error_ug": [mean, 10.0]})
    chart = lot_chart(dwells, poses, ["A1"], 1000.0)
    shown = {trace.name: trace.y.tolist() for trace in chart.plots[0].traces if trace.style == "points"}
    assert shown.get("mean of a pose, beyond the limit", []) == ([mean] if red else [])
    assert shown["single dwell"] == [1400.0, 2.0 * mean - 1400.0, 10.0]
    assert ("beyond the limit" in svg_text(chart)) is red


def test_is_made_once(run: Run) -> None:
    assert not make_report(run)
    assert make_report(run)


@pytest.mark.parametrize(
    ("value", "expanded", "shown"),
    [
        (255224.4846, 61.7, ("255\u202f224", "62")),
        (-0.230123, 0.0361, ("−0.230", "0.036")),
        (12345.678, 1234.0, ("12\u202f300", "1\u202f200")),
        (1.0, 0.0, ("1.000", "")),
    ],
)
def test_rounds_to_the_uncertainty(value: float, expanded: float, shown: tuple[str, str]) -> None:
    assert with_uncertainty(value, expanded) == shown


@given(st.floats(min_value=1e-6, max_value=1e9))
def test_rounded_numbers_stay_close(value: float) -> None:
    shown = float(significant(value).replace("\u202f", "").replace("−", "-"))
    assert abs(shown - value) <= 0.0051 * value


def test_k_is_printed_as_it_is(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    about = {**run.about, "limits": {**run.about["limits"], "coverage_factor": 2.5}}
    monkeypatch.setattr(type(run), "about", property(lambda _: about))
    page = render(run)
    assert "k = 2.5" in page
    assert "k = 2)" not in page


def test_the_bias_has_an_uncertainty_for_each_of_its_measurands(page: str) -> None:
    for words in ("mean of the record", "mean of the day after the record", "mean of a day after the next switch-on"):
        assert page.count(words) >= 3
    assert "not stated" in page
