"""Bad input and trouble, from the recipe to the result: one message, nobody else harmed, nothing issued for refused data."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from capture_double import CaptureDouble, small_job, small_run

from pipelines.archive import Archive, Run
from pipelines.cli.summary import all_passed, summary
from pipelines.export import unit_calibrations
from pipelines.report import render
from schemas.errors import DataRejected, WrongUse

TABLES_OF_RESULTS = (
    "dwells", "coefficients", "covariance", "residuals", "predictions", "wander", "verification", "verification_poses",
    "allan", "noise", "figures",
)  # fmt: skip


@pytest.fixture(scope="module")
def spoilt(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run in which A2 falls silent."""
    return small_run(tmp_path_factory.mktemp("spoilt"), {"A2": "silent"})


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """The same lot without trouble."""
    return small_run(tmp_path_factory.mktemp("sound"))


def test_a_unit_that_falls_silent_is_reported_and_the_others_go_on(spoilt: Run) -> None:
    grades = spoilt.table("grades").set_index("unit")
    assert grades["outcome"].to_dict() == {"A1": "pass", "A2": "refused", "A3": "pass"}
    assert "stopped answering at record 3" in grades.loc["A2", "reasons"]
    assert grades.loc["A2", "grade"] == "none"


def test_the_others_get_what_they_would_have_got(spoilt: Run, sound: Run) -> None:
    wanted = sound.table("coefficients").query("unit != 'A2'").reset_index(drop=True)
    coefficients = spoilt.table("coefficients")
    pd.testing.assert_frame_equal(coefficients[["unit", "axis", "effect"]], wanted[["unit", "axis", "effect"]])
    # the noise is judged by the whole lot, so that weights and errors move a little; the result does not
    assert ((coefficients["value"] - wanted["value"]).abs() < 0.1 * wanted["standard_error"]).all()
    assert (coefficients["standard_error"] / wanted["standard_error"]).between(0.9, 1.1).all()


def test_refused_data_never_have_a_result_and_are_never_exported(spoilt: Run, sound: Run) -> None:
    assert [table for table in TABLES_OF_RESULTS if "A2" in set(spoilt.table(table)["unit"])] == []
    with pytest.raises(WrongUse, match="the data of unit A2 were refused"):
        unit_calibrations(spoilt, ("A2",), failed=True)
    assert [c.unit for c in unit_calibrations(spoilt, (), failed=True)] == ["A1", "A3"]
    assert not all_passed(summary(spoilt))
    assert all_passed(summary(sound))


def test_the_report_names_the_refused_unit_and_gives_it_no_number(spoilt: Run) -> None:
    page = render(spoilt)
    row = re.search(r'<tr><td class="n">1</td><td><a href="#A2">.*?</tr>', page, flags=re.DOTALL)
    section = re.search(r'<details class="unit" id="A2" open>.*?</details>', page, flags=re.DOTALL)
    together = re.search(r'<ul class="reasons"><li>[^<]*A2[^<]*</li></ul>', page)
    reason = "stopped answering at record 3"
    assert reason in together[0]
    for part in (
        row[0],
        re.sub(rf'<ul class="reasons">(?:(?!</ul>).)*{reason}.*?</ul>', "", section[0], flags=re.DOTALL),
    ):
        assert reason not in part
        words = re.sub(r"<[^>]*>", " ", part)
        assert re.findall(r"\d+", words.replace("A2", "")) == ["1"]  # the slot
        assert not re.search(r"<(svg|img|canvas)", part)
        assert "none" in words  # the grade
    assert reason in section[0]
    page = page.replace(together[0], "")
    assert not re.search(r"\bA2\b", page.replace(row[0], "").replace(section[0], ""))
    sound_section = re.search(r'<details class="unit" id="A1">.*?</details>', page, flags=re.DOTALL)
    assert page.index(section[0]) < page.index(sound_section[0])
    assert "<svg" in sound_section[0]


def test_a_lot_in_which_every_unit_is_refused_has_a_result_too(tmp_path: Path) -> None:
    run = small_run(tmp_path, {"A1": "stuck", "A2": "nan", "A3": "dead"})
    assert set(run.table("grades")["outcome"]) == {"refused"}
    assert "0 of 3" in render(run)
    with pytest.raises(WrongUse, match="no unit passed, at least one is needed"):
        unit_calibrations(run, (), failed=True)


def test_a_station_that_delivers_no_time_is_refused(tmp_path: Path) -> None:
    job = small_job(tmp_path)
    records = Archive(tmp_path / "archive").capture(job.capture_id)
    double = CaptureDouble()
    samples, readings, history = double.record(job, 0, "dwell", 0, 0.0, job.recipe.poses[0])
    samples.loc[5, "time_s"] = np.nan
    with pytest.raises(DataRejected, match=r"samples: row 6 \(unit A1\), column time_s"):
        records.put(0, samples, readings, history, b"")
    assert records.finished() == set()
