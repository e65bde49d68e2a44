"""`tumbleline plan line`: the schedule as text, document, table and picture; refusals with what to do."""

import csv
import sys
from pathlib import Path

import pytest
from each import each
from in_process import document_of, refused, text_of
from test_plan import OWN, RECIPE, rows

SMALL = """
name = "small"
fixtures = ["A", "B"]
load_min = 6
unload_min = 4
[[shared]]
name = "table"
needed_for = ["measure"]
[[lots]]
recipe = "six.toml"
count = 2
"""


@pytest.fixture
def line(tmp_path: Path) -> Path:
    (tmp_path / "six.toml").write_text(RECIPE.replace(OWN, "").replace("faces", "six"), encoding="utf-8")
    path = tmp_path / "small.toml"
    path.write_text(SMALL, encoding="utf-8")
    return path


def test_every_step_is_in_table_picture_and_document(line: Path, tmp_path: Path) -> None:
    found = document_of("plan", "line", line, "--output", tmp_path / "s.csv", "--output", tmp_path / "s.svg", status=0)
    rows = list(csv.DictReader((tmp_path / "s.csv").read_text(encoding="utf-8").splitlines()))
    assert [(row["lot"], row["activity"], float(row["end_min"])) for row in rows] == [
        (one["lot"], one["activity"], pytest.approx(one["end_min"], abs=1e-3)) for one in found["activities"]
    ]
    drawn = (tmp_path / "s.svg").read_text(encoding="utf-8")
    assert all(f">{text}<" in drawn for text in ("six-1", "six-2", "A", "B", "table", "operator", "measure", "soak"))
    text = text_of("plan", "line", line, "--all", status=0)
    assert all(text.count(f"six-{k} ") > 3 for k in (1, 2))


def test_a_night_without_operators_is_part_of_the_schedule_and_the_start_a_time_of_day_or_hours(
    line: Path,
) -> None:
    line.write_text(f'start = "13:40"\n{SMALL}\n[operators]\nshifts = ["06:00-14:00"]\n', encoding="utf-8")
    text = text_of("plan", "line", line, status=0)
    assert text.count("+1 d 06:0") == 2  # loaded in the afternoon, unloaded in the morning
    starts = []
    for start in ('"13:30"', "13.5"):
        line.write_text(f"start = {start}\n{SMALL}", encoding="utf-8")
        starts.append(text_of("plan", "line", line, status=0))
    assert starts[0] == starts[1]
    assert " 13:30 " in starts[0]


LINES = rows(r"""
"measure" → "mesure" → did you mean measure
"six.toml" → "sixes" → recipe: no file and no recipe is called 'sixes'
"B" → "A" → A is there twice
count = 2 → count = 500 → 100
load_min = 6 → load_min = 1500 → longest shift has 1440 min
load_min = 6 → load_min = 6\nstart = "25:61" → key 'start': found '25:61': a time of day as 06:00 is needed
load_min = 6 → load_min = 6\nstart = "24:00" → hours from 0 to below 24 are needed
load_min = 6 → load_min = 6\nstart = nan → hours from 0 to below 24 are needed
load_min = 6 → load_min = 6\nstart = -5 → hours from 0 to below 24 are needed
load_min = 6 → load_min = 6\nstart = true → hours from 0 to below 24 are needed
"table" → "operator" → found the name 'operator', which a schedule has for its own
"table" → "fixtures" → found the name 'fixtures', which a schedule has for its own
count = 2 → count = 2\n[operators]\nshifts = ["06-14"] → found '06-14': a time of day as 06:00 is needed
count = 2 → count = 2\n[operators]\nshifts = [[0, 1]] → begin and end as 06:00-14:00 are needed
unload_min = 4 → unload_min = 4\nstation = "nowhere" → station: nowhere
""")


@each(LINES)
def test_what_cannot_be_is_refused(change: tuple[str, str, str], line: Path, tmp_path: Path) -> None:
    old, new, message = change
    line.write_text(SMALL.replace(old, new), encoding="utf-8")
    said = refused("plan", "line", line, "--output", tmp_path / "s.csv")
    assert message in said
    assert not (tmp_path / "s.csv").exists()


def test_without_the_solver_the_command_names_the_extra(line: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ortools.sat.python.cp_model", None)
    assert "pip install 'tumbleline[schedule]'" in refused("plan", "line", line)
