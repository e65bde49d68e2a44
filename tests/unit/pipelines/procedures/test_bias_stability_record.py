"""An hour of bias stability in which something happened says so."""

from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipelines.procedures import PROCEDURES
from pipelines.procedures.recorded import Device

STABILITY: Any = PROCEDURES["bias_stability"]


@pytest.mark.parametrize("jump", [0.0, 40.0])
def test_a_jump_of_the_mean_is_told_and_a_quiet_hour_has_no_such_text(jump: float, rng: np.random.Generator) -> None:
    n = 3600
    value = 5.0 * rng.standard_normal(n) + jump * (np.arange(n) >= 2000)
    rows = pd.DataFrame(
        {"unit": "A1", "axis": "z", "series": "mean_1s", "point": np.arange(n), "setting": np.arange(n) * 1.0, "value": value,
         "uncertainty": 0.5}
    )  # fmt: skip
    part = STABILITY.part.model_validate({"kind": "bias_stability", "scale": 1.0})
    outcome = STABILITY.evaluate(part, rows, Device({}, {}, 2.0, "g"))
    told = [one.text for one in outcome.findings if one.subject == "disturbed record"]
    assert bool(told) == bool(jump)
    assert all(text.startswith("axis z: the mean jumps by +") for text in told)
