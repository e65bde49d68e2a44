"""A new database of the orchestrator is a copy of the one that Prefect's migrations made once on this machine."""

import sqlite3
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from unittest.mock import Mock

import pytest

from pipelines.orchestrator import new_database
from pipelines.orchestrator.new_database import NAME, make_database
from pipelines.orchestrator.settings import DATABASE


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv(DATABASE, raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return tmp_path / "cache" / "tumbleline"


@pytest.fixture
def home(tmp_path: Path) -> Path:
    (tmp_path / "home").mkdir()
    return tmp_path / "home"


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Where Prefect was called upon; a small database stands for what it makes."""
    calls: list[Path] = []

    def migrate(path: Path) -> None:
        with closing(sqlite3.connect(path)) as database:
            database.execute(f"create table made (number_{len(calls)} integer)")
        calls.append(path)

    monkeypatch.setattr(new_database, "_migrate", migrate)
    return calls


def test_a_second_server_copies_what_is_stored(cache: Path, home: Path, tmp_path: Path, made: list[Path]) -> None:
    assert make_database(home)
    assert not make_database(home)
    assert make_database(_folder(tmp_path / "second"))
    assert len(made) == len(list(cache.iterdir())) == 1


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


SPOILT: dict[str, Callable[[Path], object]] = {
    "cut off": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "changed": lambda path: path.write_bytes(b"x" + path.read_bytes()[1:]),
    "empty": lambda path: path.write_bytes(b""),
    "writable by others": lambda path: path.chmod(0o666),
    "a folder": a_folder,
}


@pytest.mark.parametrize("why", SPOILT)
def test_what_is_not_as_it_was_stored_is_made_again(
    why: str, cache: Path, home: Path, tmp_path: Path, made: list[Path]
) -> None:
    make_database(home)
    SPOILT[why](*cache.iterdir())
    second = _folder(tmp_path / "second")
    assert make_database(second)
    assert len(made) == 2
    with closing(sqlite3.connect(second / NAME)) as database:
        assert database.execute("select number_1 from made").fetchall() == []
    assert make_database(_folder(tmp_path / "third"))
    assert len(made) == 2


@pytest.mark.parametrize(
    "what", [("version", lambda _: "3.8.9"), ("_MIGRATIONS", "server/database/_migrations/versions/postgresql")]
)
def test_another_prefect_has_a_database_of_its_own(
    what: tuple[str, object], cache: Path, home: Path, tmp_path: Path, made: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    make_database(home)
    monkeypatch.setattr(new_database, *what)
    assert make_database(_folder(tmp_path / "second"))
    assert len(made) == len(list(cache.iterdir())) == 2


def test_servers_that_start_at_once_each_have_a_whole_one(tmp_path: Path, cache: Path, made: list[Path]) -> None:
    homes = [_folder(tmp_path / f"home-{n}") for n in range(8)]
    with ThreadPoolExecutor(len(homes)) as pool:
        assert all(pool.map(make_database, homes))
    for folder in homes:
        with closing(sqlite3.connect(folder / NAME)) as database:
            assert database.execute("pragma integrity_check").fetchone() == ("ok",)
    assert all(path.suffix == ".db" for path in cache.iterdir())
    before = len(made)
    assert make_database(_folder(tmp_path / "later"))
    assert len(made) == before


@pytest.mark.parametrize("why", ["an address", "a database", "no cache", "no home", "prefect fails", "no folder"])
def test_prefect_makes_its_own_where_none_can_be_made(
    why: str, cache: Path, home: Path, tmp_path: Path, made: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    match why:
        case "an address":
            monkeypatch.setenv(DATABASE, "postgresql+asyncpg://line@db/prefect")
        case "a database":
            (home / NAME).write_bytes(b"of the user")
        case "no cache":
            (tmp_path / "cache").write_bytes(b"no folder can be made below it")
        case "no home":
            monkeypatch.setattr(new_database, "cache_folder", Mock(side_effect=RuntimeError("no home directory")))
        case "prefect fails":
            error = subprocess.CalledProcessError(1, ["prefect"])
            monkeypatch.setattr(new_database, "_migrate", Mock(side_effect=error))
        case _:
            home = home / "missing"
    assert not make_database(home)
    left = [path.read_bytes() for path in home.iterdir()] if home.exists() else []
    assert left == ([b"of the user"] if why == "a database" else [])
    assert [path for path in cache.glob("*") if path.is_dir()] == []


def _folder(path: Path) -> Path:
    path.mkdir()
    return path
