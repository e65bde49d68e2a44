"""The first process of a worker ends a worker that hangs: it reports no more to a server that answers.

After a server outage of a minute Prefect's worker may give up its loops and wait for ever in its own clean-up: the process lives,
takes no run, and no service manager sees it. What counts is the worker's heartbeat as the server has it. Times are those of the
monotonic clock of this computer; the heartbeat's time is compared for equality only, so that no clock needs to be right.
"""

import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from schemas.log_lines import tell

VARIABLE = "PREFECT_WORKER_HEARTBEAT_SECONDS"
PERIOD_S = 30.0  # Prefect's period between two heartbeats of a worker
MISSED = 4  # heartbeats in succession that a worker may owe
STARTUP_S = 180.0  # time that a worker may need on a busy computer until its first heartbeat


class Silence:
    """Whether heartbeats have stopped, from what the server says at each question.

    longest_s : time without a new heartbeat that is silence.
    startup_s : the same before the first heartbeat.
    gap_s : two questions further apart than this are no observation: this computer was suspended.
    """

    def __init__(self, longest_s: float, startup_s: float, gap_s: float) -> None:
        self.longest_s, self.startup_s, self.gap_s = longest_s, startup_s, gap_s
        self._last: str | None = None
        self._since = self._asked = float("nan")
        self._begun = False

    def unanswered(self) -> None:
        """The server did not answer: nothing is known about the worker, and the time begins anew."""
        self._since = float("nan")

    def heard(self, heartbeat: str, now: float) -> bool:
        """Note the time of the last heartbeat that the server has (empty without a heartbeat); whether the worker is silent."""
        new, gap = heartbeat != self._last, not now - self._asked <= self.gap_s
        if self._last is not None and new:
            self._begun = True
        self._last, self._asked = heartbeat, now
        if new or gap or not self._since <= now:
            self._since = now
        return now - self._since >= (self.longest_s if self._begun else max(self.startup_s, self.longest_s))


def period_s() -> float:
    """Seconds between two heartbeats of this computer's worker."""
    try:
        return max(1.0, float(os.environ.get(VARIABLE, "") or PERIOD_S))
    except ValueError:
        return PERIOD_S


@contextmanager
def watched(
    ask: Callable[[], str],
    child: Callable[[], subprocess.Popen[bytes] | None],
    every_s: float,
    startup_s: float = STARTUP_S,
) -> Generator[None]:
    """A context in which a child that is silent is killed, by a thread of this process; its own children go on.

    ask : time of the child's last heartbeat, empty without a heartbeat; raises where the server does not answer.
    child : the process; None before it has started.
    every_s : period of the heartbeats.
    """
    silence = Silence(MISSED * every_s, startup_s, 3.0 * every_s)

    def repeat(ended: threading.Event) -> None:
        while not ended.wait(every_s):
            try:
                silent = silence.heard(ask(), time.monotonic())
            except Exception:  # noqa: BLE001 - whatever it is, the server did not tell about the worker
                silence.unanswered()
                continue
            process = child()
            if silent and process is not None and process.returncode is None:
                tell(
                    f"worker: no heartbeat for {MISSED * every_s:.0f} s although the server answers: it hangs and is ended; a "
                    "run in progress goes on, then the service manager starts the worker again",
                    level="error",
                    event="worker_hangs",
                )
                os.kill(process.pid, signal.SIGKILL)
                return

    with in_thread("worker health", repeat):
        yield


@contextmanager
def in_thread(name: str, repeat: Callable[[threading.Event], None], patience_s: float = 0.0) -> Generator[None]:
    """A context in which a function runs in a thread of this process; its event is set at the end.

    patience_s : time to wait for the end of the thread, s
    """
    ended = threading.Event()
    thread = threading.Thread(target=repeat, args=(ended,), name=name, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join(patience_s)


def heartbeat_of(pool: str, name: str) -> str:
    """Time of the last heartbeat of a worker as the server has it; empty where it sent none."""
    from prefect.client.orchestration import get_client

    with get_client(sync_client=True) as client:
        workers = [worker for worker in client.read_workers_for_work_pool(pool) if worker.name == name]
    return workers[0].last_heartbeat_time.isoformat() if workers and workers[0].last_heartbeat_time else ""
