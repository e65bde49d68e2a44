"""The smallest orders to an axis: enable it, turn it by a degree and back, stop it on its way, lose the link on its way."""

import time
from dataclasses import dataclass

from schemas.errors import StationRefused
from stations.bringup.orders import Orders
from stations.bringup.target import axis_of, limits_of_orders
from stations.devices.table import TableAxis

TURN_DEG = 1.0
STOPPED_DEG = 3.0
STOP_AFTER_S = 1.0
POLL_S = 0.05
MARGIN_S = 10.0
RUNAWAY = 3.0
STEADY_DEG = 0.05
SCALE = 0.02


@dataclass
class AxisOrders:
    """The orders to one axis, each after its own consent."""

    orders: Orders
    silence_s: float

    def run(self) -> None:
        """Take all steps in order; a step that fails does not prevent the next."""
        self.orders.step("state of the drive", self._state)
        self.orders.step("a degree and back", self._turn)
        self.orders.step("stop on the way", self._stop)
        self.orders.step("emergency stop", self._interlock)
        self.orders.step("lost link", self._lost_link)

    def _state(self) -> None:
        """Alarm, home and readiness: what the drive says before anything is ordered."""
        state = axis_of(self.orders.target).state()
        flags = {"ready": state.ready, "homed": state.homed, "moving": state.moving}
        said = ", ".join(f"{name} {'yes' if flag else 'no'}" for name, flag in flags.items())
        if state.alarm:
            self._block(
                "no alarm", state.alarm, "none", "clear the cause and reset the drive", "the drive has an alarm"
            )
        elif not state.homed:
            remedy = "home the axis at the drive, then repeat"
            self._block("home position known", said, "homed", remedy, "the axis has no home position")
        elif state.moving:
            self._block("at rest", said, "not moving", "wait until it stands, then repeat", "the axis moves")
        else:
            self.orders.add("state of the drive", "held", said)
        order = next((point for point in self.orders.findings.points if point.what == "word order"), None)
        if order is not None and order.verdict == "not tried":
            self.orders.blocked = (
                "the word order is not known, so that a target might be another angle: jog the axis, then repeat"
            )

    def _block(self, what: str, found: str, expected: str, remedy: str, why: str) -> None:
        """A finding after which no further order is given."""
        self.orders.add(what, "differs", found, expected, remedy)
        self.orders.blocked = why

    def _turn(self) -> None:
        """A degree and back, with its read-back; the same order twice moves nothing."""
        axis = axis_of(self.orders.target)
        start = axis.position()
        goal = self._goal(start, TURN_DEG)
        what = "turns by a degree and reads it back"
        text = (
            f"the drive is enabled and the axis turns from {start:.3f}° to {goal:.3f}° at {self._speed:g}°/s, and back"
        )
        if not self.orders.consent("MOVE", text, what):
            return
        self.orders.moving()
        turned = self._moved(axis, goal, start)
        if turned is None:
            return
        ratio, ordered = turned / (goal - start), f"{goal - start:g}°"
        if abs(turned - (goal - start)) > max(SCALE * abs(goal - start), 2.0 * axis.resolution_deg):
            found = f"feedback_position changed by {turned:.4g}° for {ordered}"
            remedy = f"the scale of target or of feedback_position is wrong by {ratio:.4g}: compare both with the drive's display"
            self._block(what, found, ordered, remedy, "scales of target and position differ")
            axis.stop()
            return
        self.orders.add(what, "held", f"{turned:.4f}°", ordered)
        typed = self.orders.person.ask("By how many degrees has the table turned, as you saw it? (Enter: skip)").strip()
        self._seen(typed, turned)
        before = axis.position()
        axis.done()
        axis.start(goal)
        time.sleep(0.5)
        again = abs(axis.position() - before)
        self.orders.judge(
            "the same order again moves nothing",
            f"{again:.4f}°",
            "0°",
            good=again < max(STEADY_DEG, axis.resolution_deg),
        )
        axis.done()
        back = self._moved(axis, start, goal)
        if back is not None:
            off = axis.position() - start
            self.orders.judge(
                "comes back", f"{off:+.4f}° off", "0°", good=abs(off) <= max(STEADY_DEG, axis.resolution_deg)
            )

    def _seen(self, typed: str, turned: float) -> None:
        what = "turns as seen by a person"
        try:
            seen = abs(float(typed.replace(",", ".")))
        except ValueError:
            self.orders.add(what, "not tried", "", f"{abs(turned):.3g}°")
            return
        held = abs(seen - abs(turned)) <= max(0.2 * abs(turned), 0.2)
        remedy = (
            f"the scales of target, feedback_position and speed are wrong by {seen / abs(turned):.3g}: enter the gear"
        )
        self.orders.judge(what, f"{seen:g}°", f"{abs(turned):.3g}°", remedy, good=held)
        if not held and turned:
            for name in ("target", "feedback_position", "command_position"):
                if self.orders.target.profile.has(name):
                    scale = self.orders.target.profile.register(name).scale
                    self.orders.findings.change(name, "scale", scale * seen / abs(turned))

    def _stop(self) -> None:
        axis = axis_of(self.orders.target)
        start = axis.position()
        goal = self._goal(start, STOPPED_DEG * max(1.0, self._speed))
        what = "stops on its way and forgets the rest"
        text = f"the axis sets out for {goal:.3f}° and is stopped after {STOP_AFTER_S:g} s"
        if not self.orders.consent("STOP", text, what):
            return
        self.orders.moving()
        axis.start(goal)
        time.sleep(STOP_AFTER_S)
        axis.stop()
        _await_rest(axis)
        stood = axis.position()
        time.sleep(1.0)
        crept, left = abs(axis.position() - stood), abs(goal - stood)
        held = left > STEADY_DEG and crept < STEADY_DEG
        found = f"stands {left:.3f}° before the target" + (f", creeps by {crept:.3f}°" if crept >= STEADY_DEG else "")
        self.orders.judge(what, found, "stands before the target", "do not use this drive in a station", good=held)
        axis.done()
        self._moved(axis, start, stood)

    def _interlock(self) -> None:
        """Check the state of the drive while a person holds its emergency stop."""
        what = "reports its emergency stop"
        text = "press the emergency stop of the drive, then type the word; nothing is ordered"
        before = axis_of(self.orders.target).state()
        if not self.orders.consent("PRESSED", text, what):
            return
        state = axis_of(self.orders.target).state()
        if not state.alarm and not before.ready:
            self.orders.add(what, "not tried", "no alarm, and the drive was not ready before either; allow MOVE first")
            return
        stopped = bool(state.alarm) or not state.ready
        found = state.alarm or ("ready, no alarm" if state.ready else "not ready")
        self.orders.judge(what, found, "an alarm, or not ready", "check the wiring of the stop", good=stopped)
        self.orders.person.ask("Release the emergency stop and reset the drive, then press Enter.")

    def _lost_link(self) -> None:
        """The link is cut during a slow move: does the drive stop by itself, and when."""
        what = f"stops by itself within {self.silence_s:g} s without a link"
        target = self.orders.target
        start = axis_of(target).position()
        speed = max(limits_of_orders(target.profile, 2.0 / self.silence_s).speed_deg_s, 1e-3)
        goal = self._goal(start, speed * (self.silence_s + MARGIN_S))
        text = (
            f"the axis sets out for {goal:.3f}° at {speed:.3g}°/s, then the link is cut for {self.silence_s:g} s; this shows the "
            "drive's own time-out, on which the station relies if its computer fails"
        )
        if not self.orders.consent("LINK", text, what):
            return
        self.orders.moving()
        axis = axis_of(target, speed)
        axis.start(goal)
        begun = axis.position()
        set_out = time.monotonic()
        target.link.close()
        time.sleep(self.silence_s)
        axis = self.orders.again(lambda: axis_of(target, speed))
        state, position = axis.state(), axis.position()
        seconds = time.monotonic() - set_out
        travelled = abs(position - begun)
        if state.moving or abs(position - goal) <= STEADY_DEG:
            found = f"still {'moving' if state.moving else 'went to its target'} after {seconds:.0f} s"
            remedy = "set the communication time-out of the drive; else nothing stops it when the computer fails"
            self.orders.add(what, "differs", found, "stopped", remedy)
        else:
            self.orders.add(what, "held", f"stopped about {travelled / speed:.0f} s after the last request", "stopped")
        axis.stop()
        _await_rest(axis)
        home = axis_of(target)
        self._moved(home, start, home.position())

    @property
    def _speed(self) -> float:
        return limits_of_orders(self.orders.target.profile).speed_deg_s

    def _goal(self, start: float, turn: float) -> float:
        """A target that far from the start, inside the limits of the profile; in whole thousandths."""
        low, high = limits_of_orders(self.orders.target.profile).outer_deg
        goal = start + turn if start + turn <= high else start - turn
        if not low <= goal <= high:
            raise StationRefused(f"axis: no target {turn:g}° from {start:g}° inside {low:g}° to {high:g}°")
        return round(goal, 3)

    def _moved(self, axis: TableAxis, goal: float, start: float) -> float | None:
        """Moves to ``goal`` and gives the change of the position; a runaway axis is stopped and reported."""
        seconds = axis.start(goal)
        end = time.monotonic() + seconds + MARGIN_S
        while not axis.arrived():
            gone = abs(axis.position() - start)
            if gone > RUNAWAY * abs(goal - start) + STEADY_DEG:
                axis.stop()
                remedy = "the scale of target is too large, or that of feedback_position"
                what, ordered = "turns no further than ordered", f"{abs(goal - start):g}°"
                self._block(what, f"{gone:.3g}°", ordered, remedy, "the axis went further than ordered")
                return None
            if time.monotonic() > end:
                axis.stop()
                self.orders.add("arrives in time", "differs", f"not in {seconds + MARGIN_S:.0f} s", f"{seconds:.1f} s")
                return None
            time.sleep(POLL_S)
        axis.done()
        return axis.position() - start


def _await_rest(axis: TableAxis) -> None:
    end = time.monotonic() + MARGIN_S
    while axis.state().moving and time.monotonic() < end:
        time.sleep(POLL_S)
