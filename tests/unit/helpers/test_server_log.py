"""What a server logs as an error fails the tests that start one."""

from pathlib import Path

import pytest
from orchestrator import BUSY, errors_in

STARTED = "02:26:50.483 | WARNING | prefect.server - slow\n"
FAILED = "02:26:49.950 | ERROR   | prefect.server.services.scheduler - Unexpected error\nTraceback (most recent call last):\n"


@pytest.mark.parametrize(
    "text", [FAILED, "CRITICAL: x\n", "ERROR:    Exception in ASGI application\n", "Traceback (most\n"]
)
def test_an_error_is_found_with_what_follows_it(tmp_path: Path, text: str) -> None:
    log = tmp_path / "log"
    log.write_text(STARTED + text)
    assert errors_in(log).endswith(text)


def test_an_error_behind_one_that_sqlite_makes_of_itself_is_found(tmp_path: Path) -> None:
    log = tmp_path / "log"
    busy = f"02:26:50.900 | ERROR   | prefect.server - Encountered error\nTraceback (most\n{BUSY}\n"
    log.write_text(STARTED + busy)
    assert not errors_in(log)
    log.write_text(STARTED + busy + FAILED + STARTED)
    assert errors_in(log) == FAILED


def test_warnings_and_a_missing_log_are_no_errors(tmp_path: Path) -> None:
    (tmp_path / "log").write_text(STARTED + "02:26:50.483 | INFO    | x - no ERROR here\n")
    assert errors_in(tmp_path / "log") == errors_in(tmp_path / "none") == ""
