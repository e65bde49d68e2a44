"""A capture without a station: physics of a lot in a few lines, deterministic per record, with faults on request."""

import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from once import once
from root_process import ROOT

from inertial.frames import force_from_angles
from pipelines.archive import Archive, Records, Run
from pipelines.archive.signatures import key_file
from pipelines.chain.chain import ORDER
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Job, Request
from schemas.poses import Pose
from schemas.progress import Progress
from schemas.recipe import Recipe

LSB_PER_G = 256000.0
FULL_SCALE_LSB = 524287.0
STANDARD_G = 9.80665


class PulledPlug(Exception):
    """The capture ended as if the process had been killed."""


@dataclass
class CaptureDouble:
    """Call it as the runner calls a station.

    faults : by serial, the name of what is wrong with that unit
    stop_after : number of records after which the plug is pulled
    """

    faults: dict[str, str] = field(default_factory=dict)
    noise_g: float = 1e-4
    stop_after: int = 10**6
    measured: list[int] = field(default_factory=list)

    def __call__(self, job: Job, records: Records, progress: Progress) -> None:
        done = records.finished()
        wanted = list(plan(job.recipe))
        for count, (record, kind, soak, temperature, pose) in enumerate(wanted):
            if record in done:
                continue
            if len(self.measured) >= self.stop_after:
                raise PulledPlug
            samples, readings, history = self.record(job, record, kind, soak, temperature, pose)
            records.put(record, samples, readings, history, str(record).encode())
            self.measured.append(record)
            progress(count + 1, len(wanted), pose.name)

    def record(
        self, job: Job, record: int, kind: str, soak: int, temperature: float, pose: Pose
    ) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
        """Samples, readings and history of one record."""
        recipe = job.recipe
        duration = recipe.static_record_s if kind == "allan" else recipe.dwell_s
        n = int(duration * recipe.rate_hz)
        start = 900.0 * (soak + 1) + 15.0 * record
        force = (
            recipe.local_gravity_m_s2
            / STANDARD_G
            * force_from_angles(np.radians(pose.outer_deg), np.radians(pose.inner_deg))
        )
        samples, readings = [], []
        for unit in job.lot.units:
            rng = np.random.default_rng([job.lot.seed, unit.slot, record, 7])
            fault = self.faults.get(unit.serial, "")
            values = self.output(unit.slot, force, temperature, (n, 3), rng)
            status, seen = "ok", temperature + 0.02 * unit.slot
            if fault in {"stuck", "dead", "nan", "infinity", "clipped", "short"}:
                values = _spoil(fault, values, record, rng)
            if fault == "silent" and record >= 3:
                status, values = "no answer within 3 s", values[:0]
            if fault == "stale":
                seen = 21.5
            samples.append(_samples(unit.serial, unit.slot, record, kind, start, recipe.rate_hz, values))
            readings.append(
                {
                    "unit": unit.serial, "slot": unit.slot, "record": record, "kind": kind, "pose": pose.name, "soak": soak,
                    "outer_deg": pose.outer_deg, "inner_deg": pose.inner_deg,
                    "outer_command_deg": pose.outer_deg, "inner_command_deg": pose.inner_deg,
                    "chamber_C": temperature, "unit_C": seen, "supply_V": 3.3, "vibration_g": 1e-3,
                    "since_move_s": recipe.settle_s, "since_power_s": start, "start_s": start, "duration_s": duration,
                    "rate_hz": recipe.rate_hz, "n": n, "overflow": fault == "overflow" and record == 2, "status": status,
                    "out_unit": "LSB", "full_scale": FULL_SCALE_LSB,
                }
            )  # fmt: skip
        history = pd.DataFrame(
            [
                {"time_s": start, "chamber_C": temperature, "slot": u.slot, "unit": u.serial, "unit_C": temperature}
                for u in job.lot.units
            ]
        )
        return pd.concat(samples, ignore_index=True), pd.DataFrame(readings), history

    def output(
        self, slot: int, force: np.ndarray, temperature: float, shape: tuple[int, int], rng: np.random.Generator
    ) -> np.ndarray:
        """Counts of one unit: its own bias, scale, misalignment and temperature coefficients, white noise, rounding."""
        own = np.random.default_rng([99, slot])
        bias, tempco = own.normal(0.0, 0.01, 3), own.normal(0.0, 5e-5, 3)
        matrix = np.eye(3) + own.normal(0.0, 3e-3, (3, 3))
        theta = temperature - 25.0
        mean = bias + tempco * theta + matrix @ force * (1.0 + 1e-4 * theta)
        return np.round(LSB_PER_G * (mean + self.noise_g * rng.normal(size=shape)))


def plan(recipe: Recipe) -> list[tuple[int, str, int, float, Pose]]:
    """(record, kind, soak, temperature, pose) in order of measurement, the static record last."""
    rows: list[tuple[int, str, int, float, Pose]] = []
    for soak, temperature in enumerate(recipe.temperatures_C):
        for kind, poses in (("dwell", recipe.poses), ("verification", recipe.verification)):
            rows += [(len(rows) + i, kind, soak, temperature, pose) for i, pose in enumerate(poses)]
    if recipe.static_record_s > 0.0:
        rows.append((len(rows), "allan", len(recipe.temperatures_C), recipe.static_temperature_C, recipe.static_pose))
    return rows


def _spoil(fault: str, values: np.ndarray, record: int, rng: np.random.Generator) -> np.ndarray:
    out = values.copy()
    if fault == "stuck":
        out[:, 1] = 77.0
    elif fault == "dead":
        out[:, 2] = np.round(rng.normal(0.0, 20.0, len(out)))
    elif fault in {"nan", "infinity"} and record == 1:
        out[17, 0] = np.nan if fault == "nan" else np.inf
    elif fault == "clipped" and record == 4:
        out[3, 2] = FULL_SCALE_LSB
    elif fault == "short" and record == 2:
        out = out[: len(out) // 2]
    return out


def _samples(
    serial: str, slot: int, record: int, kind: str, start: float, rate: float, values: np.ndarray
) -> pd.DataFrame:
    n = len(values)
    columns: dict[str, Any] = {
        "unit": pd.Series([serial] * n, dtype="str"),
        "slot": np.full(n, slot),
        "record": np.full(n, record),
        "kind": pd.Series([kind] * n, dtype="str"),
        "time_s": start + np.arange(n) / rate,
        "x": values[:, 0],
        "y": values[:, 1],
        "z": values[:, 2],
    }
    return pd.DataFrame(columns)


SMALL = """
name = "small"
device = "adxl355"
units = ["A1", "A2", "A3"]
seed = 5
local_gravity_m_s2 = 9.8123
poses = "nine"
verification = [[35.0, 15.0], [105.0, -100.0]]
temperatures_C = [0.0, 50.0]
settle_s = 2.0
dwell_s = 1.0
rate_hz = 100.0
static_record_s = 30.0
effects = ["bias", "scale", "misalignment", "bias_temperature", "scale_temperature"]
limits = "consumer"
"""


AT_ROOM = (
    ("temperatures_C = [0.0, 50.0]", "temperatures_C = [23.0]\nsoak_min_s = 1.0\nallow_short_soak = true"),
    (', "bias_temperature", "scale_temperature"', ""),
    ('limits = "consumer"', f'limits = "{ROOT / "deploy" / "recipes" / "line-quick.limits.toml"}"'),
)
"""Changes of the small recipe: one soak at the temperature of the room, which a simulated station reaches at once."""

BRIEF = (*AT_ROOM, ('poses = "nine"', 'poses = "six"'), ("static_record_s = 30.0", "static_record_s = 0.0"))
"""Besides, the fewest records, for tests that a run is made, asked about or copied, whatever was measured."""


def recipe_file(folder: Path, *changes: tuple[str, str], name: str = "small.toml") -> str:
    """Path of the small recipe in a folder, with pieces of its text replaced."""
    text = SMALL
    for old, new in changes:
        if old not in text:
            raise ValueError(old)
        text = text.replace(old, new)
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return str(path)


def small_job(folder: Path, *changes: tuple[str, str], **request: Any) -> Job:
    """The job of the small recipe."""
    return Request(recipe=recipe_file(folder, *changes), **request).job()


def small_run(folder: Path, faults: dict[str, str] | None = None, *changes: tuple[str, str]) -> Run:
    """A run of the small recipe in an archive of its own, done but for its report.

    Each kind is made once and copied afterwards, which is ten times faster. A folder that has an archive already, or a test
    with a signing key, gets a run that is made there.
    """
    return _copied("run", folder, lambda place: _made(place, faults or {}, changes), faults or {}, changes)


def finished_run(folder: Path, *changes: tuple[str, str]) -> Run:
    """A run of the small recipe in an archive of its own, with its report; made once like the small run."""
    return _copied("finished", folder, lambda place: _reported(place, changes), {}, changes)


def _copied(
    kind: str, folder: Path, make: Callable[[Path], Run], faults: dict[str, str], changes: tuple[tuple[str, str], ...]
) -> Run:
    """A copy of the run that ``make`` gives for another folder, once; or what it gives for this one."""
    root = folder / "archive"
    if root.exists() or key_file() is not None:
        return make(folder)
    recipe_file(folder, *changes)  # it stands beside the archive
    which = sha256(repr((sorted(faults.items()), changes)).encode()).hexdigest()[:16]
    kept, run = once(f"{kind}-{which}", lambda place: (place / "archive", make(place).id))
    shutil.copytree(kept, root)
    return Archive(root).run(run)


def _reported(folder: Path, changes: tuple[tuple[str, str], ...]) -> Run:
    run = small_run(folder, None, *changes)
    Runner(small_job(folder, *changes), Archive(folder / "archive"), measure=CaptureDouble()).stage(ORDER[-1])
    return run


def measured_run(job: Job, archive: Archive, measure: Any) -> Run:
    """The run of a job, done but for its report."""
    runner = Runner(job, archive, measure=measure)
    for stage in ORDER[:-1]:
        runner.stage(stage)
    return runner.run


def _made(folder: Path, faults: dict[str, str], changes: tuple[tuple[str, str], ...]) -> Run:
    return measured_run(small_job(folder, *changes), Archive(folder / "archive"), CaptureDouble(faults))
