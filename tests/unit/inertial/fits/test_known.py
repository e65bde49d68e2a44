"""Allowances of a decision during a run: held against simulated looks, and the length of a dwell against its limits."""

from itertools import pairwise

import numpy as np
import pytest

from inertial.distributions import normal_tail
from inertial.fits.known import MISSED, DwellNoise, chosen_length, largest_ratio, looks_at, noise_guard, over_looks

LOTS = 4000


def test_looks_grow_from_the_first_to_before_the_last() -> None:
    counts = looks_at(8, 216)
    assert (counts[0], counts[-1] < 216) == (8, True)
    assert all(b > a for a, b in pairwise(counts))
    assert counts[-1] * 1.15 + 1 > 216
    assert looks_at(9, 9) == []


@pytest.mark.parametrize("dof", [12, 300])
def test_a_run_that_ends_at_the_first_look_within_its_guard_seldom_has_a_larger_noise(dof: int) -> None:
    counts = [dof + k for k in looks_at(10, 100)]
    noise = np.random.default_rng(5).standard_normal((LOTS, counts[-1]))
    wrong = np.zeros(LOTS, dtype=bool)
    for count in counts:
        estimated = np.sqrt(np.mean(noise[:, :count] ** 2, axis=1))
        wrong |= estimated * noise_guard(count, len(counts)) < 1.0
    assert wrong.mean() <= MISSED
    assert wrong.mean() > 0.0


def test_several_decisions_are_wrong_as_seldom_as_one() -> None:
    factor = over_looks(2.0, 10)
    assert 10.0 * float(normal_tail(factor)) == pytest.approx(float(normal_tail(2.0)))
    assert over_looks(2.0, 1) == pytest.approx(2.0)


def test_only_what_is_asked_for_is_compared() -> None:
    errors = np.array([[[1.0, 5.0, 5.0]], [[3.0, 1.0, 9.0]]])
    effects = ("bias", "scale", "misalignment")
    assert largest_ratio(errors, effects, {"bias": 2.0, "scale": 10.0}) == pytest.approx([0.5, 1.5])
    assert largest_ratio(errors, effects, {}) == pytest.approx([0.0, 0.0])


def test_a_dwell_ends_when_its_mean_is_no_better_known_and_is_longer_where_the_plan_is_not_enough() -> None:
    """White noise alone: a tenth more variance is a tenth less time. Wander alone: the shortest dwell says as much.

    Where the plan is not enough, by hand: white variance w·L₀/L times L + b falls with L; wander makes longer ones idle.
    """

    def length(white: float, wander: float, longest: int = 20, *, enough: bool) -> float:
        lengths = np.arange(1.0, longest + 1.0)
        return chosen_length(DwellNoise(white, wander, 10.0, 15.0), 10.0, lengths, enough=enough)

    assert [length(1.0, 0.0, enough=True), length(0.0, 1.0, enough=True)] == [10.0, 1.0]
    between = [length(white, 1.0, enough=True) for white in (0.1, 0.2, 0.4, 1.0)]
    assert between == sorted(between)
    assert 1.0 < between[1] < 10.0
    assert [length(1.0, 0.0, enough=False), length(0.0, 1.0, enough=False)] == [20.0, 10.0]
    assert length(1.0, 0.0, 5, enough=False) == 10.0
