"""The orchestrator that the product starts: who it answers, what it stores, and that scheduled runs appear in it."""

import asyncio
import base64
import json
import os
import re
import select
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
import websockets
from each import each
from httpx import ConnectError, HTTPStatusError, Request, Response
from in_process import refused
from orchestrator import Orchestrator, client_of, served
from root_process import ROOT

from pipelines.doctor.orchestrator import orchestrator_checks
from pipelines.flows import local
from pipelines.flows.deploy import register
from pipelines.orchestrator.archive_address import REFUSED
from pipelines.orchestrator.dead_runs import close_dead_runs_of_queue
from pipelines.orchestrator.queue_rules import apply_rules
from pipelines.orchestrator.settings import check_server
from pipelines.serving.connections import MOST
from schemas.errors import LinkLost

EVIL = "http://evil.example"
DEPLOYMENTS = ["calibrate_lot/production-line", "calibrate_lot/on-demand", "audit_archive/weekly-audit"]
DEPLOYMENTS += ["discover_in_archive/nightly-discover"]


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Orchestrator]:
    """One server for the tests of this file, with the deployments of the product."""
    home = tmp_path_factory.mktemp("orchestrator")
    few = {f"PREFECT_SERVER_SERVICES_SCHEDULER_{name}_RUNS": "1" for name in ("MIN", "MAX")}  # else some hundred
    with served(home, PREFECT_UI_STATIC_DIRECTORY=str(home / "ui"), **few) as server:
        with client_of(server):
            assert register(ROOT / "deploy" / "prefect.yaml") == DEPLOYMENTS
        yield server


def variable(line: Orchestrator, name: str, **how: str) -> int:
    """Status of a request that would change the server's state; whether it did is checked."""
    status, _ = line.ask("/api/variables/", {"name": name, "value": "1"}, **how)
    there, _ = line.ask(f"/api/variables/name/{name}")
    assert (there == 200) == (status == 201), "the answer does not say what was done"
    return status


def test_scheduled_runs_appear_the_page_is_served_and_the_files_of_the_server_are_its_own(line: Orchestrator) -> None:
    scheduled = line.until(lambda: line.runs("production-line", "SCHEDULED"), "a scheduled run of the line", 60.0)
    assert scheduled[0]["expected_start_time"][11:19] == "06:00:00"
    status, page = line.ask("/", key="")
    assert (status, "<html" in page) == (200, True)
    assert list((line.home / "ui").glob("v*/index.html"))  # where the code may not be written to
    assert stat.S_IMODE(line.home.stat().st_mode) == 0o700
    modes = {path.name: stat.S_IMODE(path.stat().st_mode) for path in line.home.glob("prefect.db*")}
    assert "prefect.db" in modes
    assert {name: oct(mode) for name, mode in modes.items() if mode & 0o077} == {}


WITHOUT_KEY = [
    {"key": key, **headers}
    for key in ("", "tumbleline:wrong")
    for headers in ({}, {"Origin": EVIL}, {"Host": "evil.example"})
]
FOREIGN = [
    *({"Origin": origin} for origin in (EVIL, "null")),
    *({"Host": host} for host in ("evil.example", "evil.example:4200", "127.0.0.1.evil.example", "")),
]


def test_only_a_request_with_the_key_from_the_own_page_changes_state(line: Orchestrator) -> None:
    assert variable(line, "plain") == 201
    assert variable(line, "own_page", Origin=f"http://127.0.0.1:{line.port}") == 201
    assert [how for how in WITHOUT_KEY if variable(line, "without_key", **how) not in {400, 401, 403}] == []
    assert [variable(line, "foreign", **how) for how in FOREIGN] == [403, 403, 400, 400, 400, 400]
    preflight = {"Origin": EVIL, "Access_Control_Request_Method": "POST"}
    assert line.ask("/api/variables/", method="OPTIONS", **preflight)[0] == 403
    assert [line.ask("/", key="", **how)[0] for how in FOREIGN if "Host" in how] == [400] * 4
    places = ("flow_runs", "deployments", "work_pools")
    assert [line.ask(f"/api/{place}/filter", {}, key="")[0] for place in places] == [401] * 3  # nothing is told either


STRANGERS = [
    {"origin": EVIL}, {"called": "evil.example"}, {"called": "evil.example", "origin": EVIL}, {"subprotocols": None},
]  # fmt: skip


@each([("events/in", None), *((path, how) for path in ("events/in", "events/out", "logs/out") for how in STRANGERS)])
def test_a_websocket_is_opened_with_the_key_and_not_to_a_stranger(
    case: tuple[str, dict | None], line: Orchestrator
) -> None:
    path, how = case
    if how is None:  # the own page: opened with the key, and closed at once without
        for key in ("", "tumbleline:wrong"):
            with pytest.raises(websockets.ConnectionClosed, match="1008"):
                asyncio.run(greet(line, path, key))
        assert asyncio.run(greet(line, path, line.key))["type"] == "auth_success"
        return
    with pytest.raises(websockets.InvalidStatus, match="403"):
        asyncio.run(greet(line, path, line.key, **how))


async def greet(line: Orchestrator, path: str, key: str, called: str = "127.0.0.1", **how: object) -> dict:
    where = {"host": "127.0.0.1", "port": line.port, "open_timeout": 30, "subprotocols": ["prefect"]} | how
    async with websockets.connect(f"ws://{called}:{line.port}/api/{path}", **where) as socket:
        await socket.send(json.dumps({"type": "auth", "token": key}))
        return json.loads(await socket.recv())


def test_deployments_have_their_queue_and_are_found_by_their_module(line: Orchestrator) -> None:
    status, queue = line.ask("/api/work_pools/line/queues/line-1")
    assert (status, queue["concurrency_limit"]) == (200, 1)  # the station takes one run at a time
    _, deployments = line.ask("/api/deployments/filter", {})
    calibrate, audit = "pipelines.flows.calibrate.calibrate_lot", "pipelines.flows.audit.audit_archive"
    assert {one["name"]: (one["work_queue_name"], one["entrypoint"]) for one in deployments} == {
        "production-line": ("line-1", calibrate),
        "on-demand": ("line-1", calibrate),
        "weekly-audit": ("audits", audit),
        "nightly-discover": ("audits", "pipelines.flows.discover.discover_in_archive"),
    }
    # a folder of flows on the path would hide modules of Python
    assert {one["job_variables"]["working_dir"] for one in deployments} == {str(ROOT)}


@pytest.mark.slow
def test_runs_whose_process_is_gone_are_closed_and_others_left_alone(line: Orchestrator) -> None:
    _, deployment = line.ask("/api/deployments/name/calibrate_lot/on-demand")
    _, elsewhere = line.ask("/api/deployments/name/audit_archive/weekly-audit")

    def began(name: str, kind: str, where: dict = deployment, **about: object) -> str:
        _, run = line.ask(f"/api/deployments/{where['id']}/create_flow_run", {"name": name})
        state = {"type": kind, "name": about.pop("state", kind.title())}
        assert line.ask(f"/api/flow_runs/{run['id']}/set_state", {"state": state, "force": True})[0] in {200, 201}
        assert line.ask(f"/api/flow_runs/{run['id']}", about, "PATCH")[0] == 204
        return run["id"]

    gone = 2**22 + 1  # above the largest number of a process
    runs = {
        "power-cut": began("power-cut", "RUNNING", infrastructure_pid=str(gone)),
        "another-process": began("another-process", "RUNNING", infrastructure_pid=str(os.getpid())),
        "never-began": began("never-began", "PENDING"),
        "waits-without-process": began("waits-without-process", "PAUSED", infrastructure_pid=str(gone)),
        "suspended": began("suspended", "PAUSED", state="Suspended"),
        "of-another-queue": began("of-another-queue", "RUNNING", elsewhere, infrastructure_pid=str(gone)),
        "ordered": began("ordered", "SCHEDULED"),
        "of-this-worker": began("of-this-worker", "RUNNING", infrastructure_pid=str(gone)),
        "on-another-computer": began("on-another-computer", "RUNNING", infrastructure_pid=str(gone)),
    }
    for name, host in (("of-this-worker", "here"), ("on-another-computer", "there")):
        label = {"prefect.worker.name": f"line-1 on {host}"}
        assert line.ask(f"/api/flow_runs/{runs[name]}/labels", label, "PATCH")[0] == 204
    alive = began("alive", "RUNNING")
    environment = {**os.environ, "PREFECT__FLOW_RUN_ID": alive}
    with subprocess.Popen(["sleep", "600"], env=environment) as process:
        line.ask(f"/api/flow_runs/{alive}", {"infrastructure_pid": str(process.pid)}, "PATCH")
        with client_of(line):
            closed, missed = close_dead_runs_of_queue("line", "line-1", "line-1 on here"), apply_rules("line", "line-1")
        process.kill()
    assert sorted(closed) == ["another-process", "never-began", "of-this-worker", "power-cut", "waits-without-process"]
    assert missed == []
    states = {name: line.ask(f"/api/flow_runs/{run_id}")[1]["state_type"] for name, run_id in runs.items()}
    assert {name for name, state in states.items() if state == "CRASHED"} == set(closed)
    for run_id in (*runs.values(), alive):
        line.ask(f"/api/flow_runs/{run_id}", method="DELETE")


def test_credentials_are_refused_as_a_parameter_of_a_flow_and_not_stored(line: Orchestrator) -> None:
    secret = "wJalrXUtnFEMI"
    _, deployment = line.ask("/api/deployments/name/calibrate_lot/on-demand")
    parameters = {"archive": f"s3://AKIA:{secret}@factory/archive"}
    status, told = line.ask(f"/api/deployments/{deployment['id']}/create_flow_run", {"parameters": parameters})
    assert (status, told["exception_message"]) == (422, REFUSED)
    status, _ = line.ask(f"/api/deployments/{deployment['id']}", {"parameters": parameters}, "PATCH")
    assert status == 422
    assert [path.name for path in line.home.iterdir() if path.is_file() and secret.encode() in path.read_bytes()] == []


def test_a_client_with_no_key_a_wrong_one_or_no_server_is_told(
    line: Orchestrator, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PREFECT_API_URL", line.environment["PREFECT_API_URL"])
    for key, told in (("", "requires a key"), ("tumbleline:" + "x" * 32, "refuses the key")):
        monkeypatch.setenv("PREFECT_API_AUTH_STRING", key)
        assert told in refused("station", "operator")
    monkeypatch.setenv("PREFECT_API_AUTH_STRING", line.key)
    check_server()
    monkeypatch.setenv("PREFECT_API_URL", "http://127.0.0.1:9/api")
    with pytest.raises(LinkLost, match="does not answer"):
        check_server()
    with pytest.raises(LinkLost, match="no longer answers"), local._answering():
        raise ConnectError("refused")  # as of a server that was killed since
    full = HTTPStatusError("", request=Request("GET", "http://a"), response=Response(500))
    with pytest.raises(LinkLost, match="disk of its database is full; make room"), local._answering():
        raise full


def sent(line: Orchestrator, path: str, size: int, key: str, *, chunked: bool) -> int:
    """Status of a POST with a body of zeros, which ends at the answer; 0 where it was cut off."""
    lines = [f"POST {path} HTTP/1.1", f"host: 127.0.0.1:{line.port}", "content-type: application/json"]
    lines += ["transfer-encoding: chunked" if chunked else f"content-length: {size}"]
    lines += [f"authorization: Basic {base64.b64encode(key.encode()).decode()}"] if key else []
    part = bytes(1_000_000)
    answer = b""
    with socket.create_connection(("127.0.0.1", line.port), timeout=60.0) as client:
        client.sendall("\r\n".join([*lines, "", ""]).encode())
        with suppress(ConnectionError):  # it does not wait for the end of a body that it has refused
            for _ in range(size // len(part)):
                client.sendall(b"%x\r\n%b\r\n" % (len(part), part) if chunked else part)
                if select.select([client], [], [], 0.0)[0]:
                    break
            client.sendall(b"0\r\n\r\n" if chunked else b"")
        with suppress(ConnectionError):
            answer = client.recv(4096)
    return int(answer[9:12] or 0)


def resident_mb(line: Orchestrator) -> float:
    found = 0
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has ended
            if f"pipelines.orchestrator.server\0--port\0{line.port}\0".encode() in path.read_bytes():
                found = int(path.parent.name)
    text = Path(f"/proc/{found}/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", text)[1]) / 1e3


@pytest.mark.parametrize("chunked", [False, True])
def test_a_body_without_the_key_is_refused_unread_and_a_large_one_with_it(chunked: bool, line: Orchestrator) -> None:  # noqa: FBT001
    places = ("/api/flow_runs/", "/api/flow_runs/filter", "/api/variables/")
    for path, key in ((path, key) for path in places for key in ("", "tumbleline:wrong")):
        before = resident_mb(line)
        assert sent(line, path, 100_000_000, key, chunked=chunked) == 401
        assert resident_mb(line) < before + 20.0
    # with the key, where it has more than a megabyte
    assert sent(line, "/api/flow_runs/", 40_000_000, line.key, chunked=chunked) == 413
    assert sent(line, "/api/variables/", 2_000_000, line.key, chunked=chunked) == 413
    assert sent(line, "/api/logs/", 4_000_000, line.key, chunked=chunked) == 422  # read: its logs are none


def test_idle_connections_do_not_shut_the_line_out(line: Orchestrator) -> None:
    with ExitStack() as within:
        idle = [within.enter_context(socket.create_connection(("127.0.0.1", line.port), 20.0)) for _ in range(700)]
        assert line.ask("/api/health", key="") == (200, True)
        closed = select.select(idle, [], [], 1.0)[0]
        assert len(closed) >= len(idle) - 1.25 * MOST


@pytest.mark.slow
def test_a_server_without_a_key_or_on_a_port_in_use_does_not_start(line: Orchestrator) -> None:
    bare = {key: value for key, value in os.environ.items() if not key.endswith("AUTH_STRING")}
    taken = f"orchestrator: port {line.port} of 127.0.0.1 cannot be used (Address already in use)"
    for port, environment, words in (
        (1, bare, ("orchestrator: no key was found", "PREFECT_SERVER_API_AUTH_STRING")),
        (line.port, line.environment | {"PREFECT_SERVER_API_AUTH_STRING": line.key}, (taken,)),
    ):
        command = [sys.executable, "-m", "pipelines.orchestrator.server", "--port", str(port)]
        pipes = {"env": environment, "capture_output": True, "text": True}
        done = subprocess.run(command, cwd=ROOT, timeout=60, check=False, **pipes)
        assert done.returncode == 2
        assert [one for one in words if one not in done.stderr] == []


def test_doctor_finds_the_server_good_and_a_wrong_key_at_fault(
    line: Orchestrator, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("PREFECT_API_URL", "PREFECT_API_AUTH_STRING"):
        monkeypatch.setenv(name, line.environment[name])
    monkeypatch.delenv("PREFECT_SERVER_API_AUTH_STRING", raising=False)
    states = {check.check: check.state for check in orchestrator_checks()}
    assert states == dict.fromkeys(("reachable", "database", "authenticated", "version", "clock"), "good")
    monkeypatch.setenv("PREFECT_API_AUTH_STRING", "line:" + "x" * 32)
    faults = [check for check in orchestrator_checks() if check.state == "fault"]
    assert [(check.check, check.found) for check in faults] == [("authenticated", "the key is refused (401)")]
