"""The smallest size that would have been named is stated, and an effect of that size is found about as often as not."""

import numpy as np
from made_worlds import Noise, World, make

from pipelines.diagnosis.diagnose import diagnose


def stepped(dwells, size_ug: float):
    """Every series with a step in the middle of this RMS, its sign at random."""
    rng = np.random.default_rng(4)
    changed = dwells.copy()
    for _, own in dwells.groupby("unit"):
        step = (own["time_s"] > own["time_s"].median()).to_numpy(float)
        step *= 1e-6 * size_ug / np.sqrt(np.mean(step**2))
        for axis in "xyz":
            changed.loc[own.index, f"out_{axis}"] += step * rng.choice([-1.0, 1.0])
    return changed


def test_random_walk_raises_the_sizes_that_are_named_and_the_document_says_so() -> None:
    quiet, loud = (make(World(units=2, poses=12, noise=Noise(flicker=5.0, walk=k)), 43_000_001) for k in (0.0, 4.0))
    sizes = []
    for made in (quiet, loud):
        rows = {row["effect"]: row for row in diagnose(made.dwells, made.history)["smallest_named"]}
        sizes.append(rows["step_change"]["size_ug"])
        assert rows["step_change"]["without_slow_noise_ug"] <= rows["step_change"]["size_ug"]
    assert sizes[1] > 4.0 * sizes[0]
    named = [
        any(
            "step_change" in g["effects"] for g in diagnose(stepped(loud.dwells, f * sizes[1]), loud.history)["classes"]
        )
        for f in (0.4, 2.0)
    ]
    assert named == [False, True]
