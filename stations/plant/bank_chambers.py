"""Registers of the simulated chambers: one chamber, each controller's own way of showing it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from stations.codec import NotEncodable, Value, named
from stations.plant.bank import Bank, number

if TYPE_CHECKING:
    from schemas.profile import Profile
    from stations.plant.chamber import Chamber
    from stations.plant.world import World

Sources = dict[str, Callable[[], Value]]
FREE = (-100.0, 250.0)  # where a profile gives no limits
HUMIDITY = 40.0


def chamber_bank(world: World, profile: Profile) -> Bank:
    """The registers of the controller behind a profile."""
    chamber = world.fixture.chamber
    own, command = _BY_ADAPTER[profile.adapter](chamber, profile)
    point = profile.register("set_point")
    sources: Sources = {
        "temperature": world.air_reading,
        "set_point": lambda: chamber.set_point,
        "working_set_point": lambda: chamber.working,
        "set_point_low": lambda: FREE[0] if point.minimum is None else point.minimum,
        "set_point_high": lambda: FREE[1] if point.maximum is None else point.maximum,
        "temperature_unit": lambda: "celsius",
        "power": lambda: 100.0 * chamber.power,
        "ramp_rate": lambda: chamber.ramp_K_min,
        "humidity": lambda: HUMIDITY,
        "humidity_set_point": lambda: HUMIDITY,
        **own,
    }
    return Bank(profile, sources, command)


def _f4t(chamber: Chamber, profile: Profile) -> tuple[Sources, Callable[[dict[str, Value]], None]]:
    """Watlow F4T: a loop that can be switched off, a ramp, no program."""
    kept: dict[str, Value] = {
        name: profile.register(name).enumeration[state]
        for name, state in (("ramp_action", "set_point"), ("ramp_scale", "per_minute"))
    }

    def command(values: dict[str, Value]) -> None:
        if "mode" in values:
            chosen = named(profile.register("mode"), number(values, "mode"))
            if chosen not in {"automatic", "off"}:
                raise NotEncodable("mode: the simulated chamber knows automatic and off")
            chamber.running = chosen == "automatic"
        if "set_point" in values:
            chamber.set_point = number(values, "set_point")
        if "ramp_rate" in values:
            chamber.ramp_K_min = number(values, "ramp_rate")
        kept.update({name: value for name, value in values.items() if name in kept})

    def mode() -> Value:
        return "automatic" if chamber.running else "off"

    sources: Sources = {
        "part_number": lambda: "TUMBLELINE-SIM",
        "alarm_1": lambda: "inactive",
        "mode": mode,
        "actual_mode": mode,
        "manual_power": lambda: 0.0,
        "ramp_action": lambda: kept["ramp_action"],
        "ramp_scale": lambda: kept["ramp_scale"],
        "program_state": lambda: "off",
        **{f"event_{n}": lambda: "off" for n in range(1, 5)},
        **{name: lambda: 0 for name in ("program_number", "program_step", "current_program", "current_step")},
    }
    return sources, command


def _plain(chamber: Chamber, _profile: Profile) -> tuple[Sources, Callable[[dict[str, Value]], None]]:
    """A controller with a set point and nothing else."""
    return {}, _set_by(chamber, "set_point")


def _f4(chamber: Chamber, _profile: Profile) -> tuple[Sources, Callable[[dict[str, Value]], None]]:
    """Watlow F4: whole numbers with one decimal, a static set point."""
    sources: Sources = {
        "status": lambda: "static",
        "decimals": lambda: 1,
        "temperature_2": lambda: 23.0,
        "set_point_2": lambda: 23.0,
    }
    return sources, _set_by(chamber, "set_point")


def _binder(chamber: Chamber, profile: Profile) -> tuple[Sources, Callable[[dict[str, Value]], None]]:
    """Binder: set points to write beside the active one; the MB1 is in manual operation."""
    written: dict[str, Value] = {
        name: chamber.set_point for name in ("set_point_basic", "set_point_manual") if profile.has(name)
    }
    act = _set_by(chamber, "set_point_manual")

    def command(values: dict[str, Value]) -> None:
        written.update({name: value for name, value in values.items() if name in written})
        act(values)

    def own(name: str) -> Callable[[], Value]:
        return lambda: written[name]

    sources: Sources = {
        **{name: own(name) for name in written},
        "mode": lambda: "manual",
        "door": lambda: int(chamber.door_open),
        "operation_lines": lambda: 0,
        "operation_lines_now": lambda: 0,
    }
    return sources, command


def _eurotherm(chamber: Chamber, _profile: Profile) -> tuple[Sources, Callable[[dict[str, Value]], None]]:
    """Eurotherm 3200: the remote set point counts while it is enabled, the first set point otherwise."""
    local = chamber.set_point
    state: dict[str, float] = {"remote": local, "enabled": 0.0}

    def command(values: dict[str, Value]) -> None:
        if "set_point" in values:
            state["remote"] = number(values, "set_point")
        if "remote_enable" in values:
            state["enabled"] = number(values, "remote_enable")
        chamber.set_point = state["remote"] if state["enabled"] else local

    sources: Sources = {
        "set_point": lambda: state["remote"],
        "target_set_point": lambda: chamber.set_point,
        "set_point_1": lambda: local,
        "set_point_2": lambda: local,
        "remote_enable": lambda: int(state["enabled"]),
        "program_status": lambda: "reset",
    }
    return sources, command


def _set_by(chamber: Chamber, name: str) -> Callable[[dict[str, Value]], None]:
    """What a write to the register that sets the chamber does."""

    def command(values: dict[str, Value]) -> None:
        if name in values:
            chamber.set_point = number(values, name)

    return command


_BY_ADAPTER = {
    "set_point": _plain,
    "watlow_f4t": _f4t,
    "watlow_f4": _f4,
    "binder": _binder,
    "eurotherm_3200": _eurotherm,
}
