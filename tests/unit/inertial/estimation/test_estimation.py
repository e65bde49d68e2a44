"""Small modules of the estimate: models with one more term, shares of the noise, loudness by soak, scatter of the poses."""

import numpy as np
import pytest
from made_worlds import BASE, NOISES, NULLS, Noise, World, make, problem_in, run_of

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun
from inertial.data_errors.handling.gain_step import GainStep
from inertial.estimation.comparison import estimate
from inertial.estimation.likelihood import scatter_of_poses
from inertial.estimation.loudness import _of_soak as scatter_of_soak
from inertial.estimation.loudness import loudness_of
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Shares
from inertial.estimation.refinement import terms_of
from inertial.estimation.shares import plausible_shares
from inertial.estimation.term import Term
from pipelines.tables.dwells import lot_of, measured

TERM, EQUAL = (Term(GainStep(), (("unit", 1.0), ("dwell", 36.0))) for _ in range(2))


def base_model() -> Model:
    """Of a lot whose last unit reads 500 ppm more from the dwell half-way on."""
    made = make(World(units=2, noise=Noise(white=25.0, flicker=30.0)), 5_700_023)
    later = (made.dwells["unit"] == made.dwells["unit"].max()) & (made.dwells["dwell"] >= 36)
    made.dwells.loc[later, ["out_x", "out_y", "out_z"]] *= 1.0 + 500e-6
    return ExaminedRun(lot_of(measured(made.dwells, made.history), square=False), BASE).model()


def test_a_model_with_an_equal_term_has_the_same_noise_and_less_it_does_not_hold_it() -> None:
    base = base_model()
    richer = base.with_term(TERM)
    assert base.with_term(EQUAL).noise is richer.noise
    assert 1e6 * richer.shared_sizes(EQUAL) == pytest.approx([500.0], rel=0.2)
    assert [t.effect.id for t in richer.without_term(EQUAL).terms] == [t.effect.id for t in base.terms]
    with pytest.raises(KeyError, match="gain_step: not a term of the model"):
        base.shared_sizes(TERM)


@pytest.mark.parametrize("shares", [Shares(1.0, 0.0), Shares(3.0, 10.0), Shares(0.1, 100.0)])
def test_terms_that_are_added_in_turn_leave_what_they_leave_together(shares: Shares) -> None:
    base = base_model()
    terms = [Term(catalogue.get(name)) for name in ("third_order", "aging_linear", "second_order")]
    in_turn = base
    for place, term in enumerate(terms):
        in_turn = in_turn.with_term(term)
        together = Model(base.problem, [*base.terms, *terms[: place + 1]])
        assert in_turn._restricted(shares) == pytest.approx(together._restricted(shares), abs=1e-6)


SEED_OF_SHARES = 5_900_000


def test_shares_of_some_blocks_keep_those_of_their_own() -> None:
    shares = Shares(1.0, 2.0, own=((1, 10.0, 20.0), (4, 30.0, 0.0)))
    assert shares.common == Shares(1.0, 2.0)
    assert (shares.of_block(4), shares.of_block(0)) == (Shares(30.0, 0.0), Shares(1.0, 2.0))
    assert shares.pick([4, 0, 1]) == Shares(1.0, 2.0, own=((0, 30.0, 0.0), (2, 10.0, 20.0)))
    assert shares.pick([0, 2]) == Shares(1.0, 2.0)
    assert shares.times(2.0, 3.0) == Shares(2.0, 6.0, own=((1, 20.0, 60.0), (4, 60.0, 0.0)))


@pytest.mark.parametrize("seed", range(3))
def test_an_axis_that_wanders_by_itself_has_shares_of_its_own(seed: int) -> None:
    made = make(World(noise=Noise(white=100.0, flicker=0.0)), SEED_OF_SHARES + 10 + seed)
    dwells = made.dwells.copy()
    wanders = (dwells["unit"] == dwells["unit"].unique()[2]).to_numpy()
    steps = np.random.default_rng(seed).standard_normal(int(wanders.sum()))
    dwells.loc[wanders, "out_y"] += 40e-6 * np.cumsum(steps)
    lot = lot_of(measured(dwells, made.history), square=False)
    noise = ExaminedRun(lot, BASE).model().noise
    (own,) = noise.shares.own
    assert own[0] == 3 * 2 + 1
    assert own[1] + own[2] > 30.0 * max(noise.shares.flicker + noise.shares.walk, 1.0)


def test_equal_axes_have_the_shares_of_their_lot() -> None:
    runs = [run_of(NULLS[name], SEED_OF_SHARES + seed) for name in ("B30", "K4", "white") for seed in range(3)]
    assert [run.model().noise.shares.own for run in runs] == [()] * 9


def test_plausible_shares_are_those_that_the_likelihood_leaves_with_weights_that_add_up() -> None:
    plausible = plausible_shares(
        lambda s: 40.0 * (np.log10(s.flicker + 1e-2) - 1.0) ** 2 + 1e3 * (s.walk > 0.02), Shares(10.0)
    )
    assert sum(weight for _, weight in plausible) == pytest.approx(1.0)
    assert max(plausible, key=lambda one: one[1])[0].flicker == pytest.approx(10.0)
    assert {round(np.log10(s.flicker), 1) for s, _ in plausible} == {0.5, 1.0, 1.5}
    assert all(s.walk <= 0.1 for s, _ in plausible)


def test_noise_that_grows_with_temperature_is_known_for_each_soak() -> None:
    run = run_of(NOISES["hot_x4"], SEED_OF_SHARES)
    loud = loudness_of(run.model())
    assert loud is not None
    warm = np.median(run.lot.state.temperature, axis=0)
    cold, hot = (float(np.median(loud[warm == each])) for each in (warm[np.argmin(warm)], warm[np.argmax(warm)]))
    # of the fast part alone the ratio is four; what is slower than a soak does not grow
    assert 1.7 < hot / cold < 4.5
    assert np.mean(loud**2) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["B30", "K4", "t3", "lengths", "units_spread", "one_unit", "B300"])
def test_soaks_of_equal_noise_are_not_told_apart(name: str) -> None:
    assert [loudness_of(run_of(NULLS[name], SEED_OF_SHARES + seed).model()) for seed in range(4)] == [None] * 4


@pytest.mark.parametrize("name", ["B30", "white", "B300"])
def test_the_scatter_of_a_few_dwells_is_on_average_as_large_as_that_of_many(name: str) -> None:
    """The logarithm of a scatter with few degrees of freedom lies far below that of its mean."""
    soaks = [np.arange(9), np.arange(9, 17), np.arange(17, 57)]
    ratios: list[np.ndarray] = []
    for seed in range(10):
        model = run_of(NULLS[name], SEED_OF_SHARES + 40 + seed).model()
        fitted = estimate(model)
        series = model.problem.y - np.einsum("bnp,bp->bn", model.local, fitted.local)
        ratios.append(np.stack([scatter_of_soak(model, series, places) for places in soaks], axis=1))
    every = np.concatenate(ratios)
    each = every.mean(axis=0)
    assert np.all(np.abs(each - each.mean()) < 0.2)  # the means themselves differ by half, of 7 % each


SEED = 5_500_000


@pytest.mark.parametrize(("rest", "least", "most"), [(0.0, 1.0, 1.0), (20.0, 2.0, 8.0)])
def test_what_is_said_of_the_station_stands_out_of_the_scatter_of_all_poses(rest, least, most):
    made = make(World(soaks=(25.0,), repeats=2, rest=rest), SEED)
    problem = problem_in(made)
    model = Model(problem, terms_of(catalogue.get_all(BASE[:3]), problem))
    # 20 µrad of rest beside 10 µg of the mean of eight units: about 1 + (20/10)² in variance
    assert least <= scatter_of_poses(model) <= most
