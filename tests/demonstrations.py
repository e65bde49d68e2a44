"""What the demonstration measures, once for every effect and seed."""

import pytest
from once import once

from pipelines.demo.measure import DemoLot, measure
from pipelines.demo.scenes import Scene


def demonstration(scene: Scene, seed: int, *_: object) -> DemoLot:
    """What the demonstration measures of a scene."""
    return once(f"demo-{scene.kind}-{seed}", lambda _: measure(scene, seed))


def demonstrations_measured_once(patch: pytest.MonkeyPatch) -> None:
    """From now on demonstrations have what was measured before."""
    patch.setattr("pipelines.demo.measure.measure", demonstration)
