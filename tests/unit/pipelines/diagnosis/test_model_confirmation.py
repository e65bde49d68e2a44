"""Nothing is recommended or confirmed that raises an error on data that were not fitted."""

from itertools import cycle
from types import SimpleNamespace

import numpy as np
import pytest
from each import each

from inertial.criticism.examination import Named
from inertial.criticism.left_out import LeftOut
from inertial.criticism.reproduced_change import ReproducedChange
from pipelines.diagnosis import confirmation
from pipelines.diagnosis.confirmation import text_of
from pipelines.diagnosis.sentences import why_recommended

ROW = {"removed": []}


def missed(size: float, density: float) -> LeftOut:
    """Errors of one size on stretches of time left out."""
    rng = np.random.default_rng(3)
    return LeftOut({"blocks of time": size * rng.standard_normal((1, 30))}, {"blocks of time": density})


def test_an_effect_is_recommended_only_where_dwells_left_out_are_predicted_no_worse() -> None:
    for before, after in ((10.0, 9.0), (10.0, 10.04), (10.0, np.nan), (np.nan, 9.0)):
        assert Named(SimpleNamespace(), 1.0, before, after).predicts is True, (before, after)
    assert Named(SimpleNamespace(), 1.0, 10.0, 550.0).predicts is False


@each([
    (10.0, 9.0, ["third_order"], []),
    (10.0, 12.0, [], ["third_order is not recommended: the error on dwells left out rises from 10.0 to 12.0 µg."]),
    (None, None, ["third_order"],
     [("third_order is recommended by its evidence alone: no dwells left out can judge it; "
       "confirm with a fresh run of the same units.")]),
])  # fmt: skip
def test_it_is_said_why_an_effect_is_recommended_or_not(row: tuple) -> None:
    before, after, recommended, lines = row
    fault = {"effects": ["bad_dwell"], "scope": "data", "heldout_after_ug": None}
    effect = {"effects": ["third_order", "odd_quadratic"], "scope": "sensor"}
    effect |= {"heldout_before_ug": before, "heldout_after_ug": after}
    assert why_recommended({"classes": [fault, effect], "recommended": recommended}) == lines


def test_a_gain_in_density_confirms_neither_an_error_that_rises_nor_a_fall_within_its_uncertainty() -> None:
    worse = confirmation._by_left_out(missed(1e-4, 100.0), missed(55e-4, 150.0))
    assert worse["confirmed"] is None
    assert worse["rises"].startswith("the error on dwells left out rises from 114 to 6")
    assert "not decided" in text_of(ROW, worse)
    assert "rises from" in text_of(ROW, worse)
    better = confirmation._by_left_out(missed(1e-4, 100.0), missed(0.5e-4, 150.0))
    assert (better["confirmed"], better["rises"]) == (True, None)
    told = " (k = 2) µg where it falls least of the poses, soaks and stretches of time left out"
    assert text_of(ROW, better).endswith(told)
    before = missed(1e-4, 100.0)
    once = before.missed["blocks of time"].copy()
    once[:, :5] *= 0.5  # one stretch of six has the whole fall
    after = LeftOut({"blocks of time": once}, {"blocks of time": 134.0})
    evidence = confirmation._by_left_out(before, after)
    assert evidence["log_density"] == pytest.approx(34.0)
    assert 0.0 < evidence["fall_ug"] < 2.0 * evidence["fall_u_ug"]
    assert (evidence["confirmed"], evidence["rises"]) == (None, None)
    text = text_of(ROW, evidence)
    assert "no clear fall" in text
    assert text.count("the error falls by") == 1


@each([(120.0, True), (103.0, None)])
def test_all_kinds_of_dwells_left_out_that_can_judge_have_to_agree(row: tuple[float, object]) -> None:
    density, confirmed = row
    before, after = (
        LeftOut(one.missed | {"poses": one.missed["blocks of time"]}, one.density | {"poses": of_poses})
        for one, of_poses in ((missed(1e-4, 100.0), 100.0), (missed(0.5e-4, 150.0), density))
    )
    evidence = confirmation._by_left_out(before, after)
    assert evidence["confirmed"] is confirmed
    told = "with poses left out the log likelihood changes by +3.0" in (evidence["reason"] or "")
    assert told is (confirmed is None)


def test_a_run_that_may_have_a_fault_confirms_nothing_by_itself() -> None:
    asked: list[str] = []

    def doubt() -> str:
        asked.append("searched")
        return "the run has a data fault: units_swapped"

    assert confirmation._by_left_out(missed(1e-4, 100.0), missed(0.5e-4, 101.0), doubt)["confirmed"] is None
    assert asked == []  # no search where the dwells left out do not decide
    evidence = confirmation._by_left_out(missed(1e-4, 100.0), missed(0.5e-4, 150.0), doubt)
    assert (evidence["confirmed"], evidence["reason"], asked) == (None, doubt(), ["searched", "searched"])
    told = "not decided by this run alone: stretches of time left out confirm it (log likelihood +50.0)"
    assert told in text_of(ROW, evidence)


def rising(rise: float, density: float) -> LeftOut:
    """Dwells left out whose errors rise or fall from dwell to dwell, and rise in all."""
    after = missed(1e-4, density)
    after.missed["blocks of time"][:, ::2] *= rise * 1.1
    after.missed["blocks of time"][:, 1::2] *= rise / 1.1
    return after


FALL, SAME, BETTER = (2e-4, 1e-4), (1e-4, 1e-4), missed(0.9e-4, 2.0)
RISES = "the error on the fresh run rises from 200 to 145000 µg"


@each([  # uncertainty of the fall, residuals before and after, dwells left out, confirmed, what is said
    (1e-5, SAME, BETTER, True, ""),
    (float("nan"), SAME, BETTER, True, ""),
    (0.6e-4, SAME, BETTER, None, "not clearly more than its uncertainty"),
    (1e-5, FALL, BETTER, True, ""),
    (1e-5, (2e-4, 0.145), BETTER, None, RISES),
    (1e-5, SAME, rising(1.02, 2.0), True, ""),
    (1e-5, SAME, rising(1.02, -2.0), True, ""),
    (1e-5, SAME, rising(1.02, -4.0), None, "the error on dwells left out rises"),
    (1e-5, SAME, rising(1.5, 2.0), None, "the error on dwells left out rises"),
])  # fmt: skip
def test_a_fresh_run_confirms_a_clear_fall_that_nothing_contradicts(
    row: tuple, monkeypatch: pytest.MonkeyPatch
) -> None:
    error, sizes, after, confirmed, said = row
    left = cycle(sizes)
    for name, value in {
        "estimate": lambda model: SimpleNamespace(terms=(), model=model), "Problem": lambda lot: lot,
        "without_own_bias": lambda problem, terms, left: left,
        "residuals_of": lambda *_: np.full((1, 9), next(left)),
        "reproduced_change": lambda *_: ReproducedChange(1.0, 0.1, 2e-4, 1e-4, error, "base"),
        "left_out": lambda *_, **__: missed(1e-4, 1.0),
    }.items():  # fmt: skip
        monkeypatch.setattr(confirmation, name, value)
    evidence = confirmation.progress("old", SimpleNamespace(terms=()), after, "fresh")
    text = text_of(ROW, evidence)
    assert evidence["confirmed"] is confirmed
    assert said in text
    assert bool(evidence["rises"]) is ("rises" in said)
    assert ("not clearly more than its uncertainty" in text) is (error == 0.6e-4)
