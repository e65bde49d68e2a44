"""What of a reduction of the deviance is common to all units: its part, its price, and the noise that divides it."""

import gc
import weakref

import numpy as np
import pytest
from scipy import stats

from benchmarks.large_lots import MODEL, many_units
from inertial.criticism.noise_draws import NoiseDraws
from inertial.effects import get_all
from inertial.estimation import likelihood
from inertial.estimation.candidate import Candidate
from inertial.estimation.covariance import Covariance
from inertial.estimation.likelihood import Common, known_together, likelihood_ratio, together, weighed
from inertial.estimation.model import Model
from inertial.estimation.noise_shares import Noise, Shares
from inertial.estimation.penalty import price
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Space
from inertial.estimation.term import Term


def blank(units: int, axes: int, n: int, y: np.ndarray, error: np.ndarray | None = None) -> Space:
    """The space of a model without columns, of white noise of variance one."""
    time, none = np.tile(np.arange(n) * 30.0, (units * axes, 1)), np.zeros((units * axes, n, 0))
    covariance = Covariance(time, np.ones(time.shape) if error is None else error, axes=axes)
    return Space(covariance, Noise(Shares(), np.ones(units * axes)), y, none, none)


@pytest.mark.parametrize(("drop", "own"), [(100.0, 240.0), (100.0, 220.0), (100.0, 900.0), (2.0, 300.0), (2.0, 200.0)])
def test_the_common_part_of_a_deviance_rises_with_it(drop: float, own: float) -> None:
    common = Common(drop=drop, own=own, rank=3, units=80)
    deviance = np.linspace(0.0, 2.0 * (drop + own), 4000)
    mean, of_units = np.array([common.parted(d, 240) for d in deviance]).T
    np.testing.assert_allclose(mean + of_units, deviance)
    for part in (mean, of_units):
        assert part[0] == 0.0
        assert np.all(np.diff(part) >= -1e-12)
        assert np.max(np.diff(part)) <= 1.001 * deviance[1]  # without a jump
    # a term that explains no more than chance is no effect that all have, whatever it takes off the sum of squares
    assert all(weighed(d, 240, 0, common=common).score < 1.0 for d in deviance[deviance < min(own, 237.0)].tolist())


@pytest.mark.parametrize(("k", "deviance"), [(3, 40.0), (3, 2.0), (7, 20.0), (7, 0.0)])
def test_a_deviance_less_its_price_is_twice_the_logarithm_of_the_evidence(k: int, deviance: float) -> None:
    value = np.sqrt(deviance / k)
    evidence = k * (stats.norm.logpdf(value, scale=max(value, 1.0)) - stats.norm.logpdf(value))
    assert deviance - price(deviance, k) == pytest.approx(2.0 * evidence, abs=1e-9)


@pytest.mark.parametrize(("axes", "n"), [(1, 12), (3, 36)])
def test_units_of_their_own_noise_seldom_appear_to_vary_together(rng: np.random.Generator, axes: int, n: int) -> None:
    space = blank(4, axes, n, np.zeros((4 * axes, n)))
    draws = rng.standard_normal((400, 4 * axes, n))
    assert np.mean([together(space, each) > 1.0 for each in draws]) < 0.08
    alike = draws + np.tile(rng.standard_normal((400, axes, n)), (1, 4, 1))
    found = [together(space, each) for each in alike]
    assert np.mean(np.array(found) > 1.0) > 0.75
    assert np.median(found) == pytest.approx(5.0, rel=0.6)
    assert known_together(space) == pytest.approx(0.4 * axes * n)


def test_what_all_units_share_is_fitted_with_missing_dwells_and_units_of_other_noise(rng: np.random.Generator) -> None:
    error = np.repeat([1.0, 5.0], 6)[:, None] * np.ones((12, 20))
    error[2, 3], error[7, 9:12] = np.inf, np.inf
    columns = rng.standard_normal((12, 20, 1, 2))
    common = np.einsum("bngp,bp->bn", columns, np.tile(rng.standard_normal((3, 2)), (4, 1)))
    space = blank(4, 3, 20, 1e4 * common, error)
    candidate = Candidate(columns, shared=False)
    np.testing.assert_allclose(likelihood.common_fit(space, candidate, 0), space.residual, atol=1e-6)
    gain = space.gain(candidate)
    assert float(gain.common[0]) == pytest.approx(space.rss)
    assert (int(gain.common_rank[0]), int(gain.rank[0])) == (6, 24)


@pytest.mark.parametrize("axes", [3, 12])
def test_the_common_part_of_a_gain_is_the_same_at_noise_that_includes_the_effect(
    rng: np.random.Generator, axes: int
) -> None:
    columns = rng.standard_normal((12, 60, 1, 1))
    y = rng.standard_normal((12, 60)) + 4.0 * columns[..., 0, 0]
    parts: list[Common] = []
    for size in (1.0, 5.0):
        space = blank(12 // axes, axes, 60, y, size * np.ones((12, 60)))
        gain = space.gain(Candidate(columns, shared=False))
        parts.append(likelihood.common_at(space, gain, 0))
        if axes == 12:  # of one unit, or of norms, nothing is common
            np.testing.assert_allclose(gain.common, gain.drop)
            assert (parts[-1].units, weighed(90.0, 12, 0, common=parts[-1])) == (1, weighed(90.0, 12, 0))
    assert (parts[1].drop, parts[1].own) == pytest.approx((parts[0].drop, parts[0].own))


def test_draws_are_tested_for_what_all_units_share_as_the_data_are() -> None:
    problem = Problem(many_units(6, 1))
    model = Model(problem, terms_of(get_all(("bias", "scale", "misalignment")), problem))
    column = np.random.default_rng(3).standard_normal((1, problem.n, 1, 1)) * np.ones((problem.blocks, 1, 1, 1))
    by_axis = column * np.eye(3)[np.arange(problem.blocks) % 3][:, None, None]
    candidates = Candidate(column, shared=False), Candidate(by_axis, shared=True)
    own, common = (np.exp(NoiseDraws(model, np.random.default_rng(5)).worst([c], 40)[0]) for c in candidates)
    ratio = stats.f.isf(common, 3, model.space.dof - 3)
    expected = stats.f.sf(ratio, 3, known_together(model.space))
    assert np.all(own <= 1.001 * expected)
    assert np.mean(np.isclose(own, expected, rtol=1e-3)) > 0.25


def test_rivals_are_compared_at_equal_wander_where_few_soaks_leave_it_open() -> None:
    problem = Problem(many_units(8, 3, "quadratic", 0.7))
    model = Model(problem, terms_of(get_all(MODEL), problem))
    quadratic, lag = get_all(("bias_temperature_quadratic", "thermal_lag"))
    best, rival = (likelihood_ratio(model, term) for term in (Term(quadratic), Term(lag, (("tau", 500.0),))))
    assert rival.shares.walk > best.shares.walk
    again = rival.at(best.shared, best.shares)
    assert (again.shares, again.rank) == (best.shares, rival.rank)
    assert rival.deviance + 5.0 < again.deviance < best.deviance + price(100.0, rival.rank - best.rank)
    for shares in (rival.shares, Shares(walk=100.0)):  # its own, and one that explains the lot worse
        assert rival.at(rival.shared, shares).score == pytest.approx(rival.score)


def test_a_ratio_keeps_no_model_with_its_columns(monkeypatch: pytest.MonkeyPatch) -> None:
    """A contest holds the ratios of all rivals: of 200 units their models took half a gigabyte."""
    problem = Problem(many_units(6, 3, "cubic", 1.0))
    model = Model(problem, terms_of(get_all(MODEL), problem))
    made: list[weakref.ref[Model]] = []
    with_term = Model.with_term
    monkeypatch.setattr(Model, "with_term", lambda *given: made.append(weakref.ref(m := with_term(*given))) or m)
    ratio = likelihood_ratio(model, Term(get_all(["third_order"])[0]))
    again = ratio.at(2.0, Shares(walk=0.5))
    gc.collect()
    assert (len(made) > 2, again.score < ratio.score, [ref() for ref in made if ref()]) == (True, True, [])


def test_pieces_of_a_candidate_hold_its_grid_once_under_keys_of_their_own() -> None:
    columns = np.random.default_rng(4).standard_normal((3, 5, 7, 2))
    whole = Candidate(columns, shared=False, rows=np.tile(np.arange(3), 4), key="effect")
    pieces = list(whole.pieces(5))
    assert np.array_equal(np.concatenate([piece.columns for piece in pieces], axis=2), columns)
    assert (len(pieces), len({piece.key for piece in pieces})) == (4, 4)
    assert (list(whole.pieces(14)), len(list(whole.pieces(1)))) == ([whole], 7)
