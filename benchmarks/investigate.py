"""Closed loop on initially ambiguous runs: `python benchmarks/investigate.py --seeds 3 --jobs 2`.

A mechanism is hidden in the simulated station (stations/plant/hidden/, no column of the fit), and the recipe cannot identify
it: edges without directions between, one wait, soaks in one direction, one temperature. A run is ambiguous if its first
diagnosis has the true effect in a class with others, or in the list of effects that are not visible. The output is the number
of these runs with the true effect alone in its class at the end, the station time of the follow-ups relative to the first
run, and the result of the other runs: an open class is a weaker answer, another effect alone in its class is a wrong one.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(
        _name, "1"
    )  # before the import of numpy: threads of two processes would compete for two cores

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

PLAIN = ("bias", "scale", "misalignment")
THERMAL = (
    *PLAIN, "bias_temperature", "bias_temperature_quadratic", "scale_temperature", "scale_temperature_quadratic",
    "misalignment_temperature",
)  # fmt: skip
QUIET = {
    "noise_density_ug": 8.0, "bias_instability_ug": 1.5, "rate_random_walk_ug": 0.003, "linearity_pct_fs": 0.0,
}  # fmt: skip
STEADY = {"bias_tempco_ug_per_K": 2.0, "scale_tempco_ppm_per_K": 4.0}


@dataclass(frozen=True)
class Scene:
    """A hidden mechanism, its effects, and a recipe that cannot identify it.

    truths : ids of the catalogue that describe the mechanism; one of them alone in its class is correct
    """

    name: str
    kind: str
    truths: tuple[str, ...]
    figures: dict[str, float]
    plan: str
    repeats: int = 1
    temperatures: tuple[float, ...] = (25.0,)
    settle_s: float = 2.0
    soak_s: float = 900.0
    one_order: bool = False
    unseen: bool = False


LOOP = (25.0, 60.0, -10.0, 20.0)
UP = (0.0, 20.0, 40.0, 60.0)
SCENES = (
    Scene("cubic on 26", "cubic_transfer", ("third_order",), {"hardening": 60e-6}, "twenty_six", 2),
    Scene("cubic on 18", "cubic_transfer", ("third_order",), {"hardening": 90e-6}, "eighteen", 2),
    Scene("cubic on 24 even", "cubic_transfer", ("third_order",), {"hardening": 25e-6}, "fibonacci24", 2),
    Scene("cubic at 4 temperatures", "cubic_transfer", ("third_order",), {"hardening": 90e-6}, "eighteen", 1, LOOP),
    Scene("pendulum on faces", "pendulous_mass", ("cross_coupling",), {"compliance": 40e-6}, "six", 6, unseen=True),
    Scene("harmonic on faces", "encoder_harmonic", ("encoder_harmonic",), {"size": 50e-6}, "six", 6),
    Scene("level on faces", "level_error", ("level_error",), {"about_x": 0.0, "about_y": -60e-6}, "six", 6),
    Scene(
        "creep in one order", "creep", ("creep_after_move",), {"size": 60e-6, "tau": 30.0}, "eighteen", 3, one_order=True
    ),
    Scene("creep on faces", "creep", ("creep_after_move",), {"size": 60e-6, "tau": 30.0}, "six", 6, one_order=True),
    Scene("warm-up seen late", "warm_up", ("warm_up",), {"size": 250e-6, "tau": 3000.0}, "eighteen", 8),
    Scene(
        "ageing seen late", "stress_relaxation", ("aging_log",), {"size": 60e-6, "shortest": 600.0}, "eighteen", 8
    ),
    Scene("late step", "step_change", ("step_change",), {"size": 40e-6, "at": 1950.0}, "eighteen", 4),
    Scene(
        "hysteresis with 4 soaks", "hysteresis_play", ("thermal_hysteresis",), {"gain": 8e-6, "width": 10.0},
        "nine", 1, LOOP,
    ),
    Scene(
        "hysteresis one way", "hysteresis_play", ("thermal_hysteresis",), {"gain": 8e-6, "width": 12.0}, "nine", 1, UP
    ),
    Scene(
        "vibration with 4 soaks", "vibration_rectification", ("vibration_rectification",), {"coefficient": 2.5e4},
        "nine", 1, LOOP,
    ),
    Scene(
        "vibration one way", "vibration_rectification", ("vibration_rectification",), {"coefficient": 2.5e4},
        "nine", 1, UP,
    ),
    Scene("warm-up one way", "warm_up", ("warm_up",), {"size": 200e-6, "tau": 3600.0}, "nine", 1, UP),
    Scene("step one way", "step_change", ("step_change",), {"size": 60e-6, "at": 4000.0}, "nine", 1, UP),
    Scene(
        "lag after short soaks", "element_lag", ("thermal_lag",), {"tempco": 60e-6, "tau": 250.0}, "nine", 1, UP,
        soak_s=300.0,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Outcome:
    """One inquiry: the scene and seed, the first classes and the last, and the station time."""

    scene: str
    seed: int
    first: list[list[str]]
    last: list[list[str]]
    unseen: bool
    ambiguous: bool
    alone: bool
    lost: bool
    wrong: bool
    beside: bool
    first_minutes: float
    extra_minutes: float
    rounds: int
    ended: str
    seconds: float
    why: list[str] = field(default_factory=list)


def job_of(scene: Scene, seed: int, units: int) -> Any:
    """The job of a scene: a lot of quiet units on the simulated station with the mechanism."""
    import numpy as np

    from inertial import poses
    from pipelines.jobs.job import Job
    from pipelines.jobs.recipes import load_limits, load_recipe
    from schemas.lot import Lot, Unit
    from schemas.recipe import Recipe
    from schemas.simulation import Hidden, Simulation
    from schemas.station import load_station

    rng = np.random.default_rng([seed, 7])
    order = rng.permutation(len(poses.plan(scene.plan)))
    turns = [order if scene.one_order else rng.permutation(order) for _ in range(scene.repeats)]
    angles = poses.plan(scene.plan)[np.concatenate(turns)]
    varied = len(scene.temperatures) > 1
    plain = load_recipe()
    changes = {
        "name": scene.name.replace(" ", "-"),
        "description": "a recipe that cannot identify the mechanism",
        "poses": [
            {"name": f"p{k + 1:03d}", "outer_deg": o, "inner_deg": i} for k, (o, i) in enumerate(angles.tolist())
        ],
        "verification": [],
        "temperatures_C": list(scene.temperatures),
        "settle_s": scene.settle_s,
        "soak_min_s": scene.soak_s,
        "allow_short_soak": True,
        "dwell_s": 8.0,
        "rate_hz": 25.0,
        "static_record_s": 60.0,
        "static_temperature_C": scene.temperatures[-1],
        "effects": list(THERMAL if varied else PLAIN),
    }
    recipe = Recipe.model_validate({**plain.model_dump(), **changes})
    lot = Lot(units=[Unit(serial=f"Q{k + 1:03d}", slot=k) for k in range(units)], device=recipe.device, seed=seed)
    station = load_station()
    hidden = [Hidden(kind=scene.kind, figures=scene.figures)]
    overrides = QUIET if varied else QUIET | STEADY
    made = (station.simulation or Simulation()).model_copy(
        update={"seed": seed, "hidden": hidden, "preset_overrides": overrides}
    )
    return Job(recipe, load_limits(recipe), lot, station.model_copy(update={"simulation": made}))


def one(task: tuple[str, int, int, float]) -> Outcome:
    """One inquiry in an archive of its own."""
    from pipelines.archive import Archive
    from pipelines.inquiry.loop import InquirySettings, Participants, run_inquiry

    name, seed, units, share = task
    scene = next(s for s in SCENES if s.name == name)
    looks: list[Any] = []
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        job = job_of(scene, seed, units)
        terms = InquirySettings(job.recipe.effects, None if share <= 0.0 else share, scene.unseen)
        document = run_inquiry(job, Archive(folder), terms, Participants(diagnosed=looks.append, stage=quickly))
    return outcome(scene, seed, looks, document, time.perf_counter() - begin)


_DIAGNOSED = {"capture", "validate", "reduce"}
"""Stages whose results a diagnosis reads."""


def quickly(name: str, runner: Any) -> Any:
    """A stage as a plain call; stages that the inquiry does not use are skipped."""
    from pipelines.chain.runner import Done

    if name not in _DIAGNOSED:
        return Done(name, True, 0.0)
    return runner.stage(name)


def outcome(scene: Scene, seed: int, looks: list[Any], document: dict[str, Any], seconds: float) -> Outcome:
    """The outcome of an inquiry."""
    first = [group["effects"] for group in looks[0].document["classes"]]
    last = [group["effects"] for group in document["classes"]]
    held = [group for group in first if set(group) & set(scene.truths)]
    kept = any(set(group) & set(scene.truths) for group in last)
    unseen = bool(set(looks[0].document["unseen"]) & set(scene.truths))
    minutes = document["minutes"]
    return Outcome(
        scene=scene.name,
        seed=seed,
        first=first,
        last=last,
        unseen=unseen,
        ambiguous=bool(held and len(held[0]) > 1) or (unseen and not held),
        alone=any(len(group) == 1 and group[0] in scene.truths for group in last),
        lost=not kept,
        wrong=not kept and any(len(group) == 1 for group in last),
        beside=kept and any(len(group) == 1 and group[0] not in scene.truths for group in last),
        first_minutes=minutes["first_run"],
        extra_minutes=minutes["follow_ups"],
        rounds=len(document["rounds"]),
        ended=document["ended"],
        seconds=seconds,
        why=[text for r in document["rounds"] for text in r["why"]],
    )


def show(outcomes: list[Outcome]) -> None:
    """Prints a line per inquiry, then the figures."""
    for o in outcomes:
        first, last = (" ; ".join("|".join(g) for g in groups) or "nothing" for groups in (o.first, o.last))
        mark = "    "
        if o.ambiguous:
            mark = "ok  " if o.alone else "WRNG" if o.wrong else "LOST" if o.lost else "OPEN"
        print(
            f"{mark} {o.scene} [{o.seed}] {'ambiguous' if o.ambiguous else 'clear'}: {first} -> {last} "
            f"({o.rounds} rounds, {o.extra_minutes:.1f} of {o.first_minutes:.0f} min extra, {o.ended}, {o.seconds:.0f} s)"
        )
    ambiguous = [o for o in outcomes if o.ambiguous]
    if not ambiguous:
        print("no run was ambiguous at first")
        return
    alone = sum(o.alone for o in ambiguous)
    shares = sorted(o.extra_minutes / o.first_minutes for o in ambiguous)
    print(
        f"{len(outcomes)} runs, {len(ambiguous)} ambiguous at first: true effect alone in its class in {alone} "
        f"({100.0 * alone / len(ambiguous):.0f} %); extra station time {100.0 * sum(shares) / len(shares):.0f} % on average, "
        f"{100.0 * shares[len(shares) // 2]:.0f} % in the median, {100.0 * shares[-1]:.0f} % at most"
    )
    still = sum(not o.alone and not o.lost for o in ambiguous)
    wrong, lost = sum(o.wrong for o in ambiguous), sum(o.lost and not o.wrong for o in ambiguous)
    beside = sum(o.beside for o in ambiguous)
    print(
        f"of the others: {still} with the true effect in an open class, {lost} with the true effect in no class and no other "
        f"named alone, "
        f"{wrong} with another effect in its place; another effect in addition to the true one in {beside}"
    )


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=1, help="runs of each scene")
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--scene", action="append", choices=[s.name for s in SCENES], help="only these (repeatable)")
    parser.add_argument("--units", type=int, default=4)
    parser.add_argument("--budget", type=float, default=0.0, help="station minutes; by default 30 %% of the first run")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, help="JSON lines with every outcome")
    return parser.parse_args()


def main() -> None:
    options = arguments()
    names = options.scene or [s.name for s in SCENES]
    tasks = [
        (n, s, options.units, options.budget)
        for n in names
        for s in range(options.first, options.first + options.seeds)
    ]
    outcomes: list[Outcome] = []
    with ProcessPoolExecutor(options.jobs) as pool:
        for result in pool.map(one, tasks) if options.jobs > 1 else map(one, tasks):
            outcomes.append(result)
            print(f"\r{len(outcomes)}/{len(tasks)} {result.scene:28}", end="", file=sys.stderr, flush=True)
    print(file=sys.stderr)
    if options.out:
        options.out.write_text("".join(json.dumps(vars(o)) + "\n" for o in outcomes))
    show(outcomes)


if __name__ == "__main__":
    main()
