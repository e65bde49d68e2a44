"""Runs of the archive again: only what changed, into a new run, the same bytes from the same code."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from capture_double import CaptureDouble, measured_run, small_job, small_run
from each import each
from long_suites import mostly_slow

from pipelines.archive import Archive, Run, code_hash
from pipelines.archive.buffered_run import BufferedRun
from pipelines.integrity import verify
from pipelines.jobs.model_change import ModelChange, change_from_options
from pipelines.rerun import import_steps, steps
from pipelines.rerun.partition import Batch, run_again
from pipelines.rerun.reproduce import LEFT_OUT, SAME, check
from pipelines.rerun.rerun import RerunOutcome, again
from pipelines.rerun.selection import entries, selected
from schemas.errors import DataRejected, WrongUse

LARGER = "bias,scale,misalignment,bias_temperature,scale_temperature,third_order"


@pytest.fixture
def run(tmp_path: Path) -> Run:
    return small_run(tmp_path)


def hashes(run: Run) -> dict[str, str]:
    return {name: run.manifest(name)["sha256"] for name in run.tables()}


def computed(outcome: RerunOutcome) -> list[str]:
    return [name for name, how in outcome.stages.items() if how == "computed"]


def other_code(monkeypatch: pytest.MonkeyPatch, *stages: str) -> None:
    """As if the code of these stages had been changed."""
    monkeypatch.setattr(import_steps, "code_hash", lambda m: "f" * 64 if m in stages else code_hash(m))


def finished(run: Run, outcome: RerunOutcome) -> Run:
    """The new run, which is finished in the list and has no finding."""
    new = run.archive.run(outcome.new)
    assert {info.id: info.finished for info in run.archive.runs()}[new.id]
    report = verify(run.archive, keys={}).checked
    assert report.findings == []
    assert [remark for remark in report.remarks if new.id in remark] == []
    return new


def test_other_limits_only_grade_again(run: Run) -> None:
    before = hashes(run)
    outcome = again(run.archive, run.id, change_from_options(limits="industrial"))
    new = finished(run, outcome)
    assert outcome.new != run.id
    assert computed(outcome) == ["grade"]
    assert new.about["rerun_of"] == run.id
    assert [(b["stage"], b["what"], b["to"]) for b in new.about["because"]] == [("grade", "limits", "industrial")]
    assert new.about["limits"]["name"] == "industrial"
    assert hashes(run) == before


@pytest.mark.slow
def test_another_model_begins_at_the_fit_and_gives_the_bytes_of_a_first_run_with_it(run: Run, tmp_path: Path) -> None:
    outcome = again(run.archive, run.id, change_from_options(effects=LARGER))
    new = finished(run, outcome)
    assert computed(outcome) == ["fit", "judge", "verify", "noise", "soak_noise", "procedures", "budget", "grade"]
    assert "third_order" in set(new.table("coefficients")["effect"])
    assert new.manifest("dwells")["taken_from"] == run.id
    assert outcome.because[0]["what"] == "model"
    (tmp_path / "first").mkdir()
    job = small_job(tmp_path / "first", ('"scale_temperature"]', '"scale_temperature", "third_order"]'))
    first = measured_run(job, Archive(tmp_path / "first" / "archive"), CaptureDouble())
    assert hashes(new) == hashes(first)
    assert outcome.new == first.id
    # interrupted by an older version before it was sealed: all stages are there, the chain does not name it
    (new.path / "sealed.json").unlink()
    shutil.rmtree(run.archive.root / "chain")
    assert set(again(run.archive, run.id, change_from_options(effects=LARGER)).stages.values()) == {"there"}
    assert (new.path / "sealed.json").is_file()


def test_changed_code_of_one_stage_leaves_the_stages_before_it(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    other_code(monkeypatch, "verify")
    outcome = again(run.archive, run.id, ModelChange())
    assert computed(outcome) == [
        "verify"
    ]  # its tables come out with the same bytes, so the key of the grade is the same
    assert [b["what"] for b in outcome.because] == ["code"]
    assert hashes(run.archive.run(outcome.new)) == hashes(run)


TROUBLE = (KeyboardInterrupt(), DataRejected("verify: no pose"), ValueError("a defect"))


@pytest.mark.slow
@pytest.mark.parametrize("trouble", mostly_slow(TROUBLE, TROUBLE[0]))
def test_a_rerun_that_fails_or_is_stopped_leaves_nothing(
    run: Run, monkeypatch: pytest.MonkeyPatch, trouble: BaseException
) -> None:
    change = change_from_options(effects=LARGER)
    before = sorted(run.archive.root.rglob("*"))

    def unplugged(*_args: object) -> None:
        raise trouble

    with monkeypatch.context() as patch:
        patch.setattr("pipelines.chain.chain.verify_tables", unplugged)
        with pytest.raises(type(trouble)):
            again(run.archive, run.id, change)
    assert sorted(run.archive.root.rglob("*")) == before
    assert run.archive.run("latest").id == run.id
    outcome = again(run.archive, run.id, change)
    assert outcome.stages["verify"] == "computed"
    assert verify(run.archive, keys={}).checked.findings == []


def test_two_reruns_at_once_leave_one_run(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    change, real = change_from_options(effects=LARGER), BufferedRun.begin
    others: list[str] = []

    def meanwhile(self: BufferedRun, about: dict) -> None:
        real(self, about)
        if not others:
            others.append("")
            others[0] = again(run.archive, run.id, change).new

    monkeypatch.setattr(BufferedRun, "begin", meanwhile)
    assert again(run.archive, run.id, change).new == others[0]
    assert verify(run.archive, keys={}).checked.findings == []


def test_an_old_capture_keeps_its_name_whatever_names_are_made_of_today(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pipelines.jobs.job.ANALYSIS_KEYS", set())
    outcome = again(run.archive, run.id, change_from_options(limits="industrial"))
    assert run.archive.run(outcome.new).about["capture"] == run.about["capture"]


def test_without_raw_samples_it_begins_at_the_dwells_and_a_check_says_what_it_could_not_check(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.rmtree(run.archive.root / "captures")
    comparison = check(run.archive, run.id)
    assert (comparison.tables["dwells"], comparison.tables["coefficients"]) == (LEFT_OUT, SAME)
    with pytest.raises(DataRejected, match="static record is not in the archive"):
        again(run.archive, run.id, change_from_options(effects=LARGER))
    other_code(monkeypatch, "reduce", "grade")
    outcome = again(run.archive, run.id, ModelChange())
    assert outcome.stages["reduce"] == "kept"
    assert [(b["stage"], b["what"]) for b in outcome.because] == [("grade", "code")]


def test_one_run_that_cannot_be_run_again_does_not_stop_the_others(run: Run) -> None:
    broken = run.archive.root / "runs" / "broken"
    broken.mkdir()
    about = {**run.about, "recipe": {**run.about["recipe"], "dwell_s": -1.0}}
    (broken / "run.json").write_text(json.dumps(about))
    outcomes = run_again(Batch(run.archive.address, ("broken", run.id)))
    assert "run broken: key 'dwell_s': found -1.0" in outcomes[0].error
    assert not outcomes[1].error
    (run.archive.root / "captures" / run.about["capture"] / "complete.json").unlink()
    with pytest.raises(DataRejected, match=r"its capture has \d+ records and is not finished"):
        again(run.archive, run.id, ModelChange())


def test_a_check_writes_nothing_and_names_the_table_and_the_size_of_what_differs(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = sorted(str(path) for path in run.archive.root.rglob("*"))
    (real,) = (stage.call for stage in steps.STAGES if stage.name == "verify")

    def moved(job: object, own: Run) -> dict[str, pd.DataFrame]:
        made = real(job, own)
        made["verification"].loc[3, "error_ug"] += 0.5
        return made

    changed = [replace(stage, call=moved) if stage.name == "verify" else stage for stage in steps.STAGES]
    monkeypatch.setattr(steps, "STAGES", tuple(changed))
    comparison = check(run.archive, run.id)
    assert sorted(str(path) for path in run.archive.root.rglob("*")) == before
    assert not comparison.same
    assert {name for name in run.tables() if comparison.tables[name] == SAME} >= {"dwells", "coefficients", "residuals"}
    assert all(d.startswith("verification: error_ug in 1 of ") for d in comparison.differences)
    assert "by at most 0.5" in comparison.differences[0]


def test_chooses_runs_by_what_they_are(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    new = again(run.archive, run.id, change_from_options(limits="industrial")).new
    archive = run.archive
    assert [e.id for e in selected(archive, ["latest"])] == [new] == [archive.run("latest").id]
    monkeypatch.setattr("pipelines.rerun.selection.entries", lambda store: entries(store)[::-1])  # no name decides
    assert [e.id for e in selected(archive, ["latest"])] == [new]
    assert [e.id for e in selected(archive, ["all"])] == [run.id]
    assert [e.id for e in selected(archive, ["device:ADXL355", "unit:A2"])] == [run.id]
    assert [e.id for e in selected(archive, ["since:2020-01-01", "until:2999-12-31"])] == [run.id]
    assert len(selected(archive, ["small"])) == 2


@each([
    (["colour:red"], "'colour:red' is not known"), (["device:"], "says nothing after the colon"),
    (["since:yesterday"], "'yesterday' is no date"), (["station:elsewhere"], "station: simulated"),
    (["smale"], "no run is called 'smale'; known: small-"),
    (["until:1999-12-31"], "none of 1 runs is until:1999-12-31; measured"),
])  # fmt: skip
def test_says_why_a_selection_names_nothing(row: tuple[list[str], str], run: Run) -> None:
    with pytest.raises(WrongUse, match=row[1]):
        selected(run.archive, row[0])
