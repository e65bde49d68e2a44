"""Verdicts on recordings by hand-held placement, poses unknown: adequate, not adequate, or not to be judged, and why."""

import numpy as np
import pandas as pd
import pytest
from each import each
from scipy.spatial.transform import Rotation

from benchmarks import hand_turned
from benchmarks.made_recordings import NOISES, Recording, make
from inertial.fits.ellipsoid import fit_ellipsoid
from inertial.norm_fit import fit_norms
from inertial.probability import passes
from pipelines.diagnosis.diagnose import diagnose
from pipelines.diagnosis.sections import parameters_of
from pipelines.diagnosis.sentences import slow_noise, verdict
from pipelines.stages.unknown_poses.fit import norms_fitted
from pipelines.tables.dwells import measured
from pipelines.tables.leave_out import leave_out
from schemas.errors import DataRejected

pytestmark = pytest.mark.usefixtures("no_next_measurement")

PLAIN = ("bias", "scale", "misalignment")


@pytest.mark.slow
@pytest.mark.parametrize(("count", "most"), [(4, 1), (8, 2)])
def test_white_noise_and_a_long_first_rest_are_adequate(count: int, most: int) -> None:
    names = list(NOISES)
    documents = [diagnose(make(Recording(24 + 4 * k, names[k % 4]), 600 + k).dwells) for k in range(count)]
    assert sum(d["adequate"] is False for d in documents) <= most
    assert all(d["classes"] == [] and d["unexplained"] is None for d in documents)


def test_few_dwells_cannot_be_judged_and_nothing_is_named_but_a_gross_misfit_is_not_adequate() -> None:
    document = diagnose(make(Recording(10, cubic=3000.0), 3).dwells)
    assert document["adequate"] is None
    assert "1 degree of freedom, 9 are needed; measure 8 more dwells" in document["reason"]
    assert document["classes"] == []
    assert verdict({**document, "units": ["HAND-1"]}).startswith("CANNOT BE JUDGED: ")
    dwells = make(Recording(14), 4).dwells
    dwells.loc[[2, 5, 8, 11], "out_x"] += [500.0, -600.0, 550.0, -450.0]
    document = diagnose(dwells)
    assert document["error"]["rms_ug"] > 20_000.0
    assert document["adequate"] is False
    for p, answer in (
        (0.2, True), (0.01, False), (np.nan, None), ([0.2, np.nan], None), ([0.01, np.nan], False), ([], None),
    ):  # fmt: skip
        assert passes(p, 0.05) is answer, p


def test_samples_of_a_movement_are_not_judged_and_name_nothing() -> None:
    rng = np.random.default_rng(0)
    n = 100
    turned = Rotation.from_rotvec(np.cumsum(0.15 * rng.standard_normal((n, 3)), axis=0)).apply([0.0, 0.0, 1.0])
    out = turned + 0.08 * np.cumsum(rng.standard_normal((n, 3)), axis=0) / np.sqrt(20.0)
    frame = pd.DataFrame(out, columns=["out_x", "out_y", "out_z"])
    document = diagnose(frame.assign(unit="M", dwell=range(n), time_s=np.arange(n) / 100.0, out_unit="g"))
    assert document["adequate"] is None
    assert "samples of a movement" in document["reason"]
    assert document["recommended"] == []


def test_what_the_verdict_rests_on_stands_beside_it() -> None:
    documents = [diagnose(make(Recording(n), 8).dwells) for n in (26, 120)]
    few, many = (document["evidence"] for document in documents)
    assert [slow_noise(document) for document in documents] == ["", ""]
    assert (few["degrees_of_freedom"], many["degrees_of_freedom"]) == (17, 111)
    assert few["bias_jackknife_ug"] > many["bias_jackknife_ug"] > 0.0
    assert few["smallest_cubic_ug"] is None or few["smallest_cubic_ug"] > 2.0 * many["smallest_cubic_ug"]
    assert many["smallest_cubic_ug"] < 500.0
    # a warm-up that 39 dwells do not separate from a walk: adequate, and what the walk may hide is said
    hidden = slow_noise(diagnose(hand_turned.make("warm_up", 1, 1.5)))
    assert hidden.startswith("white noise is 24.9 µg, the rest counts as slow noise")
    assert "warm_up below 1" in hidden


@pytest.mark.slow
def test_the_smallest_cubic_is_one_that_is_seen_in_about_half_of_the_recordings() -> None:
    smallest = diagnose(make(Recording(60), 21).dwells)["evidence"]["smallest_cubic_ug"]
    large = [diagnose(make(Recording(60, cubic=2.5 * smallest), 21 + k).dwells)["adequate"] for k in range(3)]
    small = [diagnose(make(Recording(60, cubic=0.2 * smallest), 31 + k).dwells)["adequate"] for k in range(3)]
    assert large.count(False) >= 2
    assert small.count(False) <= 1


def test_bad_dwells_are_named_and_left_out_before_physics() -> None:
    made = make(Recording(26, "white 280, B 30", bad=2, bad_ug=5000.0), 42)
    document = diagnose(made.dwells)
    assert document["adequate"] is False
    assert {d["dwell"] for d in document["leave_out"]["dwells"]} == set(made.spoilt)
    assert [g["effects"] for g in document["classes"]] == [["bad_dwell"]] * 2
    without = leave_out(made.dwells, [("HAND-1", dwell) for dwell in made.spoilt])
    assert diagnose(without)["adequate"] is document["leave_out"]["adequate_without"]


def test_nine_parameters_without_weights_are_those_of_the_ellipsoid() -> None:
    """A second method: Gauss-Newton on an upper triangular C against the general fit on K and b."""
    dwells = make(Recording(40), 12).dwells
    output = dwells[["out_x", "out_y", "out_z"]].to_numpy()
    ellipsoid = fit_ellipsoid(output, norm=1.001)
    state = measured(dwells).state
    start = ellipsoid.bias[None] + 3.0, 1.001 * ellipsoid.response[None]
    norm_fit = fit_norms(PLAIN, state, output[None], np.ones((1, 40, 1)), start, norm=1.001)
    np.testing.assert_allclose(norm_fit.fit.response()[0], ellipsoid.response, rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(norm_fit.fit.coefficients[0, :, 0], ellipsoid.bias, rtol=1e-9)
    np.testing.assert_allclose(norm_fit.left[0], ellipsoid.norm_residuals, atol=1e-9)


def test_a_warm_up_of_unknown_poses_comes_back_with_its_uncertainty() -> None:
    made = make(Recording(60, "white 280, B 30", warm_up=3000.0), 77)
    before = norms_fitted(made.dwells, None, PLAIN)
    after = norms_fitted(made.dwells, None, (*PLAIN, "warm_up"))
    assert 1e6 * after.rms < 0.3e6 * before.rms
    fit = after.fit.fit
    value, error = fit.coefficients[0], fit.standard_errors[0]
    assert abs(value[0, 4] - 3e-3 * made.response[0, 0]) < 3.5 * error[0, 4]
    assert abs(fit.nonlinear["warm_up"]["tau"] - 250.0) < 3.5 * after.fit.nonlinear_error["warm_up"]["tau"]
    assert np.all(np.abs(value[:, 0] - made.bias) < 5.0 * error[:, 0])


@each([
    ((*PLAIN, "gravity_value"), "gravity_value is an effect of the station"),
    (("bias", "misalignment"), "needs bias and scale"),
    ((*PLAIN, "slot_rotation"), "slot_rotation on axis . does not show in the norm"),
    ((*PLAIN, "supply_sensitivity"), "supply_sensitivity: the dwells have no supply"),
])  # fmt: skip
def test_what_the_norm_does_not_determine_is_refused_by_name(row: tuple[tuple[str, ...], str]) -> None:
    with pytest.raises(DataRejected, match=row[1]):
        norms_fitted(make(Recording(30), 2).dwells, None, row[0])


@pytest.mark.slow
def test_a_memory_that_was_at_rest_has_no_column_for_its_state() -> None:
    document = diagnose(make(Recording(60, "white 280, B 30", warm_up=2300.0), 96_005_004).dwells)
    assert document["adequate"] is False
    assert any("warm_up" in group["effects"] for group in document["classes"])
    # a class of several names the effect that its parameters are of
    group = {"effects": ["aging_linear", "warm_up"], "scope": "sensor"}
    group |= {"nonlinear": {"tau": 7200.0}, "nonlinear_of": "warm_up"}
    assert parameters_of(group) == "warm_up: tau = 7200 s"
    assert parameters_of({**group, "nonlinear": {}, "nonlinear_of": None}) == ""
    assert parameters_of({**group, "effects": ["warm_up"]}) == "tau = 7200 s"
