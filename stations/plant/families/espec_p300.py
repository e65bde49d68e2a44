"""The simulated ESPEC P300, a controller with a text protocol."""

import re

from schemas.profile import Profile
from stations.plant.equipment import UNKNOWN, WRONG
from stations.plant.world import World

SET = re.compile(r"TEMP, S(-?\d+(?:\.\d+)?)")
MODES = {"CONSTANT": True, "STANDBY": False, "OFF": False}
OUTSIDE = "NA:DATA OUT OF RANGE"


class P300:
    """The controller of the simulated chamber; it starts in constant operation."""

    def __init__(self, world: World, profile: Profile) -> None:
        self._world = world
        point = profile.command("set_point")
        self._low, self._high = point.minimum or 0.0, point.maximum or 0.0
        self._mode = "CONSTANT"

    def answer(self, line: str) -> tuple[str, bool]:
        if line.endswith("?"):
            return self._report(line), False
        if line.startswith("TEMP,"):
            return self._set(line)
        return self._switch(line) if line.startswith("MODE,") else (UNKNOWN, False)

    def _report(self, query: str) -> str:
        chamber = self._world.fixture.chamber
        answers = {
            "TEMP?": f"{self._world.air_reading():.1f},{chamber.set_point:.1f},{self._high:.1f},{self._low:.1f}",
            "MODE?": self._mode,
            "ALARM?": "0",
        }
        return answers.get(query, UNKNOWN)

    def _set(self, line: str) -> tuple[str, bool]:
        match = SET.fullmatch(line)
        if match is None:
            return WRONG, False
        value = float(match[1])
        if not self._low <= value <= self._high:
            return OUTSIDE, False
        self._world.fixture.chamber.set_point = value
        return f"OK:{line}", True

    def _switch(self, line: str) -> tuple[str, bool]:
        mode = line.removeprefix("MODE,")
        if mode not in MODES:
            return WRONG, False
        self._mode = mode
        self._world.fixture.chamber.running = MODES[mode]
        return f"OK:{line}", True


simulated = P300
