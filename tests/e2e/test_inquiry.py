"""The closed loop on the simulated station: what is measured besides, how it goes on, who approves it, and where it is kept."""

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import inquiries
import numpy as np
import pytest
from in_process import document_of, given, refused, text_of, typed_document
from root_process import ROOT

from pipelines.archive import Archive
from pipelines.inquiry.inquiry import FollowUp, Inquiry
from pipelines.inquiry.lineage import JointDiagnosis
from pipelines.inquiry.loop import Consent, InquirySettings, Participants, run_inquiry
from pipelines.jobs.job import job_of_run
from pipelines.rerun.selection import selected
from schemas.errors import WrongUse

CUBIC = {"hardening": 150e-6}
HUMID = "covariate:humidity_pct"

slow = pytest.mark.slow


def played(
    folder: Path, participants: Participants | None = None, settings: InquirySettings | None = None, **job: object
) -> dict:
    folder.mkdir(exist_ok=True)
    asked = inquiries.job_of(folder, **(job or CUBIC))
    everybody = participants or Participants()
    return run_inquiry(asked, Archive(folder / "archive"), settings or InquirySettings(), everybody)


@pytest.fixture(scope="module")
def told_apart(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    folder = tmp_path_factory.mktemp("inquiry")
    return folder, played(folder)


@slow
def test_an_ambiguous_run_is_told_apart_by_a_follow_up_of_the_same_devices_on_the_same_clock(
    told_apart: tuple[Path, dict],
) -> None:
    document = told_apart[1]
    assert (document["ended"], document["recommended"]) == ("told_apart", ["third_order"])
    assert 0.0 < document["minutes"]["follow_ups"] <= document["minutes"]["budget"]
    first = document["rounds"][0]
    assert "third_order" in first["why"][0]
    assert first["minutes"] == pytest.approx(first["planned_minutes"], rel=0.15)
    archive = Archive(told_apart[0] / "archive")
    first, second = (archive.run(name) for name in document["runs"][:2])
    assert second.about["parents"] == [first.id]
    ended = (first.table("readings")["start_s"] + first.table("readings")["duration_s"]).max()
    later = second.table("readings")
    assert ended < later["start_s"].min() < ended + 60.0
    assert (later["since_power_s"] > first.table("readings")["since_power_s"].max()).all()
    biases = [_bias(run.table("dwells")) for run in (first, second)]
    assert biases[1] == pytest.approx(biases[0], abs=4e-3)


def _bias(dwells: object) -> np.ndarray:
    """Bias of each axis of the first unit in g, the response taken as one."""
    own = dwells[dwells["unit"] == "A1"]
    return np.array([np.mean(own[f"out_{a}"] / 256000.0 - own[f"force_{a}"]) for a in "xyz"])


@slow
def test_a_follow_up_is_reported_listed_shown_no_model_of_its_own_and_not_measured_twice(
    told_apart: tuple[Path, dict],
) -> None:
    archive = Archive(told_apart[0] / "archive")
    follower = archive.run(told_apart[1]["runs"][1])
    assert "third_order" in follower.report.read_text(encoding="utf-8")
    kept = json.loads((follower.path / "inquiry.json").read_text(encoding="utf-8"))
    assert kept["runs"][0] == told_apart[1]["run"]
    assert next(info for info in archive.runs() if info.id == follower.id).finished
    text_of("show", follower.id, "--report", "--archive", archive.root, status=0)
    document_of("show", follower.id, "--archive", archive.root)
    assert follower.id not in [entry.id for entry in selected(archive, ["all"])]
    with pytest.raises(WrongUse, match="has too few poses for a model of its own"):
        job_of_run(follower)
    folder, before = told_apart
    done = []
    again = played(folder, Participants(stage_done=done.append))  # the same inquiry again measures nothing
    assert all(one.reused for one in done)
    assert (again["runs"], again["classes"]) == (before["runs"], before["classes"])


@slow
def test_an_inquiry_that_was_killed_goes_on_and_no_finished_dwell_is_measured_twice(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = played(tmp_path / "whole")
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


@slow
def test_without_consent_or_budget_nothing_more_is_measured(tmp_path: Path) -> None:
    seen: list[FollowUp] = []

    def no(inquiry: Inquiry, joint: JointDiagnosis, follow_up: FollowUp) -> Consent:
        seen.append(follow_up)
        return "stop"

    small = played(tmp_path / "small", settings=InquirySettings(budget=0.1))
    assert (small["ended"], len(small["runs"]), "give --budget" in small["text"]) == ("budget", 1, True)
    document = played(tmp_path, Participants(approve=no))
    assert (document["ended"], len(document["runs"])) == ("declined", 1)
    assert seen[0].minutes > 0.0
    assert document["next_measurements"][0]["minutes"] > 0.0


@slow
def test_what_faces_cannot_see_is_measured_where_it_is_asked_for(tmp_path: Path) -> None:
    hidden = {"kind": "pendulous_mass", "plan": "orthogonal24", "compliance": 80e-6}
    document = played(tmp_path, settings=InquirySettings(unseen=True, budget=5.0), **hidden)
    # the table stands some microradians off in a part of its poses, and no pose is named for that
    (group,) = document["classes"]
    assert group["effects"] == ["cross_coupling"]
    assert group["p_value"] < 1e-20
    # without the three dwells that show it nothing determines it: no fold can judge it, and its evidence decides
    assert group["heldout_after_ug"] is None
    assert document["recommended"] == ["cross_coupling"]
    assert "β in 90° steps makes fx·fy zero: Kip is invisible" in document["rounds"][0]["why"][0]


def investigation(folder: Path) -> tuple[object, ...]:
    recipe, station = inquiries.recipe_file(folder), inquiries.station_file(folder, **CUBIC)
    return ("investigate", recipe, "--station", station, "--archive", folder / "archive")


@slow
def test_at_no_terminal_the_proposal_is_printed_with_the_command_that_goes_on(tmp_path: Path) -> None:
    words = (*investigation(tmp_path), "--direct")
    status, out, err = given(*words)
    assert (status, "waits for approval" in " ".join((out + err).split()), "--yes" in out + err) == (1, True, True)
    document = document_of(*words, "--yes", status=0)
    assert (document["recommended"], document["command"]) == (["third_order"], None)


@slow
def test_a_flow_waits_for_approval_and_goes_on_when_it_is_given(tmp_path: Path) -> None:
    environment = {k: v for k, v in os.environ.items() if not k.startswith("PREFECT_")}
    command = [sys.executable, "-m", "pipelines.cli"]
    words = [*command, *map(str, investigation(tmp_path)), "--ask", "--json"]
    pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process = subprocess.Popen(words, cwd=ROOT, env=environment, **pipes)
    operator = [*command, "station", "operator", "--archive", str(tmp_path / "archive"), "--json"]

    def asked(*more: str) -> subprocess.CompletedProcess[str]:
        own = {"cwd": ROOT, "env": environment, "capture_output": True, "text": True}
        return subprocess.run([*operator, *more], check=False, timeout=60, **own)

    try:
        end, waiting = time.monotonic() + 150.0, []
        while not waiting and time.monotonic() < end and process.poll() is None:
            done = asked()
            waiting = typed_document("station", done.stdout)["waiting"] if done.returncode == 0 else []
        assert "approve: measure " in waiting[0]["question"]
        assert "third_order" in waiting[0]["question"]
        for _ in range(6):
            with suppress(subprocess.TimeoutExpired):
                asked("--answer", "go")
                process.wait(10.0)
                break
        output, errors = process.communicate(timeout=120)
    finally:
        if process.poll() is None:
            process.kill()
            process.communicate()
    assert process.returncode == 0, errors
    document = typed_document("investigate", output)
    assert document["recommended"] == ["third_order"]
    assert len(document["runs"]) > 1


def test_a_model_with_a_column_that_the_station_does_not_record_is_refused_before_anything_moves(
    tmp_path: Path,
) -> None:
    recipe = inquiries.recipe_file(tmp_path)
    text = recipe.read_text(encoding="utf-8")
    recipe.write_text(text.replace('"misalignment"]', f'"misalignment", "{HUMID}"]'), encoding="utf-8")
    assert "humidity_pct" in refused("run", recipe, "--direct", "--archive", tmp_path / "nothing")
    assert not list((tmp_path / "nothing").glob("captures/*"))
