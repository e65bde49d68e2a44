"""The person at the station: asked at a terminal, or by the orchestrator, and answered from either."""

import io
import sys
from pathlib import Path

import pytest
from capture_double import BRIEF, CaptureDouble, recipe_file, small_job
from in_process import given, typed_document
from root_process import ROOT

from pipelines.archive import Archive
from pipelines.chain.attendance import Answer, Attendance, Prompt
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.cli.terminal import scanned
from schemas.errors import LeaseLost, OperatorNeeded
from schemas.fault import FaultOrder
from schemas.station import with_faults


class Told:
    """An operator who notes what is asked and answers from a list; ``go`` when it is used up."""

    def __init__(self, *answers: Answer) -> None:
        self.answers, self.asked = list(answers), []

    def ask(self, prompt: Prompt) -> Answer:
        self.asked.append(prompt)
        return self.answers.pop(0) if self.answers else "go"


def attended(folder: Path, operator: Told, measure: object = None, fault: FaultOrder | None = None) -> None:
    job = small_job(folder, *BRIEF)
    if fault is not None:
        job = type(job)(job.recipe, job.limits, job.lot, with_faults(job.station, [fault]))
    runner = Runner(job, Archive(folder / "archive"), measure=measure or CaptureDouble())
    beside = Attendance(operator, job, runner.run.id)
    beside.capture(runner, lambda: runner.stage("capture"))
    for name in ORDER[1:-1]:
        runner.stage(name)
    beside.unload(runner.run)


def test_units_are_asked_for_before_and_after_with_results_and_not_again_when_a_run_goes_on(tmp_path: Path) -> None:
    first, again = Told(), Told()
    attended(tmp_path, first, CaptureDouble({"A2": "stuck"}))
    load, unload = first.asked
    assert (load.kind, unload.kind) == ("load", "unload")
    assert load.slots == ((0, "A1"), (1, "A2"), (2, "A3"))
    results = dict(unload.slots)
    assert results[1].startswith("A2  refused: ")
    assert all(results[slot].split("  ")[1].split(",")[0].split(":")[0] in {"pass", "fail"} for slot in (0, 2))
    attended(tmp_path, again)
    assert not again.asked


def test_a_run_that_lost_its_lease_ends_though_somebody_is_beside_it(tmp_path: Path) -> None:
    def lost(_job, _records, _progress):
        raise LeaseLost("station served: this run stood still")

    operator = Told()
    with pytest.raises(LeaseLost):
        attended(tmp_path, operator, lost)
    assert [prompt.kind for prompt in operator.asked] == ["load"]


def test_seats_that_are_not_as_the_slot_map_says_are_asked_for_until_somebody_stops(tmp_path: Path) -> None:
    operator = Told("go", "go", "stop")
    with pytest.raises(OperatorNeeded, match="stopped at 'confirm'"):
        attended(tmp_path, operator, fault=FaultOrder(kind="swapped_slots", serial="A1"))
    assert [prompt.kind for prompt in operator.asked] == ["load", "confirm", "confirm"]
    assert "slot 0: 'A2' sits there, 'A1' is needed; slot 1: 'A1' sits there" in operator.asked[1].text


@pytest.mark.slow
def test_trouble_is_asked_about_and_the_run_goes_on_behind_its_last_record(tmp_path: Path) -> None:
    class Blocked(CaptureDouble):
        def __call__(self, job, records, progress):
            if not records.finished():
                self.stop_after = 3
                try:
                    super().__call__(job, records, progress)
                except BaseException as stopped:
                    self.stop_after = 10**6
                    raise OperatorNeeded("reader: the chamber's door is open") from stopped
            super().__call__(job, records, progress)

    operator, measure = Told(), Blocked()
    attended(tmp_path, operator, measure)
    assert [prompt.kind for prompt in operator.asked] == ["load", "trouble", "unload"]
    assert measure.measured == sorted(set(measure.measured))


def run_at_a_terminal(folder: Path, typed: str, *options: str) -> tuple[int, str, str]:
    words = ("run", recipe_file(folder, *BRIEF), "--direct", "--ask", "--archive", folder / "archive")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", io.StringIO(typed))
        return given(*words, *options)


def test_a_terminal_is_asked_and_may_stop_and_a_scanner_types_the_serials(tmp_path: Path, monkeypatch) -> None:
    status, out, err = run_at_a_terminal(tmp_path, "S1\nS2\n\n\n\n\n\n\n\n\n", "--units", "scan", "--json")
    assert status in (0, 1), err
    units = typed_document("run", out)["units"]
    assert [unit["unit"] for unit in units] == ["S1", "S2"]
    for words in ("slot  0:", "Load", "Unload", "slot  1  S2"):
        assert words in err
    for unit in units:
        assert f"slot {unit['slot']:>2}  {unit['unit']}  {unit['outcome']}" in err[err.index("Unload") :]
    (tmp_path / "stopped").mkdir()
    assert run_at_a_terminal(tmp_path / "stopped", "stop\n")[0] == 3  # an operator who stops: nothing is measured
    assert not list((tmp_path / "stopped").glob("archive/captures/*/0*"))
    monkeypatch.setattr("sys.stdin", io.StringIO("\n\n"))
    with pytest.raises(Exception, match="no unit was scanned"):
        scanned(2)


@pytest.mark.slow
def test_a_lot_larger_than_the_fixture_is_measured_filling_by_filling(tmp_path: Path) -> None:
    text = (ROOT / "stations" / "simulated.toml").read_text(encoding="utf-8")
    assert text.count("[devices.slots]\n") == 1
    station = tmp_path / "two.toml"
    station.write_text(text.replace("[devices.slots]\n", "[devices.slots]\ncount = 2\n"), encoding="utf-8")
    options = ("--units", "S0,S1,S2", "--station", str(station), "--json")
    status, out, err = run_at_a_terminal(tmp_path, "\n" * 4, *options)
    assert status in (0, 1), err
    fillings = typed_document("run", out)["fillings"]
    assert [[unit["unit"] for unit in one["units"]] for one in fillings] == [["S0", "S1"], ["S2"]]
    assert err.count("Load") == err.count("Unload") == 2
