"""A new database of the orchestrator from its finished schema, in place of its migrations.

A new SQLite database goes through all migrations that Prefect has ever had, some hundred, which takes longer than all else that a
first run does before it measures. ``prefect-schema.sql`` is what they end with; its first line names the version of Prefect that
it is of. With another version the database is made by Prefect itself. ``python -m pipelines.orchestrator.new_database`` writes
the file anew, and a test compares it with what the migrations make.
"""

from __future__ import annotations

import os
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing
from importlib.metadata import version
from pathlib import Path

from pipelines.orchestrator.settings import DATABASE

SCHEMA = Path(__file__).with_name("prefect-schema.sql")
NAME = "prefect.db"
_HEAD = "-- Prefect {}"
_ENTRIES = "INSERT INTO"
_REVISION = 'INSERT INTO "alembic_version"'


def make_database(home: Path) -> bool:
    """Make ``prefect.db`` in a folder; whether it was made.

    Nothing is done where the database has an address of its own, where there is one already, or where the schema is that of
    another version of Prefect.
    """
    place = home / NAME
    if os.environ.get(DATABASE) or place.exists() or not SCHEMA.is_file():
        return False
    head, _, script = SCHEMA.read_text(encoding="utf-8").partition("\n")
    if head != _HEAD.format(version("prefect")):
        return False
    try:
        with tempfile.TemporaryDirectory(dir=home) as folder:
            made = Path(folder) / NAME
            with closing(sqlite3.connect(made)) as database:
                database.executescript(script)
                database.execute("pragma journal_mode=wal")
            place.hardlink_to(made)  # complete or not at all, and never over one that another process has just made
    except (OSError, sqlite3.Error):
        # made meanwhile, or it cannot be made this way: Prefect makes it, or says why it cannot
        return False
    return True


def schema_of(database: Path) -> str:
    """The statements that make a database that has no entries but its revision.

    Raises
    ------
    ValueError
        The migrations make other entries, which would be the same in every database made from the file.
    """
    with closing(sqlite3.connect(database)) as source:
        statements = [text for text in source.iterdump() if "sqlite_sequence" not in text]
    entries = [text for text in statements if text.startswith(_ENTRIES) and not text.startswith(_REVISION)]
    if entries:
        raise ValueError(f"the migrations make entries ({entries[0][:60]} …), a schema alone is needed")
    return "\n".join(line.rstrip() for text in statements for line in text.splitlines()) + "\n"


def migrated(home: Path) -> Path:
    """A new database made by Prefect's own migrations in a folder."""
    environment = {**os.environ, "PREFECT_HOME": str(home), "PREFECT_SERVER_ANALYTICS_ENABLED": "false"}
    environment.pop(DATABASE, None)
    command = [sys.executable, "-m", "prefect", "server", "database", "upgrade", "-y"]
    subprocess.run(command, env=environment, check=True, capture_output=True)  # noqa: S603 - no input of a user
    return home / NAME


def main() -> None:
    """Write the schema of the installed version of Prefect."""
    with tempfile.TemporaryDirectory() as folder:
        text = schema_of(migrated(Path(folder)))
    SCHEMA.write_text(f"{_HEAD.format(version('prefect'))}\n{text}", encoding="utf-8")


if __name__ == "__main__":
    main()
