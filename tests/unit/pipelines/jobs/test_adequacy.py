"""The verdict on the model of a run: the line after it, the panel of its report and ``diagnose`` say the same."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from capture_double import small_run
from in_process import document_of
from long_suites import mostly_slow
from lots import lot

from inertial.discovery.scores import scores_of
from inertial.uncertainty.rounding import chance
from pipelines.archive import Run
from pipelines.cli.text.verdict_text import print_adequacy
from pipelines.diagnosis.diagnose import diagnose
from pipelines.diagnosis.sentences import verdict
from pipelines.jobs.adequacy import adequacy_of
from pipelines.report.context import ReportContext
from pipelines.report.numbers import significant
from pipelines.report.panels import model_adequacy
from pipelines.stages.judge import judge, shares_of, told_by, verdict_of, verdict_on
from pipelines.tables.sound_lot import sound_lot

MODEL = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
FIGURES = ("rms_ug", "floor_ug", "p_value")


def _plain() -> pd.DataFrame:
    return lot(np.random.default_rng(31), units=3)


def _hidden() -> pd.DataFrame:
    rng = np.random.default_rng(32)
    return lot(rng, units=2, temperatures=(0.0, 50.0), hidden=lambda force, *_: 3e-4 * force**3)


def _knocked() -> pd.DataFrame:
    """One dwell of one unit that is far off: a fault of the data, not of the model."""
    table = _plain()
    table.loc[(table["unit"] == "U001") & (table["dwell"] == 17), "out_x"] += 0.002
    return table


def _few() -> pd.DataFrame:
    return lot(np.random.default_rng(33), units=1, plan="six", temperatures=(25.0,))


def _swapped(units: str = "U002") -> pd.DataFrame:
    """Two axes of one unit exchanged: this unit is left out."""
    table = _plain()
    unit = table["unit"].str.match(units)
    table.loc[unit, ["out_x", "out_y"]] = table.loc[unit, ["out_y", "out_x"]].to_numpy()
    return table


def _all_swapped() -> pd.DataFrame:
    return _swapped("U")


CASES = [(_plain, True), (_hidden, False), (_knocked, False), (_few, None), (_swapped, True), (_all_swapped, None)]


@pytest.mark.usefixtures("no_next_measurement")
@pytest.mark.parametrize(
    ("made", "adequate"),
    mostly_slow(CASES, *CASES[3:5]),  # exchanged axes of one unit are left out of the plain lot
    ids=lambda value: getattr(value, "__name__", str(value)),
)
def test_it_is_the_verdict_of_diagnose_in_every_figure(made, adequate) -> None:
    table = made()
    effects = MODEL if made is not _few else MODEL[:3]
    short, whole = verdict_on(table, None, effects), diagnose(table, None, effects)
    assert short["adequate"] is adequate
    assert (short["adequate"], short["reason"]) == (whole["adequate"], whole["reason"])
    assert {name: short[name] for name in FIGURES} == {name: whole["error"][name] for name in FIGURES}
    assert short["faulty"] == sorted({unit for fault in whole["blocked_by"] for unit in fault["units"]})
    assert (short["reason"] is None) == (adequate is not None)
    judged = judge(table, None, effects)["verdict"]
    assert verdict_of(judged) == told_by(whole, table["unit"].nunique())  # it comes back from its table
    shares = shares_of(judged)
    assert (shares is not None) == bool(adequate)
    if adequate:
        lot = sound_lot(table, None, effects)[2]
        by_search, by_verdict = scores_of(lot, effects), scores_of(lot, effects, shares=shares)
        np.testing.assert_allclose(by_verdict.score, by_search.score, rtol=1e-9)
        np.testing.assert_allclose(by_verdict.products.lot, by_search.products.lot, rtol=1e-9)


@pytest.mark.usefixtures("no_next_measurement")
def test_line_and_panel_and_diagnose_of_one_run_agree(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    place = ("--archive", run.archive.root)
    whole = document_of("diagnose", run.id, *place)
    document = adequacy_of(run)
    assert document["adequate"] is whole["adequate"]
    assert {name: document[name] for name in FIGURES} == {name: whole["error"][name] for name in FIGURES}
    print_adequacy(document)
    line = capsys.readouterr().out.strip()
    assert line.startswith("model ")
    assert verdict(whole).startswith(line.removeprefix("model").strip())
    panel = model_adequacy.render(ReportContext(run, {}))
    cards = re.findall(r"<b>(.*?)</b>", panel)
    assert cards == [f"{significant(document[n])} µg" for n in FIGURES[:2]] + [chance(document["p_value"])]
    assert f"tumbleline diagnose {run.id}" in panel


def test_the_verdict_of_a_run_is_read_from_its_archive(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("inertial.criticism.verdict.judged", None)  # nothing is judged again
    document = adequacy_of(run)
    [row] = run.table("verdict").to_dict("records")
    assert (row["model"], row["p_value"]) == (",".join(run.about["recipe"]["effects"]), document["p_value"])
    (listed,) = document_of("list", "--archive", run.archive.root)["runs"]
    assert listed["verdict"] == row["verdict"] == ("adequate" if document["adequate"] else "not adequate")


def _panel(run: Any) -> str | None:
    return model_adequacy.render(SimpleNamespace(run=run))  # pyright: ignore[reportArgumentType]


def test_a_run_that_cannot_be_judged_says_why_and_one_without_model_or_poses_says_nothing(tmp_path: Path) -> None:
    run = small_run(tmp_path, dict.fromkeys(("A1", "A2", "A3"), "silent"))
    document = adequacy_of(run)
    assert document["adequate"] is None
    assert "refused" in str(document["reason"])
    assert "Cannot be judged: every unit was refused" in str(_panel(run))
    assert verdict_of(judge(_plain(), None, ())["verdict"]) is None
    about = {"capture": "c", "recipe": {"poses": [], "effects": ["bias"]}}
    shocked: Any = SimpleNamespace(id="shocked", about=about, tables=lambda: ["dwells", "history"])
    assert adequacy_of(shocked) is None  # of a list of procedures without a multi-position test
    assert _panel(shocked) is None
