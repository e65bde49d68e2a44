"""Shifts of orders at three stations with random faults of worker, server, database, disk, clock: nothing lost, twice, unsafe.

The number of shifts is that of TUMBLELINE_SOAK_SHIFTS (5): some ten minutes on two free cores; 90 is a month of one shift a day.
The orchestrator's database is PostgreSQL, as several stations need it, and SQLite only where PostgreSQL is not installed.
Clocks are those of the workers' processes, their flows and watchdogs (wrong_clock.py); the clock of this computer is left alone.
"""

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Generator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import psutil
import pytest
from capture_double import BRIEF, recipe_file
from lines import deployments, kill_all, order, worker
from orchestrator import Orchestrator
from postgres_server import Postgres, installed, postgres
from root_process import ROOT, python
from served_station import FAST, modbus_station, served, station_file
from small_station import lot_of
from wrong_clock import WrongClocks

from pipelines.archive import Archive
from pipelines.integrity.archive import verify
from pipelines.orchestrator.queue_rules import ATTEMPTS
from pipelines.orchestrator.settings import CLIENT_KEY, SERVER_KEY, new_key
from stations.opening import open_devices
from stations.safety.folder import read_log

SHIFTS = int(os.environ.get("TUMBLELINE_SOAK_SHIFTS", "5"))
pytestmark = [pytest.mark.slow, pytest.mark.timeout(1200 + 600 * SHIFTS)]

STATIONS = ("line-1", "line-2", "line-3")
QUICK = (*BRIEF, ('units = ["A1", "A2", "A3"]', 'units = ["U000", "U001"]'), ("settle_s = 2.0", "settle_s = 0.2"))
SAFE_S = 90.0
SHIFT_S = 900.0
FULL_S = 5.0
DATABASE_OFF_S = 15.0
OUTAGE_S = 75.0  # longer than Prefect's worker tolerates: it ends, or hangs and is ended
OFF_S = 3600  # by how much a clock is wrong
WRONG_S = 25.0
GROWTH_MB = 150.0
GROWTH_FILES = 30


@dataclass
class Server:
    """A server that is killed and comes back at the same address."""

    home: Path
    port: int
    database: Postgres | None = None
    key: str = field(default_factory=new_key)
    process: subprocess.Popen[bytes] | None = None

    @property
    def line(self) -> Orchestrator:
        environment = {
            **os.environ, "PREFECT_HOME": str(self.home), "PYTHONPATH": str(ROOT), CLIENT_KEY: self.key,
            "PREFECT_API_URL": f"http://127.0.0.1:{self.port}/api", "PREFECT_SERVER_ALLOW_EPHEMERAL_MODE": "false",
            "TUMBLELINE_ARCHIVE": str(self.home.parent / "disk" / "archive"),
            "TUMBLELINE_STATE": str(self.home.parent / "state"),
        }  # fmt: skip
        if self.database is not None:
            address = self.home / "database"
            address.touch(0o600)
            address.write_text(self.database.address)
            environment["TUMBLELINE_ORCHESTRATOR_DATABASE"] = str(address)
        return Orchestrator(self.home, self.port, self.key, environment)

    def start(self) -> None:
        command = [sys.executable, "-m", "pipelines.orchestrator.server", "--port", str(self.port)]
        with (self.home / "killed-server.log").open("ab") as log:
            environment = {**self.line.environment, SERVER_KEY: self.key}
            self.process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=log, stderr=log)
        self.line.until(self._answers, "the server answers", 300.0)

    def kill(self) -> None:
        self.process.send_signal(signal.SIGKILL)
        self.process.wait(30)

    def _answers(self) -> bool:
        try:
            return self.line.ask("/api/ready", key="")[0] == 200
        except OSError:
            return False


@contextmanager
def small_disk(place: Path) -> Generator[bool]:
    """A folder on a file system of its own of 256 MB; whether it is one (only root may mount)."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=256m", "tmpfs", str(place)]
    mounted = os.geteuid() == 0 and subprocess.run(command, capture_output=True, check=False).returncode == 0
    try:
        yield mounted
    finally:
        if mounted:
            subprocess.run(["umount", "-l", str(place)], check=True)


class Soak:
    """Stations, workers and the server, with the faults that may happen to them."""

    def __init__(self, folder: Path, server: Server, stack: ExitStack, *, disk: bool) -> None:
        self.folder, self.server, self.line, self.stack = folder, server, server.line, stack
        self.configurations: dict[str, Any] = {}
        self.workers: dict[str, tuple[ExitStack, subprocess.Popen[bytes]]] = {}
        self.faults = {"worker": self.worker_dies, "server": self.server_dies}
        self.clocks = WrongClocks(folder / "clocks") if WrongClocks.available() else None  # without a C compiler
        if self.clocks is not None:
            self.faults["clock"] = self.clock_jumps
        if server.database is not None:
            self.faults["database"] = self.database_dies
        if disk:
            self.faults["disk"] = self.disk_fills
        self.happened: Counter[str] = Counter()
        self.again = 0

    def set_up(self) -> None:
        recipe = recipe_file(self.folder, *QUICK)
        wanted = []
        for name in STATIONS:
            port = self.stack.enter_context(served(lot_of(2)))
            config = modbus_station(port, limits=FAST).model_copy(update={"name": name})
            self.configurations[name] = config
            queue = {"name": "line", "work_queue_name": name}
            parameters = {"recipe": recipe, "station": str(station_file(self.folder, config, f"{name}.toml"))}
            policy = {"crashed": "continue"}
            wanted.append({"name": name, "work_pool": queue, "parameters": parameters, "policy": policy})
        python(self.line.environment, "-m", "pipelines.flows.deploy", deployments(self.folder, wanted))
        # after the stations, so that they end before these: a watchdog waits for a station that is gone
        self.stack.callback(lambda: [own.close() for own, _ in self.workers.values()])
        for name in STATIONS:
            self.start_worker(name)

    def start_worker(self, name: str) -> None:
        own = ExitStack()
        clock = {} if self.clocks is None else self.clocks.environment(name)
        line = replace(self.line, environment={**self.line.environment, **clock})
        process = own.enter_context(worker(line, self.folder / name, name, f"host-of-{name}"))
        self.workers[name] = (own, process)

    def clock_jumps(self, chance: random.Random) -> None:
        """The clock of a station is an hour wrong while it measures, then right again."""
        name = self.measuring(chance)
        self.clocks.set(name, chance.choice((-OFF_S, OFF_S)))
        assert self.clocks.holds(self.workers[name][1].pid, name) > 1, "the worker and its flow have this clock"
        time.sleep(WRONG_S)
        self.clocks.set(name, 0)

    def worker_dies(self, chance: random.Random) -> None:
        """The service of a worker is killed, with its flow; its station is safe before the service comes back."""
        name = self.measuring(chance)
        own, process = self.workers[name]
        if process.poll() is None:
            kill_all(process)
        own.close()
        self.line.until(lambda: self.safe(name), f"{name} is safe", SAFE_S)
        self.start_worker(name)

    def server_dies(self, chance: random.Random) -> None:
        """The server is killed and comes back after some seconds or a minute."""
        self.server.kill()
        time.sleep(OUTAGE_S if not self.happened["server"] else chance.uniform(0.0, OUTAGE_S))
        self.server.start()

    def database_dies(self, chance: random.Random) -> None:
        """The database is killed while stations measure, and comes back after some seconds."""
        database, _ = self.server.database, self.measuring(chance)
        database.kill()
        time.sleep(chance.uniform(1.0, DATABASE_OFF_S))
        database.start()

    def disk_fills(self, chance: random.Random) -> None:
        """The disk of the archive is full for some seconds."""
        filler = self.folder / "disk" / "filler"
        with filler.open("wb") as file:
            try:
                while True:
                    file.write(bytes(2**20))
                    file.flush()
            except OSError:
                time.sleep(FULL_S)
        filler.unlink()

    def measuring(self, chance: random.Random) -> str:
        """A station, as soon as it measures."""

        def sampling() -> bool:
            with open_devices(self.configurations[name], ()) as devices:
                return devices.reader.sampling() == "running"

        name = chance.choice(STATIONS)
        self.line.until(sampling, f"{name} measures", SHIFT_S)
        return name

    def safe(self, name: str) -> bool:
        with open_devices(self.configurations[name], ()) as devices:
            return devices.chamber.set_point() == 25.0 and devices.reader.sampling() == "stopped"

    def shift(self, number: int, chance: random.Random) -> None:
        """A lot at each station, a fault meanwhile; what failed is ordered again until each lot is complete."""
        for name in STATIONS:
            order(self.line, name, repeat=number + 1)
        time.sleep(chance.uniform(5.0, 25.0))
        fault = [*self.faults][number] if number < len(self.faults) else chance.choice([*self.faults])
        self.faults[fault](chance)
        self.happened[fault] += 1
        end = time.monotonic() + SHIFT_S
        while left := [name for name in STATIONS if not self.complete(name, number)]:
            assert time.monotonic() < end, f"shift {number} after '{fault}': {left} are not complete"
            for name in left:
                own, process = self.workers[name]
                if process.poll() is not None:  # the service manager starts it again
                    own.close()
                    self.start_worker(name)
                    self.again += 1
                if not (self.under_way(name, number) or self.complete(name, number)):
                    order(self.line, name, repeat=number + 1)  # it failed (a full disk): a person orders the same again
            time.sleep(2.0)
        for name in STATIONS:
            self.line.until(lambda name=name: self.safe(name), f"{name} is safe", SAFE_S)

    def under_way(self, name: str, number: int) -> bool:
        """Whether a run of the order waits, works, or continues by its policy."""
        states = ("SCHEDULED", "PENDING", "RUNNING", "CRASHED")
        runs = [run for run in self.line.runs(name, *states) if run["parameters"]["repeat"] == number + 1]
        return any(run["state_type"] != "CRASHED" or run["run_count"] < ATTEMPTS for run in runs)

    def complete(self, name: str, number: int) -> bool:
        return sum(run["parameters"]["repeat"] == number + 1 for run in self.line.runs(name, "COMPLETED")) > 0

    def size(self) -> dict[str, tuple[float, int]]:
        """Memory, MB, and open files of the server and of the first process of each worker."""
        pids = {"server": self.server.process.pid} | {name: p.pid for name, (_, p) in self.workers.items()}
        out = {}
        for name, pid in pids.items():
            process = psutil.Process(pid)
            out[name] = (process.memory_info().rss / 1e6, process.num_fds())
        return out


def test_shifts_with_faults_lose_nothing_measure_nothing_twice_and_leave_every_station_safe(tmp_path: Path) -> None:
    chance = random.Random(20261122)
    with ExitStack() as stack:
        disk = stack.enter_context(small_disk(tmp_path / "disk"))
        home = tmp_path / "orchestrator"
        home.mkdir(mode=0o700)
        with socket.create_server(("127.0.0.1", 0)) as probe:
            port = probe.getsockname()[1]
        server = Server(home, port, stack.enter_context(postgres()) if installed() else None)
        server.start()
        stack.callback(server.kill)
        soak = Soak(tmp_path, server, stack, disk=disk)
        soak.set_up()
        sizes = []
        for number in range(SHIFTS):
            soak.shift(number, chance)
            sizes.append(soak.size())
        archive = Archive(tmp_path / "disk" / "archive")
        infos = archive.runs()
        assert Counter(info.station for info in infos if info.finished) == dict.fromkeys(STATIONS, SHIFTS)
        assert len(infos) == SHIFTS * len(STATIONS), "an order has one run, however often it was interrupted"
        records = [path.parent for path in (archive.root / "captures").glob("*/*/record.json")]
        per_capture = Counter(path.parent.name for path in records)
        assert len(per_capture) == len(infos)
        assert set(per_capture.values()) == {8}, "six poses and two of verification, each once"
        assert verify(archive, keys={}).checked.findings == []
        assert "watchdog_failed" not in {entry["event"] for entry in read_log(tmp_path / "state")}
        for name in ("server", *STATIONS):
            memory, files = zip(*(size[name] for size in sizes), strict=True)
            assert memory[-1] - memory[0] < GROWTH_MB, f"{name}: {memory} MB"
            assert files[-1] - files[0] < GROWTH_FILES, f"{name}: {files} open files"
        assert soak.happened.total() == SHIFTS
        print(dict(soak.happened), f"workers started again: {soak.again}", sizes)  # noqa: T201 - the figures of the soak
