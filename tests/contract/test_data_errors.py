"""One error of handling is one file, and one data fault is one file: each is found by itself, and none is half there."""

import ast
import re
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from types import ModuleType

import lots
import numpy as np
import pandas as pd
from each import each
from test_effects import RICH

from inertial import effects
from inertial.data_errors import faults, handling
from inertial.data_errors.faults.fault import Look
from inertial.estimation.alternative import Handling
from inertial.estimation.lot import Lot
from pipelines.tables.dwells import measured

ROOT = Path(__file__).resolve().parents[2]
OUT, SPREAD = ["out_x", "out_y", "out_z"], ["sd_x", "sd_y", "sd_z"]
HANDLING = [f"{handling.__name__}.{info.name}" for info in iter_modules(handling.__path__)]
FAULTS = [f"{faults.__name__}.{info.name}" for info in iter_modules(faults.__path__) if info.name != "fault"]
DECLARED = ("symbol", "equation", "breaker", "source")


def exchanged_lot() -> Lot:
    """A lot in g of which two units were exchanged in the middle: every alternative has a place in it."""
    state, (units, n) = RICH, RICH.time.shape
    own = 2e-3 * np.arange(1, units + 1)[:, None, None]
    output = state.force * (1.0 + own) + own * (1.0 + 0.01 * (state.temperature[..., None] - 25.0))
    output[:, n // 2 :] = output[::-1, n // 2 :]
    return Lot(state, output, np.full((units, n, 3), 1e-6), np.broadcast_to(np.eye(3), (units, 3, 3)).copy())


def lacks_as_handling(module: ModuleType, lot: Lot) -> list[str]:
    """What a file of an error of handling lacks."""
    kinds = [
        thing for thing in vars(module).values()
        if isinstance(thing, type) and issubclass(thing, Handling) and thing.__module__ == module.__name__
    ]  # fmt: skip
    if [kind for kind in kinds if not hasattr(kind, "id")] or len(kinds) != 1:
        return [f"one class with an id, {len(kinds)} are there"]
    (kind,) = kinds
    if kind.__abstractmethods__:
        return sorted(kind.__abstractmethods__)
    lacks = [name for name in DECLARED if not getattr(kind, name, "").strip()]
    lacks += [] if "." in (kind.__doc__ or "") else ["a docstring that says what it is"]
    lacks += ["an id of its own"] if kind.id in effects.built_in() else []
    lacks += [f"an effect {name!r}" for name in kind.hides_behind if name not in effects.built_in()]
    lacks += [] if kind.fewest_units >= 1 else ["fewest_units"]
    return lacks + _lacks_in_a_lot(kind(), lot)


def _lacks_in_a_lot(error: Handling, lot: Lot) -> list[str]:
    """What it lacks of locations, columns and words in a lot in which it can be."""
    units, n = lot.state.time.shape
    slope = np.full((units, n, 3), 1e-5)
    locations = error.locations(lot)
    if not locations:
        return ["a location in a lot with everything recorded"]
    location = locations[len(locations) // 2]
    change, alike = error.change(lot, slope, **location), {k: v for k, v in location.items() if k != "unit"}
    lacks: list[str] = []
    if change.shape[0] not in {1, units} or change.shape[1:3] != (n, 3) or not change.shape[-1]:
        return [f"columns of the shape (units, {n}, 3, k), {change.shape} are there"]
    size = np.full(change.shape[-1], 1e-3)
    lacks += [] if np.isfinite(change).all() and change.any() else ["finite columns that are not all zero"]
    if "other" not in location:
        of_each = error.of_each_unit(lot, slope, **alike)
        lacks += [] if of_each.shape[-1] == change.shape[-1] else ["of_each_unit with as many columns"]
    lacks += [] if len(error.describe(lot, size, **location)) > 20 else ["a description"]
    near = error.near(lot, **location)
    lacks += [] if all(set(one) == set(location) for one in near) else ["locations near a location"]
    lacks += [] if set(error.units(**location)) <= set(range(units)) else ["units of the lot"]
    lacks += [] if set(error.dwells(lot, **location)) <= set(range(n)) else ["dwells of the lot"]
    return lacks


@each(HANDLING)
def test_an_error_of_handling_is_whole_in_its_file(name: str) -> None:
    assert lacks_as_handling(import_module(name), exchanged_lot()) == []


def test_an_error_of_handling_that_is_half_there_is_told_with_what_it_lacks() -> None:
    half, lot = ModuleType("half"), exchanged_lot()
    assert lacks_as_handling(half, lot) == ["one class with an id, 0 are there"]
    own = dict.fromkeys(("symbol", "equation", "__doc__"), "") | {"id": "bias", "hides_behind": ("nothing",)}
    own["__module__"] = half.__name__
    half.Half = type("Half", (Handling,), own)
    assert lacks_as_handling(half, lot) == ["change", "describe", "locations"]
    half.Half = type("Half", (import_module(f"{handling.__name__}.gain_step").GainStep,), own)
    assert lacks_as_handling(half, lot) == [
        "symbol", "equation", "a docstring that says what it is", "an id of its own", "an effect 'nothing'",
    ]  # fmt: skip


def test_every_file_takes_part_and_nothing_else_names_one() -> None:
    """Outside its package an error of handling is found, never imported or called by its id."""
    assert sorted(type(one).__module__ for one in handling.alternatives()) == HANDLING
    assert sorted(look.find.__module__ for look in faults.looks()) == FAULTS
    assert sorted(SPOILT) == sorted(name.rpartition(".")[2] for name in FAULTS)
    ids = "|".join(one.id for one in handling.alternatives())
    text = re.compile(rf'data_errors\.(?:handling|faults)\.(?!fault\b)\w+|"(?:{ids})"')
    named = [
        f"{path.relative_to(ROOT)}: {found}"
        for folder in ("inertial", "pipelines", "schemas", "stations")
        for path in sorted((ROOT / folder).rglob("*.py"))
        if ROOT / "inertial" / "data_errors" not in path.parents
        for found in text.findall(path.read_text(encoding="utf-8"))
    ]
    assert named == []


Table = pd.DataFrame
Spoil = Callable[[Table, np.ndarray], Table]


def changed(columns: list[str], change: Callable[[Table], object], dwells: slice | list[int] = slice(None)) -> Spoil:
    """Changes columns of a unit in some dwells."""

    def work(table: Table, rows: np.ndarray) -> Table:
        table.loc[rows[dwells], columns] = change(table.loc[rows[dwells], columns])
        return table

    return work


def exchanged(one: list[int], other: list[int], unit: str = "U000") -> Spoil:
    """Exchanges outputs of dwells with others of a unit."""

    def work(table: Table, rows: np.ndarray) -> Table:
        here, there = rows[one], table.index[table["unit"] == unit].to_numpy()[other]
        table.loc[[*here, *there], OUT] = table.loc[[*there, *here], OUT].to_numpy()
        return table

    return work


def first(values: Table) -> np.ndarray:
    return values.iloc[0].to_numpy(float)


def far_off(table: Table, rows: np.ndarray) -> Table:
    """Two dwells far off on an axis, in a file without scatter."""
    table.loc[rows[[5, 40]], "out_x"] += 0.3
    return table.drop(columns=SPREAD)


SPOILT: dict[str, Spoil] = {
    "truncated_file": lambda table, rows: table.drop(index=rows[50:]),
    "clock_jitter": changed(["time_s"], lambda t: t - 2000.0, slice(30, None)),
    "temperature_unit": changed(["unit_C"], lambda t: t + 273.15),
    "stuck_output": changed(OUT, first, slice(20, 30)),
    "changed_calibration": changed([*OUT, *SPREAD], lambda v: 2.0 * v, slice(30, None)),
    "dead_channel": changed(["out_z"], lambda v: 1e-3 * v),
    "scale_of_lot": changed([*OUT, *SPREAD], lambda v: 9.80665 * v),
    "axis_flip": changed(["out_y"], lambda v: -v),
    "swapped_units": exchanged([4, 15, 21, 33, 48, 60], [4, 15, 21, 33, 48, 60], "U002"),
    "wrong_pose": exchanged([3], [10]),
    "loud_dwells": changed(["sd_x"], lambda v: 40.0 * v, [5, 6, 40]),
    "outlying_dwells": far_off,
    "stale_temperature": changed(["unit_C"], first, slice(20, None)),
    "quantised": changed(OUT, lambda v: np.round(v / 2e-4) * 2e-4),
    "dropped_samples": changed(["n"], lambda v: v // 2, slice(10, 20)),
}
"""How a lot is spoilt in which the test of each file finds its fault."""


def lacks_as_fault(module: ModuleType) -> list[str]:
    """What a file of a data fault lacks."""
    look, name = getattr(module, "LOOK", None), module.__name__.rpartition(".")[2]
    if not isinstance(look, Look):
        return ["a LOOK"]
    own = look.find.__module__ == module.__name__ and look.find.__doc__
    lacks = [] if own else ["a test of its own that says what it finds"]
    lacks += [] if look.names and (module.__doc__ or "").strip() else ["names, or what it is"]
    others = [one for one in faults.looks() if one is not look]
    lacks += ["an order of its own"] if look.order in {one.order for one in others} else []
    alike = {one.order_in_one_pose for one in others} - {None}
    lacks += ["an order of its own in one pose"] if look.order_in_one_pose in alike else []
    if name not in SPOILT:
        return [*lacks, "a lot in which it finds its fault"]
    table = lots.lot(np.random.default_rng(5))
    lacks += [f"silence in a clean lot: {fault}" for fault in look.find(measured(table).readings)]
    table = SPOILT[name](table, table.index[table["unit"] == "U000"].to_numpy())
    spoilt = measured(table)
    found = list(look.find(spoilt.readings))
    lacks += [] if "U000" in {spoilt.units[fault.unit] for fault in found} else ["its fault in the spoilt unit"]
    lacks += [f"{fault.name} among its names" for fault in found if fault.name not in look.names]
    lacks += [f"evidence of {fault}" for fault in found if len(fault.evidence) < 10]
    texts = {node.value for node in ast.walk(ast.parse(Path(module.__file__ or "").read_text("utf-8")))
             if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Fault"
             for node in node.args[:1] if isinstance(node, ast.Constant)}  # fmt: skip
    return lacks + [f"{text} among its names" for text in sorted(texts - set(look.names))]


@each(FAULTS)
def test_a_data_fault_is_whole_in_its_file(name: str) -> None:
    assert lacks_as_fault(import_module(name)) == []


def test_a_data_fault_that_is_half_there_is_told_with_what_it_lacks() -> None:
    half = ModuleType("half")
    assert lacks_as_fault(half) == ["a LOOK"]
    half.LOOK = Look(import_module(FAULTS[0]).LOOK.find, (), order=faults.looks()[-1].order)
    assert lacks_as_fault(half) == [
        "a test of its own that says what it finds", "names, or what it is", "an order of its own",
        "a lot in which it finds its fault",
    ]  # fmt: skip
