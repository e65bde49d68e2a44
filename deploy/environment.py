"""``python deploy/environment.py NAME FOLDER``: the environment of a lock, made, completed, or made anew where it is not whole.

The makefile calls it with the Python that a person has, before any library is there: it uses the standard library alone.
``FOLDER/.made`` says who finished it last; a folder without it was stopped in the middle and is not trusted.
"""

import fcntl
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HELD_BY = {"run": ("all", "dev", "bench"), "all": ("dev", "bench"), "dev": ("bench",)}
"""Locks that hold all libraries of another one, in the same versions."""

OF_ANOTHER = {"crate"}  # locks of programs of other makers, whose environments do not hold the product
PROBE = "import importlib.util as u, sys; print(*sys.version_info[:2], sep='.') if u.find_spec('pip') else sys.exit(1)"
UNREACHED = (
    r"(?:Retrying \(|Max retries exceeded|name resolution|[Cc]onnection ?(?:Error|refused|reset)|timed out"
    r"|from versions: none)"
)
MOST_PIPS = 4
UNUSED = "/(?:tests?|pymavlink/dialects|sympy|moto|cfnlint)/"  # what is imported of them is compiled then
COLLECTED = re.compile(r"^(?:Collecting|Processing) (\S+)", re.MULTILINE)
FAILURES = (
    (
        re.compile(r"DO NOT MATCH THE HASHES.*?\n\s+(?P<name>\S+) from ", re.DOTALL),
        "the file that was delivered is not that of {lock}: its hash is another one",
        "empty pip's cache with '{python} -m pip cache purge' and try again; if it stays, ask who runs your package index",
    ),
    (re.compile(r"No space left on device"), "no space is left on the disk of {folder}", "free 2 GB and try again"),
    (
        re.compile(r"Failed building wheel for (?P<name>\S+)|Failed to build|to build wheel did not run"),
        "there is no wheel for {system}, and it cannot be built here",
        "take a Python of 3.11 to 3.14 with PYTHON=…, on a system that the library has wheels for",
    ),
    (
        re.compile(rf"{UNREACHED}(?:.*No matching distribution found for (?P<name>\S+))?", re.DOTALL),
        "your package index cannot be reached, or has nothing of it",
        "check network, proxy and 'pip config list', or give a folder of wheels with PIP_FIND_LINKS=… PIP_NO_INDEX=1",
    ),
    (
        re.compile(r"No matching distribution found for (?P<name>\S+)"),
        "your package index does not deliver this version for {system}",
        "see 'pip config list' for the index that is asked, and whether it has the version",
    ),
)


class NotSetUp(Exception):
    """An environment that could not be made: the message names what is missing and the remedy."""


def set_up(name: str, folder: Path, *, asked: bool = False) -> None:
    """Make or complete the environment; says so where packages are installed.

    name : of the lock, ``requirements-NAME.lock``
    asked : whether this version of Python was asked for, so that an environment of another version is made anew
    """
    lock = ROOT / f"requirements-{name}.lock"
    why = wrong_with(folder, asked=asked)
    if why:
        _say(f"{folder.relative_to(ROOT)}: {why}; it is made anew")
        shutil.rmtree(folder)
    if not why and any(_is_current(folder, lock_name) for lock_name in (name, *HELD_BY.get(name, ()))):
        return
    python = f"Python {platform.python_version()}"
    _say(
        f"installing the libraries of {lock.name} into {folder.relative_to(ROOT)} with {python}: it takes one to two minutes"
    )
    begun = time.monotonic()
    if not folder.is_dir():
        _create(folder)
    before = (folder / ".made").read_text(encoding="utf-8") if (folder / ".made").is_file() else None
    (folder / ".made").unlink(missing_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as parts:
        _install(_in_parts(lock, Path(parts)), folder, lock, before)
    if name not in OF_ANOTHER:
        _install([["--no-build-isolation", "--editable", str(ROOT)]], folder, lock, before)
    _compile(folder)
    for stamp in folder.glob(".*.lock"):  # another lock may have moved a version
        stamp.unlink()
    _stamp(folder, name).write_text(_content(name), encoding="utf-8")
    (folder / ".made").write_text(json.dumps({"root": str(ROOT)}), encoding="utf-8")
    _say(f"installed in {time.monotonic() - begun:.0f} s")


def wrong_with(folder: Path, *, asked: bool = False) -> str:
    """Why an environment cannot be used or completed; empty where it can, or where none is there."""
    if not folder.is_dir():
        return ""
    try:
        made = json.loads((folder / ".made").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return "its set-up was not finished"
    if made.get("root") != str(ROOT):
        return f"it was made in {made.get('root')}"
    version, here = _version(folder), f"{sys.version_info.major}.{sys.version_info.minor}"
    if version is None:
        return "the Python that it was made with is gone, or its pip is"
    return f"it has Python {version}, {here} is asked for" if asked and version != here else ""


def _version(folder: Path) -> str | None:
    """The version of an environment's Python; None where it does not start or has no pip."""
    try:
        done = subprocess.run([folder / "bin" / "python", "-c", PROBE], capture_output=True, text=True, check=False)  # noqa: S603
    except OSError:
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def reason(text: str, lock: Path, folder: Path) -> str:
    """The cause of a failure by pip's output: the package, what was found and the remedy, in one line."""
    words = {
        "lock": lock.name,
        "folder": folder,
        "python": folder / "bin" / "python",
        "system": f"Python {platform.python_version()} on {platform.system()} {platform.machine()}",
    }
    collected = [collected.rpartition("/")[2] for collected in COLLECTED.findall(text)] or ["pip"]
    for pattern, found, remedy in FAILURES:
        hit = pattern.search(text)
        if hit is not None:
            package = hit.groupdict().get("name") or collected[-1]
            return f"{package}: {found}; {remedy}".format(**words)
    errors = [line for line in text.splitlines() if line.lower().startswith("error")] or text.splitlines()[-1:] or [""]
    return f"{collected[-1]}: pip ended with '{errors[0].strip()}'; correct that and try again"


def _create(folder: Path) -> None:
    """An empty environment of the Python that runs this."""
    base = getattr(sys, "_base_executable", None) or sys.executable
    done = subprocess.run([base, "-m", "venv", folder], capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode:
        shutil.rmtree(folder, ignore_errors=True)
        if "ensurepip" in done.stdout + done.stderr:
            package = f"python{sys.version_info.major}.{sys.version_info.minor}-venv"
            raise NotSetUp(f"{base} has no ensurepip, which makes environments; run as root: apt-get install {package}")
        last = (done.stderr or done.stdout).strip().splitlines()[-1:]
        raise NotSetUp(f"'{base} -m venv {folder}' failed: {' '.join(last)}; correct that and try again")


def _in_parts(lock: Path, folder: Path) -> list[list[str]]:
    """Words for as many pips as there are processors, each with its part of the lock: a pip keeps one of them busy."""
    entries = re.split(r"^(?=[A-Za-z0-9])", lock.read_text(encoding="utf-8"), flags=re.MULTILINE)[1:]
    count = min(os.cpu_count() or 1, MOST_PIPS, len(entries))
    parts = [folder / f"{k}.lock" for k in range(count)]
    for k, part in enumerate(parts):
        part.write_text("".join(entries[k::count]), encoding="utf-8")
    return [["--require-hashes", "-r", str(part)] for part in parts]


def _install(parts: list[list[str]], folder: Path, lock: Path, before: str | None) -> None:
    """Run a pip for each part, all at a time; their output goes into a file."""
    log = folder / "install.log"
    failed, text = _pip(parts, folder)
    if failed and len(parts) > 1 and not any(pattern.search(text) for pattern, *_ in FAILURES):
        failed, text = _pip([["--require-hashes", "-r", str(lock)]], folder)  # they may have been in each other's way
    log.write_text(text, encoding="utf-8")
    if failed:
        if before is not None and failed > 0 and "Installing collected packages" not in text:
            (folder / ".made").write_text(before, encoding="utf-8")  # nothing was changed: what was there still works
        raise NotSetUp(f"{reason(text, lock, folder)} (all that pip said: {log})")


def _pip(parts: list[list[str]], folder: Path) -> tuple[int, str]:
    """Exit status of one that failed, or zero, and what all of them said, those that failed last.

    Without resolving: the lock is complete, and older pips stumble over its extras.
    """
    options = ["--disable-pip-version-check", "--no-input", "--progress-bar", "off", "--no-deps", "--no-compile"]
    running = []
    for words in parts:
        out = tempfile.TemporaryFile(dir=folder)  # noqa: SIM115 - closed when it was read
        command = [folder / "bin" / "python", "-m", "pip", "install", *options, *words]
        running.append((subprocess.Popen(command, cwd=ROOT, stdout=out, stderr=subprocess.STDOUT), out))  # noqa: S603
    ended: list[tuple[int, str]] = []
    for process, out in running:
        status = process.wait()
        with out:
            out.seek(0)
            ended.append((status, out.read().decode("utf-8", errors="replace")))
    ended.sort(key=lambda end: end[0] != 0)
    return ended[-1][0], "".join(text for _, text in ended)


def _compile(folder: Path) -> None:
    """Compile the libraries on all processors, without what nobody runs here: tests, and most of some large ones."""
    compiled = ["-m", "compileall", "-qq", "-j", "0", "-x", UNUSED, *folder.glob("lib/python3*/site-packages")]
    # a file that does not compile is for another version of Python: its library does not import it
    subprocess.run([folder / "bin" / "python", *compiled], stdout=subprocess.DEVNULL, check=False)  # noqa: S603


def _stamp(folder: Path, name: str) -> Path:
    return folder / f".{name}.lock"


def _content(name: str) -> str:
    """Identity of an installation: the lock, and the metadata of the product."""
    read = [(ROOT / file).read_bytes() for file in (f"requirements-{name}.lock", "pyproject.toml")]
    return hashlib.sha256(b"".join(read)).hexdigest()


def _is_current(folder: Path, name: str) -> bool:
    stamp = _stamp(folder, name)
    return stamp.is_file() and stamp.read_text(encoding="utf-8") == _content(name)


def _say(line: str) -> None:
    sys.stdout.write(f"set-up: {line}\n")
    sys.stdout.flush()


def main(words: list[str]) -> int:
    """Set up; a failure is one line."""
    with Path(__file__).open(encoding="utf-8") as script:
        fcntl.flock(script, fcntl.LOCK_EX)  # make -j calls this for two locks at a time
        try:
            set_up(words[0], ROOT / words[1], asked="--asked" in words[2:])
        except NotSetUp as problem:
            sys.stderr.write(f"set-up: {problem}\n")
            return 1
        except OSError as problem:
            sys.stderr.write(f"set-up: {problem.filename}: {problem.strerror}; correct that and try again\n")
            return 1
        except KeyboardInterrupt:
            sys.stderr.write("set-up: stopped; the next call begins it again\n")
            return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
