"""Centrifuge at two radii: offset of the proof mass and K1′, arm stretch and Koq are parted; the truth is made by mechanics."""

import numpy as np
import pytest
from spun_centrifuge import RADIUS_ERROR, spins, spun

from inertial.dynamics import centrifuge
from inertial.dynamics.centrifuge import TERMS, fit_radii, linearity_error, linearity_percent
from inertial.dynamics.centrifuge_effects import Spins
from inertial.errors import NotIdentified

TRUE = {
    "scale": 1.0004, "second_order": 2e-6, "third_order": 5e-8, "odd_quadratic": 4e-7, "asymmetry": 3e-5,
    "mass_offset": 80e-6, "arm_stretch": 3e-9,
}  # fmt: skip


def pulls(signs: tuple[float, ...], count: int) -> dict[str, np.ndarray]:
    points, by_name = spins(signs=signs), dict[str, list[float]]()
    for k in range(count):
        out, error, holes = spun(points, TRUE, np.random.default_rng([4711, len(signs), k]))
        fit = fit_radii(points.acceleration, points.radius_m, out, error, RADIUS_ERROR)
        both = len(signs) > 1
        true = TRUE | ({} if both else {"scale": 1.0004 + 3e-5, "second_order": 2e-6 + 4e-7})
        seen = {name: (fit.unit.of(name), true[name]) for name in fit.unit.names if name != "bias"}
        seen["mass_offset"] = (fit.mass_offset_m, TRUE["mass_offset"])
        seen["arm_stretch"] = (fit.arm_stretch_s2, TRUE["arm_stretch"])
        if fit.consistency is not None:
            seen["consistency"] = (fit.consistency, holes[0.3] / 0.3 / (holes[0.5] / 0.5) - 1.0)
            for j, r in enumerate((0.5, 0.3)):
                seen[f"radius {r}"] = (fit.radius_errors_m[j], holes[r] - r)
        for name, ((value, u), one) in seen.items():
            by_name.setdefault(name, []).append((value - one) / u)
    return {name: np.array(values) for name, values in by_name.items()}


def fitted(points: Spins, seed: int, true: dict[str, float] = TRUE):
    """The outputs of a run and its fit."""
    out, error, _ = spun(points, true, np.random.default_rng(seed))
    return out, fit_radii(points.acceleration, points.radius_m, out, error, RADIUS_ERROR)


def test_the_scale_by_two_radii_in_one_mounting_has_the_closed_uncertainty_of_their_distance() -> None:
    one_way = fitted(spins(signs=(1.0,)), 1)[1].unit.of("scale")[1]
    assert one_way == pytest.approx(np.sqrt(2.0) * RADIUS_ERROR / 0.2, rel=0.02)  # slopes are known far better
    both = fitted(spins(), 1)[1].unit.of("scale")[1]
    assert both == pytest.approx(1.0 / np.hypot(0.5 / RADIUS_ERROR, 0.3 / RADIUS_ERROR), rel=0.02)


def test_the_linearity_is_that_of_the_unit_without_arm_and_offset() -> None:
    straight = {"second_order": 0.0, "third_order": 0.0, "mass_offset": 2e-4, "arm_stretch": 2e-8}
    points = spins()
    out, fit = fitted(points, 2, straight)
    assert linearity_percent(fit.unit, 30.0) < 1e-3
    line = np.polyfit(points.acceleration, out, 1)
    assert 100.0 * np.max(np.abs(out - np.polyval(line, points.acceleration))) / 30.0 > 5e-3


def test_one_radius_or_radii_that_are_close_leave_the_offset_open() -> None:
    with pytest.raises(NotIdentified, match="another radius"):
        fitted(spins((0.5,)), 3)
    wide, narrow = (fitted(spins(radii), 4)[1].mass_offset_m[1] for radii in ((0.5, 0.3), (0.5, 0.49)))
    assert narrow > 20.0 * wide


@pytest.mark.parametrize("signs", [(1.0, -1.0), (1.0,)])
def test_every_parameter_is_recovered_within_its_uncertainty(signs: tuple[float, ...]) -> None:
    by_name = pulls(signs, 300)
    assert ("consistency" in by_name) == (len(signs) == 2)
    for name, values in by_name.items():
        assert abs(values.mean()) < 0.25, name
        assert 0.88 < values.std(ddof=1) < 1.12, name


def test_the_uncertainty_of_the_linearity_holds_the_covariance(rng: np.random.Generator) -> None:
    steps = np.array([1.0, 3.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0])
    force = np.concatenate([steps, -steps])
    error = np.full(force.size, 1e-4)
    curve = force + 2e-6 * force**2 + 1e-7 * force**3
    fits = [
        centrifuge.fit_polynomial(force, curve + error * rng.normal(size=force.size), error, TERMS) for _ in range(120)
    ]
    spread = np.std([linearity_percent(one, 30.0) for one in fits], ddof=1)
    assert np.mean([linearity_error(one, 30.0) for one in fits]) == pytest.approx(spread, rel=0.2)
    one = fits[0]
    apart = centrifuge.Polynomial(one.names, one.value, np.diag(np.diag(one.covariance)), one.residuals, 0.0, 0)
    assert linearity_error(apart, 30.0) > 2.0 * spread
