"""Hidden effects with memory or of temperature and time, and those of the station that all units have alike."""

from __future__ import annotations

import numpy as np

from benchmarks.strangers.curves import way_of_force
from benchmarks.strangers.kinds import Change, Scene, kind, play, relax, relays
from benchmarks.strangers.station import STEP_S, WAYPOINTS, Floats, force_of

SHIFT = 1e-3  # of a disc off its axis, in radii
EVERY = 10  # operators that do not know the rate see every tenth instant of the temperatures


def _thermal_path(scene: Scene) -> Floats:
    """Temperatures (m, u) from the store at 21 °C through the whole run."""
    stored = np.linspace(21.0, 0.0, 12)[:, None] / 21.0
    begin = 21.0 * stored + scene.day.case[0] * (1.0 - stored)
    return np.concatenate([begin, scene.day.case[::EVERY]])


def _at_dwells(scene: Scene, path: Floats) -> Floats:
    """Values (d, …) at the dwells of what runs along the thermal path."""
    return path[12 + scene.day.windows[:, scene.day.windows.shape[1] // 2] // EVERY]


@kind("effect", "soaks", "return", catalogue=("thermal_hysteresis",))
def preisach_of_heat(scene: Scene) -> Change:
    """A package with many small domains, each with two temperatures at which it switches: Preisach's operator."""
    up = scene.lot.normal(28.0, 22.0, 80)
    down = up - scene.lot.gamma(3.0, 6.0, 80)
    path = relays(_thermal_path(scene), up, down, np.full(80, 1.0 / 80.0))
    return Change(added=_at_dwells(scene, path)[..., None] * scene.gains())


@kind("effect", "soaks", "return", catalogue=("thermal_hysteresis",))
def dragged_by_heat(scene: Scene) -> Change:
    """A lid that slides on its glue: the bias hangs on the temperature with slack."""
    start = np.full(scene.shape[0], 21.0)
    path = _thermal_path(scene)
    slack = path - play(path, np.full(scene.shape[0], scene.lot.uniform(3.0, 12.0)), start)
    return Change(added=_at_dwells(scene, slack)[..., None] * scene.gains())


@kind("effect", "soaks", "short", catalogue=("thermal_lag", "thermal_rate"))
def element_lags(scene: Scene) -> Change:
    """The element follows the case, whose temperature is recorded, with a time constant of its own."""
    tau = scene.lot.uniform(500.0, 2000.0)
    element = relax(scene.day.case, tau, scene.day.case[0])
    return Change(added=scene.day.mean(element - scene.day.case)[..., None] * scene.gains())


@kind("effect", "cold", catalogue=("warm_up",))
def warms_up(scene: Scene) -> Change:
    """The electronics heat the element after switch-on, through two masses in a row."""
    fast, slow = scene.lot.uniform(60.0, 300.0), scene.lot.uniform(900.0, 3000.0)
    zero = np.zeros(scene.shape[0])
    heat = relax(relax(np.ones((scene.day.t.size, scene.shape[0])), fast, zero), slow, zero)
    return Change(added=(scene.day.mean(heat)[..., None] - 1.0) * scene.gains())


@kind("effect", "cold", catalogue=("aging_log",))
def stress_relaxes(scene: Scene) -> Change:
    """Glue that relaxes after switch-on on all time scales, from minutes to days."""
    rates = 1.0 / np.geomspace(200.0, 3e5, 14)
    decay = np.exp(-scene.day.t[:, None] * rates).mean(axis=1)
    return Change(added=scene.day.mean(decay)[:, None, None] * scene.gains())


@kind("effect", catalogue=("creep_after_move",))
def suspension_creeps(scene: Scene) -> Change:
    """A suspension that gives way slowly after each move: a spring and damper behind the spring."""
    force = scene.devices.sensed(_force_of_path(scene))
    tau = scene.lot.uniform(40.0, 400.0)
    return Change(added=scene.day.mean(relax(force, tau, force[0]) - force) * scene.gains())


@kind("effect", catalogue=("pose_hysteresis",))
def friction_in_bearing(scene: Scene) -> Change:
    """Dry friction of the bearing: what the axis feels is dragged along behind the force, over all the way of the table."""
    way = way_of_force(scene)
    width = scene.lot.uniform(0.1, 0.5)
    dragged = play(way, np.full(scene.shape, width), np.zeros(scene.shape))
    return Change(added=(dragged - way)[WAYPOINTS - 1 :: WAYPOINTS] * scene.gains())


@kind("effect", catalogue=("pose_hysteresis",))
def magnetic_domains(scene: Scene) -> Change:
    """Domains in the torquer that the force of the way has switched: Preisach's operator over the force."""
    up = scene.lot.normal(0.25, 0.4, 60)
    down = up - scene.lot.gamma(2.0, 0.3, 60)
    way = way_of_force(scene).reshape(-1, scene.shape[0] * 3)
    path = relays(way, up, down, np.full(60, 1.0 / 60.0))[WAYPOINTS - 1 :: WAYPOINTS]
    return Change(added=path.reshape(-1, *scene.shape) * scene.gains())


@kind("effect", "soaks", catalogue=("bias_temperature_quadratic", "bias_temperature_cubic"))
def curved_reference(scene: Scene) -> Change:
    """A band-gap reference, bent over temperature, that shifts the zero."""
    kelvin = scene.day.case + 273.15
    bend = kelvin / 300.0 * np.log(kelvin / 300.0) - (kelvin / 300.0 - 1.0)
    return Change(added=scene.day.mean(bend)[..., None] * scene.gains())


@kind("effect", "soaks", catalogue=("thermal_kink",))
def glass_point(scene: Scene) -> Change:
    """An adhesive with a glass transition: beyond it the bias follows temperature with another slope."""
    over = (scene.day.case - scene.lot.uniform(25.0, 45.0)) / 2.5
    return Change(added=scene.day.mean(np.logaddexp(0.0, over))[..., None] * scene.gains())


@kind("effect", "weather")
def daily_course(scene: Scene) -> Change:
    """The electronics stand outside the chamber: the bias follows the temperature of the room, which may be recorded."""
    room = relax(scene.day.room[:, None] - 22.0, 900.0, scene.day.room[:1] - 22.0)
    return Change(added=scene.day.mean(room)[..., None] * scene.gains(), notes=_column(scene, "room_C"))


@kind("effect", "weather")
def follows_barometer(scene: Scene) -> Change:
    """A case that is not stiff: the bias follows the pressure of the air, which may be recorded."""
    air = scene.day.mean(scene.day.pressure - 1013.0)[:, None, None]
    return Change(added=air * scene.gains(), notes=_column(scene, "pressure_hPa"))


def _column(scene: Scene, name: str) -> dict[str, object]:
    """The recorded column that drives an effect, None where nobody recorded it."""
    return {"column": name if scene.day.plan.weather else None}


def _force_of_path(scene: Scene) -> Floats:
    force = force_of(scene.day.path[:, 0], scene.day.path[:, 1])
    return np.repeat(force[:, None, :], scene.shape[0], axis=1)


def _outer_axis(scene: Scene) -> Floats:
    """Direction (d, 1, 3) of the outer axis seen from the fixture."""
    inner = scene.day.angles[:, 1]
    return np.stack([np.cos(inner), -np.sin(inner), np.zeros_like(inner)], axis=1)[:, None, :]


def _alike(scene: Scene, turn: Floats) -> Change:
    """A rotation (d, 1, 3) of the fixture that all units have."""
    return Change(turn=np.repeat(turn, scene.shape[0], axis=1))


@kind("effect", catalogue=("backlash",))
def worn_gears(scene: Scene) -> Change:
    """Play in both gears: the shafts hang behind their encoders, on the side from which they came."""
    way = scene.day.way.reshape(-1, 2)
    slack = np.deg2rad(0.02)
    behind = (play(way, np.full(2, slack), way[0]) - way)[WAYPOINTS - 1 :: WAYPOINTS] / slack
    worn = scene.lot.uniform(0.4, 1.0, 2)
    inner = np.array([0.0, 0.0, 1.0]) * behind[:, None, 1:] * worn[1]
    return _alike(scene, _outer_axis(scene) * behind[:, None, :1] * worn[0] + inner)


@kind("effect", "soaks", catalogue=("fixture_bends",))
def fixture_bends(scene: Scene) -> Change:
    """The fixture bends as its plate follows the chamber: a rotation that all units have alike."""
    plate = relax(scene.day.chamber, scene.lot.uniform(300.0, 900.0), scene.day.chamber[0])
    axis = np.array([*scene.lot.standard_normal(2), 0.3 * scene.lot.standard_normal()])
    return _alike(scene, ((scene.day.mean(plate) - 25.0) / 50.0)[:, None, None] * axis)


def _tilt(scene: Scene, lean: Floats) -> Change:
    """The whole table leans, about the laboratory's x and y by (d, 2), rad; seen from the fixture."""
    outer, inner = scene.day.angles.T
    about_y = np.stack([np.sin(inner) * np.cos(outer), np.cos(inner) * np.cos(outer), -np.sin(outer)], axis=1)
    return _alike(scene, _outer_axis(scene) * lean[:, None, :1] + about_y[:, None, :] * lean[:, None, 1:])


@kind("effect", "soaks", catalogue=("base_tilts",))
def base_tilts(scene: Scene) -> Change:
    """The chamber warms one leg of the base: table and level lean as the leg follows over an hour."""
    leg = relax(scene.day.chamber, 3600.0, np.asarray(22.0))
    way = scene.lot.uniform(-1.0, 1.0, 2)
    return _tilt(scene, (scene.day.mean(leg)[:, None] - 22.0) / 50.0 * way)


@kind("effect")
def floor_sinks(scene: Scene) -> Change:
    """The floor gives way under the station: the reference direction drifts during the run, ever slower."""
    sunk = 1.0 - np.exp(-scene.day.t / (STEP_S * scene.day.t.size * scene.lot.uniform(0.4, 1.5)))
    return _tilt(scene, scene.day.mean(sunk)[:, None] * scene.lot.uniform(-1.0, 1.0, 2))


@kind("effect")
def encoder_zero_drifts(scene: Scene) -> Change:
    """The zero of the outer encoder creeps during the run."""
    creep = np.sqrt(scene.day.mean(scene.day.t) / (STEP_S * scene.day.t.size))
    return _alike(scene, _outer_axis(scene) * creep[:, None, None])


@kind("effect", catalogue=("encoder_harmonic",))
def eccentric_disc(scene: Scene) -> Change:
    """The disc of the outer encoder sits off its axis: its reading is wrong by a sine of the angle."""
    phase = scene.lot.uniform(0.0, 2.0 * np.pi)
    true = scene.day.angles[:, 0]
    return _alike(scene, _outer_axis(scene) * np.arcsin(SHIFT * np.sin(true + phase))[:, None, None] / SHIFT)
