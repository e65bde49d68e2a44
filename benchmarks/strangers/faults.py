"""Worlds in which somebody or something went wrong on the first day; the fresh day is free of it."""

from __future__ import annotations

import numpy as np

from benchmarks.strangers.kinds import Change, Record, Scene, kind
from benchmarks.strangers.station import Floats


def _direction(scene: Scene) -> Floats:
    """A unit vector (3,)."""
    vector = scene.lot.standard_normal(3)
    return vector / np.linalg.norm(vector)


def _one_soak(scene: Scene) -> tuple[int, tuple[int, ...]]:
    """A soak and its dwells."""
    soak = int(scene.lot.choice(np.unique(scene.day.soak)))
    return soak, tuple(np.flatnonzero(scene.day.soak == soak).tolist())


def _rows(dwells: tuple[int, ...]) -> slice:
    return slice(dwells[0], dwells[-1] + 1)


@kind("fault")
def unit_loosens(scene: Scene) -> Change:
    """A screw comes loose in one pose: from then on every move turns the unit a little further on its seat."""
    unit, first = scene.one_unit(), int(scene.dwells * scene.lot.uniform(0.3, 0.7))
    swing = np.linalg.norm(np.diff(scene.day.force, axis=0, prepend=scene.day.force[:1]), axis=1)
    slip = swing * scene.noise.gamma(0.7, 1.0, scene.dwells) * (np.arange(scene.dwells) >= first)
    path, dwells = np.cumsum(slip), tuple(range(first, scene.dwells))
    turn = path[:, None, None] * _direction(scene) * scene.during(dwells, (unit,))
    return Change(turn=turn, units=(unit,), dwells=dwells)


@kind("fault", scaled=False)
def connectors_exchanged(scene: Scene) -> Change:
    """Two plugs change places for a third of the run; of a single unit the wires of two of its axes."""
    dwells, total = scene.block(0.3, 0.36), scene.shape[0]
    first, second = (int(i) for i in scene.lot.choice(max(total, 2), 2, replace=False))

    def alter(record: Record) -> None:
        if total > 1:
            record.out[_rows(dwells), [first, second]] = record.out[_rows(dwells), [second, first]]
        else:
            record.out[_rows(dwells), :, [first, second]] = record.out[_rows(dwells), :, [second, first]]

    return Change(alter=alter, units=(first, second) if total > 1 else (0,), dwells=dwells)


@kind("fault", "soaks", scaled=False)
def thermometer_sticks(scene: Scene) -> Change:
    """The thermometer of one unit repeats a reading from the end of a soak, for one soak or until the end."""
    unit, soaks = scene.one_unit(), int(scene.day.soak[-1]) + 1
    stuck = int(scene.lot.integers(1, soaks))
    last = soaks if scene.lot.random() < 0.5 else stuck + 1
    dwells = tuple(np.flatnonzero((scene.day.soak >= stuck) & (scene.day.soak < last)).tolist())

    def alter(record: Record) -> None:
        begin = scene.day.windows[dwells[0] - 1, -1]
        end = scene.day.windows[dwells[-1], -1]
        record.log[begin : end + 1, unit] = record.log[begin, unit]
        record.temperature[_rows(dwells), unit] = record.temperature[dwells[0] - 1, unit]

    return Change(alter=alter, units=(unit,), dwells=dwells)


@kind("fault")
def encoder_slips(scene: Scene) -> Change:
    """A coupling slips where the load of the outer axis is largest and springs back later: some poses are off by one angle."""
    load = np.sin(scene.day.angles[:, 0]) * scene.lot.choice([-1.0, 1.0])
    slipped = load > load.min() + np.ptp(load) * scene.lot.uniform(0.6, 0.9)
    axis = np.stack([np.cos(scene.day.angles[:, 1]), -np.sin(scene.day.angles[:, 1]), np.zeros(scene.dwells)], axis=1)
    dwells = tuple(np.flatnonzero(slipped).tolist())
    return Change(turn=axis[:, None, :] * scene.during(dwells), dwells=dwells)


@kind("fault")
def encoder_slips_for_a_while(scene: Scene) -> Change:
    """The inner encoder loses a small angle in one move and is homed again later."""
    dwells = scene.block(0.15, 0.35)
    return Change(turn=np.array([0.0, 0.0, 1.0]) * scene.during(dwells), dwells=dwells)


@kind("fault", "soaks")
def soak_too_early(scene: Scene) -> Change:
    """One soak is measured before the elements have the temperature that the thermometers on the boards show."""
    _, dwells = _one_soak(scene)
    middle = scene.day.mean(scene.day.t)
    tau = scene.lot.uniform(400.0, 1500.0) * scene.lot.uniform(0.8, 1.2, scene.shape[0])
    gap = np.exp(-(middle - middle[dwells[0]])[:, None].clip(0.0) / tau)[..., None] * scene.during(dwells)
    devices = scene.devices
    return Change(added=gap * (devices.bias_temperature + devices.scale_temperature * scene.sensed()), dwells=dwells)


@kind("fault", "soaks")
def plate_rotated(scene: Scene) -> Change:
    """Somebody knocks against the fixture's plate: turned for one soak, all units alike, then put back."""
    _, dwells = _one_soak(scene)
    return Change(turn=_direction(scene) * scene.during(dwells), dwells=dwells)


@kind("fault", scaled=False)
def clock_shifted(scene: Scene) -> Change:
    """The time stamps of one block are off by a constant: a computer that took another time zone or another server."""
    dwells = scene.block(0.2, 0.4)
    shift = float(scene.lot.choice([-3600.0, 3600.0, 7200.0, scene.lot.uniform(200.0, 2000.0)]))

    def alter(record: Record) -> None:
        record.time_s[_rows(dwells)] += shift

    return Change(alter=alter, dwells=dwells, notes={"shift_s": shift})


@kind("fault")
def unit_seated_again(scene: Scene) -> Change:
    """One unit is taken out and put back during the run: turned on its seat, with a bias that moved by the new stress."""
    unit, first = scene.one_unit(), int(scene.dwells * scene.lot.uniform(0.35, 0.65))
    dwells = tuple(range(first, scene.dwells))
    after = scene.during(dwells, (unit,))
    return Change(
        turn=after * _direction(scene), added=after * 0.3 * scene.lot.standard_normal(3), units=(unit,), dwells=dwells
    )


@kind("fault")
def damp_plug(scene: Scene) -> Change:
    """A damp plug loads the output of one unit for a while and dries: its amplitude is short by a share that fades."""
    unit, dwells = scene.one_unit(), scene.block(0.2, 0.4)
    middle = scene.day.mean(scene.day.t)
    dry = np.exp(-(middle - middle[dwells[0]]).clip(0.0) / scene.lot.uniform(2000.0, 8000.0))[:, None, None]
    return Change(added=-dry * scene.sensed() * scene.during(dwells, (unit,)), units=(unit,), dwells=dwells)


@kind("fault")
def started_too_early(scene: Scene) -> Change:
    """A few dwells begin before the table stands: their means hold a share of the way to the pose."""
    count = int(scene.lot.integers(2, 5))
    dwells = tuple(sorted((1 + scene.lot.choice(scene.dwells - 1, count, replace=False)).tolist()))
    sensed = scene.sensed()
    earlier = np.concatenate([sensed[:1], sensed[:-1]])
    return Change(added=(earlier - sensed) * scene.during(dwells), dwells=dwells)


@kind("fault", scaled=False)
def poses_exchanged(scene: Scene) -> Change:
    """The angles of two successive poses stand in each other's row."""
    far = np.linalg.norm(np.diff(scene.day.force, axis=0), axis=1)
    first = int(scene.lot.choice(np.flatnonzero(far > 0.2)))

    def alter(record: Record) -> None:
        record.angles[[first, first + 1]] = record.angles[[first + 1, first]]

    return Change(alter=alter, dwells=(first, first + 1))
