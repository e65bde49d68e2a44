"""The policies of deployments on a real server: missed, skipped and continued runs, at times that the test chooses."""

import os
import subprocess
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from lines import deployments, order
from orchestrator import Orchestrator, client_of, served

from pipelines.flows.deploy import register
from pipelines.monitoring.queue_numbers import read_queues
from pipelines.orchestrator.dead_runs import LOST_S, WORKER, LostRuns, have_automation
from pipelines.orchestrator.queue_rules import CONTINUED_WITHIN, SETTLED, apply_rules, newer_run

pytestmark = pytest.mark.slow  # by rows of policies: tests/faults/test_worker_processes.py

QUEUE, DAILY_QUEUE = "line-7", "line-8"
MOST_SCHEDULED = 40
"""Runs of a deployment that the server schedules ahead: a minute apart, twice as far as the tests look."""
OWN, OTHER = "line-8 on host-a", "line-8 on host-b"


def policies_of_one_station(folder: Path) -> str:
    """Deployments with a run every minute, each with a policy of its own, and one that is not due while these tests run."""
    policies = {
        "cancels": {"latest_start_min": 5, "missed": "cancel"},
        "latest": {"latest_start_min": 5, "missed": "latest", "crashed": "continue"},
        "skips": {"latest_start_min": 60, "busy": "skip"},
    }
    places = [(QUEUE, "* * * * *", name, policy) for name, policy in policies.items()]
    noon = f"0 {(datetime.now(UTC).hour + 12) % 24} * * *"
    return deployments(
        folder,
        [
            {"name": name, "policy": policy, "schedules": [{"cron": cron, "timezone": "UTC"}],
             "work_pool": {"name": "line", "work_queue_name": queue}}
            for queue, cron, name, policy in (*places, (DAILY_QUEUE, noon, "daily", policies["latest"]))
        ],
    )  # fmt: skip


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Orchestrator]:
    """A server with the deployments, without a worker; this process is a client of it."""
    home = tmp_path_factory.mktemp("rules")
    with (
        # of a hundred each, most of the time of these tests would be theirs
        served(home, PREFECT_SERVER_SERVICES_SCHEDULER_MAX_RUNS=str(MOST_SCHEDULED)) as server,
        client_of(server),
    ):
        register(Path(policies_of_one_station(home)))
        yield server


def test_an_automation_closes_runs_without_a_heartbeat_and_is_there_once(line: Orchestrator) -> None:
    have_automation()  # again, as with every registration
    _, automations = line.ask("/api/automations/filter", {})
    [automation] = [one for one in automations if one["name"] == "tumbleline: runs without a heartbeat"]
    trigger = automation["trigger"]
    assert (trigger["posture"], trigger["within"]) == ("Proactive", 60)
    assert "prefect.flow-run.Suspended" in trigger["expect"]


def test_missed_runs_are_cancelled_or_run_once_and_a_busy_station_is_waited_for_or_not(line: Orchestrator) -> None:
    names = ("cancels", "latest", "skips")
    for name in names:
        line.until(lambda name=name: len(line.runs(name, "SCHEDULED")) >= 30, f"scheduled runs of {name}", 60.0)
    first = max(start(line.runs(name, "SCHEDULED")[0]) for name in names)
    at = first + timedelta(minutes=20, seconds=30)
    told = apply_rules("line", QUEUE, at)
    limit = at - timedelta(minutes=5)

    cancelled = line.runs("cancels", "CANCELLED")
    assert cancelled
    assert all(start(run) < limit for run in cancelled)
    assert all(start(run) >= limit for run in line.runs("cancels", "SCHEDULED"))
    assert "could not start within 5 min" in cancelled[0]["state"]["message"]

    waiting = [start(run) for run in line.runs("latest", "SCHEDULED")]
    assert line.runs("latest", "CANCELLED")
    assert [when for when in waiting if when < limit] == [], "newer runs are due, so no missed one is run"

    assert line.runs("skips", "CANCELLED") == []  # nothing has the station, and none is later than an hour
    assert len(told) == len(cancelled) + len(line.runs("latest", "CANCELLED"))

    busy = line.runs("latest", "SCHEDULED")[0]
    force(line, busy, "RUNNING")
    the_monitor_says_the_same(busy, at, len(cancelled) + len(line.runs("latest", "CANCELLED")))
    apply_rules("line", QUEUE, at)
    skipped = line.runs("skips", "CANCELLED")
    assert skipped
    assert all(start(run) <= at for run in skipped)
    assert f"busy with run {busy['name']}" in skipped[0]["state"]["message"]
    assert all(start(run) > at - timedelta(seconds=10) for run in line.runs("skips", "SCHEDULED"))
    assert line.runs("cancels", "SCHEDULED"), "with busy=wait a due run waits"

    force(line, busy, "COMPLETED")
    crashed_runs_continue_or_are_closed(line)


def test_of_missed_runs_the_newest_is_run_once(line: Orchestrator) -> None:
    line.until(lambda: len(line.runs("daily", "SCHEDULED")) >= 3, "scheduled runs of daily", 60.0)
    first, second, third = (start(run) for run in line.runs("daily", "SCHEDULED")[:3])
    apply_rules("line", DAILY_QUEUE, second + timedelta(minutes=20))
    assert [start(run) for run in line.runs("daily", "CANCELLED")] == [first]
    assert [start(run) for run in line.runs("daily", "SCHEDULED")[:2]] == [second, third]
    apply_rules("line", DAILY_QUEUE, third + timedelta(minutes=1))  # the newer one is due, and not late
    assert [start(run) for run in line.runs("daily", "CANCELLED")] == [first, second]
    left = line.runs("daily", "SCHEDULED")[0]
    assert start(left) == third
    # a worker that took one of them before the rules were applied asks before it measures
    deployment = left["deployment_id"]
    assert newer_run(deployment, first, third + timedelta(minutes=1)) == left["name"]
    assert newer_run(deployment, first, second + timedelta(minutes=1)) == "", "a cancelled run is no reason"
    assert newer_run(deployment, third, third + timedelta(minutes=1)) == "", "nor is the run itself"


def the_monitor_says_the_same(busy: dict, at: datetime, missed: int) -> None:
    """What monitoring reads over the interface of the server: open runs, missed runs, queues; and whom it calls late."""
    numbers = read_queues(at)
    assert {run.queue for run in numbers.open} == {QUEUE}
    assert [run.name for run in numbers.open if run.state == "RUNNING"] == [busy["name"]]
    assert len([run for run in numbers.ended if run.queue == QUEUE]) == missed
    assert all(run.state == "CANCELLED" and run.message.startswith("missed:") for run in numbers.ended)
    assert numbers.queues == {"default": False, QUEUE: False, DAILY_QUEUE: False}
    assert numbers.workers == {}
    assert numbers.late(at) == [], "the station is busy, so nothing is late"
    numbers.open = [run for run in numbers.open if run.state == "SCHEDULED"]
    assert numbers.late(at), "without that run they are"


def crashed_runs_continue_or_are_closed(line: Orchestrator) -> None:
    """Once, as often as is allowed, and only soon after the crash; in one test with the rest, as all use the same runs."""
    continued, often, unstarted = line.runs("latest", "SCHEDULED")[-3:]
    force(line, unstarted, "CRASHED")  # its process could not start, so its count of runs is 0
    closed = line.runs("cancels", "SCHEDULED")[-1]
    for run, count in ((continued, 1), (closed, 1), (often, 3)):
        for _ in range(count):
            force(line, run, "RUNNING")
            force(line, run, "CRASHED")
    now = datetime.now(UTC)
    long_after = apply_rules("line", QUEUE, now + CONTINUED_WITHIN + timedelta(minutes=1))
    assert not [text for text in long_after if "continues" in text], "an old crash is left to a person"
    apply_rules("line", QUEUE, now)
    assert line.ask(f"/api/flow_runs/{continued['id']}")[1]["state_type"] == "CRASHED", (
        "its worker may still hold its place"
    )
    apply_rules("line", QUEUE, now + SETTLED + timedelta(seconds=1))
    states = {run["id"]: line.ask(f"/api/flow_runs/{run['id']}")[1] for run in (continued, closed, often, unstarted)}
    assert states[continued["id"]]["state_type"] == "SCHEDULED"
    assert states[continued["id"]]["run_count"] == 1
    assert "attempt 2 of 3" in states[continued["id"]]["state"]["message"]
    assert (states[unstarted["id"]]["state_type"], states[unstarted["id"]]["run_count"]) == ("SCHEDULED", 0)
    assert states[closed["id"]]["state_type"] == "CRASHED"
    assert states[often["id"]]["state_type"] == "CRASHED"


def test_a_run_whose_process_ended_while_the_server_was_away_gives_its_place_back(line: Orchestrator) -> None:
    from prefect.client.orchestration import get_client

    lost, known, unknown, elsewhere = runs = [
        order(line, "daily") for _ in range(4)
    ]  # a worker took them: none has begun
    for run in runs:
        force(line, run, "PENDING")
    ended = ended_process()
    with process_of(known) as number, process_of(unknown), get_client(sync_client=True) as client:
        for run, pid, name in ((lost, ended, OWN), (known, number, OWN), (unknown, "", OWN), (elsewhere, ended, OTHER)):
            line.ask(f"/api/flow_runs/{run['id']}", {"infrastructure_pid": pid} if pid else {}, method="PATCH")
            line.ask(f"/api/flow_runs/{run['id']}/labels", {WORKER: name}, method="PATCH")
        queue = LostRuns("line", DAILY_QUEUE, OWN)
        assert queue.close(client, 1000.0) == []
        assert queue.close(client, 1000.0 + LOST_S - 1.0) == [], "its worker may just be starting a process"
        force(line, lost, "PENDING")
        assert queue.close(client, 1000.0 + LOST_S) == [], "it was taken again"
        assert queue.close(client, 1000.0 + 2.0 * LOST_S) == [lost["name"]]
        assert queue.close(client, 1000.0 + 9.0 * LOST_S) == []
    states = [line.ask(f"/api/flow_runs/{run['id']}")[1]["state_type"] for run in runs]
    assert states == ["CRASHED", "PENDING", "PENDING", "PENDING"]
    for run in runs:  # the other tests count the runs of the line
        line.ask(f"/api/flow_runs/{run['id']}", method="DELETE")


def ended_process() -> str:
    process = subprocess.Popen([sys.executable, "-c", ""])
    process.wait(60)
    return str(process.pid)


@contextmanager
def process_of(run: dict) -> Generator[str]:
    """A process with the environment that Prefect gives to that of a run; its number."""
    environment = {**os.environ, "PREFECT__FLOW_RUN_ID": run["id"]}
    with subprocess.Popen([sys.executable, "-c", "input()"], env=environment, stdin=subprocess.PIPE) as process:
        try:
            yield str(process.pid)
        finally:
            process.kill()


def start(run: dict) -> datetime:
    return datetime.fromisoformat(run["expected_start_time"])


def force(line: Orchestrator, run: dict, kind: str) -> None:
    state = {"state": {"type": kind, "name": kind.title()}, "force": True}
    assert line.ask(f"/api/flow_runs/{run['id']}/set_state", state)[0] in {200, 201}
