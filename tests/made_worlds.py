"""Worlds of the generator in ``benchmarks/worlds``, and their lots and runs as the engine has them."""

import sys
from pathlib import Path

from inertial.criticism.examination import ExaminedRun
from inertial.estimation.lot import Lot
from inertial.estimation.problem import Problem
from pipelines.tables.dwells import lot_of, measured

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks" / "worlds"))

from noise import Noise
from tables import HIDDEN, NOISES, NULLS, RAMP_HIDDEN, RAMP_NULLS
from world import Made, World, force_of, make

__all__ = [
    "BASE",
    "HIDDEN",
    "NOISES",
    "NULLS",
    "RAMP_HIDDEN",
    "RAMP_NULLS",
    "Made",
    "Noise",
    "World",
    "force_of",
    "lot_in",
    "make",
    "problem_in",
    "run_of",
]

BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")


def lot_in(made: Made) -> Lot:
    return lot_of(measured(made.dwells, made.history))


def problem_in(made: Made) -> Problem:
    return Problem(lot_in(made))


def run_of(world: World, seed: int) -> ExaminedRun:
    """A world's run beside the five linear effects."""
    made = make(world, seed)
    return ExaminedRun(lot_of(measured(made.dwells, made.history), square=False), BASE)
