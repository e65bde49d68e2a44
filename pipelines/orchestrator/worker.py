"""The worker of a station: preparation before and clean-up after Prefect's worker.

    python -m pipelines.orchestrator.worker start --station line-1
    python -m pipelines.orchestrator.worker stop --station line-1 --wait 60

``start`` allows one worker at a time for a station on this computer, closes runs that died with the previous worker, and applies
the policies of the deployments (:mod:`pipelines.orchestrator.queue_rules`) now and while it runs. It ends a worker that hangs
(:mod:`pipelines.orchestrator.worker_health`), and ends itself when the worker has ended and the processes that it left (a run in
progress, the watchdog of the station) have ended.
``stop`` pauses the station's queue and waits for the run in progress; the next ``start`` resumes the queue.
"""

import argparse
import ctypes
import os
import platform
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from types import FrameType

from pipelines.orchestrator.settings import CLIENT_KEY, JSON_FORMAT, POLL_S, STARTUP_S, check_server, use_key
from pipelines.orchestrator.worker_health import heartbeat_of, period_s, watched
from schemas import host
from schemas.errors import OperatorNeeded, TumblelineError, WrongUse
from schemas.log_lines import JSON, tell, wants_json
from stations.safety.folder import state_folder

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def start(
    pool: str, station: str, queues: Sequence[str], host: str = "", *, once: bool = False, healthcheck: bool = False
) -> int:
    """Run a worker for a station's queue and further queues, one run at a time; its exit status when all its processes ended.

    host : name of this computer, by which a worker knows the runs of its predecessor; that of the system where empty

    Raises OperatorNeeded: another worker of this computer works for the station.
    Raises WrongUse, LinkLost: the orchestrator does not accept the key, or does not answer.
    """
    from pipelines.orchestrator.dead_runs import FREQUENCY, HEARTBEAT_S, close_dead_runs_of_queue
    from pipelines.orchestrator.queue_rules import applied, apply_rules

    os.environ.setdefault(FREQUENCY, str(HEARTBEAT_S))
    if wants_json():
        os.environ.setdefault(JSON_FORMAT, JSON)
    name = f"{station} on {host or platform.node()}"
    with _alone(station):
        check_server(STARTUP_S)
        for queue in (station, *queues):
            for run in close_dead_runs_of_queue(pool, queue, name):
                tell(f"{queue}: run {run} is closed as crashed: its process has ended")
            for text in apply_rules(pool, queue):
                tell(f"{queue}: {text}")
        if _marker(station).exists():
            _pause(pool, station, paused=False)
            _marker(station).unlink(missing_ok=True)
        command = [sys.executable, "-m", "prefect", "worker", "start", "--pool", pool, "--limit", "1", "--name", name]
        for queue in (station, *queues):
            command += ["--work-queue", queue]
        command += ["--run-once"] if once else []
        command += ["--with-healthcheck"] if healthcheck else []
        child: list[subprocess.Popen[bytes]] = []
        health = watched(lambda: heartbeat_of(pool, name), lambda: child[0] if child else None, period_s())
        with applied(pool, (station, *queues), name), nullcontext() if once else health:
            return run_until_orphans_end(command, child.append)


def stop(pool: str, station: str, wait_s: float) -> list[str]:
    """Pause the queue and wait; names of the runs still in progress. No new run begins until the worker is started again."""
    from prefect.client.orchestration import get_client

    from pipelines.orchestrator.dead_runs import WORKING, runs_of_queue

    check_server()
    if _pause(pool, station, paused=True):
        _marker(station).touch()
    end = time.monotonic() + wait_s
    with get_client(sync_client=True) as client:
        while True:
            going = [run.name for run in runs_of_queue(client, pool, station, WORKING)]
            if not going or time.monotonic() >= end:
                return going
            time.sleep(POLL_S)


def _pause(pool: str, queue: str, *, paused: bool) -> bool:
    """Pause or resume a queue; return whether its state changed."""
    from prefect.client.orchestration import get_client
    from prefect.exceptions import ObjectNotFound

    with get_client(sync_client=True) as client:
        try:
            work_queue = client.read_work_queue_by_name(queue, work_pool_name=pool)
        except ObjectNotFound:
            raise WrongUse(
                f"worker: pool '{pool}' has no queue '{queue}', the queue of a station is needed; register it with "
                "'python -m pipelines.flows.deploy deploy/prefect.yaml'"
            ) from None
        if work_queue.is_paused == paused:
            return False
        client.update_work_queue(work_queue.id, is_paused=paused)
        return True


@contextmanager
def _alone(station: str) -> Generator[None]:
    """A context in which no other worker of this computer works for the station."""
    with (state_folder() / f"worker-{station}.lock").open("a") as lock:
        try:
            host.lock(lock, host.EXCLUSIVE | host.AT_ONCE)
        except BlockingIOError:
            raise OperatorNeeded(
                f"worker: another worker works for station {station} on this computer, one is needed; stop it first"
            ) from None
        yield


def _marker(station: str) -> Path:
    """File that shows that ``stop`` paused the queue of the station, and not a person."""
    return state_folder() / f"worker-{station}.paused"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipelines.orchestrator.worker", description="The worker beside a station."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    begin = commands.add_parser("start", help="Work for a station until stopped.")
    end = commands.add_parser("stop", help="Wait for the end of the station's run and start no other.")
    for command in (begin, end):
        command.add_argument("--pool", default="line", help="Work pool of the line.")
        command.add_argument("--station", required=True, help="Name of the station and of its work queue.")
    begin.add_argument(
        "--queue", action="append", default=[], help="A further queue of the same pool; may be repeated."
    )
    begin.add_argument(
        "--host",
        default="",
        metavar="NAME",
        help="Name of this computer, where that of the system changes (containers).",
    )
    begin.add_argument("--once", action="store_true", help="Run what is due, then end.")
    begin.add_argument(
        "--with-healthcheck", action="store_true", help="Answer at /health of PREFECT_WORKER_WEBSERVER_HOST and _PORT."
    )
    end.add_argument("--wait", type=float, default=0.0, metavar="SECONDS", help="Time to wait for the run, s.")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    given = _parser().parse_args(arguments)
    try:
        if not NAME.fullmatch(given.station):
            raise WrongUse(f"worker: station '{given.station}', a plain name is needed, such as line-1; correct it")
        use_key(CLIENT_KEY)
        if given.command == "start":
            healthcheck = given.with_healthcheck
            return start(given.pool, given.station, given.queue, given.host, once=given.once, healthcheck=healthcheck)
        going = stop(given.pool, given.station, given.wait)
    except TumblelineError as problem:
        tell(str(problem))
        return problem.exit_status
    tell(
        f"{given.station}: {'no run in progress' if not going else 'still in progress: ' + ', '.join(going)}; its queue is paused"
    )
    return 1 if going else 0


PR_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
STOPS = (signal.SIGTERM, signal.SIGINT)


def run_until_orphans_end(
    command: Sequence[str], begun: Callable[[subprocess.Popen[bytes]], None] = lambda _child: None
) -> int:
    """Run a command, wait for it and its orphans, and return its exit status: the watchdog of a killed flow finishes its work.

    A service manager that stops a unit, and a container whose first process ends, kill the remaining processes. The main process
    must therefore end after the watchdog: it adopts the orphans of its descendants (Linux, ``PR_SET_CHILD_SUBREAPER``).

    begun : called with the child; only this function waits for it.

    A SIGTERM to this process is passed to the command, not to its orphans. The exit status of a child that a
    signal ended is 128 plus the signal's number, as in shells.
    """
    library = ctypes.CDLL(None, use_errno=True)
    if library.prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl(PR_SET_CHILD_SUBREAPER)")
    stopped = False

    def pass_on(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True
        if child is not None and child.returncode is None:
            os.kill(child.pid, signal.SIGTERM)

    child: subprocess.Popen[bytes] | None = None
    for number in STOPS:
        signal.signal(number, pass_on)
    child = subprocess.Popen(command, start_new_session=True)  # noqa: S603 - this process passes Ctrl-C on once
    begun(child)
    if stopped:
        child.terminate()
    status = 0
    while True:
        try:
            pid, how = os.wait()
        except ChildProcessError:
            return status
        if pid == child.pid:
            child.returncode = code = os.waitstatus_to_exitcode(how)
            status = code if code >= 0 else 128 - code


if __name__ == "__main__":
    sys.exit(main())
