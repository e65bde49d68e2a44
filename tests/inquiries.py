"""A small lot with a hidden mechanism on the simulated station, and a recipe that cannot tell it from others."""

from pathlib import Path

from pipelines.archive import Records
from pipelines.jobs.job import Job
from pipelines.jobs.recipes import load_limits, load_recipe
from schemas.lot import Lot, Unit
from schemas.simulation import Hidden, Simulation
from schemas.station import load_station

RECIPE = """
name = "ambiguous"
device = "adxl355"
units = ["A1", "A2"]
seed = 5
local_gravity_m_s2 = 9.80665
poses = "PLAN"
temperatures_C = [25.0]
soak_min_s = 60.0
allow_short_soak = true
dwell_s = 4.0
rate_hz = 25.0
effects = ["bias", "scale", "misalignment"]
limits = "limits.toml"
"""
LIMITS = """
name = "static"
rule = "guarded_acceptance"
coverage_factor = 2.0
grade = "consumer"

[figures]
zero_g_offset_mg = { max = 150.0, unit = "mg" }
"""
QUIET = {
    "noise_density_ug": 8.0, "bias_instability_ug": 1.0, "rate_random_walk_ug": 0.001, "linearity_pct_fs": 0.0,
    "bias_tempco_ug_per_K": 1.0, "scale_tempco_ppm_per_K": 1.0,
}  # fmt: skip


def recipe_file(folder: Path, plan: str = "eighteen") -> Path:
    """Path of the recipe, with its limits beside it."""
    (folder / "limits.toml").write_text(LIMITS, encoding="utf-8")
    path = folder / "ambiguous.toml"
    path.write_text(RECIPE.replace("PLAN", plan), encoding="utf-8")
    return path


def station_file(folder: Path, kind: str = "cubic_transfer", **figures: float) -> Path:
    """Path of a station's file with a mechanism hidden in it."""
    import stations

    text = (Path(stations.__file__).parent / "simulated.toml").read_text(encoding="utf-8")
    overrides = ", ".join(f"{key} = {value}" for key, value in QUIET.items())
    hidden = ", ".join(f"{key} = {value}" for key, value in figures.items())
    own = f'preset_overrides = {{{overrides}}}\nhidden = [{{kind = "{kind}", figures = {{{hidden}}}}}]\n'
    text = text.replace("[simulation]\n", f"[simulation]\n{own}")
    path = folder / "station.toml"
    path.write_text(text, encoding="utf-8")
    return path


def job_of(folder: Path, kind: str = "cubic_transfer", plan: str = "eighteen", **figures: float) -> Job:
    """The job of the recipe on a station with a mechanism in it."""
    recipe = load_recipe(str(recipe_file(folder, plan)))
    station = load_station()
    simulation = (station.simulation or Simulation()).model_copy(
        update={"hidden": [Hidden(kind=kind, figures=figures)], "preset_overrides": QUIET}
    )
    lot = Lot(
        units=[Unit(serial=s, slot=k) for k, s in enumerate(recipe.units)], device=recipe.device, seed=recipe.seed
    )
    return Job(recipe, load_limits(recipe, folder), lot, station.model_copy(update={"simulation": simulation}))


class PulledPlug(Exception):
    """The process was killed."""


class Dying(Records):
    """Records of which only so many are stored before the plug is pulled."""

    left = 10**9

    def put(self, *arguments: object) -> None:
        if Dying.left <= 0:
            raise PulledPlug
        Dying.left -= 1
        super().put(*arguments)
