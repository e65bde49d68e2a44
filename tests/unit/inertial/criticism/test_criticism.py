"""Small modules of the judge: what places gain, what stays unseen, the smallest size, classes of equals, evenness, draws."""

import numpy as np
import pytest
from long_suites import mostly_slow
from made_worlds import BASE, Noise, World, lot_in, make

from inertial import effects as catalogue
from inertial import poses
from inertial.criticism import adequacy, noise_draws
from inertial.criticism.drivers import drivers_of
from inertial.criticism.field import Candidates
from inertial.criticism.jumps import _evenness
from inertial.criticism.noise_draws import NoiseDraws
from inertial.criticism.search import judge, ranked
from inertial.criticism.unseen import smallest_named, unseen
from inertial.data_errors.handling import alternatives
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation import covariance, problem, share_statistics, space
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Gain
from inertial.estimation.term import Term
from inertial.frames import force_from_angles
from inertial.state import State
from pipelines.diagnosis.diagnose import diagnose
from pipelines.tables.dwells import lot_of, measured

SEED = 5_500_000


def test_a_column_of_one_dwell_gains_the_same_without_being_whitened():
    made = make(World(units=3, durations=(2.0, 60.0), noise=Noise(unit_white=(5.0, 1.0, 1.0))), SEED)
    there = (made.dwells["unit"] != "W002") | ~made.dwells["dwell"].isin([5, 6])
    problem = Problem(lot_of(measured(made.dwells[there], made.history)))
    model = Model(problem, terms_of(catalogue.get_all([*BASE, "level_error"]), problem))
    field = Candidates(problem, [], [WrongPose()])
    quick = field.gains([model.space], set(), handling=True)[0]["wrong_pose"]
    plain = Gain.joined([model.space.gain(one) for one in problem.pieces(WrongPose(), field.grids["wrong_pose"])])
    np.testing.assert_array_equal(quick.rank, plain.rank)
    np.testing.assert_allclose(quick.drop, plain.drop, rtol=1e-6, atol=1e-6)


def test_what_a_run_at_one_temperature_cannot_show_is_said_whatever_state_a_run_may_begin_in():
    """A play that begins at its edge would rectify the scatter of the thermometer, and count as seen."""
    made, rng = make(World(units=4, poses=24), SEED), np.random.default_rng(5)
    dwells = made.dwells[made.dwells["unit_C"].between(15.0, 35.0)].copy()
    dwells["unit_C"] = 25.0 + 0.05 * rng.standard_normal(len(dwells))
    problem = Problem(lot_of(measured(dwells)))
    base = Model(problem, terms_of(catalogue.get_all(BASE), problem))
    effect = catalogue.get("thermal_hysteresis")
    field = Candidates(problem, [effect])
    assert unseen(field, base, [effect])[0] == ("thermal_hysteresis",)
    assert smallest_named(field, base) == []


def stepped(dwells, size_ug: float):
    """Every series with a step in the middle of this RMS, its sign at random."""
    rng = np.random.default_rng(4)
    changed = dwells.copy()
    for _, own in dwells.groupby("unit"):
        step = (own["time_s"] > own["time_s"].median()).to_numpy(float)
        step *= 1e-6 * size_ug / np.sqrt(np.mean(step**2))
        for axis in "xyz":
            changed.loc[own.index, f"out_{axis}"] += step * rng.choice([-1.0, 1.0])
    return changed


@pytest.mark.slow
@pytest.mark.usefixtures("no_next_measurement")
def test_random_walk_raises_the_sizes_that_are_named_and_the_document_says_so() -> None:
    quiet, loud = (make(World(units=2, poses=12, noise=Noise(flicker=5.0, walk=k)), 43_000_001) for k in (0.0, 4.0))
    sizes = []
    for made in (quiet, loud):
        rows = {row["effect"]: row for row in diagnose(made.dwells, made.history)["smallest_named"]}
        sizes.append(rows["step_change"]["size_ug"])
        assert rows["step_change"]["without_slow_noise_ug"] <= rows["step_change"]["size_ug"]
    assert sizes[1] > 4.0 * sizes[0]
    for factor, told in ((0.4, False), (2.0, True)):
        classes = diagnose(stepped(loud.dwells, factor * sizes[1]), loud.history)["classes"]
        assert any("step_change" in group["effects"] for group in classes) is told


UNITS = 4
PLAIN = [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")]


@pytest.mark.parametrize("seed", mostly_slow(range(3), 1))
def test_cubic_and_quintic_at_faces_and_edges_are_equal_beside_a_table_that_rests_anew(seed: int) -> None:
    """Components of 0, ±√½ and ±1: beside a scale x³ and x⁵ are one column, and the data cannot prefer either."""
    rng = np.random.default_rng([seed, 18])
    angles = np.radians(np.concatenate([rng.permutation(poses.plan("eighteen")) for _ in range(2)]))
    n = len(angles)
    force = np.broadcast_to(force_from_angles(*angles.T), (UNITS, n, 3))
    # the rest position of the table is common to all units, their own noise is smaller
    noise = 3e-6 * rng.standard_normal((n, 3)) + 2e-6 * rng.standard_normal((UNITS, n, 3))
    time = np.broadcast_to(15.0 * np.arange(n), (UNITS, n))
    error = np.full((UNITS, n, 3), 2e-6)
    lot = Lot(State(force=force, time=time), force + 90e-6 * force**3 + noise, error, np.tile(np.eye(3), (UNITS, 1, 1)))
    problem = Problem(lot)
    model = Model(problem, PLAIN)
    terms = [Term(catalogue.get(name)) for name in ("third_order", "fifth_order")]
    field = Candidates(problem, [t.effect for t in terms], ())
    first, second = ranked([judge(field, model, t) for t in terms])
    assert first.log_p < np.log(1e-6)
    assert second.cost - first.cost < 0.1


def test_coefficients_of_one_distribution_are_even_and_two_of_many_are_not() -> None:
    rng = np.random.default_rng(5)
    even = [_evenness(40.0 * rng.standard_normal(24) ** 2) for _ in range(200)]
    assert np.mean(np.array(even) < -5.0) < 0.05
    assert _evenness(np.array([600.0, 150.0, *np.full(22, 1.0)])) < -50.0
    assert _evenness(np.array([141.0, 0.0, 0.0])) > -20.0  # three axes cannot say much
    assert np.isfinite(_evenness(40.0 * rng.standard_normal(300) ** 2))  # 100 units: binomials beyond 64 bits


EFFECTS = ("third_order", "odd_quadratic", "adc_nonlinearity", "level_error")


@pytest.fixture(scope="module")
def lot() -> Lot:
    return lot_in(make(World(units=2, poses=18, soaks=(25.0,)), 5_510_000))


def model_of(lot: Lot) -> Model:
    return Model(Problem(lot), PLAIN)


def numbers(lot: Lot) -> list[np.ndarray]:
    """Gains of effects and of every place of an alternative, and the probability that noise fits as badly."""
    base = model_of(lot)
    field = Candidates(base.problem, [catalogue.get(name) for name in EFFECTS], alternatives())
    (gains,) = field.gains([base.space], set(), handling=True)
    assert len(gains) > 4 + len(EFFECTS)
    probability = adequacy.adequacy(field, drivers_of(base.problem), base, np.random.default_rng(1))
    return [np.array(probability), np.array(base.noise.shares[:2]), *(g.drop for _, g in sorted(gains.items()))]


def test_small_pieces_and_empty_stores_change_no_number(lot: Lot, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = numbers(lot)
    assert whole[0] > np.log(adequacy.CERTAIN_BELOW)  # then noise is drawn
    for names, modules, value in (
        ("_PIECE", (problem, noise_draws, space), 300), ("PIECE", (covariance, share_statistics), 300),
        ("_CACHE", (problem,), 0), ("_PRODUCTS", (covariance,), 0), ("_KEPT", (noise_draws,), 0),
    ):  # fmt: skip
        for module in modules:
            monkeypatch.setattr(module, names, value)
    for one, other in zip(numbers(lot), whole, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-8 * max(float(np.max(np.abs(other))), 1.0))


def test_draws_worked_on_together_are_those_drawn_one_after_the_other(lot: Lot) -> None:
    base = model_of(lot)
    looks = list(Candidates(base.problem, [catalogue.get(name) for name in EFFECTS]).pieces())

    single, kept = (NoiseDraws(base, np.random.default_rng(2)) for _ in range(2))
    apart = np.concatenate([single.worst(looks, 7), single.worst(looks, 7)])
    assert apart.std() > 0.0
    np.testing.assert_allclose(kept.worst(looks, 7, 2), apart, rtol=1e-9)
    kept.keep(1)
    np.testing.assert_allclose(kept.worst(looks, 7)[0], apart[1], rtol=1e-9)
