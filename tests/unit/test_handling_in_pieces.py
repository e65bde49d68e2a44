"""Places of alternatives that are worked on in pieces: what they explain is what all of them together explain."""

import independent_lots as lots
import numpy as np
import pytest

from inertial.criticism.examination import ExaminedRun, candidates_of
from inertial.criticism.field import Candidates
from inertial.data_errors.handling import alternatives
from inertial.estimation import problem as problems
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
