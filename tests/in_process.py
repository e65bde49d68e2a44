"""A command in this process, answered as by a process of its own: the start of an interpreter costs seconds of imports."""

import contextlib
import io
import subprocess
import sys
from collections.abc import Callable, Sequence

import pytest

from pipelines.cli import main

Given = Callable[..., tuple[int, str, str]]


def command(words: Sequence[str], columns: int = 200) -> subprocess.CompletedProcess[str]:
    """Status, standard output and standard error of ``tumbleline`` with these words; a pipe has no columns, which is 0."""
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(sys, "argv", ["tumbleline", *words])
        patch.setenv("COLUMNS", str(columns)) if columns else patch.delenv("COLUMNS", raising=False)
        with pytest.raises(SystemExit) as left:
            main()
    return subprocess.CompletedProcess([*words], int(left.value.code or 0), out.getvalue(), err.getvalue())


def given(*words: object, columns: int = 200) -> tuple[int, str, str]:
    """The same as three values: status, standard output, standard error."""
    done = command([*map(str, words)], columns)
    return done.returncode, done.stdout, done.stderr
