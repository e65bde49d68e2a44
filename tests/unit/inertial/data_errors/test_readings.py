import numpy as np
from scipy.optimize import minimize

from inertial.data_errors.readings import design, robust_fits


def test_a_robust_fit_of_units_together_is_that_of_each_alone_and_minimises_the_biweight() -> None:
    """Units lack dwells of their own and have wrong poses of their own; the loss is minimised by a general method as well."""
    rng = np.random.default_rng(7)
    force = rng.normal(size=(3, 40, 3))
    force /= np.linalg.norm(force, axis=-1, keepdims=True)
    theta = rng.uniform(-30.0, 40.0, (3, 40))
    truth = np.concatenate([0.01 * rng.normal(size=(3, 1, 3)), np.eye(3) + 0.01 * rng.normal(size=(3, 3, 3))], axis=1)
    output = design(force) @ truth + 3e-4 * theta[..., None] + 1e-3 * rng.normal(size=force.shape)
    output[0, 3] += 0.4
    output[2, [5, 9]] -= 0.3
    output[1, :4] = theta[1, :4] = np.nan
    output[2, 20, 1] = np.nan
    together = robust_fits(force, output, theta)
    for unit in range(3):
        there = np.isfinite(output[unit]).all(axis=-1)
        f, y, t = force[unit][there], output[unit][there], theta[unit][there]
        alone = robust_fits(f[None], y[None], t[None])[0]
        np.testing.assert_allclose(together[unit], alone, rtol=0, atol=1e-12)
        x, scale = design(f, t), 4.685 * 1.5 * np.median(np.linalg.norm(y - design(f, t) @ alone.T, axis=-1))

        def loss(flat: np.ndarray) -> float:
            u = np.linalg.norm(y - x @ flat.reshape(3, 8).T, axis=-1) / scale  # noqa: B023
            return float(np.sum(np.where(u < 1.0, 1.0 - (1.0 - u**2) ** 3, 1.0)))

        best = minimize(loss, alone.ravel(), method="BFGS", options={"gtol": 1e-9})
        assert loss(alone.ravel()) - best.fun < 1e-3 * best.fun
        np.testing.assert_allclose(alone[:, :4], truth[unit].T, rtol=0, atol=2e-3)
