"""A new database of the orchestrator as a copy of a database that Prefect made once on this machine, instead of its migrations.

A new SQLite database goes through all migrations that Prefect has ever had, some hundred, which takes longer than all else that a
first run does before it measures. The first server on a machine has Prefect make an empty database, which is stored in the
user's cache folder; later ones copy it. It is named for the version of Prefect, for its migrations and for its own content:
another Prefect has another file, and a damaged or changed file is made again.
"""

import os
import sqlite3
import stat
import subprocess
import sys
import tempfile
from contextlib import closing, suppress
from hashlib import sha256
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path

from pipelines.orchestrator.settings import DATABASE, STARTUP_S, cache_folder

NAME = "prefect.db"
_MIGRATIONS = "server/database/_migrations/versions/sqlite"
_OF_OTHERS = stat.S_IWGRP | stat.S_IWOTH


def make_database(home: Path) -> bool:
    """Make ``prefect.db`` in a folder; whether it was made.

    Nothing is done where the database has another address or exists already, and where nothing can be stored:
    Prefect makes it at its start, or says why it cannot.
    """
    path = home / NAME
    if os.environ.get(DATABASE) or path.exists():
        return False
    try:
        content = _stored() or _made()
        with tempfile.NamedTemporaryFile(dir=home) as file:
            file.write(content)
            file.flush()
            # complete or not at all, and never over a file that another process has just made
            path.hardlink_to(file.name)
    except (OSError, RuntimeError, sqlite3.Error, subprocess.SubprocessError):  # RuntimeError: the user has no home
        return False
    return True


def _prefix() -> str:
    """What the names of stored databases of the installed Prefect begin with."""
    package = find_spec("prefect")
    if package is None or package.origin is None:
        raise FileNotFoundError("prefect")
    migrations = sha256()
    for path in sorted((Path(package.origin).parent / _MIGRATIONS).glob("*.py")):
        migrations.update(path.name.encode() + path.read_bytes())
    return f"prefect-{version('prefect')}-{migrations.hexdigest()[:16]}-"


def _stored() -> bytes | None:
    """The stored database of the installed Prefect; None where there is none. What is not as this user stored it is removed."""
    prefix = _prefix()
    for path in sorted(cache_folder().glob(f"{prefix}*.db")):
        with suppress(OSError):  # of another user, or no file: it is made again
            with path.open("rb") as file:
                facts = os.fstat(file.fileno())
                content = file.read()
            if facts.st_uid == os.getuid() and not facts.st_mode & _OF_OTHERS and path.name == _named(prefix, content):
                return content
            path.unlink()
    return None


def _named(prefix: str, content: bytes) -> str:
    return f"{prefix}{sha256(content).hexdigest()}.db"


def _made() -> bytes:
    """An empty database made by Prefect's own migrations, which is stored."""
    cache = cache_folder()
    cache.mkdir(mode=0o700, parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=cache, prefix="making-") as folder:  # renamed below: complete or not at all
        made = Path(folder) / NAME
        _migrate(made)
        made.chmod(0o600)
        content = made.read_bytes()
        made.rename(cache / _named(_prefix(), content))
    return content


def _migrate(made: Path) -> None:
    """Have Prefect make a database in a temporary folder, without the settings and the folder of this process."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PREFECT_")}
    environment |= {"PREFECT_HOME": str(made.parent), "PREFECT_SERVER_ANALYTICS_ENABLED": "false", "DO_NOT_TRACK": "1"}
    command = [sys.executable, "-m", "prefect", "server", "database", "upgrade", "-y"]
    subprocess.run(  # noqa: S603 - no input of a user
        command,
        env=environment,
        cwd=made.parent,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        check=True,
        timeout=STARTUP_S / 2.0,
    )
    with closing(sqlite3.connect(f"file:{made}?mode=rw", uri=True)) as database:  # no file: Prefect wrote elsewhere
        database.execute("pragma journal_mode=wal")
        database.execute("pragma wal_checkpoint(truncate)")  # all of it is in this file
