"""A blind run from a specification and a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from . import frames, timeline
from . import scene as scenes
from .chain import noiseless, nominal_force
from .device import Lot
from .faults import FAULTS, LOST, units_swapped
from .noise import flicker_series, walk_series
from .physics import REGISTRY, Draw, Physics
from .scene import Places, Scene
from .sizing import UNSEEN_GENERIC, UNSEEN_SHARE, Absorber, amplitude_for, contribution, rms, starting_model
from .spec import THERMAL_BASE, Fault, Hidden, Spec, Truth
from .temporal import covariate

Floats = NDArray[np.float64]
QUIET_SHARE = 0.03  # of the floor: what tempcos outside the starting model may leave in a run at one temperature


@dataclass(frozen=True)
class Run:
    """Measurements (`dwells`, `history`, `fresh`), and what is sealed about them."""

    dwells: pd.DataFrame
    history: pd.DataFrame
    fresh: pd.DataFrame
    fresh_history: pd.DataFrame
    sealed: Truth


def _noise(spec: Spec, lot: Lot, scene: Scene, rng: np.random.Generator) -> Floats:
    """Noise of the dwell means, (U, n, 3), g: white, 1/f and walk in real time."""
    units, count = scene.units, len(scene.middle)
    white = lot.sample_noise / np.sqrt(round(scene.timeline.dwell * lot.kind.rate))
    noise = rng.standard_normal((units, count, 3))
    length = scene.grid.size
    for share, series in (
        (spec.flicker, lambda: flicker_series(rng, 3 * units, length, fractional=bool(rng.random() < 0.5))),
        (spec.walk, lambda: walk_series(rng, 3 * units, length)),
    ):
        if share > 0.0:
            wander = scene.over_dwell(series()).reshape(units, 3, count).transpose(0, 2, 1)
            # A constant is bias: how it differs from run to run is turn-on repeatability, which no model can know.
            wander = wander - wander.mean(axis=1, keepdims=True)
            noise = noise + share * wander / rms(wander)
    return white[:, None] * noise


def _reading_noise(lot: Lot, scene: Scene) -> Floats:
    """What the thermometers' noise costs any model that reads them, (U, n, 3), g."""
    along = np.einsum("uij,nj->uni", lot.axes(), nominal_force(scene))
    slope = lot.bias_tempco[:, None] + (lot.gain() * lot.scale_tempco)[:, None] * along
    return -slope * scene.reading_error[..., None]


def _spread(noise: Floats) -> float:
    """RMS about each channel's own mean over the run: a constant is bias, not noise."""
    return rms(noise - noise.mean(axis=1, keepdims=True))


def _draw(spec: Spec, scene: Scene, units: int, seeds: Sequence[np.random.SeedSequence]) -> list[Physics]:
    drawn = []
    for effect, seed in zip(spec.effects, seeds, strict=True):
        draw = Draw(np.random.default_rng(seed), units, scene)
        if effect.startswith("covariate:"):
            drawn.append(covariate(draw, effect.partition(":")[2], spec.covariate_shape))
        else:
            drawn.append(REGISTRY[effect](draw))
    return drawn


def _separation(left: Sequence[Floats]) -> float:
    """Smallest share of an effect's unabsorbed part that the other effects' parts, scaled per unit and axis, leave over."""
    smallest = 1.0
    for index, own in enumerate(left):
        others = [other for k, other in enumerate(left) if k != index]
        if not others or rms(own) == 0.0:
            continue
        stack = np.stack(others, axis=-1).transpose(0, 2, 1, 3)  # (U, 3, n, others)
        stack = stack / np.maximum(np.linalg.norm(stack, axis=2, keepdims=True), 1e-300)
        target = own.transpose(0, 2, 1)[..., None]
        over = target - stack @ (np.linalg.pinv(stack) @ target)
        smallest = min(smallest, rms(over) / rms(own))
    return smallest


def _quiet(lot: Lot, scene: Scene, absorber: Absorber, floor: float) -> Lot:
    """The lot with tempcos small enough not to show where the starting model has no term for them."""
    still = replace(lot, bias_tempco=0.0 * lot.bias_tempco, scale_tempco=0.0 * lot.scale_tempco)
    left = rms(absorber.left(noiseless(lot, scene, []) - noiseless(still, scene, [])))
    factor = min(1.0, QUIET_SHARE * floor / max(left, 1e-30))
    return replace(lot, bias_tempco=factor * lot.bias_tempco, scale_tempco=factor * lot.scale_tempco)


def _hide(
    lot: Lot, scene: Scene, absorber: Absorber, physics: Physics, size: float, floor: float
) -> tuple[float, Hidden, Floats]:
    """Amplitude, record and unabsorbed part of one effect brought to its size (invisible ones: raw RMS to that size)."""
    probing = amplitude_for(lot, scene, physics, None, floor)
    if physics.generic > 0.0:
        probing = min(probing, floor / physics.generic)
    probe = contribution(lot, scene, physics, probing)
    shows = rms(absorber.left(probe))
    visible = shows > UNSEEN_SHARE * rms(probe) and shows > UNSEEN_GENERIC * physics.generic * probing
    amplitude = amplitude_for(lot, scene, physics, absorber, size * floor) if visible else size * probing
    added = contribution(lot, scene, physics, amplitude)
    left = absorber.left(added)
    reached, raw = rms(left), rms(added)
    share = reached / max(raw, 1e-300)
    plausible = 1e6 * amplitude <= physics.cap_ug and (not visible or abs(reached / (size * floor) - 1.0) < 0.02)
    record = Hidden(
        physics.id, physics.scope, reached / floor, 1e6 * amplitude, 1e6 * raw, share, visible, plausible, physics.variant,
        physics.parameters,
    )  # fmt: skip
    return amplitude, record, left


def _faults(
    spec: Spec, table: pd.DataFrame, names: tuple[str, ...], noise: float, rng: np.random.Generator
) -> tuple[Fault, ...]:
    left = list(names)
    done = []
    for name in spec.faults:
        if name == "units_swapped":
            done.append(units_swapped(table, tuple(left), rng))
        else:
            done.append(FAULTS[name](table, left[int(rng.integers(len(left)))], noise, rng))
        left = [unit for unit in left if unit not in done[-1].units]
    return tuple(done)


def make_run(spec: Spec, seed: int) -> Run:
    """The run, its fresh repetition and its sealed truth; the same seed gives the same bytes."""
    plan, lot_seed, day, other_day, noise, other_noise, fault, *effects = np.random.SeedSequence(seed).spawn(
        7 + len(spec.effects)
    )
    rng = np.random.default_rng(lot_seed)
    line = timeline.build(spec, np.random.default_rng(plan))
    lot = Lot.draw(rng, spec.device, spec.units)
    places = Places.draw(rng, spec.units)
    if spec.soaks == "one":
        places = replace(places, self_heating=0.0 * places.self_heating, chamber_ripple=0.3 * places.chamber_ripple)
    scene = scenes.build(spec, line, places, np.random.default_rng(day))
    again = scenes.build(spec, line, places, np.random.default_rng(other_day))
    base = spec.base or starting_model(scene)
    absorber = Absorber.of(lot, scene, base)
    errors = [_noise(spec, lot, s, np.random.default_rng(n)) for s, n in ((scene, noise), (again, other_noise))]
    if base != THERMAL_BASE:
        lot = _quiet(lot, scene, absorber, _spread(errors[0]))
    effective = [error + _reading_noise(lot, s) for error, s in zip(errors, (scene, again), strict=True)]
    floor = _spread(effective[0])
    drawn = _draw(spec, scene, spec.units, effects)
    placed = [
        _hide(lot, scene, absorber, physics, size, floor) for physics, size in zip(drawn, spec.sizes, strict=True)
    ]
    active = [(physics, amplitude) for physics, (amplitude, _, _) in zip(drawn, placed, strict=True)]
    tables = []
    for s, error, stream in ((scene, errors[0], noise), (again, errors[1], other_noise)):
        frame_rng = np.random.default_rng(stream.spawn(1)[0])
        output = noiseless(lot, s, active) + error
        tables.append(
            (frames.dwells(spec, lot, places, s, output, frame_rng), frames.history(lot, places, s, frame_rng))
        )
    white = float(np.mean(lot.sample_noise)) / np.sqrt(round(line.dwell * lot.kind.rate)) * lot.kind.per_g
    faults = _faults(spec, tables[0][0], lot.names, white, np.random.default_rng(fault))
    oracle = effective[1] - absorber.absorbed(effective[0])
    truth = Truth(
        seed, spec, base, tuple(record for _, record, _ in placed), _separation([left for _, _, left in placed]),
        1e6 * floor, 1e6 * _spread(effective[1]), 1e6 * rms(oracle), lot.kind.per_g,
        next((physics.drivers[0] for physics in drawn if physics.drivers), None),
        tuple(name for physics in drawn for name in physics.drivers), faults,
    )  # fmt: skip
    (dwells, history), (fresh, fresh_history) = tables
    dwells = dwells[dwells["dwell"] != LOST].reset_index(drop=True)
    return Run(dwells, history, fresh, fresh_history, truth)
