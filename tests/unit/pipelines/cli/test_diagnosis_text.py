"""Every verdict lists the dwells that carry it and what it is without them: in the text, in the document and on the page."""

import sys
from dataclasses import replace

import pytest
from in_process import document_of, text_of
from root_process import ROOT

from pipelines.cli.text.diagnosis_text import print_diagnosis

sys.path.insert(0, str(ROOT / "benchmarks" / "worlds"))

from tables import FAULTS
from world import World, make

pytestmark = pytest.mark.usefixtures("no_next_measurement")

SEED = 5_500_000
STATION = World(units=3, hidden=(("level_error", 3.0),))


@pytest.mark.parametrize(
    ("world", "scope", "name"),
    [
        pytest.param(STATION, "station", "level_error", marks=pytest.mark.slow),
        (replace(FAULTS["pose_0.1deg"], units=3), "data", "wrong_pose"),
        pytest.param(replace(FAULTS["slip_0.2mrad"], units=3), "data", "table_slip", marks=pytest.mark.slow),
    ],
    ids=["station effect", "one pose", "table from a time on"],
)
def test_dwells_that_carry_a_verdict_stand_in_text_document_and_page(tmp_path, capsys, world, scope, name):
    made = make(world, SEED)
    made.dwells.to_parquet(tmp_path / "dwells.parquet")
    page = tmp_path / "page.html"
    document = document_of("diagnose", tmp_path / "dwells.parquet", "--output", page)
    (group,) = document["classes"]
    assert (group["scope"], name in group["effects"]) == (scope, True)
    assert document["influence"] == group["influence"]
    # what concerns all units is carried by whole dwells
    assert len(group["influence"]) in {3, 6, 9}
    without = group["without_influence"]
    assert without["dwells"] == len(group["influence"])
    if name == "wrong_pose":  # one dwell in all units: nothing is left of it without them
        assert {row["dwell"] for row in group["influence"]} == set(made.told.dwells)
        assert without["p_value"] > 1e-3
    else:  # many dwells carry it, and it stands without these
        assert without["p_value"] < 1e-6
    first = group["influence"][0]
    share = f"({100.0 * first['share']:.0f} %)"
    print_diagnosis(document, data=None, model=None, brief=False)
    text = " ".join(capsys.readouterr().out.split())
    told = f"{first['unit']} dwell {first['dwell']} {share}"
    assert f"dwells with the largest influence on {' or '.join(group['effects'])}: {told}" in text
    assert f"without these {without['dwells']} p" in text
    assert told in page.read_text("utf-8").split("Dwells with the largest influence on the verdict")[1]


def test_missing_dwells_are_told_in_the_report_and_at_the_terminal(tmp_path):
    table = make(World(units=2, poses=12), SEED).dwells
    table = table.drop(index=table.index[(table["unit"] == "W002") & table["dwell"].isin([4, 9])])
    table.to_parquet(tmp_path / "dwells.parquet")
    page = tmp_path / "page.html"
    notice = "of 36 dwells of the lot are missing: W002 2 (4, 9); these units are judged by the others"
    assert notice in text_of("diagnose", tmp_path / "dwells.parquet", "--output", page)
    assert notice in page.read_text(encoding="utf-8")
