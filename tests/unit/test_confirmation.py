"""Nothing is recommended or confirmed that raises an error on data that were not fitted."""

from types import SimpleNamespace

import numpy as np
import pytest

from inertial.criticism.examination import Named
from inertial.criticism.left_out import LeftOut
from inertial.criticism.reproduced_change import ReproducedChange
from pipelines.diagnosis import confirmation
from pipelines.diagnosis.model_history import text_of

ROW = {"removed": []}


def missed(size: float, density: float) -> LeftOut:
    """Errors of one size on stretches of time left out."""
    rng = np.random.default_rng(3)
    return LeftOut({"blocks of time": size * rng.standard_normal((1, 30))}, {"blocks of time": density})


@pytest.mark.parametrize(
    ("before", "after", "predicts"),
    [(10.0, 9.0, True), (10.0, 10.04, True), (10.0, 550.0, False), (10.0, np.nan, False), (np.nan, 9.0, False)],
)
def test_an_effect_is_recommended_only_where_dwells_left_out_are_predicted_no_worse(
    before: float, after: float, predicts: object
) -> None:
    assert Named(SimpleNamespace(), 1.0, before, after).predicts is predicts


def test_a_gain_in_density_does_not_confirm_an_error_that_rises() -> None:
    worse = confirmation._by_left_out(missed(1e-4, 100.0), missed(55e-4, 150.0))
    assert worse["confirmed"] is None
    assert worse["rises"].startswith("the error on dwells left out rises from 114 to 6")
    assert "not decided" in text_of(ROW, worse)
    assert "rises from" in text_of(ROW, worse)
    better = confirmation._by_left_out(missed(1e-4, 100.0), missed(0.5e-4, 150.0))
    assert (better["confirmed"], better["rises"]) == (True, None)


@pytest.mark.parametrize(("left", "confirmed"), [((2e-4, 1e-4), True), ((2e-4, 0.145), None)])
def test_a_fresh_run_does_not_confirm_what_raises_its_error(
    left: tuple[float, float], confirmed: object, monkeypatch: pytest.MonkeyPatch
) -> None:
    sizes = iter(left)
    monkeypatch.setattr(confirmation, "estimate", lambda model: model)
    monkeypatch.setattr(confirmation, "Problem", lambda lot: lot)
    monkeypatch.setattr(confirmation, "residuals_of", lambda problem, model: np.full((1, 9), next(sizes)))
    monkeypatch.setattr(
        confirmation, "reproduced_change", lambda *_: ReproducedChange(1.0, 0.1, 2e-4, 1e-4, 1e-5, "base")
    )
    monkeypatch.setattr(confirmation, "left_out", lambda _: missed(1e-4, 1.0))
    evidence = confirmation.progress("old", "new", missed(0.9e-4, 2.0), "fresh")
    assert evidence["confirmed"] is confirmed
    assert ("the error on the fresh run rises from 200 to 1.45e+05 µg" in text_of(ROW, evidence)) is (confirmed is None)
