"""The local orchestrator's server: it does not outlive those who use it."""

from __future__ import annotations

import fcntl
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

from pipelines.orchestrator import server

if TYPE_CHECKING:
    import pytest


def test_a_server_whose_folder_is_gone_leaves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "LOOK_S", 0.001)
    served = SimpleNamespace(should_exit=False)
    server._leave_when_alone(tmp_path / "gone", served)  # type: ignore[arg-type]
    assert served.should_exit


def test_a_server_stays_while_a_client_lives_and_takes_its_address_away_when_it_leaves(tmp_path: Path) -> None:
    (tmp_path / server.CLIENTS).mkdir()
    (tmp_path / server.ADDRESS).write_text("{}")
    with (tmp_path / server.CLIENTS / "1").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert not server._left(tmp_path)
        assert (tmp_path / server.ADDRESS).is_file()
    assert server._left(tmp_path)
    assert not (tmp_path / server.ADDRESS).exists()
