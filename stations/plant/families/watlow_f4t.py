"""The simulated Watlow F4T."""

from schemas.profile import Profile
from stations.codec import NotEncodable, Value, named
from stations.plant.bank import Bank, Source, number, store, stored
from stations.plant.controller import controller_bank
from stations.plant.world import World


def simulated(world: World, profile: Profile) -> Bank:
    """Watlow F4T: a loop that can be switched off, a ramp, no program."""
    chamber = world.fixture.chamber
    settings: dict[str, Value] = {
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
        store(settings, values)

    def mode() -> Value:
        return "automatic" if chamber.running else "off"

    sources: dict[str, Source] = {
        "part_number": lambda: "TUMBLELINE-SIM",
        "alarm_1": lambda: "inactive",
        "mode": mode,
        "actual_mode": mode,
        "manual_power": lambda: 0.0,
        **stored(settings),
        "program_state": lambda: "off",
        **{f"event_{n}": lambda: "off" for n in range(1, 5)},
        **{name: lambda: 0 for name in ("program_number", "program_step", "current_program", "current_step")},
    }
    return controller_bank(world, profile, sources, command)
