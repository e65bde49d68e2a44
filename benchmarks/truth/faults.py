"""Data faults as a table of dwells shows them, injected into one unit (or two) of a clean run."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from .spec import Fault

OUTPUTS = ["out_x", "out_y", "out_z"]
LOST = -1  # the number of a dwell that the caller shall drop
SCATTERS = ["sd_x", "sd_y", "sd_z"]
GAIN = {"wrong_units", "wrong_range"}
Injector = Callable[[pd.DataFrame, str, float, np.random.Generator], Fault]
FAULTS: dict[str, Injector] = {}


def fault(name: str, *also: str) -> Callable[[Callable[..., tuple[int, ...]]], Callable[..., tuple[int, ...]]]:
    """Enters an injector that changes the table in place and returns the dwells it touched."""

    def enter(act: Callable[..., tuple[int, ...]]) -> Callable[..., tuple[int, ...]]:
        def inject(table: pd.DataFrame, unit: str, noise: float, rng: np.random.Generator) -> Fault:
            rows = table.index[table["unit"] == unit].to_numpy()
            touched = act(table, rows, noise, rng)
            return Fault(name, (unit,), tuple(touched), tuple(sorted({name, *also})))

        FAULTS[name] = inject
        return act

    return enter


def _dwells(table: pd.DataFrame, rows: np.ndarray) -> tuple[int, ...]:
    return tuple(int(dwell) for dwell in table.loc[rows, "dwell"])


@fault("axis_flip")
def _flip(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    values = table.loc[rows, OUTPUTS].to_numpy(copy=True)
    if rng.random() < 0.5:
        axis = int(rng.integers(3))
        zero = 0.0 if table["out_unit"].iloc[0] != "V" else 1.5
        values[:, axis] = 2.0 * zero - values[:, axis]
    else:
        order = [(1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0)][int(rng.integers(4))]
        values = values[:, order]
    table.loc[rows, OUTPUTS] = values
    return _dwells(table, rows)


def _unlike(table: pd.DataFrame, rows: np.ndarray, rng: np.random.Generator) -> tuple[int, int]:
    values = table.loc[rows, OUTPUTS].to_numpy()
    for _ in range(200):
        first, second = (int(k) for k in rng.choice(len(rows), 2, replace=False))
        if np.abs(values[first] - values[second]).max() > 0.25 * np.ptp(values):
            break
    return first, second


@fault("swapped_dwells", "wrong_pose")
def _swap(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    pair = rows[list(_unlike(table, rows, rng))]
    table.loc[pair, OUTPUTS + SCATTERS] = table.loc[pair[::-1], OUTPUTS + SCATTERS].to_numpy()
    return _dwells(table, pair)


@fault("wrong_pose", "swapped_dwells")
def _pose(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    touched = []
    for _ in range(int(rng.integers(1, 4))):
        target, source = _unlike(table, rows, rng)
        copied = table.loc[rows[source], OUTPUTS].to_numpy(dtype=float) + noise * rng.standard_normal(3)
        table.loc[rows[target], OUTPUTS] = copied
        touched.append(rows[target])
    return _dwells(table, np.unique(touched))


@fault("stuck_output")
def _stuck(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    length = int(rng.integers(4, max(5, len(rows) // 4)))
    start = int(rng.integers(1, len(rows) - length))
    held = rows[start : start + length]
    table.loc[held, OUTPUTS] = table.loc[rows[start - 1], OUTPUTS].to_numpy(dtype=float)
    table.loc[held, SCATTERS] = 0.0
    return _dwells(table, held)


@fault("stale_temperature")
def _stale(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    warmth = table.loc[rows, "unit_C"].to_numpy()
    start = int(len(rows) * rng.uniform(0.1, 0.5))
    table.loc[rows[start:], "unit_C"] = warmth[start]
    return _dwells(table, rows[start:])


@fault("wrong_units", "wrong_range")
def _units(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    factor = float(rng.choice([9.80665, 1000.0, 1.0 / 9.80665]))
    table.loc[rows, OUTPUTS + SCATTERS] *= factor
    return _dwells(table, rows)


@fault("wrong_range", "wrong_units")
def _range(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    start = int(len(rows) * rng.uniform(0.2, 0.7)) if rng.random() < 0.5 else 0
    table.loc[rows[start:], OUTPUTS + SCATTERS] *= float(rng.choice([0.5, 2.0]))
    return _dwells(table, rows[start:])


@fault("quantised")
def _quantised(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    step = noise * float(rng.uniform(12.0, 60.0))
    table.loc[rows, OUTPUTS] = np.round(table.loc[rows, OUTPUTS].to_numpy() / step) * step
    return _dwells(table, rows)


@fault("spikes", "torn_words")
def _spikes(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    hit = rng.choice(rows, max(2, len(rows) // 25), replace=False)
    for row in hit:
        axis = int(rng.integers(3))
        jump = noise * float(rng.uniform(40.0, 400.0)) * float(rng.choice([-1.0, 1.0]))
        count = float(table.loc[row, "n"])
        table.loc[row, OUTPUTS[axis]] += jump
        table.loc[row, SCATTERS[axis]] = float(
            np.hypot(table.loc[row, SCATTERS[axis]], abs(jump) * np.sqrt(count / 2.0))
        )
    return _dwells(table, np.sort(hit))


@fault("torn_words", "spikes")
def _torn(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    """Wings of ±256 counts in a tenth of the samples; the wing is taken as 40 standard errors where counts are unknown."""
    counts = table["out_unit"].iloc[0] == "LSB"
    wing = 256.0 * 8.0 if counts else 40.0 * noise * 6.0
    hit = rows[rng.random(len(rows)) < 0.3]
    if not len(hit):
        hit = rows[:3]
    samples = table.loc[hit, "n"].to_numpy(dtype=float)[:, None]
    scatter = table.loc[hit, SCATTERS].to_numpy()
    table.loc[hit, OUTPUTS] += wing * np.sqrt(0.1 / samples) * rng.standard_normal((len(hit), 3))
    table.loc[hit, SCATTERS] = np.sqrt(scatter**2 + 0.1 * wing**2)
    return _dwells(table, hit)


@fault("dead_channel", "stuck_output")
def _dead(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    axis = int(rng.integers(3))
    level = float(table.loc[rows, OUTPUTS[axis]].mean())
    quiet = rng.random() < 0.5
    table.loc[rows, OUTPUTS[axis]] = level + (0.0 if quiet else noise) * rng.standard_normal(len(rows))
    if quiet:
        table.loc[rows, SCATTERS[axis]] = 0.0
    return _dwells(table, rows)


@fault("dropped_samples", "truncated_file")
def _dropped(table: pd.DataFrame, rows: np.ndarray, noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    hit = np.sort(rng.choice(rows, max(3, len(rows) // 6), replace=False))
    share = rng.uniform(0.2, 0.7, len(hit))
    table.loc[hit, "n"] = (table.loc[hit, "n"].to_numpy() * share).astype(int)
    table.loc[hit, OUTPUTS] += noise * np.sqrt(1.0 / share - 1.0)[:, None] * rng.standard_normal((len(hit), 3))
    return _dwells(table, hit)


@fault("clock_jitter", "dropped_samples")
def _clock(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    start = int(len(rows) * rng.uniform(0.3, 0.7))
    seconds = table.loc[rows, "time_s"].to_numpy(dtype=float, copy=True)
    seconds[start:] -= float(rng.uniform(0.3, 0.8)) * (seconds[start] - seconds[0]) + 60.0
    table.loc[rows, "time_s"] = seconds
    return _dwells(table, rows[start:])


@fault("truncated_file", "dropped_samples")
def _truncated(table: pd.DataFrame, rows: np.ndarray, _noise: float, rng: np.random.Generator) -> tuple[int, ...]:
    lost = rows[int(len(rows) * rng.uniform(0.4, 0.8)) :]
    touched = _dwells(table, lost)
    table.loc[lost, "dwell"] = LOST
    return touched


def units_swapped(table: pd.DataFrame, names: tuple[str, ...], rng: np.random.Generator) -> Fault:
    """Two units' cables are exchanged from some dwell on."""
    pair = [names[int(k)] for k in rng.choice(len(names), 2, replace=False)]
    first, second = (table.index[table["unit"] == unit].to_numpy() for unit in pair)
    start = int(len(first) * rng.uniform(0.3, 0.7))
    kept = table.loc[first[start:], OUTPUTS + SCATTERS].to_numpy()
    table.loc[first[start:], OUTPUTS + SCATTERS] = table.loc[second[start:], OUTPUTS + SCATTERS].to_numpy()
    table.loc[second[start:], OUTPUTS + SCATTERS] = kept
    return Fault("units_swapped", tuple(pair), _dwells(table, first[start:]), ("units_swapped",))
