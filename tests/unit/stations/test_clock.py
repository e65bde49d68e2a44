"""The clock of a run on hardware: it goes on over sessions, and never back."""

import json
import time

import pytest

from stations.clock import WallClock


def test_a_clock_begins_at_zero_and_goes_on():
    clock = WallClock()
    first = clock.now()
    clock.sleep(0.02)
    assert 0.0 <= first < 0.01
    assert clock.now() >= first + 0.02


def test_a_resumed_clock_counts_the_time_between():
    state = json.dumps({"now_s": 100.0, "began_s": time.time() - 500.0}).encode()
    assert WallClock(state).now() == pytest.approx(500.0, abs=1.0)


def test_a_date_that_was_set_back_never_takes_a_run_back():
    state = json.dumps({"now_s": 100.0, "began_s": time.time() + 86400.0}).encode()
    assert WallClock(state).now() == pytest.approx(100.0, abs=1.0)


def test_its_state_is_what_the_next_one_needs():
    clock = WallClock(json.dumps({"now_s": 100.0, "began_s": time.time() - 100.0}).encode())
    assert WallClock(clock.state()).now() == pytest.approx(100.0, abs=1.0)
