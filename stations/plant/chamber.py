"""The thermal chamber: controller, air, walls, compressor and door, stepped once a second."""

import math
from dataclasses import dataclass

import numpy as np

STEP_S = 1.0
POWER_K_S = 0.15  # heating or cooling of the air at full power
ACTUATOR_S = 10.0
WALL_S = 600.0  # air to wall
WALL_MASS = 3.0  # heat capacity of the wall over that of the air
LEAK_S = 3000.0
DOOR_S = 60.0
GAIN_PER_K = 0.5
INTEGRAL_S = 120.0
QUIET_G = 5e-6  # vibration of the building, rms
COMPRESSOR_G = 60e-6
COOLING_FLOOR = 0.15  # fraction of the compressor capacity that runs whenever the set point is below room temperature


@dataclass
class Chamber:
    """Air at ``air`` °C, walls at ``wall`` °C; the controller ramps its working set point."""

    room: float
    ramp_K_min: float
    set_point: float = 25.0
    working: float = 25.0
    air: float = 25.0
    wall: float = 25.0
    power: float = 0.0
    integral: float = 0.0
    running: bool = True
    door_open: bool = False
    powered: bool = True
    winds_up: bool = False
    hunting: tuple[float, float] = (0.0, 1.0)  # K, s
    shaken_g: float = 0.0
    seconds: float = 0.0

    def step(self) -> None:
        """Advances by one second."""
        reach = self.ramp_K_min / 60.0 * STEP_S
        self.working += float(np.clip(self.set_point - self.working, -reach, reach))
        self.seconds += STEP_S
        swing, period = self.hunting
        error = self.working + swing * math.sin(2.0 * math.pi * self.seconds / period) - self.air
        unlimited = GAIN_PER_K * error + self.integral
        demand = float(np.clip(unlimited, -1.0, 1.0)) if self.running and self.powered else 0.0
        if unlimited == demand or self.winds_up:  # no integration while the actuator is saturated
            self.integral += GAIN_PER_K * error * STEP_S / INTEGRAL_S
        self.power += (demand - self.power) * STEP_S / ACTUATOR_S
        leak = DOOR_S if self.door_open else LEAK_S
        to_wall = (self.wall - self.air) / WALL_S
        self.air += STEP_S * (POWER_K_S * self.power + to_wall + (self.room - self.air) / leak)
        self.wall -= STEP_S * to_wall / WALL_MASS

    def vibration(self) -> float:
        """Vibration of the fixture, g rms, from the building and, in proportion to its cooling power, the compressor."""
        quiet = math.hypot(QUIET_G, self.shaken_g)
        if not self.running or not self.powered:
            return quiet
        duty = max(0.0, -self.power)
        if self.working < self.room:
            duty = max(duty, COOLING_FLOOR)
        return float(np.hypot(quiet, COMPRESSOR_G * np.sqrt(duty)))
