"""The smallest orders to a chamber: a kelvin and back, off and on, and what it does without a link."""

import time
from dataclasses import dataclass

from stations.bringup.orders import Orders
from stations.bringup.person import Verdict
from stations.bringup.target import bounds_of, chamber_of

STEP_K = 1.0
SAME_K = 0.1
RESPONSE_K, AWAY_K = 0.05, 0.5
"""Change of the air towards the set point that shows that it follows, and away from it that shows that it does not."""


@dataclass
class ChamberOrders:
    """The orders to one chamber, each after its own consent."""

    orders: Orders
    watch_s: float
    silence_s: float

    def run(self) -> None:
        """Take all steps in order; a step that fails does not prevent the next."""
        self.orders.step("state of the controller", self._state)
        self.orders.step("a kelvin and back", self._set)
        self.orders.step("off and on", self._switch)
        self.orders.step("lost link", self._lost_link)

    def _state(self) -> None:
        """Alarm, program, unit and mode: what the controller says before anything is ordered."""
        chamber = chamber_of(self.orders.target)
        air = chamber.temperature()
        chamber.require_ready()
        self.orders.add("ready for a set point", "held", f"air {air:.2f} °C, mode {chamber.mode()}")

    def _set(self) -> None:
        """A set point a kelvin away, with its read-back, and the old set point again."""
        what = "takes a set point and reads it back"
        chamber = chamber_of(self.orders.target)
        before = chamber.set_point()
        low, high = bounds_of(self.orders.target.profile, "set_point", (-100.0, 250.0))
        goal = round(before + STEP_K if before + STEP_K <= high else before - STEP_K, 1)
        if not low <= goal <= high:
            found, allowed = f"set point {before:g} °C", f"{low:g} to {high:g} °C"
            self.orders.add(what, "differs", found, allowed, "correct the limits")
            return
        text = f"the set point goes from {before:g} °C to {goal:g} °C and back; the chamber heats or cools by a kelvin"
        if not self.orders.consent("SET", text, what):
            return
        self.orders.keeper.keep(self.orders.found)
        mode = chamber.mode()
        if mode != chamber.running and self._switches:
            if not self.orders.consent("ON", f"the chamber is in mode {mode}; it is switched on", "switches on"):
                return
            chamber.on()
        air = chamber.temperature()
        chamber.set_temperature(goal)
        self.orders.add(what, "held", f"{chamber.set_point():g} °C", f"{goal:g} °C")
        time.sleep(self.watch_s)
        moved = chamber.temperature() - air
        towards = moved if goal > before else -moved
        verdict: Verdict = "held" if towards >= RESPONSE_K else "differs" if towards <= -AWAY_K else "not tried"
        found = f"air changed by {moved:+.2f} K in {self.watch_s:g} s"
        remedy = "check that sensor, heating and cooling belong to this loop; --set watch=S looks longer"
        self.orders.add("air follows the set point", verdict, found, f"towards {goal:g} °C", remedy)
        chamber.set_temperature(before)
        self.orders.add("takes the old set point again", "held", f"{chamber.set_point():g} °C", f"{before:g} °C")

    def _switch(self) -> None:
        """Off and on again: the safe state of a station may be a chamber that is off."""
        what = "switches off and on"
        if not self._switches:
            self.orders.add(what, "not tried", "no writable mode; set safety.chamber to set_point or hold")
            return
        chamber = chamber_of(self.orders.target)
        if not self.orders.consent("OFF", "heating and cooling are switched off, and on again", what):
            return
        self.orders.keeper.keep(self.orders.found)
        chamber.off()
        stood = chamber.mode()
        chamber.on()
        self.orders.add(what, "held", f"{stood}, then {chamber.mode()}", f"{chamber.standing}, then {chamber.running}")

    @property
    def _switches(self) -> bool:
        profile = self.orders.target.profile
        return profile.has("mode") and profile.entry("mode").writable

    def _lost_link(self) -> None:
        """The link is cut: most controllers keep their set point, on which the watchdog does not rely but the plan does."""
        what = f"keeps its set point for {self.silence_s:g} s without a link"
        if not self.orders.consent("LINK", f"the link is cut for {self.silence_s:g} s; nothing is ordered", what):
            return
        chamber = chamber_of(self.orders.target)
        before, mode = chamber.set_point(), chamber.mode()
        self.orders.target.link.close()
        time.sleep(self.silence_s)
        chamber = self.orders.again(lambda: chamber_of(self.orders.target))
        after, then = self.orders.again(chamber.set_point), chamber.mode()
        held = abs(after - before) <= SAME_K and then == mode
        remedy = "it has a time-out of its own: see its manual, and set it longer than a pause of the network"
        found, expected = f"{after:g} °C, mode {then}", f"{before:g} °C, mode {mode}"
        self.orders.judge(what, found, expected, remedy, good=held)
