"""What is done to the dwells of rows of the world table, and what is asked of a verdict besides."""

from collections.abc import Callable

import numpy as np
import pandas as pd
from world_row import Check, MadeLot

from benchmarks.hand_turned import EFFECTS
from inertial.frames import force_from_angles


def raised(dwells: pd.DataFrame, unit: int, axis: str, size: float, dwells_from: int = 0, until: int = 999) -> None:
    name = dwells["unit"].unique()[unit]
    chosen = (dwells["unit"] == name) & (dwells["dwell"] >= dwells_from) & (dwells["dwell"] < until)
    dwells.loc[chosen, f"out_{axis}"] += size


def in_middle_soak(*axes: tuple[int, str, float]) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """The bias of some axes of some units is another in the second of three soaks."""

    def change(dwells: pd.DataFrame) -> pd.DataFrame:
        for unit, axis, size in axes:
            raised(dwells, unit, axis, size, 24, 48)
        return dwells

    return change


def stated_forces(dwells: pd.DataFrame) -> pd.DataFrame:
    outer, inner = (np.radians(dwells[name].to_numpy()) for name in ("outer_deg", "inner_deg"))
    names = ["force_x", "force_y", "force_z"]
    dwells[names] = force_from_angles(outer, inner)
    return dwells.drop(columns=["outer_deg", "inner_deg"])


def exchanged_for_a_soak(dwells: pd.DataFrame) -> pd.DataFrame:
    middle = (dwells["dwell"] >= 24) & (dwells["dwell"] < 48)
    one, other = (np.flatnonzero(middle & (dwells["unit"] == name)) for name in dwells["unit"].unique()[:2])
    felt = [dwells.columns.get_loc(name) for name in dwells if name.startswith(("out_", "sd_", "unit_C"))]
    felt = [k for k in felt if dwells.columns[k] != "out_unit"]
    readings = dwells.iloc[one, felt].to_numpy()
    dwells.iloc[one, felt] = dwells.iloc[other, felt].to_numpy()
    dwells.iloc[other, felt] = readings
    return dwells


def exchange_is_told(document: dict, lot: MadeLot) -> bool:
    pair = set(lot.dwells["unit"].unique()[:2])
    told = [one for one in document["classes"] if "units_swapped" in one["effects"]]
    blocked = {unit for one in document["blocked_by"] if one["fault"] == "units_swapped" for unit in one["units"]}
    return blocked == pair or [set(one["units"]) for one in told] == [pair]


def last_unit_jumps(dwells: pd.DataFrame) -> pd.DataFrame:
    raised(dwells, -1, "z", 400e-6, 40)
    return dwells


def telegraph(dwells: pd.DataFrame) -> pd.DataFrame:
    """One axis jumps down for good, up for one dwell, and up for good."""
    for dwell, size in ((1, -300e-6), (32, 250e-6), (33, -250e-6), (42, 320e-6)):
        raised(dwells, 0, "x", size, dwell)
    return dwells


def drifting_scale(rate: float) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """The scale factor of every unit drifts by its own share of an exponential of time."""

    def change(dwells: pd.DataFrame) -> pd.DataFrame:
        drift = 400e-6 * np.exp(-dwells["time_s"].to_numpy() / rate)
        sizes = dict(zip(dwells["unit"].unique(), (1.0, 1.4, 0.7, 1.2, 0.9, 1.1), strict=True))
        for axis in "xyz":
            dwells[f"out_{axis}"] *= 1.0 + drift * dwells["unit"].map(sizes).to_numpy()
        return dwells

    return change


def same_pose(dwells: pd.DataFrame) -> np.ndarray:
    """Rows of two dwells of one pose."""
    angles = dwells[["outer_deg", "inner_deg"]].to_numpy()
    pose = angles[(dwells["dwell"] == 5).to_numpy()]
    return np.flatnonzero(np.all(np.abs(angles - pose) < 1e-6, axis=1))[:2]


def two_dwells_of_a_pose(dwells: pd.DataFrame) -> pd.DataFrame:
    for axis, row in zip(("out_x", "out_y"), same_pose(dwells), strict=True):
        dwells.loc[row, axis] += 1e-3
    return dwells


def half_exchanged(dwells: pd.DataFrame) -> pd.DataFrame:
    """Half of the difference between two units is exchanged from a dwell on."""
    one, other = (dwells["unit"] == name for name in ("W001", "W003"))
    late = dwells["dwell"] >= 30
    for axis in ("out_x", "out_y", "out_z"):
        apart = 0.5 * (dwells.loc[one & late, axis].to_numpy() - dwells.loc[other & late, axis].to_numpy())
        dwells.loc[one & late, axis] -= apart
        dwells.loc[other & late, axis] += apart
    return dwells


def late_and_with_gaps(dwells: pd.DataFrame) -> pd.DataFrame:
    dwells.loc[dwells["unit"] == "W002", "time_s"] += 40.0
    return dwells.drop(index=dwells.index[(dwells["unit"] == "W003") & dwells["dwell"].isin([5, 6, 40])])


def jumping(dwell: int, seed: int, size_ug: float = 300.0) -> Callable[[pd.DataFrame], pd.DataFrame]:
    """The bias is another from a dwell on, in every axis of every unit."""

    def change(dwells: pd.DataFrame) -> pd.DataFrame:
        rng = np.random.default_rng(seed)
        for unit in range(dwells["unit"].nunique()):
            for axis in "xyz":
                raised(dwells, unit, axis, 1e-6 * size_ug * rng.uniform(0.7, 1.3), dwell)
        return dwells

    return change


def jumping_and_turned(dwells: pd.DataFrame) -> pd.DataFrame:
    """At the jump the table stands 0.5° off about its inner axis: every unit feels the same other force."""
    dwells = jumping(72, 2)(dwells)
    here, turn = dwells["dwell"] == 72, np.radians(0.5)
    outer, inner = np.radians(dwells.loc[here, "outer_deg"]), np.radians(dwells.loc[here, "inner_deg"])
    dwells.loc[here, "out_x"] += np.sin(outer) * (np.sin(inner + turn) - np.sin(inner))
    dwells.loc[here, "out_y"] += np.sin(outer) * (np.cos(inner + turn) - np.cos(inner))
    return dwells


def last_unit_amplifies(dwells: pd.DataFrame) -> pd.DataFrame:
    later = (dwells["unit"] == dwells["unit"].max()) & (dwells["dwell"] >= 36)
    dwells.loc[later, ["out_x", "out_y", "out_z"]] *= 1.0 + 500e-6
    return dwells


def gain_step_is_certain(document: dict, made: MadeLot) -> bool:
    (group,) = document["classes"]
    alone = group["effects"] == ["gain_step"] and len(made.dwells["unit"].unique()) > 1
    placed = not alone or group["units"] == [made.dwells["unit"].max()]
    return placed and group["p_value"] < 1e-10 and group["size_ug"] > 10.0


def step_before(dwell: int) -> Check:

    def step_in_its_gap(document: dict, made: MadeLot) -> bool:
        (group,) = document["classes"]
        own = made.dwells[made.dwells["unit"] == made.dwells["unit"].iloc[0]].sort_values("dwell")
        after = own["time_s"] + 0.5 * own["duration_s"] > group["nonlinear"]["instant"]
        alone = "wrong_pose" not in group["effects"] and document["blocked_by"] == []
        return alone and own["dwell"][after].iloc[0] == dwell

    return step_in_its_gap


def pose_missed_at_the_step(document: dict, _: MadeLot) -> bool:
    return [g["dwells"] for g in document["classes"] if g["effects"] == ["wrong_pose"]] == [[72]]


def no_dwell_is_removed(document: dict, _: MadeLot) -> bool:
    return document["removed"] is None or document["removed"]["dwells"] == []


def left_out_dwells_judge(document: dict, _: MadeLot) -> bool:
    groups = document["classes"]
    better = all(g["heldout_after_ug"] < min(g["heldout_before_ug"], 4.0 * g["rms_after_ug"]) for g in groups)
    return better and len(groups) == 2 and groups[1]["effects"] == ["misalignment_temperature"]


def walk_is_known(document: dict, _: MadeLot) -> bool:
    # soaks that only climb hide any hysteresis that is narrower than their steps
    (dark,) = (row for row in document["unseen_in_part"] if row["effect"] == "thermal_hysteresis")
    narrow = dark["parameter"] == "half_width" and abs(dark["from"] - 1.0) < 1e-6 and 15.0 < dark["to"] < 35.0
    return document["error"]["walk_share"] > 100.0 and narrow


def small_and_seen(document: dict, _: MadeLot) -> bool:
    # a third of the noise of a dwell, most of which is walk: 20 of 67 µg, p below 1e-10
    return document["classes"][0]["size_ug"] < 0.35 * document["error"]["floor_ug"]


def carried_by_the_dwell(document: dict, _: MadeLot) -> bool:
    (group,) = document["classes"]
    return document["influence"][0] == {"unit": group["units"][0], "dwell": group["dwells"][0], "share": 1.0}


def three_soaks_are_said(document: dict, _: MadeLot) -> bool:
    # with three soaks an offset of one is, beside linear terms, an offset of another: all three are said
    evidence = document["classes"][0]["evidence"]
    return "0.5" in evidence and evidence.count("K off in soak") == 3


def time_constant_is_right(document: dict, _: MadeLot) -> bool:
    tau = float(document["classes"][0]["evidence"].split("time constant of ")[1].split(" s")[0])
    return abs(tau - 300.0) <= 30.0 and document["error"]["rms_ug"] < 1.2 * document["error"]["floor_ug"]


def both_faults_stand(document: dict, made: MadeLot) -> bool:
    moved, dwell = made.faults
    by_name = {group["effects"][0]: group for group in document["classes"]}
    told, carried = by_name["unit_moved"], {row["unit"] for row in by_name["unit_moved"]["influence"]}
    stands = told["without_influence"]["p_value"] < 1e-3 and carried == set(moved.units)
    return stands and by_name["bad_dwell"]["dwells"] == list(dwell.dwells)


def verdict_is_carried(document: dict, _: MadeLot) -> bool:
    group, shares = document["classes"][0], [row["share"] for row in document["influence"]]
    better = group["heldout_after_ug"] < group["heldout_before_ug"]
    spread = 0 < len(shares) <= 8 and all(0.0 < share < 0.5 for share in shares)
    return better and spread and document["without_influence"]["p_value"] < 1e-6


def from_one_dwell(document: dict, made: MadeLot) -> bool:
    (group,), (told,) = document["classes"], made.faults
    said = f"{told.units[0]} and {told.units[1]}: exchanged before this dwell"
    return group["dwells"] == [told.dwells[0]] and group["evidence"].startswith(said)


def jump_has_place_and_size(document: dict, made: MadeLot) -> bool:
    (group,) = document["classes"]
    placed = (group["units"], group["dwells"]) == ([made.dwells["unit"].unique()[-1]], [40])
    if group["effects"][0] != "bias_jump":
        return placed
    return placed and abs(float(group["evidence"].split("changed by ")[1].split(" ")[0]) - 400.0) <= 60.0


def unsteady(*units: str) -> Check:

    def check(document: dict, _: MadeLot) -> bool:
        groups = document["classes"]
        told = sorted(group["units"][0] for group in groups if "bias_unsteady" in group["effects"])
        sizes = [abs(float(group["evidence"].split("(")[1].split(" µg")[0].split(", ")[1])) for group in groups]
        return told == sorted(units) and all(abs(size - 333.0) <= 99.9 for size in sizes)

    return check


def some_unsteady(document: dict, _: MadeLot) -> bool:
    return any({"bias_unsteady", "bias_jump"} & set(group["effects"]) for group in document["classes"])


def jumps_are_told(document: dict, _: MadeLot) -> bool:
    told = {dwell for group in document["classes"] for dwell in group["dwells"]}
    told |= {row["dwell"] for row in (document["removed"] or {"dwells": []})["dwells"]}
    return bool(told & {0, 1}) and told >= {32, 42}


def no_reference_step(document: dict, _: MadeLot) -> bool:
    return not any("reference_step" in group["effects"] for group in document["classes"])


def not_exchanged(document: dict, _: MadeLot) -> bool:
    return not any("units_swapped" in group["effects"] for group in document["classes"])


def of_the_pose(document: dict, made: MadeLot) -> bool:
    rows = made.dwells.loc[same_pose(made.dwells), "dwell"]
    return sorted(dwell for group in document["classes"] for dwell in group["dwells"]) == sorted(rows)


def noise_beside_the_dependence(document: dict, made: MadeLot) -> bool:
    # a dwell in which the dependence is largest may stand out by itself
    named = [group["effects"] for group in document["classes"] if group["effects"] != ["bad_dwell"]]
    return named == [] and document["error"]["floor_ug"] < 1.3 * made.floor_ug < document["error"]["rms_ug"]


def tails_are_listed(document: dict, _: MadeLot) -> bool:
    return document["removed"] is None or document["removed"]["heavy_tails"] is True


def reason_names_every_unit(document: dict, _: MadeLot) -> bool:
    return "every unit (2)" in document["reason"]


def noise_of_the_lot(document: dict, made: MadeLot) -> bool:
    return abs(document["error"]["rms_ug"] - made.floor_ug) <= 0.4 * made.floor_ug


def step_with_hysteresis(document: dict, _: MadeLot) -> bool:
    return any({"thermal_hysteresis", "step_change"} <= set(group["effects"]) for group in document["classes"])


def pivot_is_in_the_class(document: dict, _: MadeLot) -> bool:
    classes = [(set(group["effects"]), group["scope"]) for group in document["classes"]]
    return classes == [({"bias_asymmetry", "dead_zone"}, "sensor")]


def memory_is_judged_on_dwells_left_out(document: dict, _: MadeLot) -> bool:
    (group,) = document["classes"]
    near_the_noise = group["heldout_after_ug"] < 1.1 * document["error"]["floor_ug"]
    return near_the_noise and group["heldout_after_ug"] < 0.6 * group["heldout_before_ug"]


def told_with_its_bias_and_without_physics(document: dict, made: MadeLot) -> bool:
    told = {group["effects"][0]: group for group in document["classes"] if group["scope"] == "data"}
    (seated,) = made.faults
    of_the_unit = all(group["units"] == list(seated.units) for group in told.values())
    # what the devices really have, where the plan has one temperature
    physics = set(document["recommended"]) - {"bias_temperature", "scale_temperature"}
    found = set(told) == {"unit_moved", "bias_step"} and of_the_unit and not physics
    return found and abs(told["bias_step"]["dwells"][0] - min(seated.dwells)) <= 1


def linear_coefficients_are_named(document: dict, _: MadeLot) -> bool:
    return sorted(document["recommended"]) == ["bias_temperature", "scale_temperature"]


def may_be_of_the_station(document: dict, _: MadeLot) -> bool:
    return {group["scope"] for group in document["classes"]} - {"data"} == {"sensor or station"}


def right_of(effect: str) -> Check:

    def right_effect_is_named(document: dict, _: MadeLot) -> bool:
        right = EFFECTS[effect][3]
        named = [bool(right & set(group["effects"])) for group in document["classes"]]
        return named == [True] and bool(right & set(document["recommended"]))

    return right_effect_is_named


def one_class_is_named(document: dict, _: MadeLot) -> bool:
    return len(document["classes"]) == 1


def bad_dwell_is_the_spoilt_one(document: dict, made: MadeLot) -> bool:
    return tuple(document["classes"][0]["dwells"]) == made.faults[0].dwells


def pose_is_the_driver(document: dict, _: MadeLot) -> bool:
    return [one["driver"] for one in document["where"]] == ["pose"]
