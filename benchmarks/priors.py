"""Priors from earlier units: `python benchmarks/priors.py --units 200 --archive 500`.

Units drawn from the physics of the plant are calibrated with the textbook plan, in lots of eight: the archive. Its family is the
prior with which the quickest recipe on ramps is searched and fitted. The benchmark compares the RMS errors (estimate − truth) of
further units with those of the textbook plan on the same units, the share of truths within U, units that do not fit their family,
and lots whose prior is widened; in worlds where the family is normal, has heavy tails, or is a mixture, where lots are off, and
where units are calibrated again, their bias moved by a switch-on. The plant knows nothing of a prior: the spreads between units
are those of the presets.
`--characteristic` prints the decisions on drawn coefficients at half, at once and at twice their limits.
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
from inertial.fits import prior
from inertial.fits.prior import Combined, Prior, combined, judged
from inertial.fits.wander import fit_lot_with_wander
from inertial.noise.dwells import DwellNoise
from inertial.population.family import Family, change_of, family_of
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
WORLDS = ("normal", "heavy tails", "mixture", "lots off", "again")
PAIRS = 104
"""Units of the archive that are calibrated twice where units come again."""
RATE_HZ = 25.0
"""Samples of a dwell, where no filter of the device would be aliased: the mean has the same noise as at the recipe's rate."""
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


def switched_on(truths: list[Truth], preset: Preset, seed: int) -> list[Truth]:
    """The units after a switch-on, which moves the bias."""
    size = 0.0 if preset.stability is None else 1e-6 * preset.stability.switch_on_ug
    return [replace(t, bias_g=t.bias_g + size * stream(seed, t.serial, "on").standard_normal(3)) for t in truths]


class Measured:
    """Units measured with a plan, fitted lot by lot: coefficients (units, m, p), their covariances and effects."""

    def __init__(self, course: Course, preset: Preset, truths: list[Truth], seed: int) -> None:
        if preset.noise_bandwidth_hz == 0.0:
            course = replace(course, rate=RATE_HZ)
        state, mean, error, slow = measured(course, preset, truths, seed)
        heat = np.asarray(state.temperature)
        self.serials = [truth.serial for truth in truths]
        fits = []
        for k in range(0, len(truths), LOT):
            own = slice(k, k + LOT)
            part = State(force=state.force[own], time=state.time[own], temperature=heat[own])
            fits.append(fit_lot_with_wander(STARTING_MODEL, part, mean[own], error[own]).fit)
        self.coefficients = np.concatenate([fit.coefficients for fit in fits])
        self.covariance = np.concatenate([fit.covariance for fit in fits])
        self.effects = [effect for effect, _ in fits[0].names[0]]
        self.off = self.coefficients - truth_of(truths, fits[0].names, slow.walk)

    def family(self) -> Family:
        """Their family."""
        return family_of(self.coefficients, self.covariance, np.arange(len(self.off)) // LOT)

    def together(self, family: Family) -> tuple[list[Prior], Combined, Array]:
        """Priors by lot, the fits with them, and their errors (units, m, p)."""
        priors, fits = [], []
        for k in range(0, len(self.off), LOT):
            own = self.coefficients[k : k + LOT], self.covariance[k : k + LOT]
            priors.append(judged(family, self.effects, *own, self.serials[k : k + LOT]))
            fits.append(combined(*own, priors[-1].mean, priors[-1].precision))
        names = ("coefficients", "covariance", "of_fit", "share")
        both = Combined(*(np.concatenate([getattr(fit, name) for fit in fits]) for name in names))
        return priors, both, both.coefficients - self.coefficients + self.off


def with_own(family: Family, before: Measured, pairs: tuple[Measured, Measured]) -> Family:
    """The family with what units calibrated before say of themselves, as a job makes it."""
    first, second = pairs
    change = change_of(second.coefficients - first.coefficients, second.covariance + first.covariance)
    both = combined(before.coefficients, before.covariance, family.mean, family.precision)
    wider = both.covariance + change[..., None] * np.eye(change.shape[-1])
    own = zip(before.serials, zip(both.coefficients, wider, strict=True), strict=True)
    return replace(family, own=dict(own))


def precision_of(family: Family) -> Array:
    """Precision of the units to be planned for, (m, p, p)."""
    return np.linalg.inv(np.mean([c for _, c in family.own.values()], axis=0)) if family.own else family.precision


def inside(off: Array, covariance: Array) -> Array:
    """Share of truths within 2 σ, (p,)."""
    return np.mean(np.abs(off) <= 2.0 * np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)), axis=(0, 1))


def rms(off: Array, columns: list[int]) -> float:
    return 1e6 * float(np.sqrt(np.mean(off[..., columns] ** 2)))


def print_world(world: str, before: Measured, after: Measured, family: Family) -> None:
    priors, both, off = after.together(family)
    unlike = sum(int((~own.fits).sum()) for own in priors)
    lots = sum(bool(own.widened) for own in priors)
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
    required[:, 0] *= options.bias_factor
    families = dict[str, Family]()
    for world in options.world or WORLDS:
        drawn = of_world(world, truths_of(preset, options.archive, seed + 1), preset, seed + 1, earlier=True)
        key = "normal" if world == "lots off" else world
        units = of_world(world, truths_of(preset, options.units, seed), preset, seed, earlier=False)
        if key not in families:
            made = world == "again" and "normal" in families
            families[key] = families["normal"] if made else Measured(long, preset, drawn, seed + 1).family()
        family = families[key]
        if world == "again":
            twice = [switched_on(drawn[:PAIRS], preset, seed + k) for k in (3, 4)]
            pairs = [Measured(long, preset, on, seed + k) for on, k in zip(twice, (3, 4), strict=True)]
            before = Measured(long, preset, switched_on(units, preset, seed + 5), seed + 5)
            family = with_own(family, before, (pairs[0], pairs[1]))
            units = switched_on(units, preset, seed + 6)
        if key not in plans:
            requirement = Requirement(
                required, seen_by(against, LEVELS), LEVELS, candidates(station), prior=precision_of(family)
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
        print_world(
            world, Measured(long, preset, units, seed), Measured(course_of(plans[key]), preset, units, seed + 2), family
        )


def characteristic(lots: int, seed: int) -> None:
    """Decisions on lots of eight of a family of 500 units in 63 lots, of which some are off, at limits of half, one and two."""
    p, unit, lot, error = 6, 1.0, 0.2, 0.5
    effects = ["bias", "scale", "misalignment", "misalignment", "bias_temperature", "scale_temperature"]
    kinds = {
        "normal": (0.0, 0.0, 0.0),
        "t5": (5.0, 0.0, 0.0),
        "a unit off by 8": (0.0, 8.0, 0.0),
        "lots off by 3": (0.0, 0.0, 3.0),
    }
    limits = prior.FOREIGN_UNIT, prior.FOREIGN_LOT
    for kind, (tails, one, off) in kinds.items():
        rng = np.random.default_rng(seed)

        def drawn(count: int, tails: float = tails, rng: np.random.Generator = rng) -> tuple[Array, Array]:
            own = (
                rng.standard_t(tails, (count * LOT, 3, p)) * np.sqrt(0.6)
                if tails
                else rng.standard_normal((count * LOT, 3, p))
            )
            common = np.repeat(lot * rng.standard_normal((count, 3, p)), LOT, axis=0)
            values = unit * own + common + error * rng.standard_normal(own.shape)
            return values, np.broadcast_to(error**2 * np.eye(p), (*own.shape, p))

        family = family_of(*drawn(63), np.repeat(np.arange(63), LOT))
        values, covariance = drawn(lots)
        values[..., 4] += off * np.repeat(rng.choice([-1.0, 1.0], lots), LOT)[:, None]
        values[::LOT, 0, 4] += one
        told: list[str] = []
        for factor in (0.5, 1.0, 2.0):
            prior.FOREIGN_UNIT, prior.FOREIGN_LOT = (factor * limit for limit in limits)
            found = [
                judged(family, effects, values[k : k + LOT], covariance[k : k + LOT])
                for k in range(0, len(values), LOT)
            ]
            wrong = sum(int((~own.fits[1:] if one else ~own.fits).sum()) for own in found)
            right = f"{sum(not own.fits[0] for own in found)} of {lots} that are off, " if one else ""
            told.append(
                f"{right}{wrong} of {len(values) - lots * bool(one)} others, {sum(bool(own.widened) for own in found)} lots"
            )
        prior.FOREIGN_UNIT, prior.FOREIGN_LOT = limits
        print(f"{kind}: units that do not fit, lots widened of {lots}: {'; '.join(told)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--archive", type=int, default=500, help="earlier units")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--device", action="append", help="preset; all by default")
    parser.add_argument("--world", action="append", choices=WORLDS)
    parser.add_argument("--factor", type=float, default=1.04, help="required errors over those of the textbook plan")
    parser.add_argument("--bias-factor", type=float, default=1.0, help="additional factor for the bias")
    parser.add_argument("--characteristic", action="store_true", help="of the decisions, with as many lots as units")
    options = parser.parse_args()
    if options.characteristic:
        characteristic(options.units, options.seed)
        return
    print(f"python benchmarks/priors.py --units {options.units} --archive {options.archive} --seed {options.seed}")
    for name in options.device or ("adxl355", "analogue", "sf1500", "qa700"):
        compared(name, options)


if __name__ == "__main__":
    main()
