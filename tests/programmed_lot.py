"""A run whose samples are those of the simulated station's own units, made in a second, to be written into these units."""

import json
import shutil
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from capture_double import BRIEF, CaptureDouble, small_job
from once import once
from pydantic import TypeAdapter

from pipelines.archive import Archive, Run
from pipelines.certificates.programmed import TOP
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Job
from pipelines.programming.documents import ProgramDocument
from pipelines.programming.job import chosen_units, document, program_run, station_of
from pipelines.programming.outcome import Choice, ProgrammingOutcome
from stations.opening import make_plant
from stations.plant.plant import Plant

LOT = (BRIEF[2], BRIEF[4])
"""Changes of the small recipe: without a static record, and limits without its figures."""


@dataclass
class PlantDouble(CaptureDouble):
    """The double with the physics of a plant's units, by their true parameters."""

    plant: Plant | None = None
    noise_g: float = 2e-5
    slots: dict[int, int] = field(default_factory=dict)

    def output(
        self, slot: int, force: np.ndarray, temperature: float, shape: tuple[int, int], rng: np.random.Generator
    ) -> np.ndarray:
        """Counts of one unit."""
        assert self.plant is not None
        t = self.plant.truth(self.plant.serials[self.plant.slots.index(slot)])
        theta = temperature - 25.0
        scale = (1.0 + 1e-6 * t.scale_ppm) * (1.0 + theta * t.scale_tempco)
        mean = t.bias_g + theta * t.bias_tempco + scale * (t.misalignment @ t.slot_rotation @ force)
        return np.round(t.output_scale * (mean + self.noise_g * rng.normal(size=shape)))


def lot_run(folder: Path) -> Run:
    """A finished run of three units in an archive in a folder; its station continues from its beginning."""
    job = small_job(folder, *LOT)
    plant = make_plant(job.station, job.lot)
    runner = Runner(job, Archive(folder / "archive"), measure=PlantDouble(plant=plant))
    list(runner.all())
    keep_state(runner.run, job, lambda _plant: None)
    return runner.run


def copied_lot(folder: Path) -> Run:
    """A copy in a folder of such a run, which is made once in a session."""

    def made(place: Path) -> Path:
        lot_run(place)
        return place

    shutil.copytree(once("programmed-lot", made), folder)
    return Archive(folder / "archive").run("latest")


def keep_state(run: Run, job: Job, prepare: Callable[[Plant], None]) -> None:
    """Let the station of a run begin anew, after ``prepare`` has changed it (by faults, which are journalled)."""
    plant = make_plant(job.station, job.lot)
    prepare(plant)
    place = run.archive.root / TOP / "station" / f"{run.about['capture']}.bin"
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(plant.journal.state(plant.now_us))


def programmed(
    run: Run, serials: tuple[str, ...] = (), **choice: Any
) -> tuple[dict[str, ProgrammingOutcome], dict[str, str]]:
    """The units written, by serial, and their certificates."""
    outcomes, given = program_run(run, chosen_units(run, serials), station_of(run), Choice(**choice), lambda text: None)
    printed = json.dumps(document(run, outcomes, given))
    TypeAdapter(ProgramDocument).validate_json(printed, strict=True, extra="forbid")  # as --json prints it
    return {one.serial: one for one in outcomes}, given


def plant_of(run: Run, job: Job) -> Plant:
    """The simulated station as the last command left it."""
    state = (run.archive.root / TOP / "station" / f"{run.about['capture']}.bin").read_bytes()
    return make_plant(job.station, job.lot, state)
