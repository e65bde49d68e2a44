"""Mistakes of unit, time and axis in an import: refused, or told in a remark that asks to check."""

import dataclasses

import numpy as np
import pandas as pd
import pytest
import recordings

from pipelines.importers.mapping import build
from pipelines.importers.record import imported
from schemas.errors import TumblelineError

FEW, MANY, SEED = 30, 300, 5_611_072
G = recordings.G
SIZES = {"g": 1.0, "mg": 1e3, "m/s^2": G}


def sound(rng: np.random.Generator) -> tuple[recordings.Recording, dict, pd.DataFrame]:
    """A recording in some unit with a clock of some unit, and the mapping that is right for it."""
    unit = str(rng.choice(["g", "mg", "m/s^2", "LSB", "V", "mV"]))
    per_g = {**SIZES, "LSB": float(rng.choice([256, 4096, 16384])), "V": 0.66, "mV": 660.0}[unit]
    noise = max(3e-4 * per_g, 0.4 if unit == "LSB" else 0.0)
    faces = bool(rng.random() < 0.4)
    one = recordings.recording(
        rng,
        rate=float(rng.choice([50.0, 100.0, 200.0, 400.0])),
        per_g=per_g,
        noise=noise,
        directions=recordings.FACES if faces else None,
    )
    if unit == "LSB":
        one = dataclasses.replace(one, output=np.round(one.output))
    clock = str(rng.choice(["s", "ms", "us"]))
    time = one.time * {"s": 1.0, "ms": 1e3, "us": 1e6}[clock]
    frame = recordings.table(one, t=time if clock == "s" else np.round(time).astype(np.int64))
    frame = frame.assign(
        gx=rng.normal(0.0, 0.02, len(frame)), mx=0.4 + rng.normal(0.0, 1e-3, len(frame)), heat=24.0 + 1e-4 * one.time
    )
    content = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "unit": "A1"}
    content["units"] = {"output": unit, "time": clock}
    if faces:
        frame["part"] = "move"
        for (start, stop), face in zip(one.spans, ("+x", "-x", "+y", "-y", "+z", "-z"), strict=True):
            frame.loc[start : stop - 1, "part"] = face
        content["columns"]["dwell"] = "part"
        content |= {"poses": {face: face for face in set(frame["part"]) - {"move"}}, "local_gravity_m_s2": G}
    return one, content, frame


def mistaken(rng: np.random.Generator, content: dict, *, faces: bool) -> tuple[str, dict]:
    """The mapping with one mistake in it."""
    kinds = ["unit of time", "unit of output", "column twice", "other quantity", *(["axes", "sign"] if faces else [])]
    kind = str(rng.choice(kinds))
    columns, units = dict(content["columns"]), dict(content["units"])
    if kind == "unit of time":
        units["time"] = str(rng.choice([unit for unit in ("s", "ms", "us", "ns") if unit != units["time"]]))
    elif kind == "unit of output":
        others = {"g": ["mg", "m/s^2", "LSB", "mV"], "mg": ["g", "m/s^2", "LSB", "V"], "m/s^2": ["g", "mg", "LSB", "mV"],
                  "LSB": ["g", "m/s^2", "V"], "V": ["mg", "m/s^2", "mV"], "mV": ["g", "m/s^2", "V"]}  # fmt: skip
        units["output"] = str(rng.choice(others[units["output"]]))
    elif kind == "column twice":
        one, other = rng.permutation(["x", "y", "z"])[:2]
        columns[str(one)] = columns[str(other)]
    elif kind == "other quantity":
        columns[str(rng.choice(["x", "y", "z"]))] = str(rng.choice(["gx", "mx", "heat", "t"]))
    elif kind == "axes":
        one, other = rng.permutation(["x", "y", "z"])[:2]
        columns[str(one)], columns[str(other)] = columns[str(other)], columns[str(one)]
    else:
        signs = ["+", "+", "+"]
        signs[int(rng.integers(3))] = "-"
        return kind, content | {"signs": signs}
    return kind, content | {"columns": columns, "units": units}


def outcome(frame: pd.DataFrame, content: dict) -> str:
    """The refusal or the remarks that ask to check; empty where the import says nothing."""
    try:
        recording = imported(frame, build(content, "t"), "f.csv")
    except TumblelineError as problem:
        return f"refused: {problem}"
    return "; ".join(remark for remark in recording.remarks if "CHECK" in remark)


@pytest.mark.parametrize("count", [FEW, pytest.param(MANY, marks=pytest.mark.slow, id="many")])
def test_mistakes_are_refused_or_told_and_sound_imports_are_not(count: int) -> None:
    silent, false = [], []
    for number in range(count):
        rng = np.random.default_rng([SEED, number])
        _, content, frame = sound(rng)
        said = outcome(frame, content)
        if said:
            false.append((number, content["units"], said))
        kind, wrong = mistaken(rng, content, faces="poses" in content)
        if not outcome(frame, wrong):
            silent.append((number, kind, content["units"], wrong["units"], wrong["columns"]))
    assert len(silent) <= 0.01 * count, silent
    assert len(false) <= 0.01 * count, false
