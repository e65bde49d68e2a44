"""Which stretches of a record that was turned by hand are rest."""

import numpy as np
import pytest
from long_suites import mostly_slow

from benchmarks.rest_and_motion import ROWS, counted, found, made
from pipelines.importers import stretches


def kept(output: np.ndarray, rate_hz: float, gravity: float | None) -> int:
    return len(stretches.found_stops(output, np.arange(len(output)) / rate_hz, [0, len(output)], gravity).found)


@pytest.mark.slow
def test_a_rest_beside_a_machine_is_a_rest_and_a_hand_in_motion_is_none_in_any_unit() -> None:
    rng, t = np.random.default_rng(4), np.arange(0.0, 20.0, 1e-3)
    machine = np.array([0.0, 0.0, 1.0]) + 0.1 * np.sin(2.0 * np.pi * 50.0 * t)[:, None] * [0.6, 0.5, 0.6]
    assert kept(machine + 2e-3 * rng.standard_normal((len(t), 3)), 1000.0, 1.0) == 1
    slow = np.arange(0.0, 60.0, 0.02)
    angle = 0.9 * np.sin(2.0 * np.pi * 0.7 * slow) + 0.5 * np.sin(2.0 * np.pi * 0.31 * slow)
    waved = np.stack([np.sin(angle), 0.3 * np.sin(2.0 * angle), np.cos(angle)], axis=1)
    waved += 4e-3 * rng.standard_normal(waved.shape)
    assert kept(waved, 50.0, 1.0) == 0
    assert kept(np.round(32768.0 + 8192.0 * waved), 50.0, None) == 0


@pytest.mark.parametrize(
    "row",
    mostly_slow([
        "5 Hz 0.05 g in a third of the rests", "50 Hz 0.1 g in half of the rests", "rests of 9 samples",
        "back to back, 9 samples", "noise 20 mg", "held for 1.5 to 3 s in half of the moves", "waved, counts",
    ], "50 Hz 0.1 g in half of the rests", "back to back, 9 samples", "waved, counts"),
)  # fmt: skip
def test_stops_made_by_mechanics_are_found_and_motion_is_none(row: str) -> None:
    for seed in (11, 12):
        record = made(ROWS[row], np.random.default_rng(seed))
        right, missed, false = counted(record, found(record))
        assert (missed, false) == (0, 0), f"{row}: {right} right"


def test_a_knock_does_not_part_a_rest_and_two_positions_without_a_move_are_two() -> None:
    rng, t = np.random.default_rng(5), np.arange(0.0, 12.0, 0.02)
    still = np.array([0.0, 0.0, 1.0]) + 1e-3 * rng.standard_normal((len(t), 3))
    assert kept(still, 50.0, 1.0) == 1
    parted = np.where((t < 6.0)[:, None], still, still[:, [2, 0, 1]])
    assert kept(parted, 50.0, 1.0) == 2


def test_the_end_of_a_slow_move_in_a_hand_is_no_stop_of_its_own() -> None:
    name = "slow moves of 4 to 8 s"
    number = list(ROWS).index(name)
    for k in range(20):
        record = made(ROWS[name], np.random.default_rng([9200, number, k]))
        if record.sd >= 5e-3:
            assert counted(record, found(record))[1:] == (0, 0)
