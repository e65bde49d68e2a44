"""Optimal recipes against the textbook plan: `python benchmarks/plans.py --units 200`.

200 units drawn from the physics of the plant (transfer, temperature, flicker, random walk, converter) are measured with both
recipes, at the time of each dwell on the station; dwells are averaged and fitted as in the chain. The benchmark compares the
RMS errors (estimate − truth) of every coefficient, the share of truths within U, and the station time. With `--known 1.5,2` the
textbook plan ends, as given and in the order of `plan order`, when lots of eight know their coefficients with 1.5 and 2 times its
errors, by the looks of a run (without the budget of the references and the verdict on the model). The air is that of the
plant's chamber, each unit follows it with its own lag and place in the air stream, and its thermometer has noise. Registers are
not simulated: a test compares the planned station time with the clock of the simulated station.
"""

from __future__ import annotations

import argparse
import os
import shlex
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import numpy as np  # noqa: E402

from benchmarks.slow_noise import ApartNoise  # noqa: E402
from inertial.fits.known import noise_guard, over_looks  # noqa: E402
from inertial.fits.wander import fit_lot_with_wander  # noqa: E402
from inertial.frames import force_from_angles  # noqa: E402
from inertial.noise.dwells import DwellNoise  # noqa: E402
from inertial.noise.measurands import DAY_S  # noqa: E402
from inertial.state import State  # noqa: E402
from pipelines.jobs.model_files import STARTING_MODEL  # noqa: E402
from pipelines.jobs.recipes import load_recipe  # noqa: E402
from pipelines.planning.context import PlanContext, plan_context  # noqa: E402
from pipelines.planning.lower_bound import lower_bound  # noqa: E402
from pipelines.planning.optimise import optimise  # noqa: E402
from pipelines.planning.plan import identified  # noqa: E402
from pipelines.planning.requirement import Requirement, candidates, temperature_choices  # noqa: E402
from pipelines.planning.soak_order import look_counts, ordered  # noqa: E402
from pipelines.planning.textbook import seen_by, textbook  # noqa: E402
from pipelines.schedule.timing import spent  # noqa: E402
from pipelines.stages.fit import LONG_S  # noqa: E402
from pipelines.stages.uncertainty.bias_measurands import BiasNoise, bias_measurands  # noqa: E402
from schemas.errors import TumblelineError  # noqa: E402
from schemas.simulation import Simulation  # noqa: E402
from schemas.station import load_station  # noqa: E402
from stations.plant.device import PlantDevices, Truth, draw_truth, rotation, stream  # noqa: E402
from stations.plant.fixture import STEP_S, Chamber  # noqa: E402
from stations.plant.preset import Preset, load_preset  # noqa: E402

Array = np.ndarray
Names = tuple[tuple[tuple[str, str], ...], ...]
CHUNK = 25
PARTS = 4
"""Parts of a dwell with temperatures of their own."""
THERMOMETER_K = 0.005
DAY_STEPS = 288
"""Of the day after a record, in which a unit's slow noise is averaged."""
RATE_HZ = 25.0
"""Samples of a dwell, where no filter of the device would be aliased."""


@dataclass(frozen=True)
class Course:
    """Dwells of a recipe in order: angles in degrees, temperature in °C, begin and duration in s."""

    outer: Array
    inner: Array
    air: Array
    start: Array
    duration: float
    rate: float


class Slow(NamedTuple):
    """Slow noise of units, (units, 3) each, g.

    walk : mean of the random walk over the dwells, from which a fit counts the bias: the bias at switch-on is no truth of it
    record, day : mean of walk and flicker over the dwells, and over the day after them
    """

    walk: Array
    record: Array
    day: Array


def course_of(planned: PlanContext) -> Course:
    """The dwells of the fit in the activities of a station."""
    dwells = [s for s in planned.activities if s.kind == "dwell"]
    return Course(
        outer=np.array([s.step.pose.outer_deg for s in dwells]),
        inner=np.array([s.step.pose.inner_deg for s in dwells]),
        air=air_of(planned),
        start=np.array([s.start for s in dwells]),
        duration=planned.recipe.dwell_s,
        rate=planned.recipe.rate_hz,
    )


def air_of(planned: PlanContext) -> Array:
    """The air of the plant's chamber, °C, second by second, as its set point follows the activities of a station."""
    whole, room = planned.activities, planned.station.simulation.room_C
    chamber = Chamber(room=room, ramp_K_min=3.0, air=room, wall=room, working=room)
    ends = np.array([s.start + s.seconds for s in whole])
    air = [room]
    for second in range(int(ends[-1]) + 2):
        chamber.set_point = whole[
            min(int(np.searchsorted(ends, second, side="right")), len(whole) - 1)
        ].step.temperature
        chamber.step()
        air.append(chamber.air)
    return np.array(air)


def heat_of(course: Course, units: int, seed: int, place: int) -> Array:
    """Temperatures of units (units, n, parts) in the parts of every dwell, °C: each follows the air with a lag of its own."""
    low, high = Simulation().slot_lag_s
    rng = np.random.default_rng([seed, place])
    keep = np.exp(-STEP_S / rng.uniform(low, high, units))
    around = Simulation().slot_gradient_K * rng.standard_normal(units)
    elements = np.full((course.air.size, units), course.air[0])
    for k in range(1, course.air.size):
        elements[k] = course.air[k] + around + (elements[k - 1] - course.air[k] - around) * keep
    middle = course.start[:, None] + course.duration * (np.arange(PARTS) + 0.5) / PARTS
    return np.stack([np.interp(middle, np.arange(course.air.size), own) for own in elements.T])


def truths_of(preset: Preset, units: int, seed: int) -> list[Truth]:
    """Units whose physics is exactly that of the model: a comparison of plans, not of models.

    In the physics the temperature coefficient of the scale also acts on the misaligned force. Every second unit is therefore
    aligned with such a coefficient, the others are misaligned without it: every coefficient differs from zero in half of them.
    """
    none, drawn = np.zeros(3), []
    for k in range(units):
        serial = f"R{k:04d}"
        seat = rotation(1e-3 * stream(seed, serial, "slot").standard_normal(3))
        truth = draw_truth(preset, serial, seed, slot_rotation=seat, supply_ratio=1.0, output_scale=preset.scale)
        truth = replace(truth, cubic=none, bias_tempco_quadratic=none, scale_tempco_quadratic=none)
        aligned = {"misalignment": np.eye(3), "slot_rotation": np.eye(3)}
        drawn.append(replace(truth, **(aligned if k % 2 else {"scale_tempco": none})))
    return drawn


def measured(course: Course, preset: Preset, truths: list[Truth], seed: int) -> tuple[State, Array, Array, Slow]:
    """State, means and their white errors (units, n, 3) in g, and slow noise, of units measured with a plan."""
    parts = [_chunk(course, preset, truths[k : k + CHUNK], seed, k) for k in range(0, len(truths), CHUNK)]
    mean, sd = (np.concatenate([part[k] for part in parts]) / preset.scale for k in (0, 1))
    heat, slow = np.concatenate([part[2] for part in parts]), np.concatenate([part[3] for part in parts], axis=1)
    lsb = preset.lsb / preset.scale
    n = round(course.rate * course.duration)
    error = np.sqrt(sd**2 / n + np.where(sd < lsb, lsb**2 / 12.0, 0.0))
    force = force_from_angles(np.radians(course.outer), np.radians(course.inner))
    time = np.broadcast_to(course.start + course.duration / 2.0, heat.shape)
    return State(force=np.broadcast_to(force, (*heat.shape, 3)), time=time, temperature=heat), mean, error, Slow(*slow)


def _chunk(course: Course, preset: Preset, truths: list[Truth], seed: int, place: int) -> tuple[Array, ...]:
    """Means and standard deviations (units, n, 3), what the thermometers say (units, n), slow noise (3, units, 3)."""
    devices = PlantDevices(preset, truths)
    noise = ApartNoise(preset, [stream(seed, t.serial, "noise") for t in truths])
    n, before, means, sds, slow = round(course.rate * course.duration), 0.0, [], [], []
    heat = heat_of(course, len(truths), seed, place)
    part = np.minimum(np.arange(n) * PARTS // n, PARTS - 1)
    lsb = float(np.float32(preset.lsb))
    force = force_from_angles(np.radians(course.outer), np.radians(course.inner))
    for f, own, start in zip(force, np.moveaxis(heat, 1, 0), course.start, strict=True):
        turned = np.repeat(np.stack([t.slot_rotation @ f for t in truths])[None], PARTS, axis=0)
        clean = devices.output(turned, own.T)[part]
        noise.jump(start - before)
        begun, drawn = noise.walk, noise.sample(n, course.rate)
        counts = devices.counts(clean + drawn) * lsb
        before = start + course.duration
        means.append(counts.mean(axis=0) - preset.zero_level)
        sds.append(counts.std(axis=0, ddof=1))
        slow.append(np.stack([0.5 * (begun + noise.walk), (drawn - noise.white).mean(axis=0)]))
    shown = heat.mean(axis=2) + THERMOMETER_K * np.random.default_rng([seed, place, 1]).standard_normal(heat.shape[:2])
    later = []
    for _ in range(DAY_STEPS):
        noise.jump(DAY_S / DAY_STEPS)
        later.append(noise.slow)
    own = np.concatenate([np.mean(slow, axis=0), np.mean(later, axis=0)[None]])
    return np.stack(means, axis=1), np.stack(sds, axis=1), shown, own


def truth_of(truths: list[Truth], names: Names, slow: Array) -> Array:
    """True coefficients (units, 3, p) of the standard thermal model in g, for forces in the fixture's frame.

    slow : (units, 3), g, what of the slow noise counts as bias
    """
    out = np.zeros((len(truths), 3, len(names[0])))
    for u, truth in enumerate(truths):
        matrix = truth.matrix
        for axis in range(3):
            across = iter(((axis + 1) % 3, (axis + 2) % 3))
            for c, (effect, _) in enumerate(names[axis]):
                out[u, axis, c] = {
                    "bias": lambda a=axis, t=truth, w=slow[u]: t.bias_g[a] + w[a],
                    "scale": lambda a=axis, m=matrix: m[a, a],
                    "misalignment": lambda a=axis, m=matrix, it=across: m[a, next(it)],
                    "bias_temperature": lambda a=axis, t=truth: t.bias_tempco[a],
                    "scale_temperature": lambda a=axis, m=matrix, t=truth: m[a, a] * t.scale_tempco[a],
                }[effect]()
    return out


def compared(name: str, options: argparse.Namespace) -> None:
    """Prints one device's figures."""
    preset = load_preset(name)
    base = load_recipe().model_copy(
        update={"device": name, "effects": list(STARTING_MODEL), "static_record_s": 0.0, "name": name.lower()}
    )
    white = preset.sampled_density_ug(base.rate_hz)
    noise = DwellNoise(1e-6 * white, 1e-6 * preset.bias_instability_ug, 1e-6 * preset.rate_random_walk_ug)
    levels = tuple(float(part) for part in options.temperatures.split(","))
    station = load_station()
    against = plan_context(textbook(base, levels), station, noise)
    required = identified(against).errors * options.factor
    if options.bias_factor != 1.0:
        required[:, 0] *= options.bias_factor
    if options.ramp:
        levels = (min(levels), max(levels))
    begun = time.perf_counter()
    requirement = Requirement(
        required,
        seen_by(against, levels),
        (min(levels), max(levels)),
        candidates(station),
        optional_levels=temperature_choices(levels),
        verification=options.verification,
    )
    try:
        best = optimise(base, against, requirement, lambda _: None, ramp=options.ramp)
    except TumblelineError as refusal:
        print(f"{name}: {refusal}")
        return
    took = time.perf_counter() - begun
    recipe = best.planned.recipe
    heat = ", ".join(f"{t:g}" for t in recipe.temperatures_C)
    print(
        f"{name}: {'ramps to' if options.ramp else 'soaks at'} {heat} °C, {best.planned.state.time.size} dwells of "
        f"{recipe.dwell_s:g} s in {len(recipe.poses)} poses and {len(recipe.verification)} for verification; "
        f"search time {took:.0f} s"
    )
    for title, course in (("textbook", against), ("optimal", best.planned)):
        parts = spent(course.activities).document()
        spread = ", ".join(f"{part} {parts[part]:.0f}" for part in ("soaks", "moves", "dwells"))
        print(f"  {title:<9}{parts['total']:6.0f} min: {spread}")
    bound = lower_bound(base, against, requirement, ramp=options.ramp)
    if bound is not None:
        print(f"  uninterrupted measurement needs {100.0 * bound.share:.0f} %, for {bound.effect}")
    print(f"  station time {100.0 * best.share:.1f} %; expected errors at most {best.worst:.3f} of the required ones")
    table(errors_of(against, preset, options), errors_of(best.planned, preset, options))


LOT = 8


def known(name: str, options: argparse.Namespace) -> None:
    """Prints what a device's lots need until they are known."""
    preset = load_preset(name)
    update = {"device": name, "effects": list(STARTING_MODEL), "static_record_s": 0.0, "name": name.lower()}
    base = load_recipe().model_copy(update=update)
    white = 1e-6 * preset.sampled_density_ug(base.rate_hz)
    noise = DwellNoise(white, 1e-6 * preset.bias_instability_ug, 1e-6 * preset.rate_random_walk_ug)
    levels = tuple(float(part) for part in options.temperatures.split(","))
    against = plan_context(textbook(base, levels), load_station(), noise)
    expected = identified(against).errors
    truths = truths_of(preset, options.units, options.seed)
    lots = [truths[k : k + LOT] for k in range(0, len(truths), LOT)]
    whole = [Looked(against, preset, lot, options.seed + k, 0.0 * expected) for k, lot in enumerate(lots)]
    print(f"{name}: textbook plan {against.minutes:.0f} min, within U {inside_of(whole)}", flush=True)
    for factor in map(float, options.known.split(",")):
        new = plan_context(ordered(against, factor * expected).recipe, against.station, noise)
        for title, plan in (("as given", against), ("in order", new)):
            looked = [Looked(plan, preset, lot, options.seed + k, factor * expected) for k, lot in enumerate(lots)]
            minutes = np.array([one.minutes for one in looked])
            early = sum(one.early for one in looked)
            print(
                f"  {factor:g} times its errors, {title}: {early} of {len(lots)} lots end early, {minutes.mean():.0f} min "
                f"({minutes.min():.0f} to {minutes.max():.0f}), {100.0 * minutes.mean() / against.minutes:.1f} %; "
                f"within U {inside_of(looked)}; at any look beyond what a failure is told by: "
                f"{100.0 * np.mean(np.concatenate([one.beyond for one in looked])):.2f} %"
            )
            ratios = {
                effect: rms_of(looked, effect) / rms_of(whole, effect) for effect in dict.fromkeys(looked[0].effects)
            }
            print(
                f"    RMS error over the whole plan's: {', '.join(f'{e} {r:.2f}' for e, r in ratios.items())}",
                flush=True,
            )


class Looked:
    """A lot that ends when it is known.

    required : (3, p), standard errors in g; early : whether it ends before the plan; minutes : of the station until then
    off, inside, beyond : (units, 3, p), errors in g, whether they are within U, and whether they are beyond what a unit would be
        told to fail by, at any look
    """

    def __init__(self, plan: PlanContext, preset: Preset, truths: list[Truth], seed: int, required: Array) -> None:
        course = course_of(plan)
        if preset.noise_bandwidth_hz == 0.0:  # the mean has the same noise as at the recipe's rate
            course = replace(course, rate=RATE_HZ)
        state, mean, error, slow = measured(course, preset, truths, seed)
        dwells = [one for one in plan.activities if one.kind == "dwell"]
        self.beyond = np.zeros((len(truths), *required.shape), dtype=bool)
        counts = look_counts(plan.activities, plan.station, plan.recipe)
        for count in [*counts, len(dwells)]:
            part = State(
                force=state.force[:, :count],
                time=state.time[:, :count],
                temperature=np.asarray(state.temperature)[:, :count],
            )
            if count < len(dwells) and not required.any():
                continue
            fit = fit_lot_with_wander(plan.recipe.effects, part, mean[:, :count], error[:, :count]).fit
            spread = np.sqrt(np.diagonal(fit.covariance, axis1=-2, axis2=-1))
            guard = noise_guard(int(fit.dof.sum()), len(counts))
            off = fit.coefficients - truth_of(truths, fit.names, slow.walk)
            self.beyond = self.beyond | (np.abs(off) > over_looks(2.0, len(counts)) * guard * spread)
            if count < len(dwells) and np.all(guard * spread <= required):
                break
        self.effects = [effect for effect, _ in fit.names[0]]
        self.off = off
        self.inside = np.abs(self.off) <= 2.0 * spread
        self.early = count < len(dwells)
        self.minutes = (dwells[count - 1].start + dwells[count - 1].seconds) / 60.0


def inside_of(looked: list[Looked]) -> str:
    """Share of truths within U by effect, in words."""
    every = np.concatenate([one.inside for one in looked])
    names = looked[0].effects
    parts = [
        f"{effect} {100.0 * every[..., [c for c, other in enumerate(names) if other == effect]].mean():.1f}"
        for effect in dict.fromkeys(names)
    ]
    return f"{100.0 * every.mean():.1f} % ({', '.join(parts)})"


def rms_of(looked: list[Looked], effect: str) -> float:
    """RMS error of an effect's coefficients over units and axes, g."""
    own = [c for c, other in enumerate(looked[0].effects) if other == effect]
    return float(np.sqrt(np.mean(np.concatenate([one.off for one in looked])[..., own] ** 2)))


@dataclass(frozen=True)
class Errors:
    """Errors (units, 3) in g of each coefficient by effect, and whether they are within U.

    The bias is there twice, with U of each: that of the record, and that of the day after it, which its user has.
    """

    off: dict[str, list[Array]]
    inside: dict[str, list[Array]]


def errors_of(course: PlanContext, preset: Preset, options: argparse.Namespace) -> Errors:
    """Errors of fits to units drawn from the physics of the plant."""
    truths = truths_of(preset, options.units, options.seed)
    state, mean, error, slow = measured(course_of(course), preset, truths, options.seed)
    found = fit_lot_with_wander(course.recipe.effects, state, mean, error)
    fit, level = found.fit, np.sqrt(np.mean(error**2, axis=1) * found.lack_of_fit)
    spread = np.sqrt(np.diagonal(fit.covariance, axis1=-2, axis2=-1))
    goes_on = found.walk_shown or float(np.ptp(np.asarray(state.time)[0])) >= LONG_S
    stated = bias_measurands(
        BiasNoise(
            error=spread[..., 0],
            gain=found.gain[:, :, 0],
            flicker=level * found.flicker,
            carried=level * found.walk * goes_on,
            excess=np.zeros_like(level),
            time=np.asarray(state.time)[0],
            every=np.asarray(state.time)[0],
            known=found.widened,
            widened=1.0,
        )
    )
    off, inside = dict[str, list[Array]](), dict[str, list[Array]]()

    def add(effect: str, one: Array, u: Array) -> None:
        off.setdefault(effect, []).append(one)
        inside.setdefault(effect, []).append(np.abs(one) <= 2.0 * u)

    for where, u in (("record", "bias_record_u_ug"), ("day", "bias_long_u_ug")):
        own = (fit.coefficients - truth_of(truths, fit.names, getattr(slow, where)))[..., 0]
        add(f"bias, {where}", own, stated[u])
    others = fit.coefficients - truth_of(truths, fit.names, slow.walk)
    for c, (effect, _) in enumerate(fit.names[0]):
        if effect != "bias":
            add(effect, others[..., c], spread[..., c])
    return Errors(off, inside)


def table(before: Errors, after: Errors) -> None:
    """Prints RMS errors by effect, over units and axes, with the 95 % interval of their ratio, and the share within U."""
    print(f"  {'RMS error, µg':<24}{'textbook':>10}{'optimal':>10}{'ratio':>8}{'95 % interval':>18}{'within U, %':>18}")
    worse: list[str] = []
    for effect in before.off:
        a, b = (1e6 * float(np.sqrt(np.mean(np.square(x.off[effect])))) for x in (before, after))
        held = [100.0 * float(np.mean(x.inside[effect])) for x in (before, after)]
        spread = float(
            np.exp(1.96 / np.sqrt(np.size(before.off[effect])))
        )  # of the ratio of two independent RMS values
        worse += [effect] if b / a > spread else []
        print(
            f"  {effect:<24}{a:10.3g}{b:10.3g}{b / a:8.3f}{b / a / spread:10.3f} …{b / a * spread:6.3f}"
            f"{held[0]:10.1f}{held[1]:8.1f}"
        )
    print(f"  significantly worse than the textbook plan: {', '.join(worse) or 'none'}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--units", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--device", action="append", help="preset; adxl355 and analogue by default")
    parser.add_argument("--temperatures", default="-10,25,60")
    parser.add_argument("--factor", type=float, default=1.0, help="required errors over those of the textbook plan")
    parser.add_argument("--bias-factor", type=float, default=1.0, help="additional factor for the bias")
    parser.add_argument(
        "--verification", type=int, default=1, help="dwells of each verification pose; the textbook plan has none"
    )
    parser.add_argument("--ramp", action="store_true", help="measure while the chamber ramps, without soaks")
    parser.add_argument("--known", default="", help="end when known with so many times the textbook plan's errors")
    options = parser.parse_args()
    print(f"python benchmarks/plans.py {shlex.join(sys.argv[1:])}")
    for name in options.device or ("adxl355", "analogue"):
        (known if options.known else compared)(name, options)


if __name__ == "__main__":
    main()
