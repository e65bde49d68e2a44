"""What interrupted a run at its station stands in its result and on its report."""

from pathlib import Path

import pytest
from capture_double import CaptureDouble, measured_run, small_job
from in_process import text_of

from pipelines.archive import Archive, Run
from pipelines.capture.interruptions import interruptions
from pipelines.cli.summary import summary
from pipelines.report import render
from schemas.event import Event

pytestmark = pytest.mark.usefixtures("no_verdict")
DOOR = "the chamber's door is open, closed is needed"
BACK = "thrown away; back to the last checkpoint"


class Interrupted(CaptureDouble):
    """A capture whose station had an opened door twice within one dwell, and a unit that fell silent."""

    def __call__(self, job, records, progress):
        for event in (
            Event(0.0, "reference", -1, "supplies as the run begins", "later ones are compared with them"),
            Event(100.0, "spoilt", 1, DOOR, BACK),
            Event(190.0, "resumed", 1, "gone for 30 s", "settled anew, then measured", {"paused_s": 90.0}),
            Event(300.0, "spoilt", 1, DOOR, BACK),
            Event(420.0, "resumed", 1, "gone for 30 s", "settled anew, then measured", {"paused_s": 120.0}),
            Event(500.0, "suspended", 2, "outer axis: no answer", "back to the last checkpoint"),
        ):
            records.events.note(event)
        super().__call__(job, records, progress)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    folder: Path = tmp_path_factory.mktemp("interrupted")
    return measured_run(small_job(folder), Archive(folder / "archive"), Interrupted())


def test_an_opened_door_pauses_and_repeated_dwells_are_in_the_result_on_the_report_and_at_the_terminal(
    run: Run,
) -> None:
    interrupted = summary(run)["interruptions"]
    assert (interrupted["door_opened"], interrupted["pauses"], interrupted["paused_s"]) == (2, 3, 90.0 + 120.0)
    [dwell] = interrupted["repeated_dwells"]
    assert (dwell["record"], dwell["times"], dwell["reasons"]) == (1, 2, [DOOR, DOOR])
    assert dwell["pose"] == run.table("readings").set_index("record")["pose"].loc[1].iloc[0]
    assert [event["kind"] for event in interrupted["events"]] == ["spoilt", "resumed", "spoilt", "resumed", "suspended"]
    page = render(run)
    assert "Interruptions at the station" in page
    assert "Door opened: 2" in page
    assert page.count(BACK) == 2
    shown = text_of("show", run.id, "--archive", run.archive.root)
    assert "3 pauses (3.5 min waited), the door was opened 2 times" in shown
    assert "measured again 2 times" in shown


def test_a_run_without_any_says_so_and_one_that_did_not_note_them_says_that(run: Run, monkeypatch) -> None:
    table = Run.table
    monkeypatch.setattr(Run, "table", lambda one, name: table(one, name).iloc[: 0 if name == "events" else None])
    none = {"door_opened": 0, "pauses": 0, "paused_s": 0.0, "repeated_dwells": [], "events": []}
    assert interruptions(run) == none
    assert "nothing paused the run" in render(run)
    monkeypatch.setattr(Run, "tables", lambda _self: ["grades"])
    assert interruptions(run) is None
