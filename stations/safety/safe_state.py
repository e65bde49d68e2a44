"""The safe state of a station: axes stopped, sampling stopped, the chamber where the station's file says."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from schemas.errors import StationError
from schemas.safety import Safety
from stations.devices.chamber import ThermalChamber
from stations.devices.reader import Reader
from stations.devices.table import TableAxis

AGAIN_S = 1.0


@dataclass(frozen=True)
class SafeStep:
    """One command towards the safe state: the part of the station, the result in words, and the action."""

    part: str
    what: str
    act: Callable[[], None]


@dataclass(frozen=True)
class Reached:
    """Completed and failed commands of the safe state, failed ones with the reason."""

    done: list[str] = field(default_factory=list[str])
    failed: dict[str, str] = field(default_factory=dict[str, str])

    @property
    def safe(self) -> bool:
        """Whether all commands succeeded."""
        return not self.failed

    def sentence(self) -> str:
        """Completed and failed commands in a sentence."""
        failed = [f"{what} not done ({why})" for what, why in self.failed.items()]
        return "; ".join([*self.done, *failed])


def safe_steps(
    safety: Safety, axes: Mapping[str, TableAxis], chamber: ThermalChamber, reader: Reader
) -> list[SafeStep]:
    """The commands in order, moving parts first; each sets an absolute state, so it may be sent twice."""
    steps: list[SafeStep] = []
    if safety.axes == "stop":
        steps += [SafeStep(part, f"{part} axis stopped", axis.stop) for part, axis in axes.items()]
    steps.append(SafeStep("reader", "sampling stopped", reader.stop))
    goal = safety.temperature_C
    if safety.chamber == "off":
        steps.append(SafeStep("chamber", "chamber off", chamber.off))
    elif safety.chamber == "set_point":
        steps.append(SafeStep("chamber", f"chamber to {goal:g} °C", lambda: chamber.set_temperature(goal)))
    return steps


def equipment_steps(equipment: Mapping[str, Any]) -> list[SafeStep]:
    """The commands that stop test equipment: an exciter or centrifuge before anything else."""
    return [SafeStep(role, f"{role.replace('_', ' ')} stopped", device.make_safe) for role, device in equipment.items()]


def reach_safe_state(steps: list[SafeStep], *, patience_s: float = 0.0) -> Reached:
    """Sends every command, also after failures of others, and returns the result.

    steps : the commands, in order
    patience_s : time during which failed commands are repeated, s; 0 sends each once
    """
    left, done = list(steps), list[str]()
    end = time.monotonic() + patience_s
    while True:
        failed: dict[str, str] = {}
        for step in list(left):
            try:
                step.act()
            except StationError as problem:
                failed[step.what] = str(problem)
            else:
                done.append(step.what)
                left.remove(step)
        if not left or time.monotonic() + AGAIN_S > end:
            return Reached(done, failed)
        time.sleep(AGAIN_S)
