"""Work that takes longer than a request: in separate processes, with progress and cancellation.

A job is known by the hash of what decides its result, so that two browsers share the same job. Results are kept in
memory, the newest of them; jobs that ran when the server ended are shown as interrupted.
"""

import multiprocessing
import queue
import threading
import time
from collections import OrderedDict
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

from pipelines.archive import files
from pipelines.archive.keys import digest
from schemas.errors import ArchiveUnusable

State = Literal["waiting", "running", "done", "failed", "stopped", "interrupted"]
ENDED = frozenset({"done", "failed", "stopped", "interrupted"})
KEPT_RESULTS = 24
KEPT_JOBS = 200
GRACE_S = 2.0


@dataclass
class BackgroundJob:
    """A job and its progress."""

    id: str
    kind: str
    title: str
    state: State = "waiting"
    done: int = 0
    total: int = 0
    note: str = "waiting for a free process"
    problem: str = ""
    started: float = 0.0
    ended: float = 0.0
    version: int = field(default=0, compare=False)

    def document(self) -> dict[str, Any]:
        """The job for a page."""
        seconds = (self.ended or time.time()) - self.started if self.started else 0.0
        return {**asdict(self), "seconds": round(seconds, 1)}


class _Process:
    """A process that runs jobs in order; the first job imports the science."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other,), daemon=True, name="workbench-worker")
        self.process.start()
        other.close()

    def end(self) -> None:
        """End the process and its job."""
        self.process.terminate()
        self.process.join(GRACE_S)
        if self.process.is_alive():
            self.process.kill()
        self.pipe.close()


def _serve(pipe: Connection) -> None:
    """The loop of a process: it receives requests and sends progress and results."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server decides when its processes end
    from pipelines.workbench.services.work import done_in_process

    with suppress(EOFError, OSError):  # the server ended
        while True:
            kind, request = pipe.recv()
            pipe.send(done_in_process(kind, request, lambda *how_far: pipe.send(("progress", how_far))))


class Jobs:
    """The table of jobs."""

    def __init__(self, path: Path, workers: int) -> None:
        self._path, self._workers = path, max(1, workers)
        self._lock = threading.RLock()
        self._jobs: OrderedDict[str, BackgroundJob] = OrderedDict()
        self._results: OrderedDict[str, Any] = OrderedDict()
        self._requests: dict[str, tuple[str, Mapping[str, Any]]] = {}
        self._queue: queue.Queue[str | None] = queue.Queue()
        self._busy: dict[str, _Process] = {}
        self._threads: list[threading.Thread] = []
        self.version = 0
        self._remember()

    def submit(self, kind: str, title: str, request: Mapping[str, Any]) -> BackgroundJob:
        """The job for a request: the existing job, or a new job at the end of the queue."""
        name = key_of(kind, request)
        with self._lock:
            known = self._jobs.get(name)
            if known is not None and (known.state in {"waiting", "running"} or name in self._results):
                return known
            job = BackgroundJob(name, kind, title)
            self._jobs[name] = job
            self._jobs.move_to_end(name)
            while len(self._jobs) > KEPT_JOBS:
                self._jobs.popitem(last=False)
            self._requests[name] = (kind, dict(request))
            self._changed(job)
            self._queue.put(name)
            if len(self._threads) < self._workers:
                thread = threading.Thread(target=self._work, daemon=True, name="workbench-jobs")
                self._threads.append(thread)
                thread.start()
            return job

    def result(self, kind: str, request: Mapping[str, Any]) -> Any:
        """The result of a request; None if there is none."""
        name = key_of(kind, request)
        with self._lock:
            if name in self._results:
                self._results.move_to_end(name)
            return self._results.get(name)

    def forget(self, kind: str, request: Mapping[str, Any]) -> None:
        """Drop a job that is done with its result, so that it can be asked for again."""
        with self._lock:
            self._results.pop(key_of(kind, request), None)
            self._jobs.pop(key_of(kind, request), None)

    def known(self, kind: str, request: Mapping[str, Any]) -> BackgroundJob | None:
        """The job of a request; None where it was not asked for."""
        with self._lock:
            return self._jobs.get(key_of(kind, request))

    def get(self, name: str) -> BackgroundJob | None:
        """The job of this id."""
        with self._lock:
            return self._jobs.get(name)

    def all(self, since: int = -1) -> list[BackgroundJob]:
        """The jobs that changed after a version, oldest first."""
        with self._lock:
            return [job for job in self._jobs.values() if job.version > since]

    def stop(self, name: str) -> BackgroundJob | None:
        """Take a job out of the queue, or end the process that does it."""
        with self._lock:
            job = self._jobs.get(name)
            if job is None or job.state in ENDED:
                return job
            job.state, job.note, job.ended = "stopped", "stopped by the user", time.time()
            process = self._busy.pop(name, None)
            self._changed(job)
        if process is not None:
            process.end()
        return job

    def close(self) -> None:
        """End all processes."""
        for _ in self._threads:
            self._queue.put(None)
        with self._lock:
            busy = list(self._busy.values())
            self._busy.clear()
        for process in busy:
            process.end()

    def _work(self) -> None:
        """The loop of a thread: it owns a process, and starts another after that has ended."""
        process: _Process | None = None
        while (name := self._queue.get()) is not None:
            with self._lock:
                job = self._jobs.get(name)
                if job is None or job.state != "waiting":
                    continue
                job.state, job.started, job.note = "running", time.time(), "starting"
                self._changed(job)
            if process is None or not process.process.is_alive():
                process = _Process()
            with self._lock:
                self._busy[name] = process
            self._follow(job, process)
            with self._lock:
                if self._busy.pop(name, None) is None:
                    process = None  # it was ended with the job
        if process is not None:
            process.end()

    def _follow(self, job: BackgroundJob, process: _Process) -> None:
        """Send a job to a process, and record its messages until it is done."""
        kind, request = self._requests.pop(job.id)
        try:
            process.pipe.send((kind, request))
            while True:
                message, content = process.pipe.recv()
                if message == "progress":
                    with self._lock:
                        job.done, job.total, job.note = content
                        self._changed(job)
                    continue
                self._end(job, message, content)
                return
        except (EOFError, OSError):
            self._end(job, "failed", "the process of this job ended; look at the log of the server, and try again")

    def _end(self, job: BackgroundJob, message: str, content: Any) -> None:
        with self._lock:
            if job.state in ENDED:
                return
            job.ended = time.time()
            if message == "done":
                job.state, job.note, job.done = "done", "", job.total
                self._results[job.id] = content
                while len(self._results) > KEPT_RESULTS:
                    self._results.popitem(last=False)
            else:
                job.state, job.problem, job.note = "failed", str(content), ""
            self._changed(job)

    def _changed(self, job: BackgroundJob) -> None:
        self.version += 1
        job.version = self.version
        if job.state != "running" or job.done == 0:
            self._keep()

    def _keep(self) -> None:
        """Store the list of jobs, so that the next server can state the interrupted jobs."""
        with suppress(ArchiveUnusable, OSError):
            content = [job.document() for job in list(self._jobs.values())[-20:]]
            self._path.parent.mkdir(parents=True, exist_ok=True)
            files.publish(self._path, files.json_bytes({"jobs": content}), "jobs", files.ELSEWHERE)

    def _remember(self) -> None:
        """The unfinished jobs of an earlier server process."""
        if not self._path.is_file():
            return
        with suppress(ArchiveUnusable, KeyError, TypeError):
            for stored in files.read_json(self._path)["jobs"]:
                if stored["state"] in {"waiting", "running"}:
                    note = "the server ended before it was done; start it again"
                    job = BackgroundJob(
                        str(stored["id"]), str(stored["kind"]), str(stored["title"]), "interrupted", note=note
                    )
                    self._jobs[job.id] = job


def key_of(kind: str, request: Mapping[str, Any]) -> str:
    """The id of a job: the hash of what decides its result."""
    return digest({"kind": kind, "request": dict(request)})[:20]
