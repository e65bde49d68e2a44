"""The set-up says what is missing and what to do, begins anew what was stopped, and leaves alone what is whole."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from each import each

from deploy import environment
from deploy.environment import NotSetUp, reason, set_up, wrong_with

LOCK, FOLDER = Path("requirements-run.lock"), Path(".venv")
TAMPERED = """Collecting rich==15.0.0 (from -r requirements-run.lock (line 7))
ERROR: THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE. If you have updated the package versions, please ...
    six==1.17.0 from file:///files/six-1.17.0-py2.py3-none-any.whl#sha256=47 (from -r requirements-run.lock (line 1)):
"""
NOWHERE = """ERROR: Could not find a version that satisfies the requirement six==1.17.0 (from versions: none)
ERROR: No matching distribution found for six==1.17.0
"""
UNREACHED = f"WARNING: Retrying (Retry(total=0)) after connection broken by 'NewConnectionError('...')': /simple/six/\n{NOWHERE}"
OLDER = """ERROR: Could not find a version that satisfies the requirement six==99.0 (from versions: 1.16.0, 1.17.0)
ERROR: No matching distribution found for six==99.0
"""
NOT_BUILT = """Processing ./broken-1.0.tar.gz (from -r b.txt (line 1))
  ERROR: Failed building wheel for broken
"""
NOT_BEGUN = """Processing ./files/broken-1.0.tar.gz (from -r b.txt (line 1))
  × Getting requirements to build wheel did not run successfully.
"""
FULL = "Collecting scipy==1.17.1\nERROR: Could not install packages due to an OSError: [Errno 28] No space left on device\n"
OTHER = "Collecting scipy==1.17.1\nERROR: something new\n"


@each([
    (TAMPERED, "six==1.17.0", "not that of requirements-run.lock", "pip cache purge"),
    (UNREACHED, "six==1.17.0", "cannot be reached", "check network, proxy"),
    (NOWHERE, "six==1.17.0", "cannot be reached, or has nothing", "PIP_FIND_LINKS="),
    (OLDER, "six==99.0", "does not deliver this version for Python 3", "pip config list"),
    (NOT_BUILT, "broken", "there is no wheel for Python 3", "with PYTHON="),
    (NOT_BEGUN, "broken-1.0.tar.gz", "there is no wheel for Python 3", "with PYTHON="),
    (FULL, "scipy==1.17.1", "no space is left on the disk of .venv", "free 2 GB"),
    (OTHER, "scipy==1.17.1", "pip ended with 'ERROR: something new'", "try again"),
    ("", "pip", "pip ended with ''", "try again"),
])  # fmt: skip
def test_what_pip_says_becomes_package_cause_and_remedy(row: tuple[str, str, str, str]) -> None:
    text, package, found, remedy = row
    told = reason(text, LOCK, FOLDER)
    assert told.startswith(f"{package}: ")
    assert found in told
    assert remedy in told
    assert "\n" not in told


def made(folder: Path, root: Path, python: str | None = sys.executable) -> Path:
    (folder / "bin").mkdir(parents=True)
    (folder / ".made").write_text(json.dumps({"root": str(root)}), encoding="utf-8")
    if python is not None:
        (folder / "bin" / "python").symlink_to(python)
    return folder


def test_an_environment_that_is_not_whole_is_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    assert wrong_with(tmp_path / "none") == ""
    assert wrong_with(made(tmp_path / "good", tmp_path)) == ""
    assert wrong_with(tmp_path / "good", asked=True) == ""
    assert "is gone" in wrong_with(made(tmp_path / "gone", tmp_path, "/nowhere/python3"))
    assert "is gone" in wrong_with(made(tmp_path / "broken", tmp_path, shutil.which("false")))
    assert wrong_with(made(tmp_path / "moved", Path("/elsewhere"))) == "it was made in /elsewhere"
    (made(tmp_path / "stopped", tmp_path) / ".made").unlink()
    assert wrong_with(tmp_path / "stopped") == "its set-up was not finished"
    monkeypatch.setattr(environment, "_version", lambda _: "3.99")
    assert wrong_with(tmp_path / "good") == ""
    assert wrong_with(tmp_path / "good", asked=True).startswith("it has Python 3.99, ")


def test_parts_of_a_lock_hold_each_library_once_with_its_hashes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    words = environment._in_parts(environment.ROOT / "requirements-run.lock", tmp_path)
    parts = [Path(path).read_text(encoding="utf-8") for *_, path in words]
    assert len(parts) == 3
    entries = [entry for part in parts for entry in part.replace("\n    ", " ").splitlines()]
    lines = (environment.ROOT / "requirements-run.lock").read_text(encoding="utf-8").replace("\n    ", " ").splitlines()
    assert sorted(entries) == sorted(line for line in lines if not line.startswith("#"))
    assert all("--hash=" in entry for entry in entries)


@each([(OTHER, 0, 2), (OTHER, 1, 2), (UNREACHED, 1, 1)])
def test_parts_that_were_in_each_others_way_are_installed_by_one_pip(
    row: tuple[str, int, int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said, status, calls = row
    asked: list[list[list[str]]] = []

    def pip(parts: list[list[str]], _folder: Path) -> tuple[int, str]:
        asked.append(parts)
        return (1, said) if len(parts) > 1 else (status, said)

    monkeypatch.setattr(environment, "_pip", pip)
    parts = [["-r", "0.lock"], ["-r", "1.lock"]]
    if status:
        with pytest.raises(NotSetUp, match=r"\(all that pip said: "):
            environment._install(parts, tmp_path, LOCK, None)
    else:
        environment._install(parts, tmp_path, LOCK, None)
    assert asked == [parts, [["--require-hashes", "-r", str(LOCK)]]][:calls]
    assert (tmp_path / "install.log").read_text(encoding="utf-8") == said


def _wheel(folder: Path, name: str) -> str:
    """The hash of a wheel of one module without content, which is written into a folder."""
    module = name.replace("-", "_")
    wheel, info = folder / f"{module}-1.0-py3-none-any.whl", f"{module}-1.0.dist-info"
    texts = {
        f"{module}.py": "",
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n",
        f"{info}/WHEEL": "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    record = "".join(f"{path},,\n" for path in [*texts, f"{info}/RECORD"])
    with zipfile.ZipFile(wheel, "w") as file:
        for path, text in {**texts, f"{info}/RECORD": record}.items():
            file.writestr(path, text)
    return hashlib.sha256(wheel.read_bytes()).hexdigest()


@pytest.fixture
def tree(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A tree with a lock of two libraries, whose wheels lie in a folder; no network."""
    monkeypatch.setattr(environment, "ROOT", tmp_path)
    for name in [name for name in os.environ if name.startswith("PIP_")]:
        monkeypatch.delenv(name)
    for name, value in {"CONFIG_FILE": os.devnull, "NO_INDEX": "1", "FIND_LINKS": str(tmp_path / "wheels")}.items():
        monkeypatch.setenv(f"PIP_{name}", value)
    (tmp_path / "wheels").mkdir()
    lines = [f"{name}==1.0 --hash=sha256:{_wheel(tmp_path / 'wheels', name)}\n" for name in ("tiny-one", "tiny-two")]
    (tmp_path / "requirements-crate.lock").write_text("".join(lines), encoding="utf-8")
    (tmp_path / "pyproject.toml").write_text("", encoding="utf-8")
    return tmp_path


@pytest.mark.slow
def test_an_environment_is_made_completed_and_then_left_alone(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tree / ".venv"
    set_up("crate", folder)
    first, last = capsys.readouterr().out.splitlines()
    assert "installing the libraries of requirements-crate.lock into .venv with Python 3" in first
    assert "one to two minutes" in first
    assert last.startswith("set-up: installed in ")
    assert subprocess.run([folder / "bin" / "python", "-c", "import tiny_one, tiny_two"], check=False).returncode == 0
    set_up("crate", folder)
    assert capsys.readouterr().out == ""

    (folder / ".made").unlink()  # as a set-up leaves it that is stopped
    (folder / "lib" / "torn").write_text("", encoding="utf-8")
    set_up("crate", folder)
    assert ".venv: its set-up was not finished; it is made anew" in capsys.readouterr().out
    assert not (folder / "lib" / "torn").exists()

    (tree / "requirements-crate.lock").write_text(f"not-there==2.0 --hash=sha256:{'0' * 64}\n", encoding="utf-8")
    with pytest.raises(NotSetUp, match=r"^not-there==2\.0: your package index cannot be reached, .*install\.log\)$"):
        set_up("crate", folder)
    assert wrong_with(folder) == ""  # nothing was changed
