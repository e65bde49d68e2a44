"""Flows without a server: the start of a deployed run, runs of a schedule that come too late, and what a night tells."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from types import SimpleNamespace

import pytest
from each import each

from pipelines.demo.archive_lots import Line, write_lots
from pipelines.flows import calibrate, discover
from pipelines.monitoring.alerts import alerts_of


def running(monkeypatch: pytest.MonkeyPatch, **about: object) -> None:
    """A flow run with these properties, in place of Prefect's."""
    base = {"id": "fffffff0-0000-4000-8000-000000000000", "tags": [], "run_count": 1, "scheduled_start_time": None}
    monkeypatch.setattr(calibrate, "flow_run", SimpleNamespace(**base | about))


@each([("fffffff0-0000", 2**28 - 1), ("00000001-0000", 0), ("12345678-0", 0x1234567)])
def test_a_deployed_run_measures_anew_whatever_its_id_is(row: tuple[str, int], monkeypatch: pytest.MonkeyPatch) -> None:
    running(monkeypatch, id=row[0])
    asked = calibrate.requested("production", None, ["A1"], None, None, None, None)
    assert asked.repeat == asked.job().lot.repeat == row[1]


LATE = [  # minutes after its time, tags, how often it began, what is told
    (16, ["auto-scheduled"], 1, "missed: it starts 16 min after its time, at most 15 min are allowed"),
    (14, ["auto-scheduled"], 1, ""),
    (600, [], 1, ""),  # an order of a person
    (600, ["auto-scheduled"], 2, ""),  # continues after a crash
    (40, ["auto-scheduled", "latest_start_min=30"], 1, "at most 30 min are allowed"),
]


@each(LATE)
def test_a_run_of_a_schedule_that_comes_too_late_measures_nothing(
    row: tuple[int, list[str], int, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    minutes, tags, count, told = row
    due = datetime.now(UTC) - timedelta(minutes=minutes)
    running(monkeypatch, tags=tags, run_count=count, scheduled_start_time=due)
    assert told in calibrate.late_start() if told else calibrate.late_start() == ""


def test_of_missed_runs_that_a_worker_took_before_the_rules_only_the_newest_measures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    about = {"scheduled_start_time": datetime.now(UTC) - timedelta(hours=10), "deployment_id": "aaaaaaaa-0000"}
    running(monkeypatch, tags=["auto-scheduled", "missed=latest"], **about)
    asked: list[tuple[str, datetime]] = []
    for newer, told in (("", ""), ("swift-hare", "run swift-hare of the same deployment is newer")):
        monkeypatch.setattr(calibrate, "newer_run", lambda *about, newer=newer: asked.append(about) or newer)
        assert told in calibrate.late_start() if told else calibrate.late_start() == ""
    assert asked == [("aaaaaaaa-0000", about["scheduled_start_time"])] * 2


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
    row = {"id": "D1", "effects": ["third_order"], "driver": "wafer", "drivers": ["wafer"], "size_ug": 0.4}
    unknown = {"id": "D2", "driver": "slot", "since": "2026-01-02", "map": [], "nearest": "magnetic"}
    row["since"] = "2026-01-01"
    content = json.loads(document.read_text("utf-8")) | {"discoveries": [row], "unexplained": [unknown]}
    document.write_text(json.dumps(content), encoding="utf-8")
    snapshot = type("Empty", (), {"when": datetime.now(UTC), "runs": [], "stations": None, "late": []})()
    monkeypatch.setattr("pipelines.monitoring.alerts._of_runs", lambda _: [])
    alert, other = alerts_of(snapshot, tmp_path / "pages")
    assert [(one["kind"], one["subject"]) for one in (alert, other)] == [("discovery", "wafer"), ("discovery", "slot")]
    assert "third_order by wafer, rms 0.4 µg" in alert["text"]
    assert other["text"] == "discovery D2: unexplained by slot, no effect of the catalogue explains it"
