"""Common parts of the simulated controllers of chambers and drives: registers, set points, moves."""

from collections.abc import Callable, Mapping

from schemas.profile import Profile
from stations.codec import Value
from stations.plant.bank import Bank, Busy, Sink, Source, number
from stations.plant.fixture import Chamber
from stations.plant.table import Axis
from stations.plant.world import World

DEFAULT_LIMITS_C = (-100.0, 250.0)  # for profiles without limits
HUMIDITY_PCT = 40.0
ABSOLUTE = 1  # type of a move


def controller_bank(world: World, profile: Profile, registers: Mapping[str, Source], command: Sink) -> Bank:
    """A bank with the given registers and the common ones of a chamber controller; ``command`` handles writes."""
    chamber = world.fixture.chamber
    point = profile.register("set_point")
    sources: dict[str, Source] = {
        "temperature": world.air_reading,
        "set_point": lambda: chamber.set_point,
        "working_set_point": lambda: chamber.working,
        "set_point_low": lambda: DEFAULT_LIMITS_C[0] if point.minimum is None else point.minimum,
        "set_point_high": lambda: DEFAULT_LIMITS_C[1] if point.maximum is None else point.maximum,
        "temperature_unit": lambda: "celsius",
        "power": lambda: 100.0 * chamber.power,
        "ramp_rate": lambda: chamber.ramp_K_min,
        "humidity": lambda: HUMIDITY_PCT,
        "humidity_set_point": lambda: HUMIDITY_PCT,
        **registers,
    }
    return Bank(profile, sources, command)


def set_by(chamber: Chamber, name: str) -> Callable[[dict[str, Value]], None]:
    """The effect of a write to the register of the set point."""

    def command(values: dict[str, Value]) -> None:
        if name in values:
            chamber.set_point = number(values, name)

    return command


def start_move(world: World, axis: Axis, profile: Profile, values: dict[str, Value]) -> None:
    """Starts a move of a drive at rest."""
    if axis.moving(world.now):
        raise Busy(profile.name)
    axis.go(world.now, number(values, "target"), number(values, "speed"), number(values, "acceleration"))
