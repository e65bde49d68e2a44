"""A module of Python run as a process of its own in the project's root, as a worker or an operator's shell would."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def python(environment: dict[str, str], *arguments: str) -> str:
    """Output of a module, run in the project's root."""
    done = subprocess.run(
        [sys.executable, *arguments],
        cwd=ROOT,
        env=environment,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
