"""Every effect of the catalogue keeps the contract of effects; they are found by themselves, and none is exempt."""

import inspect
import pkgutil
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from each import each
from scipy.linalg import block_diag

from docs.effects_page import page
from inertial import effects, poses
from inertial.design import grid_of, resting_grid
from inertial.effects import SensorEffect, StationEffect
from inertial.effects.base import AnyEffect
from inertial.errors import MissingInput, NotIdentified
from inertial.fits.linear import fit_lot
from inertial.frames import force_from_angles
from inertial.state import State
from pipelines.diagnosis.diagnose import diagnose
from pipelines.export.polynomials import ACROSS, BIAS, SCALE, effects_left_out, polynomials
from pipelines.tables.dwells import lot_of, measured

EVERY = sorted(effects.built_in())
BASE = ("bias", "scale", "misalignment")
LOOP = (25.0, 45.0, 60.0, 44.0, 26.0, 5.0, -10.0, 6.0, 24.0)
GONE = 1e-6
"""Share of a column that is left where the model absorbs it wholly."""


def plan_state(plan: str, temperatures: tuple[float, ...], *, units: int = 2) -> State:
    """A lot on a plan with everything recorded and everything moving that a plan can move."""
    rng = np.random.default_rng(7)
    rounds = [rng.permutation(poses.plan(plan)) for _ in temperatures]
    angles = np.radians(np.concatenate(rounds))
    n = len(angles)
    outer, inner = np.broadcast_to(angles.T[:, None, :], (2, units, n))
    wait = rng.uniform(2.0, 60.0, (units, n))
    time = np.cumsum(60.0 + wait[:1], axis=1) + np.repeat(900.0 * np.arange(len(temperatures)), n // len(temperatures))
    time = np.broadcast_to(time, (units, n)).copy()
    chamber = np.repeat(temperatures, n // len(temperatures)) * np.ones((units, 1))
    settling = np.exp(-(np.arange(n) % (n // len(temperatures))) / 4.0)
    return State(
        force=force_from_angles(outer, inner),
        time=time,
        temperature=chamber + 0.8 * settling * np.sign(np.gradient(chamber, axis=1) + 1e-9),
        chamber=chamber,
        since_power=time - time[:, :1] + 30.0,
        since_move=wait,
        supply=3.3 + 0.02 * rng.standard_normal((units, n)),
        vibration=1e-4 * rng.uniform(0.2, 3.0, (units, n)),
        outer=outer.copy(),
        inner=inner.copy(),
        slot=np.arange(units, dtype=float),
    )


RICH = plan_state("fibonacci24", LOOP)
RICH = replace(RICH, felt=RICH.force)  # sensors without misalignment: what they feel is what is commanded


def values_of(effect: AnyEffect, state: State) -> dict[str, float]:
    """Values from the middle of the grids of an effect's nonlinear parameters, with its constants."""
    grid = grid_of(effect, state)
    return grid[len(grid) // 2]


def all_columns(effect: AnyEffect, state: State, values: dict[str, float]) -> np.ndarray:
    """Columns of the three axes in one array, (3, units, n, p)."""
    if isinstance(effect, SensorEffect):
        return np.stack([np.broadcast_to(c, (*state.time.shape, c.shape[-1])) for c in
                         (effect.columns(state, axis, **values) for axis in range(3))])  # fmt: skip
    assert isinstance(effect, StationEffect)
    change = effect.force_change(state, **values)
    return np.moveaxis(np.broadcast_to(change, (*state.force.shape, change.shape[-1])), -2, 0)


def least_left(columns: np.ndarray, base: np.ndarray) -> float:
    """Smallest share of a combination of columns (n, p) of equal size that a model leaves over; 0 for an empty one."""
    size = np.linalg.norm(columns, axis=-2)
    if np.any(size < 1e-12):
        return 0.0
    q, _ = np.linalg.qr(base)
    left = columns / size - q @ (q.T @ (columns / size))
    return float(np.linalg.svd(left, compute_uv=False)[-1])


def lacks(effect: AnyEffect) -> list[str]:
    """What an effect lacks of words, attributes in its own file, names, units and finite columns."""
    kind, text = type(effect), inspect.getdoc(effect) or ""
    wanted = ("symbol", "equation", "source", "typical_ug", "breaker")
    out = [f"{name} in the class {kind.__name__} of {kind.__module__}" for name in wanted if name not in vars(kind)]
    out += [name for name in wanted if not str(getattr(effect, name)).strip()]
    out += [] if "." in text else ["a docstring that is a sentence"]
    low, high = effect.typical_ug
    out += [] if 0.0 <= low <= high and high > 0.0 else [f"a range of sizes, {effect.typical_ug} is there"]
    hides = {other for other in effect.hides_behind if not other.startswith("covariate:")}
    out += [f"an effect {other!r} that it hides behind" for other in hides - set(EVERY)]
    out += [] if f"### {effect.id}\n" in page() else ["an entry of the reference"]
    values = values_of(effect, RICH)
    columns = all_columns(effect, RICH, values)
    of_sensor = isinstance(effect, SensorEffect)
    names = [effect.names(axis) for axis in range(3)] if of_sensor else [effect.names()] * 3
    out += [] if [len(one) for one in names] == [columns.shape[-1]] * 3 else ["a name for every column"]
    out += [] if not effect.per or len(effect.per) == len(names[0]) else ["a unit for every column"]
    start = effect.start_columns(RICH, 0, **values) if of_sensor else effect.start_change(RICH, **values)
    shape = RICH.time.shape if of_sensor else RICH.force.shape
    out += [] if np.isfinite(columns).all() and np.isfinite(start).all() else ["finite columns"]
    out += [] if columns.shape[:-1] == (3, *RICH.time.shape) else ["columns of all dwells"]
    return out + ([] if np.broadcast_shapes(start.shape[:-1], shape) == shape else ["start columns of all dwells"])


@each(EVERY)
def test_an_effect_is_whole_in_its_file(name: str) -> None:
    assert lacks(effects.get(name)) == []


STILL = (
    "felt", "force", "time", "temperature", "chamber", "since_power", "since_move", "supply", "vibration", "outer", "inner",
)  # fmt: skip


@each(EVERY)
def test_says_nothing_where_nothing_changes_and_its_parameters_change_what_it_says(name: str) -> None:
    """The same pose, temperature, supply and instant again and again: whatever a column says then is a bias."""
    n, effect = RICH.time.shape[-1], effects.get(name)
    still = {key: np.repeat(getattr(RICH, key)[:, 5:6], n, axis=1) for key in STILL}
    columns = all_columns(effect, replace(RICH, **still, memory={}), values_of(effect, RICH))
    assert np.ptp(columns, axis=-2).max(initial=0.0) < 1e-9
    for parameter in effect.parameters(RICH):
        grid = parameter.grid()
        assert grid.size > 1
        assert parameter.low <= grid.min() <= grid.max() <= parameter.high
        values = values_of(effect, RICH)
        seen = [all_columns(effect, RICH, {**values, parameter.name: float(v)}) for v in (grid[0], grid[-1])]
        assert not np.allclose(seen[0], seen[1], rtol=1e-6, atol=1e-12), parameter.name
    if isinstance(effect, SensorEffect):
        made = [
            [of(RICH, axis, **values) for axis in range(3)]
            for values in grid_of(effect, RICH)
            for of in (effect.columns, effect.start_columns)
        ]
        assert effect.same_on_axes == all(np.array_equal(one, axes[0]) for axes in made for one in axes)


def test_every_module_of_the_package_holds_an_effect_or_is_a_base() -> None:
    """A file without a class with an id would be skipped silently."""
    bases = {"base", "covariate", "formula", "own_file"}
    modules = {info.name for info in pkgutil.iter_modules(effects.__path__)} - bases
    assert modules == {type(effects.get(name)).__module__.rpartition(".")[2] for name in EVERY}


def model_columns(names: list[str], state: State, axis: int) -> np.ndarray:
    return np.concatenate([effects.get(n).columns(state, axis)[0] for n in names], axis=-1)


@each(EVERY)
def test_is_recovered_where_the_plan_sees_it_and_refused_where_not(name: str, rng: np.random.Generator) -> None:
    effect = effects.get(name)
    base = [n for n in BASE if n != name]
    values = values_of(effect, RICH)
    columns = all_columns(effect, RICH, values)
    models = [model_columns(base, RICH, axis) for axis in range(3)]
    if isinstance(effect, SensorEffect):
        shows = min(least_left(columns[axis, 0], models[axis]) for axis in range(3))
    else:
        # the coefficients of a station are those of the three axes together: a rotation leaves its own axis as it is
        shows = least_left(columns[:, 0].reshape(-1, columns.shape[-1]), block_diag(*models))
    output = RICH.force
    size = np.maximum(np.max(np.abs(columns), axis=(0, 1, 2)), 1e-12)
    truth = 1e-3 * rng.uniform(0.5, 1.0, (3, columns.shape[-1])) / size
    if isinstance(effect, StationEffect):
        truth = np.repeat(truth[:1], 3, axis=0)
    output = output + np.moveaxis(np.einsum("aunp,ap->aun", columns, truth), 0, -1)
    fitted = [*base, name]
    if shows < GONE:
        with pytest.raises(NotIdentified):
            fit_lot(fitted, RICH, output, nonlinear={name: values})
        return
    fit = fit_lot(fitted, RICH, output, nonlinear={name: values})
    second_order = 1e-3 * 1e-3  # a station's effect goes through K, which is itself found beside it
    assert np.max(np.abs(fit.residuals)) < (1e-8 if isinstance(effect, SensorEffect) else second_order)
    if isinstance(effect, StationEffect):
        assert np.allclose(fit.shared, truth[0], rtol=5e-3, atol=1e-8)
    if isinstance(effect, SensorEffect) and name not in BASE:
        at = [k for k, (e, _) in enumerate(fit.names[0]) if e == name]
        assert np.allclose(fit.coefficients[..., at], truth, rtol=1e-4, atol=1e-8)


def six_faces() -> pd.DataFrame:
    """Dwells on the six faces at one temperature, three rounds, four units, white noise; only what is required is recorded."""
    rng = np.random.default_rng(3)
    angles = np.tile(poses.plan("six"), (3, 1))
    force = force_from_angles(*np.radians(angles).T)
    parts = []
    for unit in range(4):
        gain = np.eye(3) + 3e-3 * rng.standard_normal((3, 3))
        out = 5e-3 * rng.standard_normal(3) + force @ gain.T + 5e-6 * rng.standard_normal(force.shape)
        table = pd.DataFrame({"unit": f"U{unit}", "dwell": range(len(force)), "n": 400})
        for k, axis in enumerate("xyz"):
            table[f"out_{axis}"], table[f"force_{axis}"], table[f"sd_{axis}"] = out[:, k], force[:, k], 1e-4
        parts.append(table)
    return pd.concat(parts, ignore_index=True).assign(time_s=lambda table: 30.0 * table["dwell"])


@pytest.fixture(scope="module")
def diagnosis_of_six_faces() -> dict:
    return diagnose(six_faces(), effects=list(BASE))


@each([n for n in EVERY if n not in BASE])
def test_is_reported_unseen_on_six_faces_exactly_where_it_cannot_show(name: str, diagnosis_of_six_faces: dict) -> None:
    state = lot_of(measured(six_faces())).state
    effect = effects.get(name)
    shows = False
    try:
        for values in resting_grid(effect, state):
            columns = all_columns(effect, state, values)
            for axis in range(3):
                base = model_columns(list(BASE), state, axis)
                shows |= any(least_left(column[:, None], base) > 1e-5 for column in columns[axis, 0].T)
    except MissingInput:
        shows = False
    assert (name in diagnosis_of_six_faces["unseen"]) == (not shows)


@each(EVERY)
def test_export_holds_it_or_says_that_it_does_not(name: str) -> None:
    """Effects beyond polynomials in temperature are told of in what is exported, never dropped silently."""
    p = len(effects.get(name).names(0)) if isinstance(effects.get(name), SensorEffect) else 0
    fitted = SimpleNamespace(
        units=["U1"], effects=[*BASE, name], axes=(0, 1, 2), names=[[(name, "Kxy"), (name, "Kxz")]] * 3,
        value=lambda effect: np.full((1, 3, p), 0.25) if effect == name and p else np.zeros((1, 3, 0)),
    )  # fmt: skip
    bias, response = polynomials(fitted, "U1")
    kept = name in {*BIAS, *SCALE, *ACROSS}
    assert (name in effects_left_out(fitted)) != kept
    assert bool(np.any(bias) or np.any(response)) == kept
