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


@pytest.mark.parametrize(("began_s", "now_s"), [(-500.0, 500.0), (86400.0, 100.0), (-100.0, 100.0)])
def test_a_resumed_clock_counts_the_time_between_and_a_date_that_was_set_back_takes_no_run_back(began_s, now_s):
    clock = WallClock(json.dumps({"now_s": 100.0, "began_s": time.time() + began_s}).encode())
    assert clock.now() == pytest.approx(now_s, abs=1.0)
    assert WallClock(clock.state()).now() == pytest.approx(now_s, abs=1.0)
