"""A run that kills itself where it is told: ``dying.py RECIPE ARCHIVE [plant:SECONDS | stage:NAME | file:NUMBER]``."""

import os
import signal
import sys
from pathlib import Path

from pipelines.archive import Archive, files
from pipelines.chain.runner import Runner
from pipelines.jobs.job import Request
from stations.plant.plant import PlantClock


def die() -> None:
    """Ends the process as a power cut would."""
    os.kill(os.getpid(), signal.SIGKILL)


def die_at_plant_time(seconds: float) -> None:
    """Arranges the end for a time of the plant."""
    sleep = PlantClock.sleep

    def fatal(clock: PlantClock, span: float) -> None:
        left = seconds - clock.now()
        if left > span:
            sleep(clock, span)
            return
        sleep(clock, left)
        die()

    PlantClock.sleep = fatal


def die_at_file(number: int) -> None:
    """Arranges the end for the moment when so many files have been written aside and the last is not yet in its place."""
    write, written = files._write_durably, [0]

    def fatal(path: Path, data: bytes) -> None:
        write(path, data)
        written[0] += 1
        if written[0] == number:
            die()

    files._write_durably = fatal


def main(recipe: str, archive: str, how: str = ":") -> None:
    """The run, as far as it comes."""
    kind, _, value = how.partition(":")
    if kind == "plant":
        die_at_plant_time(float(value))
    if kind == "file":
        die_at_file(int(value))
    for done in Runner(Request(recipe=recipe).job(), Archive(archive)).all():
        if kind == "stage" and done.stage == value:
            die()


if __name__ == "__main__":
    main(*sys.argv[1:])
