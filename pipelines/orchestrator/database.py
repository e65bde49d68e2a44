"""Copy and restoration of the orchestrator's database: SQLite while its server runs, or PostgreSQL with its own programs."""

import os
import shutil
import sqlite3
import subprocess
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path
from urllib.parse import unquote, urlsplit

from pipelines.orchestrator.settings import DATABASE, use_database
from schemas.errors import WrongUse

POSTGRES = ("postgresql+asyncpg://", "postgresql://")
PRIVATE = 0o600


def default_database() -> str:
    """The database of this environment: the address of its server, else ``prefect.db`` in PREFECT_HOME."""
    use_database()
    named = os.environ.get(DATABASE, "")
    home = os.environ.get("PREFECT_HOME") or str(Path.home() / ".prefect")
    return named if named.startswith(POSTGRES) else str(Path(home) / "prefect.db")


def copy_into(folder: Path, keep: int) -> Path:
    """A new copy of the database of this environment in a folder, named by its time; older copies than ``keep`` are removed."""
    source = default_database()
    stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S.%f")  # two copies may be made in one second
    suffix = ".dump" if source.startswith(POSTGRES) else ".db"
    made = folder / f"orchestrator-{stamp}{suffix}"
    copy_database(source, made)
    for old in sorted(folder.glob(f"orchestrator-*{suffix}"))[:-keep]:
        old.unlink()
    return made


def copy_database(source: str, target: Path) -> int:
    """Write a consistent copy of a database to a new file; its size, bytes.

    Raises WrongUse: the database or a needed program is missing, the target exists, or the copy failed.
    """
    if target.exists():
        raise WrongUse(f"backup: {target} exists, a new file is needed; name another")
    target.parent.mkdir(parents=True, exist_ok=True)
    aside = target.with_name(f"{target.name}.part")
    aside.unlink(missing_ok=True)
    aside.touch(PRIVATE)
    try:
        if source.startswith(POSTGRES):
            _run(["pg_dump", "--format=custom", "--no-owner", f"--file={aside}", *_address(source)], source)
        else:
            _copy_sqlite(Path(source), aside)
        aside.rename(target)
    finally:
        aside.unlink(missing_ok=True)
    return target.stat().st_size


def restore_database(copy: Path, target: str) -> None:
    """Replace a database with a copy; its server must be stopped.

    Raises WrongUse: the copy or a needed program is missing, it is no sound database, or the server still uses the database.
    """
    if not copy.is_file():
        raise WrongUse(f"restore: {copy} is not there, a copy of the database is needed; name it with --database")
    if target.startswith(POSTGRES):
        options = ["--clean", "--if-exists", "--no-owner", "--single-transaction", "--exit-on-error"]
        _run(["pg_restore", *options, *_address(target), str(copy)], target)
        return
    path = Path(target)
    _refuse_unsound(copy)
    _refuse_used(path)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    aside = path.with_name(f"{path.name}.restored")
    aside.unlink(missing_ok=True)
    aside.touch(PRIVATE)
    _copy_sqlite(copy, aside)
    for suffix in ("-wal", "-shm"):
        path.with_name(path.name + suffix).unlink(missing_ok=True)
    aside.replace(path)


def _copy_sqlite(source: Path, target: Path) -> None:
    """Copy with SQLite's own backup, which includes what lies in the write-ahead log."""
    if not source.is_file():
        raise WrongUse(f"backup: {source} is not there, the database of a server is needed; set PREFECT_HOME")
    try:
        with (
            closing(sqlite3.connect(f"file:{source}?mode=ro", uri=True)) as before,
            closing(sqlite3.connect(target)) as after,
        ):
            before.backup(after)
    except sqlite3.Error as problem:
        raise WrongUse(
            f"backup: {source} cannot be copied ({problem}), a SQLite database is needed; check it"
        ) from None
    _refuse_unsound(target)


def _refuse_used(path: Path) -> None:
    """Refuse a database in write-ahead mode that another process has open: each holds a shared lock on it all the time."""
    if not path.is_file():
        return
    try:
        with closing(sqlite3.connect(path, timeout=1.0)) as database:
            database.execute("pragma locking_mode=exclusive")
            database.execute("begin exclusive")
            database.rollback()
    except sqlite3.OperationalError as problem:
        raise WrongUse(
            f"restore: {path} is in use ({problem}), a stopped server is needed; stop it and its workers, then restore"
        ) from None
    except sqlite3.DatabaseError:  # it is damaged, which is why it is replaced
        return


def _refuse_unsound(path: Path) -> None:
    try:
        with closing(sqlite3.connect(f"file:{path}?mode=ro", uri=True)) as database:
            state = database.execute("pragma integrity_check").fetchone()[0]
    except sqlite3.Error as problem:
        state = str(problem)
    if state != "ok":
        raise WrongUse(f"backup: {path} is no sound database ({state}), an intact one is needed; use another copy")


def _address(url: str) -> list[str]:
    """The options of PostgreSQL's programs for an address; the password goes through the environment."""
    parts = urlsplit(url)
    options = [f"--dbname={parts.path.lstrip('/')}", f"--host={parts.hostname or 'localhost'}"]
    options += [f"--port={parts.port}"] if parts.port else []
    return [*options, f"--username={unquote(parts.username)}"] if parts.username else options


def _run(command: list[str], url: str) -> None:
    program = shutil.which(command[0])
    if program is None:
        raise WrongUse(f"backup: {command[0]} is not installed, it is needed for PostgreSQL; install postgresql-client")
    password = urlsplit(url).password
    environment = {**os.environ, **({"PGPASSWORD": unquote(password)} if password else {})}
    done = subprocess.run(  # noqa: S603 - PostgreSQL's own program with the address of the configuration
        [program, *command[1:]], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )
    if done.returncode:
        last = (done.stderr.strip().splitlines() or ["no message"])[-1]
        raise WrongUse(f"backup: {command[0]} failed ({last}), a reachable database is needed; correct the address")
