"""``python -m deploy.pythons``: set-up, main job and tests in a fresh clone, for each Python that is found; one table.

PYTHONS names interpreters in place of those that are found, TESTS folders or files of tests in place of all. What is committed is
cloned. The output of each interpreter is kept in ``build/pythons/``. Needs the standard library alone.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
LOGS = ROOT / "build" / "pythons"
MINORS = range(11, 15)
PROBE = "import os, sys, platform as p; print(p.python_version(), os.path.realpath(sys.executable))"
CLOSING = re.compile(r"^(?:\d+ (?:passed|failed|errors?|skipped|deselected|warnings?)|no tests ran).*$", re.MULTILINE)
HEAD = ("interpreter", "version", "set-up s", "run exit", "run s", "tests")


class Interpreter(NamedTuple):
    """A Python: its program, and its version to the patch."""

    program: Path
    version: str

    @property
    def minor(self) -> int:
        """The second number of a version of Python 3; -1 for other programs."""
        return int(self.version.split(".")[1]) if self.version.startswith("3.") else -1


class Outcome(NamedTuple):
    """The result of the tests with a Python."""

    interpreter: Interpreter
    set_up_s: float
    run_status: int | None
    run_s: float
    tests: str
    good: bool

    def row(self) -> tuple[str, ...]:
        """The cells of the table."""
        status = "–" if self.run_status is None else str(self.run_status)
        return (
            str(self.interpreter.program),
            self.interpreter.version,
            f"{self.set_up_s:.0f}",
            status,
            f"{self.run_s:.0f}",
            self.tests,
        )


def interpreters(named: str = "") -> list[Interpreter]:
    """Each supported Python once, oldest first: those named, else those of PATH, of the system and of pyenv."""
    path = [Path(folder) for folder in os.get_exec_path()]
    known = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    programs = [
        *(folder / f"python3.{minor}" for minor in MINORS for folder in path),
        Path("/usr/bin/python3"),
        *sorted(known.glob("*/bin/python3")),
    ]
    if named:
        programs = [Path(shutil.which(name) or name) for name in named.split()]
    found: dict[Path, Interpreter] = {}
    for program in programs:
        held = _probe(program) if program.is_file() else None
        if held is None and named:
            raise SystemExit(f"test-pythons: '{program}' is no Python that starts; correct PYTHONS")
        if held is not None and held.minor in MINORS:
            found.setdefault(held.program, held)
    return sorted(found.values(), key=lambda interpreter: [int(n) for n in re.findall(r"\d+", interpreter.version)])


def _probe(path: Path) -> Interpreter | None:
    try:
        done = subprocess.run([path, "-c", PROBE], capture_output=True, text=True, check=False, timeout=60)  # noqa: S603
    except (OSError, subprocess.TimeoutExpired):
        return None
    if done.returncode:
        return None
    version, program = done.stdout.split()
    return Interpreter(Path(program), version)


def tried(interpreter: Interpreter, tests: str, folder: Path) -> Outcome:
    """Set-up, main job and tests in a clone; the clone is removed, its output remains.

    tests : folders or files; empty for all
    folder : of the clone, and of a link to the data that lie beside a checkout
    """
    clone = folder / "clone"
    log = LOGS / f"{interpreter.version}.log"
    with log.open("w", encoding="utf-8") as out:

        def call(*words: str) -> tuple[int, float]:
            begun = time.monotonic()
            done = subprocess.run(words, cwd=folder, env=_environment(), stdout=out, stderr=out, check=False)  # noqa: S603
            return done.returncode, time.monotonic() - begun

        def make(*words: str) -> tuple[int, float]:
            return call("make", "-C", str(clone), f"PYTHON={interpreter.program}", *words)

        status, _ = call("git", "clone", "--quiet", str(ROOT), str(clone))
        ready, set_up_s = make(".venv/.run") if status == 0 else (status, 0.0)
        if ready:
            return Outcome(interpreter, set_up_s, None, 0.0, f"not set up, see {log.relative_to(ROOT)}", good=False)
        ran, run_s = make("run")
        ready, more_s = make(".venv/.dev", ".venv/crate-validator/.done")
        tested, _ = make("pytest", f"TESTS={tests}") if ready == 0 else (ready, 0.0)
    closing = CLOSING.findall(log.read_text(encoding="utf-8", errors="replace"))
    told = closing[-1] if closing else f"none, see {log.relative_to(ROOT)}"
    shutil.rmtree(clone)
    return Outcome(interpreter, set_up_s + more_s, ran, run_s, told, good=ran == tested == 0)


def _environment() -> dict[str, str]:
    """The variables of this process without what the surrounding make or an active environment says."""
    left_out = ("MAKE", "MFLAGS", "PYTHON", "TESTS", "VIRTUAL_ENV")
    return {name: value for name, value in os.environ.items() if not name.startswith(left_out)}


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows under their heads, in columns."""
    widths = [max(map(len, column)) for column in zip(HEAD, *rows, strict=True)]
    lines = [HEAD, tuple("─" * width for width in widths), *rows]
    return "\n".join("  ".join(c.ljust(w) for c, w in zip(line, widths, strict=True)).rstrip() for line in lines)


def main() -> int:
    """Try every Python; 1 where any fails."""
    found = interpreters(os.environ.get("PYTHONS", ""))
    if not found:
        sys.stderr.write(
            "test-pythons: no Python from 3.11 to 3.14 is found; name them, as in PYTHONS='python3.12 python3.13'\n"
        )
        return 1
    LOGS.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    for interpreter in found:
        sys.stdout.write(
            f"test-pythons: {interpreter.version} ({interpreter.program}); output in build/pythons/{interpreter.version}.log\n"
        )
        sys.stdout.flush()
        with tempfile.TemporaryDirectory(prefix="tumbleline-pythons-", ignore_cleanup_errors=True) as folder:
            data = ROOT.parent / "shared"
            if data.is_dir():
                (Path(folder) / data.name).symlink_to(data)
            outcomes.append(tried(interpreter, os.environ.get("TESTS", ""), Path(folder)))
        sys.stdout.write(table([outcomes[-1].row()]) + "\n")
    sys.stdout.write("\n" + table([outcome.row() for outcome in outcomes]) + "\n")
    return 0 if all(outcome.good for outcome in outcomes) else 1


if __name__ == "__main__":
    sys.exit(main())
