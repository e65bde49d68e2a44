"""Monitoring: numbers of archive, orchestrator and stations, their text for Prometheus, health, and alerts to a web hook."""

import json
import re
import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
import yaml
from asgi_client import AsgiClient
from capture_double import small_run
from each import each
from in_process import given
from prometheus_client.parser import text_string_to_metric_families
from root_process import ROOT

from pipelines.archive import Archive, files
from pipelines.cli.printing import remark
from pipelines.monitoring import snapshot as snapshots
from pipelines.monitoring.alerts import Poster, alerts_of
from pipelines.monitoring.archive_numbers import ArchiveNumbers, ArchiveReader, LineNumbers, RunTime
from pipelines.monitoring.exposition import text
from pipelines.monitoring.queue_numbers import OpenRun, QueueNumbers
from pipelines.monitoring.service import alerting, application
from pipelines.monitoring.snapshot import Monitor, Snapshot, StationNumbers, read_stations
from schemas.errors import WrongUse
from schemas.log_lines import log_line
from stations.safety.lease_files import lease_file, new_holder, write_holder

DEPLOY = ROOT / "deploy" / "monitoring"
NOW = datetime(2026, 6, 1, 12, tzinfo=UTC)
NAME = r"[a-zA-Z_:][a-zA-Z0-9_:]*"
SAMPLE = re.compile(rf'{NAME}(\{{{NAME}="(\\.|[^"\\\n])*"(,{NAME}="(\\.|[^"\\\n])*")*\}})? (\S+)')


def run(state: str, minutes_ago: float, name: str = "a-run", message: str = "", queue: str = "line-1") -> OpenRun:
    return OpenRun(f"id-{name}", name, queue, state, NOW - timedelta(minutes=minutes_ago), message, 1)


def full(**changes: object) -> Snapshot:
    """A snapshot in which every family has a sample; its names need escapes."""
    times = RunTime(station_s=7200.0, pauses=2, paused_s=60.0, repeated=1, door=1)
    numbers = ArchiveNumbers({('st "1"\\x', "line\nsix"): LineNumbers(3, 1, 20, 4, NOW, times)})
    numbers.free_bytes, numbers.certified, numbers.due = 10**11, 24, {0: 2, 30: 5}
    queues = QueueNumbers([run("RUNNING", 20)], [], {"line-1": False}, {"line-1 on host": True})
    stations = StationNumbers({"line-1"}, {}, Counter({("line-1", "watchdog_safe"): 2}))
    content = {"archive": numbers, "queues": queues, "stations": stations, "faults": {"archive": ""}} | changes
    return Snapshot(NOW, 30, **content)


def families(data: bytes) -> dict[str, list]:
    return {family.name: family.samples for family in text_string_to_metric_families(data.decode())}


def test_the_numbers_are_in_the_format_of_prometheus() -> None:
    data = text(full())
    for line in data.decode().splitlines():
        assert line.startswith(("# HELP tumbleline_", "# TYPE tumbleline_")) or SAMPLE.fullmatch(line), line
    metrics = families(data)
    passed = [one for one in metrics["tumbleline_units"] if one.labels["outcome"] == "passed"]
    assert [(one.labels["station"], one.labels["recipe"], one.value) for one in passed] == [
        ('st "1"\\x', "line\nsix", 20.0)
    ]
    assert metrics["tumbleline_yield_ratio"][0].value == pytest.approx(20 / 24)
    assert {one.labels["within_days"]: one.value for one in metrics["tumbleline_units_due"]} == {"0": 2.0, "30": 5.0}
    assert metrics["tumbleline_healthy"][0].value == 1.0


def test_every_metric_of_dashboard_and_rules_exists_with_the_labels_that_they_name() -> None:
    dashboard = json.loads((DEPLOY / "dashboard.json").read_text(encoding="utf-8"))
    rules = yaml.safe_load((DEPLOY / "rules.yaml").read_text(encoding="utf-8"))
    metrics = families(text(full()))
    targets = [(p["title"], t["expr"], t["legendFormat"]) for p in dashboard["panels"] for t in p["targets"]]
    targets += [(r["alert"], r["expr"], r["annotations"]["summary"]) for g in rules["groups"] for r in g["rules"]]
    assert len(targets) >= 20
    for title, expression, shown in targets:
        names = re.findall(r"tumbleline_[a-z_]+", expression)
        assert names, title
        assert [name for name in names if name not in metrics] == [], title
        labels = set(metrics[names[0]][0].labels) | {"instance"}
        used = re.findall(r"\{\{\s*(?:\$labels\.)?([a-z_]+)", shown)
        used += [label for group in re.findall(r"by \(([^)]*)\)", expression) for label in group.split(", ")]
        used += re.findall(r'([a-z_]+)="', expression)
        assert set(used) - {"value"} <= labels, title
    shown = {name for _, expression, _ in targets for name in re.findall(r"tumbleline_[a-z_]+", expression)}
    left = {"tumbleline_info", "tumbleline_window_days", "tumbleline_source_up", "tumbleline_queue_paused"}
    left |= {"tumbleline_archive_lag_seconds", "tumbleline_station_driven", "tumbleline_station_events"}
    left |= {"tumbleline_last_run_timestamp_seconds"}
    assert set(metrics) - shown == left, "a metric that nothing shows"
    assert all(panel["fieldConfig"]["defaults"]["unit"] for panel in dashboard["panels"])


def test_the_numbers_of_an_archive_are_those_of_its_tables(tmp_path: Path) -> None:
    made = small_run(tmp_path, {"A2": "stuck"})
    reader = ArchiveReader(Archive(tmp_path / "archive"), 30)
    [(key, line)] = reader.read().lines.items()
    assert key[1] == "small"
    assert (line.finished, line.unfinished) == (0, 1)
    made.save_report("key", "<html></html>", {})
    grades = made.table("grades")["outcome"]
    numbers = reader.read()
    line = numbers.lines[key]
    assert (line.finished, line.unfinished) == (1, 0)
    assert (line.passed, line.failed) == ((grades == "pass").sum(), (grades != "pass").sum())
    assert line.failed >= 1
    assert line.times.station_s == pytest.approx(made.table("dwells")["time_s"].max())
    assert numbers.unsealed == 0
    (made.path / "sealed.json").unlink()
    end = datetime.fromisoformat(files.read_json(made.path / "report.json")["when"])

    def read_after(**time: float) -> ArchiveNumbers:
        return ArchiveReader(Archive(tmp_path / "archive"), 30).read(end + timedelta(**time))

    assert read_after(hours=2).unsealed == 1
    assert read_after(seconds=7.0).lag_s == pytest.approx(7.0), "the lag begins with the end of the run"
    assert read_after(days=31).lines == {}, "outside of the window"


def test_a_station_that_was_not_left_safe_is_told_and_a_driven_one_is_not(tmp_path: Path) -> None:
    (tmp_path / "leases").mkdir()
    here = new_holder("line-1", "run-1")
    write_holder(lease_file(tmp_path, "tcp:1"), here)
    dead = type(here)(**{**here.__dict__, "station": "line-2", "pid": 2**22 + 1, "run": "run-2"})
    write_holder(lease_file(tmp_path, "tcp:2"), dead)
    stations = read_stations(tmp_path)
    assert stations.driven == {"line-1"}
    assert list(stations.unsafe) == ["line-2"]
    assert "run-2" in stations.unsafe["line-2"]


@each([
    ({"queues": QueueNumbers([run("SCHEDULED", 10)], [], {"line-1": False}, {})}, "was due at 11:50 UTC"),
    ({"stations": StationNumbers(set(), {"line-1": "run-1"})}, "station line-1: not reported safe after run-1"),
    ({"faults": {"archive": "holds no archive"}, "archive": None}, "archive: holds no archive"),
    ({"archive": ArchiveNumbers(free_bytes=10**6), "least_free_bytes": 1e9}, "0.0 GB are free"),
    ({"archive": ArchiveNumbers(unsealed=2, lag_s=7200.0)}, "2 finished runs are not in the hash chain"),
    ({"expected": ("line-2",)}, "queue line-2: no worker is online"),
])  # fmt: skip
def test_what_needs_a_person_is_told_and_is_unhealthy(row: tuple[dict, str]) -> None:
    taken = full(**row[0])
    assert not taken.ok
    [problem] = taken.problems
    assert row[1] in problem
    assert families(text(taken))["tumbleline_healthy"][0].value == 0.0
    waiting = QueueNumbers([run("SCHEDULED", 60), run("RUNNING", 90, "other")], [], {"line-1": False}, {})
    assert full(queues=waiting).ok, "a run that waits for a busy station is not late"


class _Fixed(Monitor):
    """A monitor whose snapshot the test gives."""

    def __init__(self, taken: Snapshot) -> None:
        self.taken = taken

    def snapshot(self) -> Snapshot:
        return self.taken


def test_the_service_answers_prometheus_and_health_checks() -> None:
    monitor = _Fixed(full())
    client = AsgiClient(application(monitor), "http://127.0.0.1")
    answer = client.get("/metrics")
    assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
    assert "tumbleline_runs" in families(answer.content)
    assert (client.get("/healthz").status_code, client.get("/livez").status_code) == (200, 200)
    monitor.taken = full(stations=StationNumbers(set(), {"line-1": "run-1"}))
    answer = client.get("/healthz")
    assert (answer.status_code, answer.json()["ok"]) == (503, False)
    assert "station line-1" in answer.json()["problems"][0]
    assert client.post("/metrics").status_code == 405


def test_a_source_that_cannot_be_read_is_a_fault_and_hides_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TUMBLELINE_STATE", str(tmp_path / "state"))
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    monkeypatch.setattr(snapshots, "KEEP_S", 0.0)
    taken = Monitor(Archive(tmp_path / "none")).snapshot()
    assert {source for source, fault in taken.faults.items() if fault} == {"archive", "orchestrator"}
    assert {one.labels["source"]: one.value for one in families(text(taken))["tumbleline_source_up"]} == {
        "archive": 0.0, "orchestrator": 0.0, "stations": 1.0,
    }  # fmt: skip
    monkeypatch.setattr(snapshots, "read_stations", lambda folder: {}["pid"])  # a defect
    taken = Monitor(Archive(tmp_path / "none")).snapshot()
    assert "KeyError" in taken.faults["stations"]
    assert not taken.ok


@contextmanager
def receiver(answers: list[int]) -> Iterator[tuple[str, list[dict]]]:
    """A web hook on loopback: it answers with these statuses in order, then 200; what it accepted."""
    accepted: list[dict] = []

    class Hook(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            content = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            status = answers.pop(0) if answers else 200
            if status == 200:
                accepted.append(content)
            self.send_response(status)
            if 300 <= status < 400:
                self.send_header("Location", "/elsewhere")
            self.end_headers()

        def do_GET(self) -> None:
            """Any page but the web hook."""
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            """Quiet."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Hook)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_address[1]}/hook", accepted
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def troubled(folder: Path) -> Snapshot:
    """A line with one trouble of each kind, and an audit document with two findings."""
    findings = [
        {"kind": "drift", "subject": s, "message": f"{s} drifts", "whose": "test engineer"} for s in ("A1", "A2")
    ]
    (folder / "audit-2026-05-25.json").write_text(json.dumps({"findings": findings[:1]}), encoding="utf-8")
    (folder / "audit-2026-06-01.json").write_text(json.dumps({"findings": findings}), encoding="utf-8")
    ended = [run("CRASHED", 5, "crashed"), run("FAILED", 5, "failed"), run("CANCELLED", 5, "missed", "missed: …")]
    queues = QueueNumbers([run("SCHEDULED", 20, "late")], ended, {"line-1": False}, {})
    return full(queues=queues, stations=StationNumbers(set(), {"line-1": "run-1"}))


def test_every_trouble_is_an_alert_that_is_delivered_once_although_receiver_and_service_fail(tmp_path: Path) -> None:
    taken = troubled(tmp_path)
    kinds = Counter(alert["kind"] for alert in alerts_of(taken))
    assert kinds == {"crashed": 1, "failed": 1, "missed": 1, "late": 1, "unsafe": 1}
    now = Snapshot(datetime.now(UTC), 30, None, None, None)
    of_audit = alerts_of(now, tmp_path)
    assert [alert["subject"] for alert in of_audit] == ["A1", "A2"]
    assert all(alert["kind"] == "audit" and "test engineer" in alert["text"] for alert in of_audit)
    alerts = [*alerts_of(taken), *of_audit]
    with receiver([200, 500, 200, 503]) as (address, accepted):
        count, fault = Poster(address, tmp_path).post(alerts)
        assert (count, "500" in fault) == (1, True)
        count, fault = Poster(address, tmp_path).post(alerts)  # a new process, with the same folder
        assert (count, "503" in fault) == (1, True)
        assert Poster(address, tmp_path).post(alerts) == (5, "")
        assert Poster(address, tmp_path).post(alerts) == (0, "")
    assert [one["id"] for one in accepted] == [one["id"] for one in alerts]
    assert {*accepted[0]} == {"source", "kind", "id", "subject", "text", "when"}
    again = run("CRASHED", 1, "crashed")
    second = OpenRun(again.id, again.name, again.queue, again.state, again.since, again.message, 2)
    other = alerts_of(full(queues=QueueNumbers([], [second])))
    assert other[0]["id"] not in {one["id"] for one in alerts}, "the second crash of a run is told too"


class _Failing(_Fixed):
    """A monitor whose first snapshots fail."""

    failures = 2

    def snapshot(self) -> Snapshot:
        self.failures -= 1
        if self.failures >= 0:
            raise ValueError("no number")
        return self.taken


@each([(_Fixed, 503), (_Failing, 200)])
def test_alerts_are_posted_as_they_come_and_go_on_after_a_refusal_and_an_unexpected_error(
    row: tuple[type[_Fixed], int], tmp_path: Path
) -> None:
    monitor = row[0](full())
    with receiver([row[1]]) as (address, accepted), alerting(monitor, Poster(address, tmp_path), None, every_s=0.02):
        monitor.taken = full(stations=StationNumbers(set(), {"line-1": "run-1"}))
        for _ in range(500):
            if accepted:
                break
            threading.Event().wait(0.02)
    assert [one["kind"] for one in accepted] == ["unsafe"]


def test_messages_and_the_error_of_a_command_are_text_or_json(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("TUMBLELINE_LOG", raising=False)
    assert log_line("line-1: it is", queue="line-1") == "tumbleline: line-1: it is\n"
    monkeypatch.setenv("TUMBLELINE_LOG", "json")
    line = log_line("a\n“b”", "error", queue="line-1")
    content = json.loads(line)
    assert (content["message"], content["level"], content["queue"]) == ("a\n“b”", "error", "line-1")
    assert (line.count("\n"), datetime.fromisoformat(content["when"]).tzinfo is None) == (1, False)
    remark("warning: a\nb", style="yellow")  # as the progress and the remarks of a command
    remark("")
    content = json.loads(capsys.readouterr().err)
    assert (content["message"], content["level"]) == ("warning: a\nb", "warning")
    content = json.loads(given("--log", "json", "shw")[2])
    assert (content["level"], content["status"]) == ("error", 2)
    assert "no command is called 'shw'" in content["message"]


def test_a_receiver_that_redirects_has_accepted_nothing_and_one_refused_alert_holds_up_no_other(tmp_path: Path) -> None:
    alerts = alerts_of(full(stations=StationNumbers(set(), {"line-1": "run-1"})))
    with receiver([307, 302]) as (address, accepted):
        for status in ("307", "302"):
            count, fault = Poster(address, tmp_path).post(alerts)
            assert (count, status in fault) == (0, True)
        assert Poster(address, tmp_path).post(alerts) == (1, "")
    assert len(accepted) == 1
    alerts = alerts_of(troubled(tmp_path))
    (tmp_path / "other").mkdir()
    with receiver([400]) as (address, accepted):
        count, fault = Poster(address, tmp_path / "other").post(alerts)
    assert (count, "400" in fault) == (len(alerts) - 1, True)
    assert [one["id"] for one in accepted] == [one["id"] for one in alerts[1:]]
    with pytest.raises(WrongUse, match="an address such as https://host/path is needed"):
        Poster("ftp://host/hook", tmp_path)
