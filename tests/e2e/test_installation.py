"""What an installation lacks is said with its name and the remedy; how the orchestrator starts from it, and leaves."""

import errno
import fcntl
import importlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from each import each

from pipelines.archive import files
from pipelines.flows import local
from pipelines.orchestrator import server
from schemas.errors import ArchiveUnusable, TumblelineError
from schemas.installed import not_installed

START = "import sys; sys.modules[{missing!r}] = None; sys.argv[0] = 'tumbleline'; from pipelines.__main__ import main; main()"


def raised(path: Path, text: str, monkeypatch: pytest.MonkeyPatch) -> ImportError:
    """What the import of a module with this text raises."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    monkeypatch.syspath_prepend(path.parent)
    with pytest.raises(ImportError) as caught:
        importlib.import_module(path.stem)
    return caught.value


@each([("typer", "--help"), ("pandas", "plan production")])
def test_a_missing_library_is_one_line_with_the_remedy(case: tuple[str, str], tmp_path: Path) -> None:
    missing, words = case
    command = [sys.executable, "-c", START.format(missing=missing), *words.split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    for part in (f"the library '{missing}' is not installed", f"run: {sys.executable} -m pip install", "run.lock"):
        assert part in done.stderr
    assert "defect" not in done.stderr


def test_a_library_that_is_missing_or_does_not_load_is_named_with_the_reason_and_no_other_error_is_its_fault(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    problem = raised(tmp_path / "site-packages" / "needy.py", "import absent_one.part", monkeypatch)
    assert (not_installed(problem) or "").startswith("the library 'absent_one' is not installed: the environment ")
    outer = RuntimeError("it could not start")
    outer.__cause__ = problem
    assert not_installed(outer) == not_installed(problem)
    text = "raise ImportError('libx.so.1: cannot open shared object file')"
    problem = raised(tmp_path / "site-packages" / "torn.py", text, monkeypatch)
    assert (not_installed(problem) or "").startswith("the library 'torn' cannot be loaded (libx.so.1: cannot open")
    of_a_user = raised(tmp_path / "my_effect.py", "import absent_one", monkeypatch)
    # a module of this product that is not there is a defect
    defect = raised(tmp_path / "site-packages" / "old_plugin.py", "import inertial.no_such_module", monkeypatch)
    for other in (of_a_user, defect, ValueError("x"), ImportError("made, not raised")):
        assert not_installed(other) is None


LAST_LINES = {
    "ModuleNotFoundError: No module named 'absent.part'": (2, "orchestrator: the library 'absent' is not installed: "),
    "OSError: something else": (3, "orchestrator: its server ended with status 3; read "),
}


@each(LAST_LINES)
def test_a_server_that_ends_at_its_start_says_which_library_it_lacks(
    last: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    earlier = "ModuleNotFoundError: No module named 'of_an_earlier_start'\n"
    (tmp_path / "server.log").write_text(earlier, encoding="utf-8")
    ending = tmp_path / "python"
    ending.write_text(f'#!/bin/sh\necho "{last}" >&2\nexit 3\n', encoding="utf-8")
    ending.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(ending))
    with pytest.raises(TumblelineError) as caught:
        local._start(tmp_path, lambda: None)
    status, told = LAST_LINES[last]
    assert caught.value.exit_status == status
    assert str(caught.value).startswith(told)


def test_a_server_that_ends_on_a_full_disk_is_told_by_the_folder_and_its_room(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, _: bytes) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    monkeypatch.setattr(files, "_write_durably", full)
    with pytest.raises(ArchiveUnusable, match=r"cannot be written \(No space left .*free space is needed"):
        local._start(tmp_path, lambda: None)


def test_a_server_whose_folder_is_gone_or_whose_clients_have_gone_leaves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "LOOK_S", 0.001)
    served = SimpleNamespace(should_exit=False)
    server._leave_when_alone(tmp_path / "gone", served)
    assert served.should_exit
    (tmp_path / server.CLIENTS).mkdir()
    (tmp_path / server.ADDRESS).write_text("{}")
    with (tmp_path / server.CLIENTS / "1").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert not server._left(tmp_path)
        assert (tmp_path / server.ADDRESS).is_file()
    assert server._left(tmp_path)
    assert not (tmp_path / server.ADDRESS).exists()  # it takes its address away
