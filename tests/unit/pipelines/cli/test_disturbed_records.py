"""What the noise of a record at rest says of steps on the floor and of a louder stretch, by the command that a user types."""

from pathlib import Path

import numpy as np
from in_process import document_of, text_of


def test_steps_on_the_floor_are_told_and_a_louder_stretch_ends_where_it_does(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    t = np.arange(60_000) / 100.0
    output = 6e-4 * rng.standard_normal((t.size, 3)) + [0.0, 0.0, 1.0]
    for k in np.linspace(4_000, 56_000, 10).astype(int):
        output[k : k + 10, 2] += 5e-3 * np.cos(0.9 * np.pi * np.arange(10))
    output[20_000:26_000, 0] += 2e-3 * rng.standard_normal(6_000)
    path = tmp_path / "floor.csv"
    np.savetxt(path, np.c_[t, output], fmt="%.6f", delimiter=",", header="t,ax,ay,az", comments="")
    document = document_of("noise", "allan", path)
    found = {one["channel"]: one for one in document["disturbances"]}
    assert {name: one["kind"] for name, one in found.items()} == {"ax": "loud", "az": "bursts"}
    assert abs(found["ax"]["start_s"] - 200.0) < 0.5
    assert abs(found["ax"]["stop_s"] - 260.0) < 0.5
    assert found["az"]["count"] == 10
    text = text_of("noise", "allan", path)
    assert "ax: the noise is louder from" in text
    assert "az: 10 short bursts or more between 39." in text
