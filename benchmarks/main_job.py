"""The main job, timed from the command to the report: `python benchmarks/main_job.py`.

`tumbleline run` is started as by a user, once with `--direct` and once through the orchestrator, each in a new
archive. Wall times by stage are those that the command prints; peak memory is that of the process of the command, and for the
orchestrator also of its server.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
STAGE = re.compile(r"^(\w+)\s+(\d+\.\d) s$")
MB = 2.0**20
LOOK_S = 0.1
WAYS = {"direct": ("--direct",), "orchestrator": ()}


@dataclass
class Timed:
    """One run: wall time in s, total and of each stage, and peak memory in bytes of the command and its server."""

    seconds: float = 0.0
    stages: dict[str, float] = field(default_factory=dict)
    command_bytes: int = 0
    server_bytes: int = 0
    status: int = 0

    @property
    def outside_capture(self) -> float:
        """Time of all stages except the capture, s."""
        return sum(seconds for name, seconds in self.stages.items() if name != "capture")

    @property
    def around(self) -> float:
        """Time outside the stages: interpreter, imports, start and history of the orchestrator, s."""
        return self.seconds - sum(self.stages.values())


def resident(pid: int) -> int:
    """Peak resident memory of a process, bytes; 0 where it has ended or the system does not report it."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return 0
    match = re.search(r"VmHWM:\s+(\d+) kB", status)
    return 1024 * int(match[1]) if match else 0


def server_of(archive: Path) -> int:
    """Process id of the server of the orchestrator beside an archive; 0 without one."""
    try:
        match = re.search(r'"pid":\s*(\d+)', (archive / "orchestrator" / "server.json").read_text())
    except OSError:
        return 0
    return int(match[1]) if match else 0


def timed(recipe: str, options: tuple[str, ...]) -> Timed:
    """One run of the command in an empty archive."""
    out = Timed()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        archive = Path(folder) / "archive"
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "200"}
        command = [sys.executable, "-m", "pipelines.cli", "run", recipe, "--archive", str(archive), "--json", *options]
        start = time.perf_counter()
        process = subprocess.Popen(
            command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        output: list[str] = []
        reader = threading.Thread(target=lambda: output.extend(process.stderr or ()))
        reader.start()
        while process.poll() is None:
            out.command_bytes = max(out.command_bytes, resident(process.pid))
            out.server_bytes = max(out.server_bytes, resident(server_of(archive)))
            time.sleep(LOOK_S)
        out.seconds = time.perf_counter() - start
        reader.join()
    out.status = process.returncode
    if out.status not in {0, 1}:
        raise RuntimeError(f"main_job: status {out.status}: {''.join(output)[-2000:]}")
    out.stages = {m[1]: float(m[2]) for line in output if (m := STAGE.match(line.strip()))}
    return out


def show(way: str, one: Timed) -> None:
    """Prints a run."""
    stages = " · ".join(f"{name} {seconds:.1f}" for name, seconds in one.stages.items())
    server = f", its server {one.server_bytes / MB:.0f} MB" if one.server_bytes else ""
    print(f"{way:<13} {one.seconds:6.1f} s from command to report; peak memory {one.command_bytes / MB:.0f} MB{server}")
    print(
        f"{'':<13} {one.outside_capture:6.1f} s in stages after capture; {one.around:.1f} s start-up and orchestrator"
    )
    print(f"{'':<13} s by stage: {stages}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--recipe", default="production", help="a recipe file or a built-in recipe")
    parser.add_argument("--way", action="append", choices=list(WAYS), help="only this (repeatable)")
    options = parser.parse_args()
    ways = options.way or list(WAYS)
    print(f"python benchmarks/main_job.py --recipe {options.recipe} {' '.join(f'--way {way}' for way in ways)}")
    for way in ways:
        show(way, timed(options.recipe, WAYS[way]))


if __name__ == "__main__":
    main()
