"""The closed loop on the simulated station: what is measured besides, how it goes on, who approves it, and where it is kept."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import inquiries
import numpy as np
import pytest
from pydantic import TypeAdapter
from typer.testing import CliRunner

from pipelines.archive import Archive
from pipelines.cli import app
from pipelines.cli.documents.station import OperatorDocument
from pipelines.inquiry.documents import InquiryDocument
from pipelines.inquiry.inquiry import FollowUp, Inquiry
from pipelines.inquiry.lineage import JointDiagnosis
from pipelines.inquiry.loop import Consent, InquirySettings, Participants, run_inquiry
from pipelines.rerun.selection import selected
from schemas.errors import WrongUse

ROOT = Path(__file__).resolve().parents[2]
CUBIC = {"hardening": 150e-6}


def played(
    folder: Path, participants: Participants | None = None, settings: InquirySettings | None = None, **job: object
) -> dict:
    wanted = job or CUBIC
    return run_inquiry(
        inquiries.job_of(folder, **wanted),
        Archive(folder / "archive"),
        settings or InquirySettings(),
        participants or Participants(),
    )


@pytest.fixture(scope="module")
def told_apart(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("inquiry")
    return folder, played(folder)


@pytest.mark.slow
def test_an_ambiguous_run_is_told_apart_by_a_follow_up_within_the_budget(told_apart: tuple[Path, dict]) -> None:
    document = told_apart[1]
    assert document["ended"] == "told_apart"
    assert document["recommended"] == ["third_order"]
    assert len(document["runs"]) > 1
    assert 0.0 < document["minutes"]["follow_ups"] <= document["minutes"]["budget"]
    first = document["rounds"][0]
    assert "third_order" in first["why"][0]
    assert "0.71" in first["why"][0]
    assert first["minutes"] == pytest.approx(first["planned_minutes"], rel=0.15)


@pytest.mark.slow
def test_follow_ups_go_on_with_the_same_devices_on_the_same_clock(told_apart: tuple[Path, dict]) -> None:
    archive = Archive(told_apart[0] / "archive")
    first, second = (archive.run(name) for name in told_apart[1]["runs"][:2])
    assert second.about["parents"] == [first.id]
    ended = (first.table("readings")["start_s"] + first.table("readings")["duration_s"]).max()
    later = second.table("readings")
    assert later["start_s"].min() > ended
    assert later["start_s"].min() < ended + 60.0
    assert (later["since_power_s"] > first.table("readings")["since_power_s"].max()).all()
    biases = [_bias(run.table("dwells")) for run in (first, second)]
    assert biases[1] == pytest.approx(biases[0], abs=4e-3)


def _bias(dwells: object) -> np.ndarray:
    """Bias of each axis of the first unit in g, the response taken as one."""
    own = dwells[dwells["unit"] == "A1"]
    return np.array([np.mean(own[f"out_{a}"] / 256000.0 - own[f"force_{a}"]) for a in "xyz"])


@pytest.mark.slow
def test_a_follow_up_has_a_report_and_is_listed_and_shown(told_apart: tuple[Path, dict]) -> None:
    archive = Archive(told_apart[0] / "archive")
    follower = archive.run(told_apart[1]["runs"][1])
    assert "third_order" in follower.report.read_text(encoding="utf-8")
    kept = json.loads((follower.path / "inquiry.json").read_text(encoding="utf-8"))
    assert kept["runs"][0] == told_apart[1]["run"]
    assert next(info for info in archive.runs() if info.id == follower.id).finished
    reported = CliRunner().invoke(app, ["report", follower.id, "--archive", str(archive.root)])
    assert reported.exit_code == 0, reported.output
    assert follower.id not in [entry.id for entry in selected(archive, ["all"])]
    shown = CliRunner().invoke(app, ["show", follower.id, "--archive", str(archive.root), "--json"])
    assert shown.exit_code in (0, 1), shown.output


@pytest.mark.slow
def test_a_follow_up_is_no_model_of_its_own(told_apart: tuple[Path, dict]) -> None:
    from pipelines.jobs.job import job_of_run

    archive = Archive(told_apart[0] / "archive")
    with pytest.raises(WrongUse, match="has too few poses for a model of its own"):
        job_of_run(archive.run(told_apart[1]["runs"][1]))


@pytest.mark.slow
def test_the_same_inquiry_again_measures_nothing(told_apart: tuple[Path, dict]) -> None:
    folder, before = told_apart
    done = []
    again = played(folder, Participants(stage_done=done.append))
    assert all(one.reused for one in done)
    assert again["runs"] == before["runs"]
    assert again["classes"] == before["classes"]


@pytest.mark.slow
def test_an_inquiry_that_was_killed_goes_on_and_no_finished_dwell_is_measured_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = played(tmp_path / "whole") if (tmp_path / "whole").mkdir() is None else {}
    (tmp_path / "killed").mkdir()
    monkeypatch.setattr("pipelines.archive.archive.Records", inquiries.Dying)
    monkeypatch.setattr(inquiries.Dying, "left", 20)  # 18 records of the first run, two of the follow-up
    with pytest.raises(inquiries.PulledPlug):
        played(tmp_path / "killed")
    monkeypatch.setattr(inquiries.Dying, "left", 10**9)
    archive = Archive(tmp_path / "killed" / "archive")
    follower = next(i.id for i in archive.runs() if archive.run(i.id).about.get("parents"))
    stored = archive.capture(archive.run(follower).about["capture"])
    times = {k: (stored.path / f"{k:05d}" / "record.json").stat().st_mtime_ns for k in stored.finished()}
    assert set(times) == {0, 1}
    asked = []
    document = played(tmp_path / "killed", Participants(approve=lambda *_: asked.append(1) or "go"))
    assert all((stored.path / f"{k:05d}" / "record.json").stat().st_mtime_ns == t for k, t in times.items())
    assert len(asked) == len(document["rounds"]) - 1
    assert document["runs"] == whole["runs"]
    assert document["classes"] == whole["classes"]


@pytest.mark.slow
def test_without_consent_nothing_more_is_measured(tmp_path: Path) -> None:
    seen: list[FollowUp] = []

    def no(inquiry: Inquiry, joint: JointDiagnosis, follow_up: FollowUp) -> Consent:
        seen.append(follow_up)
        return "stop"

    document = played(tmp_path, Participants(approve=no))
    assert document["ended"] == "declined"
    assert len(document["runs"]) == 1
    assert seen[0].minutes > 0.0
    assert document["next_measurements"][0]["minutes"] > 0.0


@pytest.mark.slow
def test_a_budget_that_is_too_small_says_what_it_takes(tmp_path: Path) -> None:
    document = played(tmp_path, settings=InquirySettings(budget=0.1))
    assert document["ended"] == "budget"
    assert "give --budget" in document["text"]
    assert len(document["runs"]) == 1


@pytest.mark.slow
def test_what_faces_cannot_see_is_measured_where_it_is_asked_for(tmp_path: Path) -> None:
    hidden = {"kind": "pendulous_mass", "plan": "orthogonal24", "compliance": 80e-6}
    document = played(tmp_path, settings=InquirySettings(unseen=True, budget=5.0), **hidden)
    # the table stands some microradians off in a part of its poses, and no pose is named for that
    (group,) = document["classes"]
    assert group["effects"] == ["cross_coupling"]
    assert group["p_value"] < 1e-20
    # without the three dwells that show it nothing determines it: no fold can judge it, so it is named and not recommended
    assert group["heldout_after_ug"] is None
    assert document["recommended"] == []
    assert "not recommended yet: cross_coupling" in document["text"]
    assert "β in 90° steps makes fx·fy zero: Kip is invisible" in document["rounds"][0]["why"][0]


@pytest.mark.slow
def test_at_no_terminal_the_proposal_is_printed_with_the_command_that_goes_on(tmp_path: Path) -> None:
    recipe, station = inquiries.recipe_file(tmp_path), inquiries.station_file(tmp_path, **CUBIC)
    given = ["investigate", str(recipe), "--station", str(station), "--archive", str(tmp_path / "archive"), "--direct"]
    waiting = CliRunner().invoke(app, given)
    assert waiting.exit_code == 1, waiting.output
    assert "waits for approval" in " ".join(waiting.output.split())
    assert "--yes" in waiting.output
    done = CliRunner().invoke(app, [*given, "--yes", "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    TypeAdapter(InquiryDocument).validate_json(done.stdout, strict=True, extra="forbid")
    assert document["recommended"] == ["third_order"]
    assert document["command"] is None


@pytest.mark.slow
def test_a_flow_waits_for_approval_and_goes_on_when_it_is_given(tmp_path: Path) -> None:
    recipe, station = inquiries.recipe_file(tmp_path), inquiries.station_file(tmp_path, **CUBIC)
    archive = tmp_path / "archive"
    given = ["investigate", str(recipe), "--station", str(station), "--archive", str(archive), "--ask", "--json"]
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PREFECT_")}
    command = [sys.executable, "-m", "pipelines.cli"]
    process = subprocess.Popen(
        [*command, *given], cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    operator = [*command, "operator", "--archive", str(archive), "--json"]
    try:
        question = _asked(operator, process, environment)
        assert "approve: measure " in question
        assert "third_order" in question
        rounds = 0
        while process.poll() is None and rounds < 6:
            subprocess.run([*operator, "--go"], cwd=ROOT, env=environment, capture_output=True, check=False, timeout=60)
            rounds += 1
            _wait(process, 10.0)
        output, errors = process.communicate(timeout=120)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    assert process.returncode == 0, errors
    document = json.loads(output)
    assert document["recommended"] == ["third_order"]
    assert len(document["runs"]) > 1


def _asked(operator: list[str], process: subprocess.Popen, environment: dict[str, str]) -> str:
    """What the flow run asks, as soon as it does."""
    end = time.monotonic() + 150.0
    while time.monotonic() < end and process.poll() is None:
        done = subprocess.run(
            operator, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=60
        )
        if done.returncode == 0:
            TypeAdapter(OperatorDocument).validate_json(done.stdout, strict=True, extra="forbid")
        waiting = json.loads(done.stdout)["waiting"] if done.returncode == 0 else []
        if waiting:
            return waiting[0]["question"]
    _, errors = process.communicate(timeout=10)
    raise AssertionError(errors)


def _wait(process: subprocess.Popen, seconds: float) -> None:
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        return
