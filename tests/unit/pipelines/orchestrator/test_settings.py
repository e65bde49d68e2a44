"""The orchestrator's key: where it is looked for, and what is refused as one."""

import os
from pathlib import Path

import pytest

from pipelines.flows.local import _private_file, local_server
from pipelines.orchestrator.server import private_folder
from pipelines.orchestrator.settings import CLIENT_KEY, KEY_FILE, SERVER_KEY, new_key, settings, use_key
from schemas.errors import ArchiveUnusable, WrongUse


@pytest.fixture(autouse=True)
def bare(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in (SERVER_KEY, CLIENT_KEY, KEY_FILE, "CREDENTIALS_DIRECTORY"):
        monkeypatch.setenv(name, "x")  # so that what the tests set is taken back
        monkeypatch.delenv(name)


def key_file(folder: Path, text: str, mode: int = 0o600, name: str = "prefect-auth") -> Path:
    path = folder / name
    path.write_text(text)
    path.chmod(mode)
    return path


def test_keys_are_long_and_a_command_has_one_for_client_and_server_and_no_foreign_origin(tmp_path: Path) -> None:
    keys = {new_key() for _ in range(100)}
    assert len(keys) == 100
    assert min(len(key) for key in keys) >= len("tumbleline:") + 43  # 32 random bytes
    environment = settings(tmp_path, 4321, "a:key")
    assert environment[SERVER_KEY] == environment[CLIENT_KEY] == "a:key"
    assert environment["PREFECT_SERVER_CORS_ALLOWED_ORIGINS"] == "http://127.0.0.1:4321,http://localhost:4321"


def test_it_is_taken_from_a_file_that_is_named_or_from_the_credentials_of_a_unit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    key = new_key()
    key_file(tmp_path, f"{key}\n")
    monkeypatch.setenv("CREDENTIALS_DIRECTORY", str(tmp_path))
    assert use_key(CLIENT_KEY) == key
    assert os.environ[CLIENT_KEY] == key
    monkeypatch.delenv(CLIENT_KEY)
    other = new_key()
    monkeypatch.setenv(KEY_FILE, str(key_file(tmp_path, other, name="other")))
    assert use_key(SERVER_KEY) == other
    assert use_key(CLIENT_KEY) == other


def test_a_key_that_is_missing_short_or_open_to_others_is_refused_and_not_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for key in ("", "short:key", "x" * 40):
        monkeypatch.setenv(SERVER_KEY, key)
        with pytest.raises(WrongUse, match="one of the form user:password") as told:
            use_key(SERVER_KEY)
        assert not key or key not in str(told.value)
    monkeypatch.delenv(SERVER_KEY)
    for mode in (0o644, 0o640, 0o604):
        monkeypatch.setenv(KEY_FILE, str(key_file(tmp_path, new_key(), mode)))
        with pytest.raises(WrongUse, match=f"has mode {mode:04o}, 0600 or less is needed"):
            use_key(SERVER_KEY)
    monkeypatch.setenv(KEY_FILE, str(tmp_path / "none"))
    with pytest.raises(WrongUse, match="cannot be read"):
        use_key(SERVER_KEY)


def test_what_an_older_version_left_open_is_closed(tmp_path: Path) -> None:
    folder, file = tmp_path / "orchestrator", tmp_path / "server.json"
    folder.mkdir(mode=0o755)
    private_folder(folder)
    assert folder.stat().st_mode & 0o777 == 0o700
    file.write_text("{}")
    file.chmod(0o644)
    os.close(_private_file(file, os.O_TRUNC))
    assert file.stat().st_mode & 0o777 == 0o600


def test_the_server_of_another_user_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "orchestrator"
    home.mkdir()
    monkeypatch.setattr("os.getuid", lambda: 54321)
    with pytest.raises(ArchiveUnusable, match=r"belongs to another user .* run with --direct"), local_server(home):
        pytest.fail("it was used")
