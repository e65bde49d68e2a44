"""A recorded quantity is one row: everything that names quantities follows from it, and nothing has a row that is half there."""

import re
from dataclasses import fields
from itertools import pairwise
from pathlib import Path

from capture_double import small_job
from each import each

from inertial.criticism.drivers import quantities
from inertial.expressions import QUANTITIES
from inertial.planning.remedies import REMEDIES
from inertial.planning.sequences import SequenceStep, extended
from inertial.quantities import BOOKKEEPING, BY_COLUMN, DERIVED, KNOWN_COLUMNS, LEFT_ALONE, RECORDED, column_of
from inertial.state import State
from pipelines.importers import mapping
from pipelines.report.residuals import LABELS
from pipelines.schedule.planned_state import planned_state
from pipelines.stages.reduce import KEPT, WHERE_THERE
from schemas import tables
from stations.profile_files import load_profile, profile_names

ROOT = Path(__file__).resolve().parents[2]
# also columns of other tables than dwells
NEVER_NAMED = {"unit_C", "chamber_C", "time_s", "outer_deg", "inner_deg", "slot"}
NEVER_READ = {"outer_deg", "inner_deg", "slot"}
HERE = {
    "inertial/quantities.py",
    "schemas/tables.py",  # the contract of readings, old ones too
    "pipelines/capture/record.py",  # what each instrument is called
    "stations/overview.py",  # a live display
    "pipelines/report/residuals.py",  # pictures that are always shown
}
"""Where columns may be written out."""


@each(RECORDED, lambda row: row.column)
def test_a_row_is_whole(row, tmp_path):
    assert row.label
    assert (row.column in KNOWN_COLUMNS) == bool(row.attribute)
    assert not row.attribute or row.attribute in {item.name for item in fields(State)}
    assert row.axis_label == LABELS[row.column]
    assert bool(row.mapped) == (bool(row.attribute) and row.column != "time_s")  # the time has a meaning of its own
    assert not row.mapped or mapping.MEANINGS[row.mapped] == row.column
    assert not row.formula or (QUANTITIES[row.formula][0] == QUANTITIES[row.column][0] == row.attribute)
    assert not row.attribute or column_of(row.attribute) == row.column
    assert row.column not in BOOKKEEPING


def test_every_station_reads_what_the_rows_say_and_dwells_keep_it():
    required = {name for name in tables.TABLES["readings"].columns if name in BY_COLUMN} - NEVER_READ
    assert required == {row.column for row in RECORDED if row.reading}
    assert required <= set(KEPT)
    assert set(WHERE_THERE) == {row.column for row in RECORDED if row.joined == "max"}
    recorded = {r.column for name in profile_names() for r in load_profile(name).registers if r.column}
    assert recorded  # what a reader records besides has a row
    assert recorded <= {row.column for row in RECORDED if not row.attribute}


def test_a_plan_has_every_quantity_and_every_driver(tmp_path):
    recipe = small_job(tmp_path).recipe
    columns = [row.column for row in RECORDED if not row.attribute]
    state = planned_state(recipe, recorded=columns)
    for row in RECORDED:
        # no table has a heading: units put by hand do
        if row.attribute and row.column not in {"power_off_s", "heading_deg"}:
            assert getattr(state, row.attribute) is not None
    assert list(state.covariates) == columns
    drivers = {row.column for row in RECORDED if row.driver} | {row.name for row in DERIVED if row.driver}
    assert {name for name, _, _ in quantities(state)} == drivers


def test_steps_that_are_added_to_a_plan_go_on_with_every_quantity(tmp_path):
    state = planned_state(small_job(tmp_path).recipe)
    longer = extended(state, [SequenceStep(0.1, 0.2, 25.0)])
    count = state.time.size + 1
    assert [
        row.column
        for row in RECORDED
        if row.attribute and not row.once and getattr(state, row.attribute) is not None
        if getattr(longer, row.attribute).shape != (count,)
    ] == []
    for row in LEFT_ALONE:  # what steps leave alone has a remedy that varies it
        (remedy,) = (r for r in REMEDIES if r.driver == row.attribute)
        assert (remedy.feature(state), remedy.cure(state)) == (row.varied.feature, row.varied.cure)
        assert remedy.feature(remedy.apply(state)) == ""


def test_no_other_module_lists_the_columns():
    """Two columns of quantities on neighbouring lines as texts are a list by hand."""
    names = [row.column for row in RECORDED if row.attribute and row.column not in NEVER_NAMED]
    text = re.compile("|".join(f'"{name}"' for name in names))
    modules = set()
    for folder in ("inertial", "pipelines", "schemas", "stations"):
        for path in (ROOT / folder).rglob("*.py"):
            written = enumerate(path.read_text(encoding="utf-8").splitlines())
            lines = [number for number, line in written for _ in text.findall(line)]
            if any(b - a <= 1 for a, b in pairwise(lines)):
                modules.add(path.relative_to(ROOT).as_posix())
    assert modules <= HERE
