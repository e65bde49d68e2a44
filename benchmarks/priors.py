"""Priors from earlier units: `python benchmarks/priors.py --units 200 --archive 500`.

Units drawn from the physics of the plant are calibrated with the textbook plan, in lots of eight: the archive. Its family is the
prior with which the quickest recipe on ramps is searched and fitted. The benchmark compares the RMS errors (estimate − truth) of
further units with those of the textbook plan on the same units, the share of truths within U, units that do not fit their family,
and lots whose prior is widened; in worlds where the family is normal, has heavy tails, or is a mixture, and where lots are off.
The plant knows nothing of a prior: the spreads between units are those of the presets.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

from benchmarks.plans import Course, course_of, measured, truth_of, truths_of
from inertial.fits.prior import Combined, Prior, combined, judged
from inertial.fits.wander import fit_lot_with_wander
from inertial.noise.dwells import DwellNoise
from inertial.population.family import Family, family_of
from inertial.state import State
from pipelines.jobs.model_files import STARTING_MODEL
from pipelines.jobs.recipes import load_recipe
from pipelines.planning.context import PlanContext, plan_context
from pipelines.planning.lower_bound import lower_bound
from pipelines.planning.optimise import optimise
from pipelines.planning.plan import identified
from pipelines.planning.requirement import Requirement, candidates
from pipelines.planning.textbook import seen_by, textbook
from schemas.station import load_station
from stations.plant.device import Truth, stream
from stations.plant.preset import Preset, load_preset

Array = np.ndarray
LOT = 8
LEVELS = (-10.0, 60.0)
WORLDS = ("normal", "heavy tails", "mixture", "lots off")
DOF_HEAVY, APART, OFF = 4.0, 0.9, 4.0
"""Degrees of freedom of the tails; half the distance of two populations and the distance of a lot, in spreads between units."""


def of_world(world: str, truths: list[Truth], preset: Preset, seed: int, *, earlier: bool) -> list[Truth]:
    """The units of a world: their spread is that of the preset in each, but for lots that are off."""
    spread = 1e-6 * preset.bias_tempco_ug_per_K
    out: list[Truth] = []
    for k, truth in enumerate(truths):
        rng = stream(seed, truth.serial, "world")
        if world == "heavy tails":
            wide = float(np.sqrt((DOF_HEAVY - 2.0) / rng.chisquare(DOF_HEAVY)))
            own = {name: wide * getattr(truth, name) for name in ("bias_tempco", "scale_tempco", "bias_g", "scale_ppm")}
        elif world == "mixture":
            side = APART * spread * rng.choice([-1.0, 1.0])
            own = {"bias_tempco": side + np.sqrt(1.0 - APART**2) * truth.bias_tempco}
        elif world == "lots off" and not earlier:
            own = {"bias_tempco": truth.bias_tempco + OFF * spread * stream(seed, k // LOT, "lot").choice([-1.0, 1.0])}
        else:
            own = {}
        out.append(replace(truth, **own))
    return out


class Measured:
    """Units measured with a plan, fitted lot by lot: coefficients (units, m, p), their covariances and effects."""

    def __init__(self, course: Course, preset: Preset, truths: list[Truth], seed: int) -> None:
        state, mean, error = measured(course, preset, truths, seed)
        fits = []
        for k in range(0, len(truths), LOT):
            own = slice(k, k + LOT)
            part = State(force=state.force[own], time=state.time[own], temperature=state.temperature[own])
            fits.append(fit_lot_with_wander(STARTING_MODEL, part, mean[own], error[own]).fit)
        self.coefficients = np.concatenate([fit.coefficients for fit in fits])
        self.covariance = np.concatenate([fit.covariance for fit in fits])
        self.effects = [effect for effect, _ in fits[0].names[0]]
        self.off = self.coefficients - truth_of(truths, fits[0].names)

    def family(self) -> Family:
        """Their family."""
        return family_of(self.coefficients, self.covariance, np.arange(len(self.off)) // LOT)

    def together(self, family: Family) -> tuple[list[Prior], Combined, Array]:
        """Priors by lot, the fits with them, and their errors (units, m, p)."""
        priors, fits = [], []
        for k in range(0, len(self.off), LOT):
            own = self.coefficients[k : k + LOT], self.covariance[k : k + LOT]
            priors.append(judged(family, self.effects, *own))
            fits.append(combined(*own, priors[-1].mean, priors[-1].precision))
        names = ("coefficients", "covariance", "kept", "share")
        both = Combined(*(np.concatenate([getattr(fit, name) for fit in fits]) for name in names))
        return priors, both, both.coefficients - self.coefficients + self.off


def inside(off: Array, covariance: Array) -> Array:
    """Share of truths within 2 σ, (p,)."""
    return np.mean(np.abs(off) <= 2.0 * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)), axis=(0, 1))


def rms(off: Array, columns: list[int]) -> float:
    return 1e6 * float(np.sqrt(np.mean(off[..., columns] ** 2)))


def print_world(world: str, before: Measured, after: Measured, family: Family) -> None:
    priors, both, off = after.together(family)
    unlike = sum(int((~prior.fits).sum()) for prior in priors)
    lots = sum(bool(prior.widened) for prior in priors)
    print(f"  {world}: {unlike} of {len(off)} units do not fit their family, {lots} of {len(priors)} lots widened")
    covered, alone = inside(off, both.covariance), inside(after.off, after.covariance)
    for effect in dict.fromkeys(after.effects):
        own = [c for c, name in enumerate(after.effects) if name == effect]
        a, b, without = (rms(x, own) for x in (before.off, off, after.off))
        spread = float(np.exp(1.96 / np.sqrt(off[..., own].size)))
        print(
            f"    {effect:<20}{a:10.3g}{without:10.3g}{b:10.3g}  ratio {b / a:5.3f} ({b / a / spread:.3f} … {b / a * spread:.3f})"
            f"  within U {100 * covered[own].mean():5.1f} % (without prior {100 * alone[own].mean():5.1f} %)"
            f"  of the prior {100 * both.share[..., own].mean():4.1f} %"
        )


def compared(name: str, options: argparse.Namespace) -> None:
    preset, seed = load_preset(name), options.seed
    update = {"device": name, "effects": list(STARTING_MODEL), "static_record_s": 0.0, "name": name.lower()}
    base = load_recipe().model_copy(update=update)
    white = 1e-6 * preset.sampled_density_ug(base.rate_hz)
    noise = DwellNoise(white, 1e-6 * preset.bias_instability_ug, 1e-6 * preset.rate_random_walk_ug)
    station = load_station()
    against = plan_context(textbook(base, LEVELS), station, noise)
    long, plans = course_of(against), dict[str, PlanContext]()
    required = identified(against).errors * options.factor
    for world in options.world or WORLDS:
        drawn = of_world(world, truths_of(preset, options.archive, seed + 1), preset, seed + 1, earlier=True)
        family = Measured(long, preset, drawn, seed + 1).family()
        key = "normal" if world == "lots off" else world
        if key not in plans:
            requirement = Requirement(
                required, seen_by(against, LEVELS), LEVELS, candidates(station), prior=family.precision
            )
            begun = time.perf_counter()
            plans[key] = best = optimise(base, against, requirement, lambda _: None, ramp=True).planned
            took = time.perf_counter() - begun
            bound = lower_bound(base, against, requirement, ramp=True)
            limit = "none" if bound is None else f"{100 * bound.share:.0f} % for {bound.effect}"
            print(
                f"{name}, {world}: station time {100 * best.minutes / against.minutes:.1f} % of {against.minutes:.0f} min; "
                f"bound {limit}; {best.state.time.size} dwells of {best.recipe.dwell_s:g} s; search {took:.0f} s",
                flush=True,
            )
        units = of_world(world, truths_of(preset, options.units, seed), preset, seed, earlier=False)
        print_world(
            world, Measured(long, preset, units, seed), Measured(course_of(plans[key]), preset, units, seed + 2), family
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--archive", type=int, default=500, help="earlier units")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--device", action="append", help="preset; all by default")
    parser.add_argument("--world", action="append", choices=WORLDS)
    parser.add_argument("--factor", type=float, default=1.04, help="required errors over those of the textbook plan")
    options = parser.parse_args()
    print(f"python benchmarks/priors.py --units {options.units} --archive {options.archive} --seed {options.seed}")
    for name in options.device or ("adxl355", "analogue", "sf1500", "qa700"):
        compared(name, options)


if __name__ == "__main__":
    main()
