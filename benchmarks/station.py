"""Station time and overhead: `python benchmarks/station.py`.

- lots on one fixture: station time (clock of the simulation) of the same recipe for 1, 8, 16 and 32 units
- orchestration: additional wall time of the orchestrator, compared with the station time of the run on hardware
- a day: 24 h of soaks and dwells of eight units, and a 24 h static record of one unit at 100 Hz streamed to Parquet, validated
  and analysed; wall time, and memory of the process during the record
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))
MB = 2.0**20
HOUR_S = 3600.0
LIMITS = '[figures]\nresidual_rms_ug = { max = 1e6, unit = "µg" }\n'
RECIPE = """
name = "{name}"
device = "adxl355"
units = [{units}]
seed = 3
local_gravity_m_s2 = 9.80665
poses = "{poses}"
verification = []
temperatures_C = [{temperatures}]
soak_min_s = {soak}
settle_s = 2.0
dwell_s = 10.0
rate_hz = 100.0
static_record_s = {static}
effects = ["bias", "scale", "misalignment"]
limits = "wide.toml"
"""


def recipe(folder: Path, name: str, units: int, **figures: object) -> str:
    """Path of a recipe in a folder."""
    (folder / "wide.toml").write_text('name = "wide"\n' + LIMITS, encoding="utf-8")
    given = {"poses": "fibonacci24", "temperatures": "0.0, 25.0, 50.0", "soak": 900.0, "static": 0.0, **figures}
    serials = ", ".join(f'"S{n:02d}"' for n in range(units))
    path = folder / f"{name}-{units}.toml"
    path.write_text(RECIPE.format(name=name, units=serials, **given), encoding="utf-8")
    return str(path)


def memory() -> float:
    """Resident memory of this process now, MB."""
    match = re.search(r"VmRSS:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return 1024 * int(match[1]) / MB if match else float("nan")


def station_seconds(readings: object) -> float:
    """Time from power-on to the end of the last record, s on the clock of the station."""
    return float((readings["start_s"] + readings["duration_s"]).max())


def captured(path: str, archive: Path, station: Path | None = None, *, upto: str = "capture") -> tuple[object, float]:
    """The direct run of a recipe up to a stage, and its wall time in s."""
    from pipelines.archive import Archive
    from pipelines.chain.chain import ORDER
    from pipelines.chain.runner import Runner
    from pipelines.jobs.job import Request

    start = time.perf_counter()
    runner = Runner(Request(recipe=path, station=station).job(), Archive(archive))
    for stage in ORDER[: ORDER.index(upto) + 1]:
        runner.stage(stage)
    return runner.run, time.perf_counter() - start


def lots(folder: Path, sizes: list[int], poses: str) -> None:
    """Station time of lots of several sizes."""
    alone = 0.0
    for units in sizes:
        station = ROOT / "deploy" / "stations" / f"simulated-{32 if units > 16 else 16}.toml"
        run, wall = captured(recipe(folder, "lot", units, poses=poses), folder / f"lot-{units}", station)
        readings = run.table("readings")
        seconds = station_seconds(readings)
        alone = alone or seconds
        sound = readings.loc[readings["status"] == "ok", "unit"].nunique()
        print(
            f"lot of {units:>2}: {seconds:8.1f} s of station time, {seconds / alone:.4f} of that of one unit; "
            f"{sound} units measured; {wall:.1f} s of wall time",
            flush=True,
        )


def orchestration(name: str) -> None:
    """Additional time of the orchestrator in the main job."""
    walls: dict[str, float] = {}
    seconds = 0.0
    for way, options in (("direct", ["--direct"]), ("orchestrator", [])):
        with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
            archive = Path(folder) / "archive"
            command = [
                sys.executable,
                "-m",
                "pipelines.cli",
                "run",
                name,
                "--archive",
                str(archive),
                "--json",
                *options,
            ]
            start = time.perf_counter()
            done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
            walls[way] = time.perf_counter() - start
            if done.returncode not in {0, 1}:
                raise RuntimeError(f"station: status {done.returncode}: {done.stderr[-2000:]}")
            from pipelines.archive import Archive

            seconds = station_seconds(Archive(archive).run("latest").table("readings"))
    added = walls["orchestrator"] - walls["direct"]
    print(
        f"orchestration of '{name}': {walls['direct']:.1f} s direct, {walls['orchestrator']:.1f} s with orchestrator: "
        f"{added:.1f} s more, {added / seconds:.2%} of {seconds:.0f} s of station time",
        flush=True,
    )


def day_of_soaks(folder: Path, hours: float) -> None:
    """A day of production: soaks and dwells of eight units."""
    soaks = max(2, round(hours * HOUR_S / 5000.0))
    temperatures = ", ".join(f"{20.0 + (n % 2) * 20.0 + 0.001 * n:.3f}" for n in range(soaks))
    path = recipe(folder, "day", 8, temperatures=temperatures, soak=4300.0, poses="nine")
    run, wall = captured(path, folder / "day")
    seconds = station_seconds(run.table("readings"))
    print(
        f"soaks and dwells of 8 units: {seconds / HOUR_S:.1f} h of station time in {wall:.0f} s of wall time, "
        f"{wall * 24.0 * HOUR_S / seconds:.0f} s for 24 h; {memory():.0f} MB",
        flush=True,
    )


def day_of_noise(folder: Path, hours: float, units: int) -> None:
    """A static record of a day."""
    from pipelines.archive import Records

    memories: list[float] = []
    part = Records.part

    def record_part(self: Records, record: int, number: int, samples: object) -> None:
        part(self, record, number, samples)
        memories.append(memory())

    Records.part = record_part
    path = recipe(folder, "static", units, temperatures="25.0", static=hours * HOUR_S, poses="nine")
    run, wall = captured(path, folder / "static")
    after = memory()
    start = time.perf_counter()
    run, _ = captured(path, folder / "static", upto="noise")
    analysed = time.perf_counter() - start
    seconds = station_seconds(run.table("readings"))
    samples = sum(len(piece) for piece in run.records.samples())
    first = run.table("allan").query("axis == 'x'").iloc[0]
    early = memories[len(memories) // 8] if memories else after
    rate = wall * 24.0 * HOUR_S / seconds
    print(
        f"static record of {hours:g} h, {units} unit(s) at 100 Hz: {samples} samples in {len(memories) + 1} parts; capture "
        f"{wall:.0f} s, {rate:.0f} s for 24 h of station time; validate to noise {analysed:.0f} s "
        f"(σ of x {first['deviation_ug']:.0f} µg at {first['tau_s']:.2f} s)"
    )
    late = memories[-1] if memories else after
    print(
        f"  memory: {early:.0f} MB after an eighth of it, {late:.0f} MB at its end, {after:.0f} MB after the capture, "
        f"{memory():.0f} MB after the analysis",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hours", type=float, default=24.0, help="of the long record and of the day")
    parser.add_argument("--short", action="store_true", help="small lots, two hours, the quick recipe")
    parser.add_argument("--only", action="append", choices=["lots", "orchestration", "soaks", "noise"])
    parser.add_argument("--units", type=int, default=1, help="of the static record")
    options = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    hours = 2.0 if options.short else options.hours
    print(f"python benchmarks/station.py {' '.join(sys.argv[1:])}".rstrip())
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as place:
        folder = Path(place)
        work = {
            "lots": lambda: lots(
                folder, [1, 16] if options.short else [1, 8, 16, 32], "nine" if options.short else "fibonacci24"
            ),
            "orchestration": lambda: orchestration("production"),
            "soaks": lambda: day_of_soaks(folder, hours),
            "noise": lambda: day_of_noise(folder, hours, options.units),
        }
        for name, do in work.items():
            if not options.only or name in options.only:
                do()


if __name__ == "__main__":
    main()
