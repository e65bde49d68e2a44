"""A table with errors, a device and a fit, written out here and not taken from the code under test: truth for budgets."""

import numpy as np

Array = np.ndarray
SINGLE = (
    *("gravity", "level_1", "level_2", "orthogonality", "outer", "inner"),
    *("offset", "slope", "gradient", "supply", "gain"),
)
ORDERS = ((1, np.sin), (1, np.cos), (2, np.sin), (2, np.cos))
PRODUCTION = {
    "gravity": 10e-6, "level_1": 100e-6, "level_2": 100e-6, "orthogonality": 60e-6, "outer": 60e-6, "inner": 100e-6,
    "harmonics": 40e-6, "seat": 500e-6, "offset": 0.3, "slope": 0.003, "gradient": 0.2, "soak": 0.1, "supply": 100e-6,
    "gain": 30e-6, "reader": 5e-6, "pose": 50e-6,
}  # fmt: skip
"""Standard uncertainties of a workshop's station."""


def draws(rng: np.random.Generator, sizes: dict[str, float], soaks: int, dwells: int) -> dict[str, Array]:
    """One draw of every influence, in rad, K and relative."""
    one = {name: sizes[name] * rng.standard_normal() for name in SINGLE}
    return {
        **one,
        "harmonics": sizes["harmonics"] * rng.standard_normal((2, 4)),
        "seat": sizes["seat"] * rng.standard_normal(3),
        "soak": sizes["soak"] * rng.standard_normal(soaks),
        "reader": sizes["reader"] * rng.standard_normal(3),
        "pose": sizes["pose"] * rng.standard_normal((2, dwells)),
    }


def felt(outer: Array, inner: Array, d: dict[str, Array]) -> Array:
    """True specific force (n, 3), g, by the matrices of every dwell."""
    up = np.array([d["level_1"], d["level_2"], 1.0]) * (1.0 + d["gravity"])
    eta = d["orthogonality"]
    ry = np.array([[np.cos(eta), 0, np.sin(eta)], [0, 1, 0], [-np.sin(eta), 0, np.cos(eta)]])
    x, y, z = d["seat"]
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    slot = np.eye(3) + k + 0.5 * k @ k
    a = outer + d["outer"] + d["pose"][0] + _waves(d["harmonics"][0], outer)
    b = inner + d["inner"] + d["pose"][1] + _waves(d["harmonics"][1], inner)
    zero, one = np.zeros_like(a), np.ones_like(a)
    rx = np.array([[one, zero, zero], [zero, np.cos(a), -np.sin(a)], [zero, np.sin(a), np.cos(a)]])
    rz = np.array([[np.cos(b), -np.sin(b), zero], [np.sin(b), np.cos(b), zero], [zero, zero, one]])
    table = np.einsum("ijn,jk,kln->nil", rx, ry, rz)
    return np.einsum("ij,nkj,k->ni", slot, table, up)


def _waves(sizes: Array, angle: Array) -> Array:
    return sum(size * wave(order * angle) for size, (order, wave) in zip(sizes, ORDERS, strict=True))


def outputs(outer: Array, inner: Array, read: Array, soak: Array, d: dict[str, Array]) -> Array:
    """Outputs (n, 3) of a device of bias 0, scale 1, 50 µg/K and 200 ppm/K whose thermometers read ``read``."""
    theta = read - 25.0
    true = theta - d["offset"] - d["slope"] * theta - d["gradient"] - d["soak"][soak]
    force = felt(outer, inner, d)
    out = 50e-6 * true[:, None] + (1.0 + 200e-6 * true[:, None]) * force
    return out * (1.0 + d["supply"]) * (1.0 + d["gain"]) + d["reader"]


def nominal_force(outer: Array, inner: Array) -> Array:
    """(Rx(outer)·Rz(inner))ᵀ·(0, 0, 1), (n, 3)."""
    sa, ca = np.sin(outer), np.cos(outer)
    return np.stack([np.sin(inner) * sa, np.cos(inner) * sa, ca], axis=1)


def columns(force: Array, read: Array, axis: int, *, temperature: bool) -> Array:
    """Design of one axis: bias, own force, the two others, and with temperature the terms in θ and θ²."""
    theta = read - 25.0
    own = force[:, axis]
    parts = [np.ones_like(own), own, force[:, (axis + 1) % 3], force[:, (axis + 2) % 3]]
    if temperature:
        parts += [theta, theta**2, theta * own, theta**2 * own]
    return np.stack(parts, axis=1)


def fitted(force: Array, read: Array, out: Array, *, temperature: bool) -> Array:
    """Least-squares coefficients (3, p)."""
    return np.stack(
        [np.linalg.lstsq(columns(force, read, a, temperature=temperature), out[:, a], rcond=None)[0] for a in range(3)]
    )
