"""Flows without a server: the start of a deployed run, runs of a schedule that come too late, and what a night tells."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest

from pipelines.demo.archive_lots import Line, write_lots
from pipelines.flows import calibrate, discover
from pipelines.monitoring.alerts import alerts_of


def running(monkeypatch: pytest.MonkeyPatch, **about: object) -> None:
    """A flow run with these properties, in place of Prefect's."""
    base = {"id": "fffffff0-0000-4000-8000-000000000000", "tags": [], "run_count": 1, "scheduled_start_time": None}
    monkeypatch.setattr(calibrate, "flow_run", SimpleNamespace(**base | about))


@pytest.mark.parametrize(
    ("id_", "number"), [("fffffff0-0000", 2**28 - 1), ("00000001-0000", 0), ("12345678-0", 0x1234567)]
)
def test_a_deployed_run_measures_anew_whatever_its_id_is(
    monkeypatch: pytest.MonkeyPatch, id_: str, number: int
) -> None:
    running(monkeypatch, id=id_)
    asked = calibrate.requested("production", None, ["A1"], None, None, None, None)
    assert asked.repeat == number
    assert asked.job().lot.repeat == number


@pytest.mark.parametrize(
    ("minutes", "tags", "count", "told"),
    [
        (16, ["auto-scheduled"], 1, "missed: it starts 16 min after its time, at most 15 min are allowed"),
        (14, ["auto-scheduled"], 1, ""),
        (600, [], 1, ""),  # an order of a person
        (600, ["auto-scheduled"], 2, ""),  # continues after a crash
        (40, ["auto-scheduled", "latest_start_min=30"], 1, "at most 30 min are allowed"),
    ],
)
def test_a_run_of_a_schedule_that_comes_too_late_measures_nothing(
    monkeypatch: pytest.MonkeyPatch, minutes: int, tags: list[str], count: int, told: str
) -> None:
    due = datetime.now(UTC) - timedelta(minutes=minutes)
    running(monkeypatch, tags=tags, run_count=count, scheduled_start_time=due)
    assert told in calibrate.late_start() if told else calibrate.late_start() == ""


@pytest.mark.parametrize(
    ("newer", "told"), [("", ""), ("swift-hare", "run swift-hare of the same deployment is newer")]
)
def test_of_missed_runs_that_a_worker_took_before_the_rules_only_the_newest_measures(
    monkeypatch: pytest.MonkeyPatch, newer: str, told: str
) -> None:
    due = datetime.now(UTC) - timedelta(hours=10)
    tags = ["auto-scheduled", "missed=latest"]
    running(monkeypatch, tags=tags, scheduled_start_time=due, deployment_id="aaaaaaaa-0000-4000-8000-000000000000")
    asked: list[tuple[str, datetime]] = []
    monkeypatch.setattr(calibrate, "newer_run", lambda *about: asked.append(about) or newer)
    assert told in calibrate.late_start() if told else calibrate.late_start() == ""
    assert asked == [("aaaaaaaa-0000-4000-8000-000000000000", due)]


def test_a_night_writes_page_and_document_and_a_discovery_is_an_alert(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = write_lots(tmp_path, Line(2), 3)
    told: list[str] = []
    monkeypatch.setattr(discover, "create_markdown_artifact", lambda key, markdown: told.append(markdown))
    monkeypatch.setattr(discover, "look", discover.look.fn)
    assert discover.discover_in_archive.fn(str(made.folder), pages=str(tmp_path / "pages")) == 0
    assert "0 discoveries in 3 lots" in told[0]
    page, document = sorted((tmp_path / "pages").iterdir())
    assert page.suffix == ".html"
    row = {
        "id": "D1",
        "effects": ["third_order"],
        "drivers": ["wafer"],
        "driver": "wafer",
        "size_ug": 0.4,
        "since": "2026-01-01",
    }
    unknown = {"id": "D2", "driver": "slot", "since": "2026-01-02", "map": [], "nearest": "magnetic"}
    content = json.loads(document.read_text("utf-8")) | {"discoveries": [row], "unexplained": [unknown]}
    document.write_text(json.dumps(content), encoding="utf-8")
    snapshot = type("Empty", (), {"when": datetime.now(UTC), "runs": [], "stations": None, "late": []})()
    monkeypatch.setattr("pipelines.monitoring.alerts._of_runs", lambda _: [])
    alert, other = alerts_of(snapshot, tmp_path / "pages")
    assert (alert["kind"], alert["subject"]) == ("discovery", "wafer")
    assert "third_order by wafer, rms 0.4 µg" in alert["text"]
    assert (other["kind"], other["subject"]) == ("discovery", "slot")
    assert other["text"] == "discovery D2: unexplained by slot, no effect of the catalogue explains it"
