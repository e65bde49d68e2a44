"""The empty database that Prefect's migrations make is copied, and Prefect finds nothing left to migrate in a copy."""

import os
import sqlite3
import stat
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from pipelines.orchestrator.new_database import NAME, make_database
from pipelines.orchestrator.settings import DATABASE


def test_prefect_itself_makes_an_empty_database_which_is_copied(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv(DATABASE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    home, another = tmp_path / "home", tmp_path / "another"
    home.mkdir()
    another.mkdir()
    assert make_database(home)
    assert [path.name for path in home.iterdir()] == [NAME]
    assert stat.S_IMODE((home / NAME).stat().st_mode) == 0o600
    with closing(sqlite3.connect(home / NAME)) as database:
        tables = [name for (name,) in database.execute("select name from sqlite_master where type = 'table'")]
        entries = {name: database.execute(f'select count(*) from "{name}"').fetchone()[0] for name in tables}
        assert {name for name, count in entries.items() if count} == {"alembic_version"}
        assert "flow_run" in tables
        assert database.execute("pragma journal_mode").fetchone() == ("wal",)
    (stored,) = (tmp_path / "cache" / "tumbleline").iterdir()
    assert stat.S_IMODE(stored.stat().st_mode) == 0o600
    command = [sys.executable, "-m", "prefect", "server", "database", "upgrade", "-y"]
    assert make_database(another)
    before = (another / NAME).read_bytes()
    assert before == stored.read_bytes()
    subprocess.run(command, env={**os.environ, "PREFECT_HOME": str(another)}, check=True, capture_output=True)
    assert (another / NAME).read_bytes() == before, "Prefect finds nothing left to migrate"
