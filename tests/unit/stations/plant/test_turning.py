"""What the simulated table does while it turns: the force on a circle, the wobble, and an encoder that is read late."""

import numpy as np
import pytest

from schemas.simulation import Turning
from stations.plant.table import Axis
from stations.plant.turning import TurningForce, places

UP = np.array([0.0, 0.0, 1.0])
PLAIN = Turning(cogging_deg=0.0, unbalance_deg=0.0, jitter_ms=0.0)


def axes(turning: Turning) -> tuple[Axis, Axis, TurningForce]:
    outer, inner = Axis(1, 10), Axis(1, 20)
    return outer, inner, TurningForce(outer, inner, turning, [0, 2])


def test_a_circle_pulls_inward_by_the_square_of_the_rate() -> None:
    _, inner, force = axes(PLAIN)
    inner.go(0.0, 400.0, 90.0, 200.0)
    time = np.linspace(1.0, 3.0, 50)
    expected = -(np.radians(90.0) ** 2) * places(PLAIN, [0, 2])[:, :2] / 9.80665
    felt = np.asarray(force.force(time, UP))
    assert felt[..., :2] == pytest.approx(np.broadcast_to(expected, (50, 2, 2)), abs=1e-7)
    assert felt[..., 2] == pytest.approx(0.0, abs=1e-7)


def test_a_table_at_rest_adds_nothing() -> None:
    _, inner, force = axes(Turning(wobble_urad=100.0))
    inner.go(0.0, 90.0, 30.0, 30.0)
    assert force.force(inner.move.end + np.array([1.6, 5.0]), UP) == 0.0


def test_an_outer_axis_that_leans_moves_the_vertical_along_itself_twice_a_turn() -> None:
    outer, _, force = axes(Turning(wobble_urad=100.0, radius_mm=0.0, cogging_deg=0.0, unbalance_deg=0.0))
    outer.go(0.0, 180.0, 30.0, 30.0)
    time = np.linspace(1.5, 5.5, 200)
    along = np.asarray(force.force(time, UP))[:, 0, 0]
    angle = np.radians(outer.angle(time))
    assert along == pytest.approx(100e-6 * np.cos(2.0 * angle), abs=1e-9)


def test_a_reading_is_as_old_as_its_latency_and_ripple_ends_with_the_turn() -> None:
    _, inner, _ = axes(PLAIN.model_copy(update={"cogging_deg": 0.01}))
    inner.go(0.0, 300.0, 30.0, 30.0)
    assert inner.encoder(5.0) == pytest.approx(float(inner.angle(np.array([4.995]))[0]), abs=2.5e-3)
    at_rest = inner.move.end + 10.0
    assert float(inner.angle(np.array([at_rest]))[0]) == pytest.approx(300.0, abs=2e-3)
