"""Small modules of the estimate: models with one more term, shares and scatter of the noise, refined dwells, shared noise."""

from dataclasses import replace

import numpy as np
import pytest
from long_suites import mostly_slow
from made_worlds import BASE, NOISES, NULLS, Noise, World, make, problem_in, run_of

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun
from inertial.data_errors.handling import named
from inertial.data_errors.handling.gain_step import GainStep
from inertial.estimation.comparison import estimate
from inertial.estimation.likelihood import shared_factor
from inertial.estimation.loudness import _of_soak as scatter_of_soak
from inertial.estimation.loudness import loudness_of
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Shares
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import better_placed, terms_of
from inertial.estimation.shares import plausible_shares
from inertial.estimation.term import Term
from inertial.frames import force_from_angles
from inertial.state import State
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


SEED_OF_SHARES = 5_900_000


@pytest.mark.parametrize("seed", mostly_slow(range(3), 0))
def test_an_axis_that_wanders_by_itself_has_shares_of_its_own(seed: int) -> None:
    made = make(World(noise=Noise(white=100.0, flicker=0.0)), SEED_OF_SHARES + 10 + seed)
    dwells = made.dwells.copy()
    wanders = (dwells["unit"] == dwells["unit"].unique()[2]).to_numpy()
    steps = np.random.default_rng(seed).standard_normal(int(wanders.sum()))
    dwells.loc[wanders, "out_y"] += 40e-6 * np.cumsum(steps)
    lot = lot_of(measured(dwells, made.history), square=False)
    noise = ExaminedRun(lot, BASE).model().noise
    (own,) = noise.shares.by_block
    assert own[0] == 3 * 2 + 1
    assert own[1] + own[2] > 30.0 * max(noise.shares.flicker + noise.shares.walk, 1.0)


@pytest.mark.slow
def test_equal_axes_have_the_shares_of_their_lot() -> None:
    runs = [run_of(NULLS[name], SEED_OF_SHARES + seed) for name in ("B30", "K4", "white") for seed in range(2)]
    assert [run.model().noise.shares.by_block for run in runs] == [()] * 6


def test_plausible_shares_are_those_that_the_likelihood_leaves_with_weights_that_add_up() -> None:
    def deviance(shares: Shares) -> float:
        return 40.0 * (np.log10(shares.flicker + 1e-2) - 1.0) ** 2 + 1e3 * (shares.walk > 0.02)

    plausible = plausible_shares(deviance, Shares(10.0))
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


@pytest.mark.parametrize("name", mostly_slow(["B30", "K4", "t3", "lengths", "units_spread", "one_unit", "B300"], "t3"))
def test_soaks_of_equal_noise_are_not_told_apart(name: str) -> None:
    assert [loudness_of(run_of(NULLS[name], SEED_OF_SHARES + seed).model()) for seed in range(2)] == [None] * 2


@pytest.mark.slow
@pytest.mark.parametrize("name", mostly_slow(["B30", "white", "B300"], "B30"))
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


@pytest.mark.parametrize("beside", [-2, 0, 3])
def test_a_unit_that_moved_is_placed_at_the_dwell_of_the_move(beside: int) -> None:
    made = make(World(units=3, fault="unit_moved", amount=1.0), 6_600_001)
    (told,) = made.faults
    problem, moved = problem_in(made), named("unit_moved")

    def at(dwell: int) -> Term:
        return Term(moved, (("unit", float(int(told.units[0][1:]) - 1)), ("dwell", float(dwell))))

    model = Model(problem, [*terms_of(catalogue.get_all(BASE), problem), at(told.dwells[0] + beside)])
    assert better_placed(model, model.terms[-1]) == (at(told.dwells[0]) if beside else None)


def test_an_error_without_an_instant_stays_where_it_is() -> None:
    problem, term = problem_in(make(World(units=3), 6_600_002)), Term(named("pose_off"), (("pose", 3.0),))
    assert better_placed(Model(problem, [*terms_of(catalogue.get_all(BASE), problem), term]), term) is None


@pytest.mark.parametrize("later_s", mostly_slow([0.0, 12.0], 12.0))
def test_a_step_is_placed_in_each_gap_of_a_run_longer_than_the_grid(later_s: float) -> None:
    # units read one after the other divide each gap, and the grid has one instant in five
    units, dwells = 4, 3 * 48
    made = make(World(units=units, poses=48, noise=Noise(white=25.0, flicker=30.0)), 5_900_001)
    lot = lot_of(measured(made.dwells, made.history), square=False)
    state = replace(lot.state, time=lot.state.time + later_s * np.arange(units)[:, None] / units, memory={})
    effects = catalogue.get_all([*BASE, "step_change"])
    (instant,) = effects[-1].parameters(state)
    assert len(instant.choices) < dwells - 3
    for dwell in range(40, 110, 9):
        later = (np.arange(dwells) >= dwell)[None, :, None]
        jumped = replace(lot, state=replace(state, memory={}), output=lot.output + 300e-6 * later)
        found = terms_of(effects, Problem(jumped))[-1].keywords["instant"]
        assert ((state.time > found).argmax(axis=1) == dwell).all()


UNITS, DWELLS = 4, 120
PLAIN = [Term(catalogue.get(name)) for name in ("bias", "scale", "misalignment")]
DRIFT = Term(catalogue.get("aging_linear"))


def model_of(rng: np.random.Generator, together: float, drift: np.ndarray, *, missing: bool = False) -> Model:
    """Ideal units that drift, with noise of a microgram of which the share ``together`` is the same in all units."""
    outer, inner = rng.uniform(-3.0, 3.0, (2, DWELLS))
    time = np.broadcast_to(30.0 * np.arange(DWELLS), (UNITS, DWELLS))
    force = np.broadcast_to(force_from_angles(outer, inner), (UNITS, DWELLS, 3))
    own, common = rng.standard_normal((UNITS, DWELLS, 3)), rng.standard_normal((DWELLS, 3))
    noise = 1e-6 * (np.sqrt(1.0 - together) * own + np.sqrt(together) * common)
    output = force + drift[:, None, None] * (time / 3600.0)[..., None] + noise
    error = np.full(output.shape, 1e-6)
    if missing:
        error[0, 5] = np.inf
    lot = Lot(State(force=force, time=time), output, error, np.broadcast_to(np.eye(3), (UNITS, 3, 3)))
    return Model(Problem(lot), [*PLAIN, DRIFT])


@pytest.mark.parametrize("missing", [False, True])
def test_what_is_alike_in_all_units_counts_less_the_more_they_share(rng, missing):
    for together in (0.3, 0.5, 0.9):
        factor = shared_factor(model_of(rng, together, np.full(UNITS, 2e-5), missing=missing), DRIFT)
        assert factor == pytest.approx(1.0 + (UNITS - 1) * together, rel=0.12)


def test_independent_units_one_unit_and_what_differs_in_sign_from_unit_to_unit_count_in_full(rng):
    assert shared_factor(model_of(rng, 0.0, np.full(UNITS, 2e-5)), DRIFT) == 1.0
    lot = model_of(rng, 0.5, np.full(UNITS, 2e-5)).problem.lot
    assert shared_factor(Model(Problem(lot.units([0])), [*PLAIN, DRIFT]), DRIFT) == 1.0
    signs = np.array([1.0, -1.0, 1.0, -1.0])
    assert shared_factor(model_of(rng, 0.6, 2e-5 * signs), DRIFT) == pytest.approx(1.0, abs=0.05)
