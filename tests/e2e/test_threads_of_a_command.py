"""A command computes on one BLAS thread without the Makefile, and the help does not wait for numpy."""

import json
import os
import subprocess
import sys

import pytest

from pipelines.cli import THREADS

ASKED = """
import json, sys
from pipelines.cli import main
{change}
sys.argv = ["tumbleline", *{words}]
try:
    main()
except SystemExit:
    pass
import threadpoolctl
loaded = "numpy" in sys.modules
import numpy, scipy.linalg
pools = [one["num_threads"] for one in threadpoolctl.threadpool_info() if one["user_api"] == "blas"]
sys.stderr.write(json.dumps({{"loaded": loaded, "pools": pools}}) + "\\n")
"""


def threads(*words: str, change: str = "", **variables: str) -> dict:
    """Whether a command has loaded numpy, and the BLAS threads in its process after it."""
    environment = {key: value for key, value in os.environ.items() if key not in THREADS} | variables
    done = subprocess.run(
        [sys.executable, "-c", ASKED.format(words=list(words), change=change)],
        env=environment, capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    return json.loads(done.stderr.splitlines()[-1])


def test_a_command_computes_on_one_thread() -> None:
    report = threads("plan", "production", "--json")
    assert report["loaded"]
    assert report["pools"]
    assert set(report["pools"]) == {1}


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS takes no second thread on one processor")
def test_a_number_that_the_user_has_set_is_kept() -> None:
    assert set(threads("--version", OMP_NUM_THREADS="2")["pools"]) == {2}


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="BLAS takes no second thread on one processor")
def test_without_the_setting_there_are_several() -> None:
    """The test above could fail: the libraries of this machine take more threads when nobody limits them."""
    change = "import pipelines.cli; pipelines.cli._one_thread = lambda: None"
    assert max(threads("--version", change=change)["pools"]) > 1


def test_the_help_does_not_load_numpy() -> None:
    assert not threads("--help")["loaded"]
