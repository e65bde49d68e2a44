"""What is due agrees with the ledger: with what ``show UNIT --at DATE`` says, whatever was certified, superseded and revoked."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from calibration_rows import calibrations
from each import each
from hypothesis import given, settings
from hypothesis import strategies as st
from ledger_events import event

from benchmarks.generated_ledger import write_events
from pipelines.audit.calibrations import Calibrations, date_of, day_of
from pipelines.audit.due import Certificates, certificates_of, due, uncertified
from pipelines.audit.rules import load_rules
from pipelines.certificates import Ledger, LedgerEntry
from schemas.errors import WrongUse

DAY = "2026-06-30"
UNTIL = day_of(DAY) + 1.0
RULES = load_rules()


def measured(*rows: tuple[str, str, str], outcome: str = "pass") -> Calibrations:
    """Calibrations of (unit, run, day); the last one of all has the outcome."""
    days = [(unit, "bench", day_of(day)) for unit, _, day in rows]
    outcomes = ["pass"] * (len(rows) - 1) + [outcome]
    return calibrations(days, run=[row[1] for row in rows], outcome=outcomes, errors=1.0)


def known(root: Path, *events: LedgerEntry, captures: dict[str, str] | None = None) -> Certificates:
    """A ledger with these events, each as it was written on its first day."""
    count: dict[str, int] = {}
    for one in events:
        count[one.serial] = count.get(one.serial, 0) + 1
        own = {**one.__dict__, "sequence": count[one.serial], "when": one.when or f"{one.start}T12:00:00+00:00"}
        write_events(root, [LedgerEntry(**own)])
    return certificates_of(root, UNTIL, captures or {})


def told(all_: Calibrations, certificates: Certificates) -> tuple[str, str, str, bool]:
    """Of the one unit: when it is due, why, by which certificate, and whether one holds."""
    due_units = due(all_, np.ones(len(all_), dtype=bool), RULES, [], {}, certificates)
    return date_of(due_units.day[0]), str(due_units.because[0]), str(due_units.certificate[0]), bool(due_units.valid[0])


REVOKED: dict[str, Any] = {"action": "revoke", "until": "9999-12-31", "ends": (1,)}
FIRST = ("A1", "r-1", "2026-01-01")
STATES = {
    "due when its certificate ends and not when the interval does":
        ([event(start="2026-01-02", until="2026-09-01")], [FIRST], "pass", ("2026-09-01", "certificate", "A1/1", True)),
    "due since its certificate ended":
        ([event(start="2025-01-02", until="2026-01-02")], [("A1", "r-1", "2025-01-01")], "pass",
         ("2026-01-02", "certificate", "A1/1", False)),
    "due at once where it is revoked":
        ([event(start="2026-01-02"), event(start="2026-01-02", when="2026-05-05T08:00:00+00:00", **REVOKED)], [FIRST], "pass",
         ("2026-05-05", "revoked", "A1/1", False)),
    "due from the day on which a revocation holds":
        ([event(start="2026-01-02"), event(start="2026-03-03", **REVOKED)], [FIRST], "pass",
         ("2026-03-03", "revoked", "A1/1", False)),
    "a revocation that was written after the day is not known on it":
        ([event(start="2026-01-02"), event(start="2026-01-02", when="2026-07-01T08:00:00+00:00", **REVOKED)], [FIRST], "pass",
         ("2027-01-01", "certificate", "A1/1", True)),
    "a newer pass that is not certified leaves the older certificate standing":
        ([event(start="2025-08-01", until="2026-08-01")], [("A1", "r-1", "2025-07-31"), ("A1", "r-2", "2026-06-01")], "pass",
         ("2026-08-01", "certificate", "A1/1", True)),
    "a unit that failed is due although its certificate holds":
        ([event(start="2026-01-02")], [FIRST, ("A1", "r-2", "2026-06-01")], "fail",
         ("2026-06-01", "did not pass", "A1/1", True)),
}  # fmt: skip


@each(STATES)
def test_when_a_unit_is_due_why_and_whether_a_certificate_holds(name: str, tmp_path: Path) -> None:
    events, rows, outcome, expected = STATES[name]
    assert told(measured(*rows, outcome=outcome), known(tmp_path, *events)) == expected


def test_what_passed_and_was_not_certified_is_told_and_due_by_its_interval(tmp_path: Path) -> None:
    ledger = known(tmp_path, event(serial="B1", start="2026-01-02"))
    all_ = measured(("A1", "r-1", "2026-02-01"), ("B1", "r-1", "2026-01-01"))
    due_units = due(all_, np.ones(2, dtype=bool), RULES, [], {}, ledger)
    assert [str(all_.unit[due_units.row[k]]) for k in uncertified(all_, due_units, ledger)] == ["A1"]
    assert (date_of(due_units.day[0]), due_units.because[0], due_units.valid[0]) == ("2027-02-01", "fixed", False)
    newer = measured(("A1", "r-1", "2025-07-31"), ("A1", "r-2", "2026-06-01"))
    ledger = known(tmp_path / "older", event(start="2025-08-01", until="2026-08-01"))
    assert uncertified(newer, due(newer, np.ones(2, dtype=bool), RULES, [], {}, ledger), ledger).size == 1
    one, ledger = measured(FIRST), known(tmp_path / "none")  # without a ledger nothing is told
    assert uncertified(one, due(one, np.ones(1, dtype=bool), RULES, [], {}, ledger), ledger).size == 0
    assert told(one, ledger) == ("2027-01-01", "fixed", "", False)
    captures = {"r-1": "c", "again-1": "c"}  # a run again of the same capture certifies the measurement
    ledger = known(tmp_path / "again", event(run="again-1", start="2026-01-02"), captures=captures)
    assert due(one, np.ones(1, dtype=bool), RULES, [], {}, ledger).entered.all()
    ledger = known(tmp_path / "kind", event(start="2026-01-02", device="SF1500"))
    assert told(one, ledger)[2:] == ("", False)  # a certificate of another kind of device


def test_a_broken_history_is_told_and_leaves_the_others_alone(tmp_path: Path) -> None:
    known(tmp_path, event(start="2026-01-02"), event(serial="B1", start="2026-01-02"))
    next((tmp_path / "calibrations").glob("*/*/000001.json")).write_text("{", encoding="utf-8")
    ledger = certificates_of(tmp_path, UNTIL, {})
    assert len(ledger.problems) == 1
    assert len(ledger) == 1


MONTH = st.integers(1, 12).map(lambda month: f"2026-{month:02d}-01")


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(["certify", "supersede", "revoke"]), MONTH, MONTH), max_size=8), MONTH)
def test_one_certificate_holds_on_a_day_and_it_is_the_one_that_the_ledger_says(
    tmp_path_factory: pytest.TempPathFactory, steps: list[tuple[str, str, str]], day: str
) -> None:
    root = tmp_path_factory.mktemp("ledger")
    ledger = Ledger(root)
    for number, (action, first, second) in enumerate(steps):
        start, until = sorted((first, second))
        try:
            if action == "revoke":
                ledger.revoke("A1", "x", day=start)
            else:
                ledger.add(event(run=f"r-{number}", start=start, until=until), supersede=action == "supersede")
        except WrongUse:
            continue
    for month in range(1, 13):
        assert sum(one.holds(f"2026-{month:02d}-01") for one in ledger.calibrations("A1")) <= 1
    everything = certificates_of(root, day_of("2100-01-01"), {})
    certificates = Certificates(day, everything.of, {}, {})
    standing = certificates.standing("ADXL355", "A1", "r-0")
    held = ledger.valid_at("A1", day)
    if held is None:
        assert standing is None or standing.state != "valid"
    else:
        assert (standing.state, standing.certificate, standing.until) == ("valid", held.certificate, day_of(held.until))
