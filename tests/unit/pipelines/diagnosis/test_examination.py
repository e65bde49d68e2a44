"""Each data fault is caught in the unit that has it, and nothing in clean lots; other units are still diagnosed."""

import lots
import numpy as np
import pytest
from each import each
from long_suites import mostly_slow

from inertial.data_errors.faults.quantised import lattice_step
from pipelines.diagnosis.diagnose import diagnose, examination
from pipelines.diagnosis.sections import fault_lines
from pipelines.tables import condense

pytestmark = pytest.mark.usefixtures("no_next_measurement")

BASE = ["bias", "scale", "misalignment"]
OUT = ["out_x", "out_y", "out_z"]
SAMPLES = [*OUT, "sd_x", "sd_y", "sd_z"]


def put(columns, dwells, change):
    """A fault: what some dwells of a unit have in columns (n, k), changed by ``change(values, rng)``."""

    def spoil(table, rows, rng):
        table.loc[rows[dwells], columns] = change(table.loc[rows[dwells], columns].to_numpy(dtype=float), rng)

    return spoil


def spikes(table, rows, rng):
    table.loc[rows[[5, 6, 40]], "out_x"] += 3e-3
    table.loc[rows[[5, 6, 40]], "sd_x"] *= 40.0


ALL = slice(None)
FAULTS = {
    "axis_flip": put(["out_y"], ALL, lambda values, _: -values),
    "axis_flip ": put(OUT, ALL, lambda values, _: values[:, [1, 0, 2]]),
    "swapped_dwells": put(OUT, [3, 10], lambda values, _: values[::-1]),
    "wrong_units": put(SAMPLES, ALL, lambda values, _: 9.80665 * values),
    "wrong_range": put(SAMPLES, slice(30, None), lambda values, _: 2.0 * values),
    "stuck_output": put(OUT, slice(20, 30), lambda values, _: values[0]),
    "dead_channel": put(["out_z"], ALL, lambda values, rng: 0.01 + rng.normal(0.0, 1e-5, values.shape)),
    "stale_temperature": put(["unit_C"], slice(20, None), lambda values, _: values[0]),
    "spikes": spikes,
    "quantised": put(OUT, ALL, lambda values, _: np.round(values / 2e-4) * 2e-4),
    "clock_jitter": put(["time_s"], slice(30, None), lambda values, _: values - 2000.0),
    "dropped_samples": put(["n"], slice(10, 20), lambda values, _: 0.0 * values + 400),
}
SEEN_ALONE = sorted(set(FAULTS) - {"wrong_units", "dropped_samples"})  # these are seen beside others only


QUICK_ALONE = ("axis_flip", "dead_channel", "spikes", "stale_temperature")


@pytest.mark.parametrize("name", mostly_slow(SEEN_ALONE, *QUICK_ALONE))
def test_a_fault_blocks_a_unit_that_is_alone(name, rng):
    table = lots.lot(rng, units=1)
    FAULTS[name](table, table.index.to_numpy(), rng)
    diagnosis = diagnose(table)
    assert [(b["fault"], b["units"]) for b in diagnosis["blocked_by"]] == [(name.strip(), ["U000"])]
    assert diagnosis["recommended"] == []
    assert not diagnosis["adequate"]
    assert diagnosis["error"]["rms_ug"] is None


def lacking(table, unit, dwells):
    """The table without some dwells of a unit, by their place."""
    return table.drop(index=table.index[table["unit"] == unit].to_numpy()[dwells])


@pytest.mark.slow
def test_swapped_units_and_a_truncated_file_are_known(rng):
    table = lots.lot(rng)
    (line,) = fault_lines(diagnose(lacking(table, "U002", slice(50, None))))
    assert line.startswith("data fault of U002 (not judged): truncated_file, dwells ")
    one, other = (table.index[table["unit"] == u].to_numpy()[40:] for u in ("U001", "U003"))
    table.loc[[*one, *other], OUT] = table.loc[[*other, *one], OUT].to_numpy()
    faults = {(b["fault"], *b["units"]) for b in diagnose(table)["blocked_by"]}
    assert faults == {("units_swapped", "U001"), ("units_swapped", "U003")}


@pytest.mark.slow
def test_a_unit_without_some_dwells_is_diagnosed_by_those_it_has(rng):
    table = lots.lot(rng, hidden=lambda f, t, s, r: r.normal(0.0, 60e-6, 3) * f**3)
    count = (table["unit"] == "U000").sum()
    table = lacking(lacking(lacking(table, "U000", [5]), "U001", rng.permutation(count)[: count // 3]), "U002", [-1])
    document = diagnose(table)
    assert document["blocked_by"] == []
    assert document["recommended"] == ["third_order"]
    (notice,) = (text for text in document["warnings"] if "missing" in text)
    assert notice.startswith(f"of {count} dwells of the lot are missing: U000 1 (5), U001 {count // 3} (")
    assert f"U002 1 ({count - 1})" in notice
    FAULTS["axis_flip"](table, table.index[table["unit"] == "U003"].to_numpy(), rng)  # it leaves the others alone
    document = diagnose(table)
    assert [b["units"] for b in document["blocked_by"]] == [["U003"]]
    assert document["recommended"] == ["third_order"]


@pytest.mark.slow
def test_a_unit_without_most_of_its_dwells_is_refused(rng):
    table = lots.lot(rng, units=3, temperatures=(0.0, 50.0))
    count = int((table["unit"] == "U000").sum())
    few = rng.permutation(count - 1)[: count // 2 + 1]
    document = diagnose(lacking(lacking(table, "U001", few), "U002", [2, 3]))
    assert [(b["fault"], b["units"]) for b in document["blocked_by"]] == [("dropped_samples", ["U001"])]
    assert ["U002 2 (2, 3)" in text for text in document["warnings"]] == [True]
    # numbered again it is no truncated file, and of dwells left out on purpose nothing is said
    again = lacking(table, "U001", [5, 20, 21, 40])
    own = again["unit"] == "U001"
    again.loc[own, "dwell"] = np.arange(own.sum())
    assert diagnose(again)["blocked_by"] == []
    document = examination(lacking(table, "U001", [5]), None, BASE, ["U001:5"]).document
    assert not any("missing" in text for text in document["warnings"])


@pytest.mark.slow
@each([name for name in FAULTS if name not in QUICK_ALONE])
def test_a_fault_blocks_its_unit_and_no_other_also_where_units_lack_dwells(name, rng):
    table = lots.lot(rng, units=3, temperatures=(0.0, 50.0))
    rows = table.index[table["unit"] == "U000"].to_numpy()
    FAULTS[name](table, rows, rng)
    table = lacking(lacking(table, "U000", [7]), "U002", [15, 44])
    diagnosis = diagnose(table)
    assert {(b["fault"], *b["units"]) for b in diagnosis["blocked_by"]} == {(name.strip(), "U000")}
    assert diagnosis["recommended"] == []


@pytest.mark.parametrize("seed", mostly_slow(range(8), 0))
def test_clean_lots_raise_no_alarm(seed):
    rng = np.random.default_rng(seed)
    assert diagnose(lots.lot(rng, plan="six" if seed % 2 else "fibonacci", units=1 + seed % 3))["blocked_by"] == []


def test_a_clipped_output_is_physics_and_no_fault(rng):
    def hidden(force, *_):
        return np.clip(force, -0.97, 0.97) - force

    assert diagnose(lots.lot(rng, plan="six", temperatures=(0, 25, 50, 25), hidden=hidden))["blocked_by"] == []


def test_dwells_that_are_too_many_to_be_judged_at_once_are_told(rng, monkeypatch):
    monkeypatch.setattr(condense, "MOST", 40)
    table = lots.lot(rng, units=1, temperatures=(25.0,) * 3)
    count = len(table)
    told = f"{count} dwells are more than the 40 that can be judged at once: one in {-(-count // 40)} is judged"
    assert told in diagnose(table)["warnings"]
    still = table[[*OUT, "unit", "dwell"]].assign(force_x=1.0)
    assert "neighbours in one pose is judged" in condense.reduction(still)[0]


def test_the_step_of_a_lattice_is_found_and_real_numbers_have_none(rng):
    assert lattice_step(np.round(rng.normal(size=40) / 0.25) * 0.25) == pytest.approx(0.25)
    assert lattice_step(rng.normal(size=40)) is None
