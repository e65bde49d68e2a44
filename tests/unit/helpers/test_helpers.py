"""What the helpers of the tests do: rules over many things, and logs of a server."""

import os
from pathlib import Path

import pytest
from each import each
from orchestrator import BUSY, errors_in


def test_every_value_is_tried_and_all_that_are_wrong_are_named() -> None:
    seen = []

    @each([1, 2, 3, 4])
    def rule(value: int) -> None:
        seen.append(value)
        assert value != 2
        if value == 4:
            raise KeyError("gone")

    with pytest.raises(AssertionError, match=r"2 of 4 wrong\n2: AssertionError(.|\n)*4: KeyError: 'gone'"):
        rule()
    assert seen == [1, 2, 3, 4]
    with pytest.raises(pytest.skip.Exception):
        each([1, 1])(lambda _: pytest.skip("not here"))()
    with pytest.raises(AssertionError, match="nothing to check"):
        each([])(rule)()


@each(["first", "second"])
def test_every_value_has_a_folder_and_patches_of_its_own(value: str, tmp_path, monkeypatch) -> None:

    assert list(tmp_path.iterdir()) == []
    assert "TUMBLELINE_EACH" not in os.environ
    (tmp_path / value).touch()
    monkeypatch.setenv("TUMBLELINE_EACH", value)


def test_an_error_in_a_log_is_found_also_behind_one_that_sqlite_makes_of_itself(tmp_path: Path) -> None:
    log, slow = tmp_path / "log", "02:26:50.483 | WARNING | prefect.server - slow\n"
    busy = f"02:26:50.900 | ERROR   | prefect.server - Encountered error\nTraceback (most\n{BUSY}\n"
    failed = "02:26:49.950 | ERROR   | prefect.server.services.scheduler - Unexpected error\nTraceback (most recent call last):\n"
    assert not errors_in(log)
    for text in (failed, "CRITICAL: x\n", "ERROR:    Exception in ASGI application\n", "Traceback (most\n"):
        log.write_text(slow + text)
        assert errors_in(log).endswith(text)
    log.write_text(slow + busy + "02:26:50.483 | INFO    | x - no ERROR here\n")
    assert not errors_in(log)
    log.write_text(slow + busy + failed + slow)
    assert errors_in(log) == failed
