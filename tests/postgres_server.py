"""A PostgreSQL server of its own on loopback, for slow tests: started, killed and started again, removed afterwards."""

import os
import pwd
import secrets
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

PLACES = [*sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True), Path("/usr/bin"), Path("/usr/local/bin")]
PROGRAMS = ("initdb", "pg_ctl", "postgres")


@dataclass
class Postgres:
    """A cluster: its programs, folder, port and the address for the orchestrator."""

    programs: Path
    folder: Path
    port: int
    password: str

    @property
    def address(self) -> str:
        return f"postgresql+asyncpg://prefect:{self.password}@127.0.0.1:{self.port}/prefect"

    def start(self) -> None:
        options = f"-p {self.port} -c listen_addresses=127.0.0.1 -c unix_socket_directories={self.folder}"
        log = self.folder / "log"
        self._run("pg_ctl", "-D", str(self.folder / "data"), "-l", str(log), "-o", options, "-w", "start")

    def kill(self) -> None:
        """Kill the first process as a loss of power would; its children notice and end."""
        pid = int((self.folder / "data" / "postmaster.pid").read_text().split()[0])
        os.kill(pid, signal.SIGKILL)
        for _ in range(200):
            with closing(socket.socket()) as probe:
                if probe.connect_ex(("127.0.0.1", self.port)):
                    return
            time.sleep(0.05)

    def stop(self) -> None:
        self._run("pg_ctl", "-D", str(self.folder / "data"), "-m", "fast", "-w", "stop")

    def query(self, text: str, database: str = "prefect") -> str:
        """Output of a query as the superuser."""
        environment = {**os.environ, "PGPASSWORD": self.password}
        command = ["psql", "-h", "127.0.0.1", "-p", str(self.port), "-U", "prefect", "-d", database, "-AtX", "-c", text]
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout.strip()

    def _run(self, program: str, *arguments: str) -> None:
        command = [*_as_user(), str(self.programs / program), *arguments]
        done = subprocess.run(command, cwd="/", stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        assert done.returncode == 0, (
            command,
            (self.folder / "log").read_text() if (self.folder / "log").exists() else "",
        )


def installed() -> Path | None:
    """Folder of the programs of PostgreSQL; None where it is not installed."""
    programs = next((place for place in PLACES if all((place / name).is_file() for name in PROGRAMS)), None)
    return programs if shutil.which("psql") else None


@contextmanager
def postgres() -> Generator[Postgres]:
    """A new cluster with the database of an orchestrator; skips where PostgreSQL is not installed."""
    programs = installed()
    if programs is None:
        pytest.skip("PostgreSQL is not installed")
    folder = Path(tempfile.mkdtemp(prefix="tumbleline-postgres-"))
    try:
        with closing(socket.socket()) as probe:
            probe.bind(("127.0.0.1", 0))
            port = int(probe.getsockname()[1])
        cluster = Postgres(programs, folder, port, secrets.token_urlsafe(16))
        (folder / "password").write_text(cluster.password)
        if os.geteuid() == 0:
            user = pwd.getpwnam("postgres")
            for path in (folder, folder / "password"):
                os.chown(path, user.pw_uid, user.pw_gid)
        cluster._run(
            "initdb", "-D", str(folder / "data"), "-U", "prefect", "--auth-host=scram-sha-256", "--auth-local=scram-sha-256",
            "--pwfile", str(folder / "password"), "--locale=C.UTF-8", "--data-checksums",
        )  # fmt: skip
        cluster.start()
        cluster.query("create database prefect", "postgres")
        cluster.query("create extension if not exists pg_trgm")
        try:
            yield cluster
        finally:
            cluster.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _as_user() -> list[str]:
    """PostgreSQL refuses to run as root."""
    if os.geteuid():
        return []
    user = pwd.getpwnam("postgres")
    return ["setpriv", f"--reuid={user.pw_uid}", f"--regid={user.pw_gid}", "--clear-groups"]
