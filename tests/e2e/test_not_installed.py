"""A library that is missing or does not load is said with its name and the remedy, and is no defect of the program."""

import importlib
import subprocess
import sys
from pathlib import Path

import pytest

from pipelines.flows import local
from pipelines.workbench.services import work
from schemas.errors import TumblelineError
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


@pytest.mark.parametrize(
    ("missing", "words"),
    [
        ("typer", ("--help",)),
        ("rich", ("doctor",)),
        ("pydantic", ("plan", "production")),
        ("pandas", ("plan", "production")),
    ],
)
def test_a_missing_library_is_one_line_with_the_remedy(missing: str, words: tuple[str, ...], tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", START.format(missing=missing), *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1), done.stderr
    assert f"the library '{missing}' is not installed" in done.stderr
    assert f"run: {sys.executable} -m pip install" in done.stderr
    assert "requirements-run.lock" in done.stderr
    assert "defect" not in done.stderr


def test_what_a_library_of_ours_needs_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    problem = raised(tmp_path / "site-packages" / "needy.py", "import absent_one.part", monkeypatch)
    assert (not_installed(problem) or "").startswith("the library 'absent_one' is not installed: the environment ")
    outer = RuntimeError("it could not start")
    outer.__cause__ = problem
    assert not_installed(outer) == not_installed(problem)


def test_a_library_that_does_not_load_is_named_with_the_reason(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = "raise ImportError('libx.so.1: cannot open shared object file')"
    problem = raised(tmp_path / "site-packages" / "torn.py", text, monkeypatch)
    assert (not_installed(problem) or "").startswith("the library 'torn' cannot be loaded (libx.so.1: cannot open")


def test_an_import_in_a_file_of_the_user_is_no_fault_of_the_installation(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert not_installed(raised(tmp_path / "my_effect.py", "import absent_one", monkeypatch)) is None
    assert not_installed(ValueError("x")) is None
    assert not_installed(ImportError("made, not raised")) is None


def test_a_module_of_this_product_that_is_not_there_is_a_defect(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    problem = raised(tmp_path / "site-packages" / "old_plugin.py", "import inertial.no_such_module", monkeypatch)
    assert not_installed(problem) is None


def test_work_of_the_workbench_says_it_too(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = raised(tmp_path / "site-packages" / "needy_too.py", "import absent_two", monkeypatch)

    def fails(*_: object) -> None:
        raise problem

    monkeypatch.setitem(work.WORK, "fails", fails)
    state, text = work.done_in_process("fails", {}, lambda *_: None)
    assert state == "failed"
    assert text.startswith("the library 'absent_two' is not installed")
    assert "absent_two" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("last", "status", "told"),
    [
        (
            "ModuleNotFoundError: No module named 'absent.part'",
            2,
            "orchestrator: the library 'absent' is not installed: ",
        ),
        ("OSError: something else", 3, "orchestrator: its server ended with status 3; read "),
    ],
)
def test_a_server_that_ends_at_its_start_says_which_library_it_lacks(
    last: str, status: int, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = tmp_path / "server.log"
    log.write_text("ModuleNotFoundError: No module named 'of_an_earlier_start'\n", encoding="utf-8")
    server = tmp_path / "python"
    server.write_text(f'#!/bin/sh\necho "{last}" >&2\nexit 3\n', encoding="utf-8")
    server.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(server))
    with pytest.raises(TumblelineError) as caught:
        local._start(tmp_path, lambda: None)
    assert caught.value.exit_status == status
    assert str(caught.value).startswith(told)
