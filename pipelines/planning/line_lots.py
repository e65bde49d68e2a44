"""What a lot goes through on a line, phase by phase: durations from the same timing that a plan predicts its minutes with."""

from dataclasses import dataclass, field

from inertial import timing
from pipelines.schedule.steps import Step, steps
from pipelines.schedule.timing import air_of, schedule
from schemas.recipe import Recipe
from schemas.station import StationConfig

UNLOAD_K = 10.0  # from the room: nobody takes out what is hotter, and what is colder gathers dew


@dataclass(frozen=True)
class Phase:
    """A part of a recipe that nothing may interrupt: ``seconds`` at or towards ``temperature`` °C.

    kind : soak, measure, ramp (measured while the temperature changes), static, return (to the room), or a role of equipment
    needs : what a shared resource may be needed for
    """

    kind: str
    temperature: float
    seconds: float
    needs: frozenset[str] = field(default_factory=frozenset[str])


def phases_of(recipe: Recipe, station: StationConfig) -> list[Phase]:
    """The phases of a recipe on a station, in order, from a device at room temperature until it may be unloaded.

    Ramps that follow each other are one phase: between them nothing waits.
    """
    activities = schedule(steps(recipe), station, recipe)
    phases: list[Phase] = []
    for activity in activities:
        kind, needs = ("soak", frozenset({"soak"})) if activity.kind == "soak" else _needs(activity.step)
        before = phases[-1] if phases else None
        if before is not None and kind != "soak" and (before.kind, before.needs) == (kind, needs):
            phases[-1] = Phase(kind, activity.step.temperature, before.seconds + activity.seconds, needs)
        else:
            phases.append(Phase(kind, activity.step.temperature, activity.seconds, needs))
    room = station.simulation.room_C if station.simulation else station.pace.room_C
    last = activities[-1].end
    back = timing.settling_s(last.air, last.device, room, UNLOAD_K, air_of(station))
    return [*phases, Phase("return", room, back)] if back > 0.0 else phases


def _needs(step: Step) -> tuple[str, frozenset[str]]:
    """Kind and needs of a record of a step, with the move before it."""
    if step.order is not None and step.order.role and not step.order.on_table:
        return step.order.role, frozenset({step.order.role})
    if step.kind == "allan":
        return "static", frozenset({"static"})
    role = {step.order.role} if step.order is not None and step.order.role else set[str]()
    return (
        ("measure", frozenset({"measure", *role})) if step.settled else ("ramp", frozenset({"measure", "soak", *role}))
    )
