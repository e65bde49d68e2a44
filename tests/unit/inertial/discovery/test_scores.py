"""Scores of a lot against a fit with the effect in it, and errors of the station that leave them as they are."""

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from benchmarks.discovery.lots import FLOOR_UG, WORLDS, Lots
from inertial import effects as catalogue
from inertial.discovery.pose_shape import SHAPE
from inertial.discovery.scores import LotScores, scores_of
from inertial.effects.base import SensorEffect
from inertial.estimation.model import Model
from inertial.estimation.problem import Lot, Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.term import Term
from pipelines.demo.archive_lots import EFFECTS, Hidden, Line
from pipelines.tables.sound_lot import sound_lot


def lot_of(seed: int, hidden: Hidden | None = None, rests: float = 0.0) -> Lot:
    """A lot of a simulated line."""
    dwells, _ = Line(seed, hidden=hidden, rests=rests, wafers=1).lot("s")
    lot = sound_lot(dwells, None, EFFECTS)[2]
    assert lot is not None
    return lot


@pytest.fixture(autouse=True)
def one_thread() -> None:
    threadpool_limits(1)


@pytest.mark.parametrize("name", ["third_order", "bias_temperature_quadratic", "second_order"])
def test_score_over_information_is_the_coefficient_of_a_fit(name: str) -> None:
    lot, effect = lot_of(11), catalogue.get(name)
    scores = scores_of(lot, EFFECTS, [effect])
    problem = Problem(lot)
    model = Model(problem, terms_of(catalogue.get_all(EFFECTS), problem))
    fall = model.space.gain(Term(effect).candidate(problem)).by_block[:, 0].reshape(8, 3)
    assert scores.score**2 / scores.own == pytest.approx(fall, rel=1e-8)
    # a second way: generalised least squares with the covariance written out
    space, block = model.space, 4
    series = np.concatenate([problem.y[..., None], model.local, problem.columns(effect, {})], axis=-1)
    white = space.covariance.whiten(series, model.noise.shares)
    fitted = np.linalg.lstsq(white[block][:, 1:], white[block][:, 0], rcond=None)[0][-1]
    unit, axis = divmod(block, 3)
    assert scores.score[unit, axis] / scores.own[unit, axis] == pytest.approx(fitted, rel=1e-6)


def test_an_error_of_the_table_leaves_the_scores_beside_free_errors_of_the_station() -> None:
    lot = lot_of(12)
    level = catalogue.get("level_error")
    problem = Problem(lot)
    change = 50e-6 * problem.columns(level, {})[..., 0].reshape(8, 3, -1)
    tilted = replace(lot, output=lot.output + np.swapaxes(change, -1, -2))
    names = {"third_order", "second_order", "magnetic"}
    tried = [one for one in catalogue.built_in().values() if one.id in {*names, "level_error"}]
    before, after = (scores_of(one, EFFECTS, tried) for one in (lot, tilted))
    alone = [scores_of(one, EFFECTS, [e for e in tried if e.id in names]) for one in (lot, tilted)]
    free, bound = (_moved(*pair) for pair in ((before, after), alone))
    assert free < 1.0  # the noise that is estimated beside the error is another one
    assert bound > 5.0
    moved = np.abs(after.of_station[0] - before.of_station[0])
    assert moved.max() / np.sqrt(before.of_station[1].max()) > 5.0


def _moved(before: LotScores, after: LotScores) -> float:
    """Largest change of a lot's sums, in standard deviations."""
    sigma = np.sqrt(before.information)
    moved = np.abs(after.score.sum(axis=0) - before.score.sum(axis=0))
    return float((moved / np.where(sigma > 0.0, sigma, np.inf)).max())


def test_a_hardening_spring_is_a_cubic_of_all_units_and_falls_behind() -> None:
    scores = scores_of(lot_of(13, Hidden("W01", 300e-6)), EFFECTS)
    at = scores.products.columns.index(("third_order", 0))
    z = scores.score.sum(axis=0).reshape(3, -1)[:, at] / np.sqrt(scores.information.reshape(3, -1)[:, at])
    assert (z < -20.0).all()


def test_what_no_lot_can_tell_has_no_information() -> None:
    scores = scores_of(lot_of(14), EFFECTS)
    names = [name for name, _ in scores.products.columns if name != SHAPE]
    assert all(issubclass(type(catalogue.get(name)), SensorEffect) for name in names)
    assert not set(names) & set(EFFECTS)
    at = names.index("bias_temperature_cubic")  # three temperatures: the cubic is the quadratic and the line
    information = scores.information.reshape(3, -1)
    assert information[:, at] == pytest.approx(0.0, abs=1e-6 * information[0, names.index("third_order")])
    again = scores_of(lot_of(14), EFFECTS)
    assert again.score == pytest.approx(scores.score)


def test_a_size_is_the_rms_that_an_effect_leaves_also_in_outputs_that_wander() -> None:
    """White noise of 8 µg and a wander of 36 µg; springs that differ from unit to unit, which no error of the station does."""
    size = 0.02 * np.tile([[1.0], [-1.0]], (4, 3))
    without, sprung = Lots(WORLDS[0], 5).scored(), Lots(WORLDS[0], 5).scored("third_order", size)
    at = sprung.products.columns.index(("third_order", 0)) + len(sprung.products.columns) * np.arange(3)
    with_it, before = (scores.score[:, at] / scores.own[:, at] for scores in (sprung, without))
    found = np.abs(with_it - before) * sprung.products.size[at]
    np.testing.assert_allclose(found, 1e-6 * FLOOR_UG * np.abs(size), rtol=0.15)


def test_the_temperature_coefficient_of_a_bias_is_that_of_the_fit() -> None:
    lot = lot_of(15)
    out, warm = np.moveaxis(lot.output, -1, 1), lot.state.temperature[:, None] - 25.0
    force = np.broadcast_to(lot.state.force, lot.output.shape)
    columns = np.stack([np.ones_like(warm[:, 0]), *np.moveaxis(force, -1, 0), warm[:, 0]], axis=-1)
    scores = scores_of(lot, EFFECTS, [catalogue.get("third_order")])
    for unit, axis in np.ndindex(8, 3):
        design = np.column_stack([columns[unit], warm[unit, 0] * columns[unit, :, 1 + axis]])
        plain = np.linalg.lstsq(design, out[unit, axis], rcond=None)[0][4]
        assert scores.tempco[unit, axis] == pytest.approx(plain, abs=1.5e-6)  # 12 µg of wander over 70 K, of 40 µg/K
    without = scores_of(lot, ["bias", "scale", "misalignment"], [catalogue.get("third_order")])
    assert np.isnan(without.tempco).all()
