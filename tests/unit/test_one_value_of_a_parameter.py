"""A time constant or width has one value under one name: in a diagnosis, and in the comparison of the model with that effect."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "blind"))

from truth import Spec, make_run

from pipelines.diagnosis.compare import compare
from pipelines.diagnosis.examination import examination


@pytest.mark.slow
@pytest.mark.parametrize(
    ("effect", "parameter", "soaks"), [("thermal_hysteresis", "half_width", "nine"), ("thermal_lag", "tau", "ramps")]
)
def test_a_parameter_has_one_value_and_an_interval_that_holds_it(effect: str, parameter: str, soaks: str) -> None:
    run = make_run(Spec(effects=(effect,), sizes=(2.0,), plan="six", soaks=soaks, units=3), 3)
    document = examination(run.dwells, run.history, None).document
    (group,) = [g for g in document["classes"] if effect in g["effects"]]
    fitted = compare(run.dwells, [*document["effects"], group["nonlinear_of"]], run.history)
    told, own = group["nonlinear"][parameter], fitted["nonlinear"][group["nonlinear_of"]][parameter]
    assert told == pytest.approx(own, rel=0.01)
    for low, high in (
        group["nonlinear_interval"][parameter],
        fitted["nonlinear_interval"][group["nonlinear_of"]][parameter],
    ):
        assert low <= own * 1.01
        assert high >= own * 0.99
        assert low < high
