"""Worlds without an effect and without a fault, but with noise that nobody described."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.stats import levy_stable

from benchmarks.strangers.devices import coloured
from benchmarks.strangers.kinds import Change, Scene, kind
from benchmarks.strangers.station import STEP_S, Floats


@kind("null", scaled=False)
def null(scene: Scene) -> Change:
    """Ordinary noise alone: white, 1/f and a small walk."""
    del scene
    return Change()


def _levels(scene: Scene) -> Floats:
    """Strength (u, 3) of a noise that units and axes have in different measure, in units of their white noise."""
    return scene.devices.white(scene.day.plan.duration_s) * scene.lot.uniform(0.6, 1.4, scene.shape)


@kind("noise")
def smooth(scene: Scene) -> Change:
    """1/f^2.5: smoother than a random walk."""
    return Change(added=scene.day.mean(coloured(scene.noise, scene.day.t.size, 2.5, scene.shape)) * _levels(scene))


@kind("noise")
def pink_and_a_half(scene: Scene) -> Change:
    """1/f^1.5: between flicker and walk."""
    return Change(added=scene.day.mean(coloured(scene.noise, scene.day.t.size, 1.5, scene.shape)) * _levels(scene))


@kind("noise")
def mains_beat(scene: Scene) -> Change:
    """The mains beats with the sampling clock, alike in all units and in phase; the mains' frequency wanders a little."""
    beat = 1.0 / np.exp(scene.lot.uniform(np.log(60.0), np.log(3000.0)))
    drift = 0.15 * coloured(scene.noise, scene.day.t.size, 1.0)
    phase = 2.0 * np.pi * np.cumsum(beat * (1.0 + drift)) * STEP_S + scene.noise.uniform(0.0, 2.0 * np.pi)
    pickup = scene.lot.uniform(0.3, 1.0, 3) * scene.lot.choice([-1.0, 1.0], 3)
    return Change(added=scene.day.mean(np.sin(phase))[:, None, None] * pickup * np.ones(scene.shape) * 1e-5)


@kind("noise")
def popcorn(scene: Scene) -> Change:
    """Two levels; the times in each are spread over decades. Some units only."""
    times, middle = scene.day.t, np.log(scene.lot.uniform(100.0, 1500.0))
    sick = scene.lot.random(scene.shape) < 0.6
    sick.flat[int(scene.lot.integers(sick.size))] = True
    state = np.zeros((times.size, *scene.shape))
    for unit, axis in np.argwhere(sick):
        edges = np.cumsum(np.exp(middle + 1.5 * scene.noise.standard_normal(4000)))
        state[:, unit, axis] = (np.searchsorted(edges, times) + scene.noise.integers(2)) % 2
    return Change(added=scene.day.mean(state) * _levels(scene))


@kind("noise")
def grows_with_force(scene: Scene) -> Change:
    """Floor motion turns into noise where the axis lies along gravity: as strong as the force squared, new in every dwell."""
    return Change(
        added=scene.noise.standard_normal((scene.dwells, *scene.shape)) * scene.sensed() ** 2 * _levels(scene)
    )


@kind("noise")
def modulated(scene: Scene) -> Change:
    """White noise of the samples whose amplitude swells and fades over an hour; the scatter inside a dwell shows it."""
    swell = np.exp(1.2 * scene.day.mean(coloured(scene.noise, scene.day.t.size, 2.0)))[:, None, None]
    sd = swell * _levels(scene)
    samples = np.sqrt(scene.day.plan.duration_s * scene.devices.rate_hz)
    return Change(added=scene.noise.standard_normal(sd.shape) * sd, sample_sd=sd * samples)


@kind("noise")
def stable_tails(scene: Scene) -> Change:
    """Alpha-stable shocks of the floor, in all axes of a unit at once."""
    mix = np.eye(3) + 0.8 * scene.lot.uniform(-1.0, 1.0, (3, 3))
    size = (scene.dwells, scene.shape[0], 1)
    radius = np.sqrt(levy_stable.rvs(0.85, 1.0, size=size, random_state=scene.noise))
    shocks = np.minimum(radius, 12.0) * scene.noise.standard_normal((scene.dwells, *scene.shape))
    return Change(added=shocks @ mix.T * _levels(scene))


@kind("noise")
def laplace_tails(scene: Scene) -> Change:
    """Laplace's distribution; the axes of a unit share their size and are correlated."""
    mix = np.linalg.cholesky(np.array([[1.0, 0.6, -0.3], [0.6, 1.0, 0.2], [-0.3, 0.2, 1.0]]))
    size = np.sqrt(scene.noise.exponential(1.0, (scene.dwells, scene.shape[0], 1)))
    return Change(added=size * scene.noise.standard_normal((scene.dwells, *scene.shape)) @ mix.T * _levels(scene))


@kind("noise")
def supply_ripple(scene: Scene) -> Change:
    """Slow ripple of a regulator that all units hang on; each rejects it in its own measure, nobody records it."""
    slow = coloured(scene.noise, scene.day.t.size, 1.2) + 0.3 * np.sin(scene.day.t / scene.lot.uniform(20.0, 200.0))
    return Change(added=scene.day.mean(slow)[:, None, None] * scene.lot.uniform(0.4, 1.2, scene.shape) * 1e-5)


@kind("noise")
def aliased_line(scene: Scene) -> Change:
    """A fan's line folded down by the sampling: a tone whose frequency wanders through zero, its own in every unit."""
    units = scene.shape[0]
    near = scene.lot.uniform(-2e-3, 2e-3, units) + 4e-3 * coloured(scene.noise, scene.day.t.size, 2.0, (units,))
    phase = 2.0 * np.pi * np.cumsum(near, axis=0) * STEP_S + scene.noise.uniform(0.0, 2.0 * np.pi, units)
    lag = scene.lot.uniform(0.0, 2.0 * np.pi, scene.shape)
    return Change(added=scene.day.mean(np.sin(phase[..., None] + lag)) * _levels(scene))


@kind("noise", "soaks")
def compressor_flicker(scene: Scene) -> Change:
    """1/f noise while the compressor of the chamber runs, none while it rests."""
    flicker = coloured(scene.noise, scene.day.t.size, 1.0, scene.shape)
    return Change(added=scene.day.mean(flicker * scene.day.compressor[:, None, None]) * _levels(scene))


@kind("noise")
def table_repeats_badly(scene: Scene) -> Change:
    """Every move ends at a slightly different angle: all units are wrong alike in that dwell."""
    miss = scene.noise.standard_normal((scene.dwells, 1, 3)) * scene.lot.uniform(0.3, 1.0, 3)
    return Change(turn=np.repeat(miss, scene.shape[0], axis=1))


@kind("noise", "soaks")
def hot_noise(scene: Scene) -> Change:
    """1/f noise of an activated process: its strength follows Arrhenius' law."""
    kelvin = scene.day.case + 273.15
    strength = np.exp(scene.lot.uniform(2000.0, 4500.0) * (1.0 / 298.15 - 1.0 / kelvin))[..., None]
    return Change(
        added=scene.day.mean(coloured(scene.noise, scene.day.t.size, 1.0, scene.shape) * strength) * _levels(scene)
    )


@kind("noise")
def settling_noise(scene: Scene) -> Change:
    """1/f noise that dies away with the root of the time since switch-on."""
    fade = np.sqrt(1.0 / (1.0 + scene.day.t / 1500.0))[:, None, None]
    return Change(
        added=scene.day.mean(coloured(scene.noise, scene.day.t.size, 1.0, scene.shape) * fade) * _levels(scene)
    )


@kind("noise")
def clicks(scene: Scene) -> Change:
    """A package that relieves stress in clicks: each a jump that relaxes over minutes, at random times."""
    rate, tau = 1.0 / scene.lot.uniform(1500.0, 5000.0), scene.lot.uniform(100.0, 900.0)
    hits = scene.noise.random((scene.day.t.size, scene.shape[0], 1)) < rate * STEP_S
    heights = hits * scene.noise.standard_t(4, (scene.day.t.size, *scene.shape))
    path = lfilter([1.0], [1.0, -np.exp(-STEP_S / tau)], heights, axis=0)
    return Change(added=scene.day.mean(path) * _levels(scene))
