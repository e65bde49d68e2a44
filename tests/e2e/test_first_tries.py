"""What a person tries first, and what an installation lacks: one sentence with what was found and what to do."""

import errno
import fcntl
import importlib
import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from each import each
from in_process import command, given, refused, text_of
from root_process import ROOT
from served_station import modbus_station, served, station_file

from inertial import effects
from pipelines.archive import Archive, files
from pipelines.flows import local
from pipelines.orchestrator import server
from pipelines.serving.connections import listening_socket
from schemas.errors import ArchiveUnusable, TumblelineError, WrongUse
from schemas.installed import not_installed
from stations.clock import WallClock

WHOLE = '''
import numpy as np
from inertial.effects.base import SensorEffect, stack

class Glue(SensorEffect):
    """A glue that gives."""

    id = "glue"
    symbol = "g"
    equation = "g·f²"
    source = "own measurements"
    typical_ug = (1.0, 1000.0)
    breaker = "other poses"

    def names(self, axis):
        return ("g",)

    def columns(self, state, axis, **nonlinear):
        return stack(state, [state.force[..., axis] ** 2])
'''
BROKEN = {
    "class body": ('    symbol = "g"', "    symbol = 1 / 0", r"line 9 in Glue: ZeroDivisionError"),
    "attribute": ("    typical_ug = (1.0, 1000.0)\n", "", "class Glue (line 5): no typical_ug"),
    "method": ("def names", "def nams", "class Glue (line 5): no method names"),
    "columns": ("state.force[..., axis] ** 2", "state.forces", "class Glue (line 5): line 19 in columns: AttributeError"),
    "nothing": ("stack(state, [state.force[..., axis] ** 2])", "None", "columns returned NoneType"),
    "shape": (
        "stack(state, [state.force[..., axis] ** 2])", "np.zeros((3, 1))", "columns returned shape (3, 1), shape (3, 22, 1)",
    ),
    "not finite": ("axis] ** 2", "axis] * np.nan", "columns returned values that are not finite"),
    "exit": ("import numpy as np", "raise SystemExit(3)", "line 2: SystemExit: 3"),
    "parameter": ('"other poses"', '"other poses"\n    nonlinear = (3,)', "nonlinear holds 3, a Nonlinear is needed"),
    "bounds": (
        '"other poses"',
        '"other poses"\n    from inertial.effects import Nonlinear\n    nonlinear = (Nonlinear("t", "s", 9.0, 1.0),)',
        "nonlinear t: bounds 9 and 1, the lower one is needed first, both above zero",
    ),
    "syntax": ("def names(self, axis):", "def names(self, axis", "line 15: SyntaxError"),
}  # fmt: skip


@each(["", *BROKEN], lambda what: what or "without an error")
def test_an_error_in_a_users_effect_names_file_class_and_line(what: str, measured: Archive, tmp_path: Path) -> None:
    old, new, message = BROKEN.get(what, ("", "", ""))
    assert old in WHOLE
    path = tmp_path / "own.py"
    path.write_text(WHOLE.replace(old, new) if old else WHOLE, encoding="utf-8")
    words = ("compare", "latest", "--archive", measured.root, "--effects", "bias,scale,misalignment,glue")
    with effects.additions_forgotten():
        if not what:
            text_of(*words, "--effect-file", path)  # it is judged
            return
        told = refused(*words, "--effect-file", path)
    assert str(path) in told
    assert message in told
    assert what != "shape" or "1) is needed (…, dwells, coefficients" in told


def test_a_shock_without_a_scale_is_refused_with_the_key(tmp_path: Path) -> None:
    time_s = np.arange(2000) / 20e3
    pulse = np.where((time_s > 0.02) & (time_s < 0.031), 30.0 * np.sin(np.pi * (time_s - 0.02) / 0.011), 0.0)
    head = "time [s],z [V],reference [g]"
    table = np.column_stack([time_s, 0.007 * pulse, pulse])
    np.savetxt(tmp_path / "shock.csv", table, delimiter=",", header=head, comments="")
    (tmp_path / "part.toml").write_text("duration_ms = 11.0\n", encoding="utf-8")
    own = ["--procedure", "shock", "--units", "S1"]
    words = ("import", tmp_path / "shock.csv", *own, "--archive", tmp_path / "archive")
    for part in ((), ("--set", tmp_path / "part.toml")):
        told = refused(*words, "--map", "z=z [V],reference=reference [g]", *part)
        assert "procedure shock has no scale, output per g is needed" in told
        assert "--set FILE.toml" in told or "part.toml" in told


def test_a_dash_is_standard_output_and_what_is_refused_writes_nothing(measured: Archive, home: Path) -> None:
    archive = ("--archive", measured.root)
    export = ("export", "latest", "--units", "A1", "--include", "failed", *archive)
    _, printed, _ = given(*export)
    assert given(*export, "--output", "-")[1] == printed
    assert json.loads(printed)
    assert given("export", "latest", "--waveforms", "0", "--output", "-", *archive)[1].startswith("time [s],")
    _, model, told = given("extend", "model.toml", "third_order", "--output", "-")
    assert '"third_order"' in model
    assert "version 2 has third_order" in told
    for words in (
        ("improve", "latest", "--output", "-", *archive),
        ("archive", "key", "--output", "-"),
        ("export", "latest", "--waveforms", "0", "--format", "mat", "--output", "-", *archive),
        ("extend", "model.toml", "third_order", "--output", "-", "--json"),
        ("plan", "optimise", "--output", "-", "--json"),
    ):
        refused(*words)
    recipe = ROOT / "deploy" / "recipes" / "procedures" / "tilt.toml"
    for words in (("optimise", recipe), (recipe, "--output", "page.html")):
        assert "its procedures have no multi_position" in refused("plan", *words)
    assert list(home.iterdir()) == []


def test_exports_need_a_nominal_scale_and_a_file_for_each_unit(measured: Archive, home: Path) -> None:
    words = ("export", "latest", "--archive", measured.root, "--format")
    one = (*words, "ardupilot", "--units", "A1", "--include", "failed")
    _, by_preset, _ = given(*one)
    assert by_preset.startswith("# accelerometer calibration of unit A1")
    assert by_preset == given(*one, "--set", "nominal=256000")[1]
    told = refused(*one, "--set", "nominal=-1")
    assert "nominal scale of unit A1: -1, a positive output per g is needed" in told
    assert "3 files in this format" in refused(*words, "ardupilot", "--include", "failed")
    assert "is not text" in refused(*words, "matlab", "--include", "failed")


def test_a_clock_of_a_station_that_is_served_faster_runs_faster_and_goes_on() -> None:
    clock = WallClock(speed=60.0)
    begun = time.monotonic()
    clock.sleep(6.0)
    assert 0.1 <= time.monotonic() - begun < 3.0
    assert clock.now() >= 6.0
    assert WallClock(clock.state(), speed=60.0).now() >= 6.0


@pytest.mark.slow  # the clock alone: the test above
def test_a_station_that_is_served_faster_is_checked_by_a_client_that_knows_the_speed(tmp_path: Path) -> None:
    with served(speed=30.0) as port:
        knowing = modbus_station(port, link={"speed": 30.0})
        text_of("station", "check", "--station", station_file(tmp_path, knowing), status=0)
        unknowing = station_file(tmp_path, modbus_station(port), "unknowing.toml")
        status, _, err = given("station", "check", "--station", unknowing)
        assert (status, "needs the same speed in [link]" in " ".join(err.split())) == (3, True)


def test_a_port_in_use_is_refused_before_an_address_is_printed() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(WrongUse, match=rf"port {port} of 127.0.0.1 cannot be used \(Address already in use\)"):
            listening_socket("127.0.0.1", port, "workbench")
        for words in (["workbench"], ["station", "monitor", "--port", "9464"]):
            done = command([*words, "--port", str(port)])
            assert (done.returncode, done.stdout) == (2, "")
            assert done.stderr.count("\n") == 1, done.stderr


@pytest.mark.slow
def test_ctrl_c_with_an_open_page_ends_the_workbench_in_one_line(tmp_path: Path) -> None:
    words = [sys.executable, "-m", "pipelines.cli", "workbench", str(tmp_path / "archive"), "--port", "0"]
    kept = {**os.environ, "TUMBLELINE_WORKBENCH_TOKEN": "0123456789abcdef" * 2, "PYTHONPATH": str(ROOT)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(words, cwd=tmp_path, env=kept, **pipes) as process:
        address = process.stdout.readline().split("/?")[0]
        with _opened(f"{address}/events") as events:
            assert events.readline() == b"event: boot\n"
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30.0)
    assert (process.returncode, out) == (0, ""), err
    assert err == "Open the address above; Ctrl-C ends the workbench.\nworkbench: ended\n"


def _opened(address: str):
    """The answer of a server that may still be starting."""
    for _ in range(200):
        try:
            return urllib.request.build_opener(urllib.request.ProxyHandler({})).open(address, timeout=20.0)
        except urllib.error.URLError as problem:
            if not isinstance(problem.reason, ConnectionRefusedError):
                raise
            time.sleep(0.1)
    raise AssertionError(f"{address} does not answer")


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
