"""S(θ)·M: temperature changes the gain of an axis, not where the axis points; truth is the simulated device's own transfer."""

from dataclasses import replace

import lots
import numpy as np
import pandas as pd
import pytest
from long_suites import mostly_slow

from inertial.correction import correct, predict
from inertial.fits.linear import fit_lot
from inertial.state import State
from pipelines.diagnosis.diagnose import diagnose
from pipelines.export.polynomials import corrected_output, polynomials
from pipelines.stages.fit import fit
from pipelines.tables.calibration import read_calibration
from stations.plant.device import PlantDevices, draw_truth, rotation
from stations.plant.preset import load_preset

MODEL = (
    "bias", "scale", "misalignment", "bias_temperature", "scale_temperature", "bias_temperature_quadratic",
    "scale_temperature_quadratic",
)  # fmt: skip
PRESETS = ("ADXL355", "QA700", "SF1500", "analogue")
NO_HISTORY = pd.DataFrame({name: pd.Series(dtype=float) for name in ("time_s", "chamber_C", "slot", "unit", "unit_C")})


def devices(name: str, seed: int, units: int = 4) -> PlantDevices:
    """Devices whose axes lean by 20 mrad, in seats that are turned by 3 mrad; nonlinearity has tests of its own."""
    preset = load_preset(name).model_copy(update={"misalignment_sd_mrad": 20.0})
    rng = np.random.default_rng(seed)
    truths = []
    for unit in range(units):
        slot = rotation(3e-3 * rng.standard_normal(3))
        drawn = draw_truth(preset, f"U{unit}", seed, slot_rotation=slot, supply_ratio=1.0, output_scale=preset.scale)
        truths.append(replace(drawn, misalignment=drawn.misalignment @ slot, cubic=np.zeros(3)))
    return PlantDevices(preset, truths)


def plan(soaks: tuple[float, ...] = (-10.0, 15.0, 40.0, 60.0)) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Angles (n, 2), forces (n, 3) and temperatures (n,)."""
    angles = np.tile(lots.directions("fibonacci"), (len(soaks), 1))
    return angles, lots.force(angles), np.repeat(soaks, len(angles) // len(soaks))


def told(made: PlantDevices, force: np.ndarray, warm: np.ndarray, units: int = 4) -> tuple[State, np.ndarray]:
    """Outputs (units, n, 3) of forces (n, 3) at temperatures (n,), and the state that knows both."""
    own = np.repeat(warm[:, None], units, axis=1)
    output = np.swapaxes(made.output(np.repeat(force[:, None], units, axis=1), own), 0, 1)
    return State(force=force, time=30.0 * np.arange(len(warm)), temperature=own.T), output


def dwells_of(made: PlantDevices, noise_ug: float, rng: np.random.Generator, units: int = 4) -> pd.DataFrame:
    angles, force, warm = plan()
    n = len(warm)
    own = warm[:, None] + rng.normal(0.0, 0.2, units)
    out = made.output(np.repeat(force[:, None], units, axis=1), own)
    out = out + 1e-6 * noise_ug * rng.standard_normal(out.shape)
    time = 30.0 * np.arange(n) + 3600.0 * (np.arange(n) // 24)
    angles_deg = dict(zip(("outer_deg", "inner_deg"), np.degrees(angles).T, strict=True))
    rows = [
        lots.dwell_rows(
            f"U{u}", time, force, out[:, u], 1e-6 * noise_ug * np.sqrt(1000.0) * rng.uniform(0.97, 1.03), n=1000,
            pose=np.arange(n).astype(str), unit_C=own[:, u], **angles_deg,
        )
        for u in range(units)
    ]  # fmt: skip
    return pd.concat(rows, ignore_index=True)


@pytest.mark.parametrize("name", mostly_slow(PRESETS))
def test_a_lot_without_hidden_physics_is_adequate_at_a_microg_with_axes_that_lean_by_20_mrad(name: str) -> None:
    document = diagnose(dwells_of(devices(name, 71), 1.0, np.random.default_rng(71)), None, MODEL)
    assert document["adequate"], (document["error"]["p_value"], [c["effects"] for c in document["classes"]])
    assert document["error"]["p_value"] > 0.001
    assert not document["classes"]


@pytest.mark.parametrize("name", PRESETS)
def test_the_fitted_model_is_the_device_and_its_correction_gives_the_force_anywhere(name: str) -> None:
    made = devices(name, 73)
    _, force, warm = plan()
    first = fit_lot(MODEL, *told(made, force, warm))
    assert 1e6 * np.max(np.abs(first.residuals)) < 0.05  # the own axis alone leaves 10 to 200 µg
    elsewhere = np.random.default_rng(5).standard_normal((50, 3))
    state, output = told(made, elsewhere, np.random.default_rng(6).uniform(-10.0, 60.0, 50))
    unknown = replace(state, force=np.zeros((50, 3)))
    corrected = correct(MODEL, unknown, output, first.coefficients, first.nonlinear)
    np.testing.assert_allclose(corrected, np.broadcast_to(elsewhere, corrected.shape), atol=2e-7)
    np.testing.assert_allclose(predict(MODEL, state, first.coefficients, first.nonlinear), output, atol=2e-7)


def test_what_firmware_gets_corrects_the_device_at_its_temperatures() -> None:
    made = devices("ADXL355", 74)
    dwells = dwells_of(made, 0.01, np.random.default_rng(74))
    stage = fit(dwells, NO_HISTORY, MODEL)
    calibration = read_calibration(stage["coefficients"], stage["covariance"])
    force = np.random.default_rng(7).standard_normal((20, 3))
    for unit in range(4):
        exported = polynomials(calibration, f"U{unit}")
        for heat in (-10.0, 25.0, 60.0):
            out = told(made, force, np.full(20, heat))[1][unit]
            np.testing.assert_allclose(corrected_output(*exported, out, heat), force, atol=1e-6)


def test_poses_that_differ_between_soaks_give_the_same_axes() -> None:
    """The bias' run with temperature is taken out before the axes are told: it would be taken for 10 mrad of misalignment."""
    made = devices("ADXL355", 75)
    _, force, warm = plan((-20.0, 0.0, 20.0, 40.0, 60.0))
    kept = np.array([k for k in range(len(warm)) if (force[k] @ [0.3, 0.5, 0.8] > -0.4) or warm[k] > 10.0])
    assert 1e6 * np.max(np.abs(fit_lot(MODEL, *told(made, force[kept], warm[kept])).residuals)) < 0.3
