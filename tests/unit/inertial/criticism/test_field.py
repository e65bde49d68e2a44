"""What places of alternatives explain, in pieces, together and without being whitened."""

import independent_lots as lots
import numpy as np
import pytest
from made_worlds import BASE, Noise, World, make

from inertial import effects as catalogue
from inertial.criticism.examination import ExaminedRun, candidates_of
from inertial.criticism.field import Candidates
from inertial.data_errors.handling import alternatives
from inertial.data_errors.handling.wrong_pose import WrongPose
from inertial.estimation import problem as problems
from inertial.estimation.model import Model
from inertial.estimation.problem import Problem
from inertial.estimation.refinement import terms_of
from inertial.estimation.space import Gain
from pipelines.tables.condense import condense
from pipelines.tables.dwells import lot_of, measured

MODEL = ("bias", "scale", "misalignment")


def gains() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(20_261_204)
    dwells = lots.world(rng, units=2, plan="six", temperatures=(10.0, 30.0), checks=(), flicker=30.0, day_s=0).dwells
    run = ExaminedRun(lot_of(measured(condense(dwells), None), square=False), MODEL)
    base = run.model()
    fields = Candidates(base.problem, candidates_of(base, MODEL), alternatives())
    by_id = fields.gains(base.space, set(), handling=True)
    return {one.id: by_id[one.id].drop for one in fields.handling}


def test_alternatives_in_pieces_explain_what_they_explain_together(monkeypatch: pytest.MonkeyPatch) -> None:
    together = gains()
    monkeypatch.setattr(problems, "_PIECE", 1)
    monkeypatch.setattr(problems, "_CACHE", 0)
    in_pieces = gains()
    assert len(together) > 4
    assert in_pieces.keys() == together.keys()
    for name, drop in together.items():
        np.testing.assert_allclose(in_pieces[name], drop, rtol=1e-9, atol=1e-9 * max(float(np.max(drop)), 1.0))


SEED = 5_500_000


def test_a_column_of_one_dwell_gains_the_same_without_being_whitened():
    made = make(World(units=3, durations=(2.0, 60.0), noise=Noise(unit_white=(5.0, 1.0, 1.0))), SEED)
    dwells = made.dwells.drop(
        index=made.dwells.index[(made.dwells["unit"] == "W002") & made.dwells["dwell"].isin([5, 6])]
    )
    problem = Problem(lot_of(measured(dwells, made.history)))
    model = Model(problem, terms_of(catalogue.get_all([*BASE, "level_error"]), problem))
    field = Candidates(problem, [], [WrongPose()])
    quick = field.gains(model.space, set(), handling=True)["wrong_pose"]
    pieces = problem.pieces(WrongPose(), field.grids["wrong_pose"])
    plain = Gain.joined([model.space.gain(piece) for piece in pieces])
    np.testing.assert_array_equal(quick.rank, plain.rank)
    np.testing.assert_allclose(quick.drop, plain.drop, rtol=1e-6, atol=1e-6)
