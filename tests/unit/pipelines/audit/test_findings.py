"""Small archives whose truth is known, made to mislead: what the audit says of them."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from calibration_rows import calibrations
from root_process import ROOT

sys.path.insert(0, str(ROOT))

from benchmarks.generated_archive import write_archive
from benchmarks.generated_ledger import write_ledger
from inertial.population.capability import Index as Capability
from pipelines.archive import Archive
from pipelines.audit.audit import Scope, audit
from pipelines.audit.calibrations import IMPORTED, Calibrations, date_of, day_of
from pipelines.audit.due import due, last_measured
from pipelines.audit.exchanged_serials import strangers
from pipelines.audit.findings import _incapable, findings
from pipelines.audit.parameters import NAMES
from pipelines.audit.population import Ability
from pipelines.audit.rules import load_rules
from pipelines.audit.unit_findings import of_small_kinds, twice

RULES = load_rules()


def of(*rows: tuple[str, str, str, float], values: np.ndarray | None = None) -> Calibrations:
    """Calibrations of (unit, device, station, day); a run is a station on a day."""
    return calibrations([(row[0], *row[2:]) for row in rows], values, device=[row[1] for row in rows])


def test_one_serial_on_two_kinds_or_stations_within_minutes_is_two_units_and_on_the_next_day_one() -> None:
    kinds = of(("A", "ADXL355", "s", 0.0), ("A", "SF1500", "s", 90.0), ("B", "ADXL355", "s", 0.0))
    assert list(twice(kinds)) == ["A"]
    assert twice(of(("A", "ADXL355", "s", 0.0), ("A", IMPORTED, "s", 90.0))) == {}  # which states no device
    at_once = of(("A", "X", "s", 10.0), ("A", "X", "t", 10.002), ("B", "X", "s", 10.0), ("B", "X", "t", 11.0))
    assert list(twice(at_once)) == ["A"]
    again = of(("A", "X", "s", 10.0), ("A", "X", "s", 10.002))  # the same station began once more
    assert twice(again) == {}


@pytest.mark.parametrize(("ppk", "remedy"), [(1.5, "outside: measure more units, reduce"), (0.9, "outside: reduce")])
def test_a_ppk_that_few_units_leave_open_asks_for_more_units(ppk: float, remedy: str) -> None:
    bounds = Capability(ppk, 0.8, 2.1)
    able = Ability("ADXL355", "bias_error_ug", "µg", 1000.0, False, 20, 500.0, bounds, None, Capability(0.0, 0.0, 0.17))
    assert remedy in next(_incapable(cast("Any", SimpleNamespace(abilities=[able], rules=RULES)))).message


def test_exchanged_serials_are_told_among_four_units_and_no_change_of_a_unit_is(rng: np.random.Generator) -> None:
    rows = [(unit, "ADXL355", "s", day) for unit in "ABCD" for day in (0.0, 180.0)]
    own = 5000.0 * rng.standard_normal((4, len(NAMES)))
    values = np.repeat(own, 2, axis=0) + 0.1 * rng.standard_normal((8, len(NAMES)))
    values[[1, 5]] = values[[5, 1]]  # A and C on the second day
    strange = strangers(of(*rows, values=values), RULES)
    assert [(one.row, one.looks_like, one.exchanged) for one in strange] == [(1, "C", True), (5, "A", True)]
    values = np.repeat(5000.0 * rng.standard_normal((4, len(NAMES))), 2, axis=0)
    values[1] += 9000.0
    values[5] -= 9000.0
    assert strangers(of(*rows, values=values), RULES) == []


def test_of_few_units_those_that_left_their_tolerance_are_found_by_their_uncertainty(rng: np.random.Generator) -> None:
    rows = [(unit, "ADXL355", "s", day) for unit in "ABCD" for day in (0.0, 180.0)]
    values = np.repeat(5000.0 * rng.standard_normal((4, len(NAMES))), 2, axis=0)
    bias, scale = NAMES.index("bias_x"), NAMES.index("scale_z")
    values[1, bias] += 1600.0  # A: tolerance 1500 µg
    values[3, bias] += 1400.0
    values[5, scale] -= 1020.0  # C: tolerance 1000 ppm, but U is 40 ppm
    moved = of(*rows, values=values)
    errors = np.where(np.arange(len(NAMES)) == scale, 14.2, moved.errors)
    found = of_small_kinds(replace(moved, errors=errors), np.ones(8, dtype=bool), RULES, (), 0.0)
    assert [(one.kind, one.units, one.evidence["parameter"]) for one in found] == [("found_outside", ("A",), "bias_x")]
    assert list(of_small_kinds(moved, np.ones(8, dtype=bool), RULES, {"ADXL355"}, 0.0)) == []


def test_units_are_due_from_their_last_calibration_and_at_the_station_that_made_it() -> None:
    start, half = day_of("2024-08-31"), RULES.model_copy(update={"interval_months": 6})
    all_ = of(("A", "X", "s", start), ("B", "X", "s", start), ("B", "X", "s", start + 20.0))
    due_units = due(all_, np.ones(3, dtype=bool), half, [], {})
    assert [date_of(day) for day in due_units.day] == ["2025-02-28", "2025-03-20"]  # by calendar months
    all_ = of(("A", "X", "s", start), ("A", "X", "t", start + 300.0), ("B", "X", "s", start))
    due_units = last_measured(all_, due(all_, np.ones(3, dtype=bool), RULES, [], {}), "s")
    assert [str(all_.unit[row]) for row in due_units.row] == ["B"]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("factory") / "archive"
    write_archive(folder, 12, years=1.0, seed=5, workers=1)
    return folder


def test_clocks_that_were_never_set_or_run_ahead_leave_out_their_runs_and_are_told(made: Path, tmp_path: Path) -> None:
    shutil.copytree(made, tmp_path / "archive", ignore=shutil.ignore_patterns("index"))
    said = ["2199-01-01T00:00:00+00:00", "yesterday", "1970-01-01T00:00:05+00:00"]
    runs = sorted((tmp_path / "archive" / "runs").iterdir())[:3]
    for run, moment in zip(runs, said, strict=True):
        about = json.loads((run / "run.json").read_bytes())
        (run / "run.json").write_text(json.dumps({**about, "when": moment}), encoding="utf-8")
    until = day_of("2022-02-01")
    audited = audit(Archive(tmp_path / "archive"), RULES, Scope(day_of("2021-01-01"), until, tomorrow=until))
    told = {finding.subject: finding for finding in findings(audited) if finding.who == "archive"}
    assert set(told) == {run.name for run in runs}
    assert "is in the future" in told[runs[0].name].message
    assert "its date 'yesterday' is invalid" in told[runs[1].name].message
    assert "a clock that was never set" in told[runs[2].name].message
    assert not set(audited.all.run) & {run.name for run in runs}


def test_a_serial_that_two_runs_have_at_once_is_told_with_both_runs(made: Path) -> None:
    scope = Scope(day_of("2021-01-01"), day_of("2022-02-01"))
    audited = audit(Archive(made), RULES, scope)
    unit = audited.all.unit.copy()
    once = np.array([str(one).startswith("N") for one in unit])  # of those that did not come back
    a, b = (np.flatnonzero(once & (audited.all.device == device))[0] for device in ("ADXL355", "SF1500"))
    unit[b] = unit[a]
    told = findings(replace(audited, all=replace(audited.all, unit=unit)))
    [finding] = [one for one in told if one.kind == "two_units"]
    assert finding.units == (str(unit[a]),)
    assert set(finding.evidence["runs"]) == {str(audited.all.run[a]), str(audited.all.run[b])}


def test_units_that_failed_under_a_valid_certificate_make_one_finding_for_their_kind(
    made: Path, tmp_path: Path
) -> None:
    shutil.copytree(made, tmp_path / "archive", ignore=shutil.ignore_patterns("index"))
    archive, scope = Archive(tmp_path / "archive"), Scope(day_of("2021-01-01"), day_of("2022-02-01"))
    first = audit(archive, RULES, scope)
    failed = [int(row) for row in first.due.row[first.due.because == "did not pass"]]
    assert failed
    all_ = first.all
    columns = (all_.unit, all_.device, all_.run, all_.station)
    write_ledger(archive.root, [(*(str(column[row]) for column in columns), "2021-12-01") for row in failed])
    audited = audit(archive, RULES, scope)
    told = {finding.subject: finding for finding in findings(audited) if finding.kind == "held_but_failed"}
    assert {unit for finding in told.values() for unit in finding.units} == {str(first.all.unit[row]) for row in failed}
    assert set(told) == {str(first.all.device[row]) for row in failed}
    assert "uncertified" in {finding.kind for finding in findings(audited)}
