"""A step with a sample that departs alone has no figures; without it, it has them."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import signal

from pipelines.procedures import PROCEDURES
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, ProcedureStep, UnitRecord, at_rest

STEP: Any = PROCEDURES["step_response"]
RATE = 50_000.0


@pytest.mark.parametrize("glitch", [0.0, 0.1, -0.5])
def test_a_sample_that_departs_alone_leaves_no_figures(glitch: float, rng: np.random.Generator) -> None:
    part = STEP.part.model_validate({"kind": "step_response", "hold_ms": 20.0})
    t = np.arange(2500) / RATE - 0.01
    drive = np.where((t >= 0.0) & (t < 0.02), 1.0, 0.0)
    w = 2.0 * np.pi * 1000.0
    output = signal.lsim(([w**2], [1.0, 1.2 * w, w**2]), drive, t - t[0])[1] + 1e-4 * rng.standard_normal(t.size)
    output[np.searchsorted(t, 0.008)] += glitch
    wave = np.stack([output] * 3, axis=1)
    step = ProcedureStep("step", at_rest("step"), 25.0, role="step_generator", setting={"volts": 1.0, "hold_s": 0.02})
    samples = {REFERENCE: UnitRecord(t - t[0], np.stack([drive] * 3, axis=1)), "A1": UnitRecord(t - t[0], wave)}
    record = ProcedureRecord(0, step, pd.DataFrame({"unit": ["A1"]}), samples)
    device = Device({}, {}, 10.0, "V")
    outcome = STEP.evaluate(part, STEP.reduce(part, [record], device), device)
    figures = outcome.figures["A1"]
    assert all(one.identified for one in figures) == (glitch == 0.0)
    assert all("departs alone" in one.note for one in figures) == (glitch != 0.0)
