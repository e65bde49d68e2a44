"""Axes that stand still and torn words are found in records of any resolution, and in sound ones none."""

import numpy as np
import pytest
import recordings

from inertial.record_faults import clipped, frozen, resolution, torn

FEW, MANY = 25, 400
COUNTS = [FEW, pytest.param(MANY, marks=pytest.mark.slow, id="many")]
SEED = 706_114


def drawn(rng: np.random.Generator) -> recordings.Recording:
    return recordings.counts(
        rng,
        rate=float(rng.choice([50.0, 100.0, 200.0, 400.0])),
        positions=int(rng.integers(8, 25)),
        per_g=float(rng.choice([256.0, 1000.0, 4096.0, 16384.0, 131072.0])),
        noise=float(rng.uniform(0.4, 8.0)),
    )


def stands_still(one: recordings.Recording, rng: np.random.Generator) -> bool:
    axis, (start, stop) = int(rng.integers(3)), one.spans[int(rng.integers(len(one.spans)))]
    broken = one.output.copy()
    broken[start:stop, axis] = broken[start, axis]
    return any(f.axis == axis and f.start <= start + 5 and f.stop >= stop - 5 for f in frozen(broken))


def words_are_torn(one: recordings.Recording, rng: np.random.Generator) -> bool:
    power = 256.0 if one.noise * 8.0 < 256.0 else 512.0
    axis = int(rng.integers(3))
    wrong = rng.random(len(one.output)) < rng.uniform(0.06, 0.11)
    broken = one.output.copy()
    broken[wrong, axis] += power * rng.choice([-1.0, 1.0], size=int(wrong.sum()))
    faults = torn(broken)
    return [t.axis for t in faults] == [axis] and faults[0].offsets[0] == int(power)


def is_sound(one: recordings.Recording, _: np.random.Generator) -> bool:
    return not (frozen(one.output) or torn(one.output))


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize(("right", "number"), [(stands_still, 1), (words_are_torn, 2), (is_sound, 3)])
def test_faults_of_recordings_are_found_and_sound_ones_have_none(right, number: int, count: int) -> None:
    generators = [np.random.default_rng([SEED, number, k]) for k in range(count)]
    assert sum(right(drawn(rng), rng) for rng in generators) >= 0.99 * count


def test_counts_printed_in_g_with_few_digits_keep_their_lattice_and_torn_words() -> None:
    """A digit of 10⁻⁶ g on a step of 7.6·10⁻⁶ g: the smallest gaps are wrong by up to 13 %, the step is not."""
    hits, runs = 0, 12
    for number in range(runs):
        rng = np.random.default_rng([SEED, 4, number])
        one = recordings.counts(rng, rate=100.0, per_g=131072.0, noise=float(rng.uniform(1.0, 8.0)))
        broken, axis = one.output.copy(), int(rng.integers(3))
        wrong = rng.random(len(broken)) < 0.08
        broken[wrong, axis] += 256.0 * rng.choice([-1.0, 1.0], size=int(wrong.sum()))
        printed = np.round(broken / one.per_g, 6)
        assert resolution(printed[:, axis]) == pytest.approx(1.0 / one.per_g, rel=1e-4)
        hits += [t.axis for t in torn(printed)] == [axis]
    assert hits == runs


def test_single_precision_is_no_lattice_of_a_converter(rng: np.random.Generator) -> None:
    values = (9.7 + 5e-3 * rng.normal(size=4000)).astype(np.float32)
    printed = np.array([float(f"{value:.8g}") for value in values])
    assert resolution(printed) is None
    assert resolution(values.astype(np.float64)) is None
    counts = np.round(1.2e7 + 500.0 * rng.normal(size=4000))  # of 24 bits, where single precision has steps of one
    assert resolution(counts) == 1.0


def test_an_axis_that_never_changes_is_one_stretch_beside_others_that_do(rng: np.random.Generator) -> None:
    output = recordings.counts(rng).output
    output[:, 1] = 7.0
    assert [(f.axis, f.start, f.stop) for f in frozen(output)] == [(1, 0, len(output))]
    assert frozen(np.ones((500, 3))) == []
    coarse = np.tile([100.2, -40.4, 7.4], (4000, 1)) + 0.12 * rng.normal(size=(4000, 3))
    assert frozen(np.round(coarse)) == []  # digits coarser than the noise


@pytest.mark.parametrize("step", [1.0, 0.25, 3.9e-3, 1 / 16384])
def test_the_resolution_is_the_step_of_the_converter_also_in_printed_decimals(rng, step: float) -> None:
    values = step * np.round(rng.normal(0.0, 20.0, 4000))
    assert resolution(values) == pytest.approx(step, rel=1e-6)
    printed = np.array([float(f"{value:.7g}") for value in values])
    assert resolution(printed) == pytest.approx(step, rel=1e-3)
    assert resolution(rng.normal(size=4000)) is None


def test_samples_at_the_end_of_a_range_are_counted_and_a_largest_sample_of_noise_is_not(rng) -> None:
    wave = np.round(2000.0 * np.sin(np.linspace(0.0, 60.0, 6000)) + rng.normal(0.0, 3.0, 6000))
    assert clipped(wave)[2] == 0
    cut = np.clip(wave, -1500.0, 1500.0)
    low, high, count = clipped(cut)
    assert (low, high) == (-1500.0, 1500.0)
    assert count == pytest.approx(np.count_nonzero(np.abs(wave) >= 1500.0), rel=0.1)


def test_an_axis_whose_noise_is_a_tenth_of_a_digit_is_not_stuck_where_it_stands_between_two() -> None:
    """Twenty positions of 8 s, 256 LSB/g: the output stands still unless gravity is near the middle between two digits."""
    rng = np.random.default_rng(55)
    up = rng.standard_normal((20, 3))
    force = 256.0 * np.repeat(up / np.linalg.norm(up, axis=1, keepdims=True), 800, axis=0)
    fine, coarse = (np.round(force + sigma * rng.standard_normal(force.shape)) for sigma in (0.6, 0.1))
    assert frozen(coarse) == []
    assert frozen(fine) == []
    fine[4100:4700, 1] = fine[4100, 1]
    (one,) = frozen(fine)
    assert (one.axis, one.start) == (1, 4100)
    assert 4700 <= one.stop < 4720
