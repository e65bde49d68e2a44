"""The worker beside a station: what must be so before and after Prefect's own worker works.

    python -m pipelines.flows.worker start --station line-1
    python -m pipelines.flows.worker stop --station line-1 --wait 60

``start`` lets one worker at a time work for a station on this machine, closes runs that died with the last one, and cancels
scheduled runs that were missed. It ends when the worker has ended and with it whatever a killed flow left running: the
station's watchdog.
``stop`` pauses the station's queue and waits for the run that goes on; the next ``start`` resumes it.
"""

from __future__ import annotations

import argparse
import fcntl
import re
import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pipelines.flows.attended import attend
from pipelines.flows.knock import POLL_S, knock
from pipelines.flows.settings import CLIENT_KEY, STARTUP_S, use_key
from schemas.errors import OperatorNeeded, TumblelineError, WrongUse
from stations.safety.folder import state_folder

if TYPE_CHECKING:
    from collections.abc import Generator, Sequence
    from pathlib import Path

NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")


def start(pool: str, station: str, queues: Sequence[str], *, once: bool = False, healthcheck: bool = False) -> int:
    """Exit status of a worker for a station's queue and further ones, one run at a time; when everything it left has ended.

    Raises
    ------
    OperatorNeeded
        Another worker of this machine works for the station.
    WrongUse, LinkLost
        The orchestrator does not take the key, or does not answer.
    """
    from pipelines.flows.dead_runs import cancel_missed_runs, close_dead_runs_of_queue

    with _alone(station):
        knock(STARTUP_S)
        for queue in (station, *queues):
            for name in close_dead_runs_of_queue(pool, queue):
                _tell(f"{queue}: run {name} is closed as crashed: its process is gone")
            for name in cancel_missed_runs(pool, queue):
                _tell(f"{queue}: run {name} is cancelled: it was missed")
        if _marker(station).exists():
            _pause(pool, station, paused=False)
            _marker(station).unlink(missing_ok=True)
        command = [
            sys.executable,
            "-m",
            "prefect",
            "worker",
            "start",
            "--pool",
            pool,
            "--limit",
            "1",
            "--name",
            station,
        ]
        for queue in (station, *queues):
            command += ["--work-queue", queue]
        command += ["--run-once"] if once else []
        command += ["--with-healthcheck"] if healthcheck else []
        return attend(command)


def stop(pool: str, station: str, wait_s: float) -> list[str]:
    """Names of the runs that still go on after the wait; no further one begins until the station's worker is started again."""
    from prefect.client.orchestration import get_client

    from pipelines.flows.dead_runs import WORKING, runs_of_queue

    knock()
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
    """Pauses or resumes a queue; whether it was otherwise before."""
    from prefect.client.orchestration import get_client
    from prefect.exceptions import ObjectNotFound

    with get_client(sync_client=True) as client:
        try:
            found = client.read_work_queue_by_name(queue, work_pool_name=pool)
        except ObjectNotFound:
            raise WrongUse(
                f"worker: pool '{pool}' has no queue '{queue}', that of a station is needed; register it with "
                "'python -m pipelines.flows.deploy deploy/prefect.yaml'"
            ) from None
        if found.is_paused == paused:
            return False
        client.update_work_queue(found.id, is_paused=paused)
        return True


@contextmanager
def _alone(station: str) -> Generator[None]:
    """A block in which no other worker of this machine works for the station."""
    with (state_folder() / f"worker-{station}.lock").open("a") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise OperatorNeeded(
                f"worker: another one works for station {station} on this machine, one is needed; stop that one first"
            ) from None
        yield


def _marker(station: str) -> Path:
    """File that says that the station's queue was paused by ``stop``, and not by somebody who has a reason."""
    return state_folder() / f"worker-{station}.paused"


def _tell(text: str) -> None:
    sys.stderr.write(f"tumbleline: {text}\n")
    sys.stderr.flush()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m pipelines.flows.worker", description="The worker beside a station."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    begin = commands.add_parser("start", help="Work for a station until told to end.")
    end = commands.add_parser("stop", help="Let the station's run end and no other begin.")
    for one in (begin, end):
        one.add_argument("--pool", default="line", help="The work pool of the line.")
        one.add_argument("--station", required=True, help="The station's name, which is that of its work queue.")
    begin.add_argument(
        "--queue", action="append", default=[], help="A further queue of the same pool; may be repeated."
    )
    begin.add_argument("--once", action="store_true", help="Do what is due, and end.")
    begin.add_argument(
        "--with-healthcheck", action="store_true", help="Answer at /health of PREFECT_WORKER_WEBSERVER_HOST and _PORT."
    )
    end.add_argument("--wait", type=float, default=0.0, metavar="SECONDS", help="How long to wait for the run.")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit status of what the command line asks for."""
    given = _parser().parse_args(arguments)
    try:
        if not NAME.fullmatch(given.station):
            raise WrongUse(f"worker: station '{given.station}', a plain name is needed, such as line-1; correct it")
        use_key(CLIENT_KEY)
        if given.command == "start":
            healthcheck = given.with_healthcheck
            return start(given.pool, given.station, given.queue, once=given.once, healthcheck=healthcheck)
        going = stop(given.pool, given.station, given.wait)
    except TumblelineError as problem:
        _tell(str(problem))
        return problem.exit_status
    _tell(
        f"{given.station}: {'no run goes on' if not going else 'still going on: ' + ', '.join(going)}; its queue is paused"
    )
    return 1 if going else 0


if __name__ == "__main__":
    sys.exit(main())
