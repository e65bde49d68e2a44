"""A new database of the orchestrator is the one that Prefect's migrations make, and is made only where it would be new."""

import sqlite3
import stat
from contextlib import closing
from pathlib import Path

import pytest

from pipelines.orchestrator import new_database
from pipelines.orchestrator.new_database import NAME, SCHEMA, make_database, migrated, schema_of
from pipelines.orchestrator.settings import DATABASE


@pytest.fixture(autouse=True)
def no_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(DATABASE, raising=False)


def test_the_schema_is_what_the_migrations_of_the_installed_prefect_make(tmp_path: Path) -> None:
    _, _, kept = SCHEMA.read_text(encoding="utf-8").partition("\n")
    assert parts(kept) == parts(schema_of(migrated(tmp_path))), (
        "write it anew: python -m pipelines.orchestrator.new_database"
    )


def parts(schema: str) -> list[list[str]]:
    """Lines of each statement in order: the migrations write the constraints of a table in any order."""
    return sorted(sorted(line.rstrip(",").strip() for line in text.splitlines()) for text in schema.split(";\n"))


def test_a_database_is_made_once_with_the_revision_and_in_write_ahead_mode(tmp_path: Path) -> None:
    assert make_database(tmp_path)
    assert not make_database(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == [NAME]
    with closing(sqlite3.connect(tmp_path / NAME)) as database:
        assert len(database.execute("select version_num from alembic_version").fetchall()) == 1
        assert database.execute("select count(*) from flow_run").fetchone() == (0,)
        assert database.execute("pragma journal_mode").fetchone() == ("wal",)
    assert stat.S_ISREG((tmp_path / NAME).stat().st_mode)


@pytest.mark.parametrize("why", ["another version", "an address", "a database"])
def test_none_is_made_where_prefect_makes_its_own(why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if why == "another version":
        monkeypatch.setattr(new_database, "version", lambda _: "3.8.9")
    elif why == "an address":
        monkeypatch.setenv(DATABASE, "postgresql+asyncpg://line@db/prefect")
    else:
        (tmp_path / NAME).write_bytes(b"of the user")
    assert not make_database(tmp_path)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == ([b"of the user"] if why == "a database" else [])


def test_entries_that_migrations_would_make_are_no_schema(tmp_path: Path) -> None:
    make_database(tmp_path)
    with closing(sqlite3.connect(tmp_path / NAME)) as database:
        database.execute("insert into configuration (key, value) values ('own', '1')")
        database.commit()
    with pytest.raises(ValueError, match="make entries"):
        schema_of(tmp_path / NAME)


def test_a_folder_that_cannot_be_written_is_left_to_prefect(tmp_path: Path) -> None:
    assert not make_database(tmp_path / "missing")
