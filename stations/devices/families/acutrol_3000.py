"""Centrifuges and rate tables that speak as the ACUTROL 3000, with a recorder that leaves a result file."""

from collections.abc import Sequence

from schemas.errors import OperatorNeeded, StationTimeout
from stations.devices.equipment import Recording, RecordingEquipment, RecordingSpoilt

POLL_S = 0.5
PATIENCE_S = 600.0
REACHED = 2e-5  # of the rate, or deg/s below one
STANDING_DEG_S = 0.01
SAME_MOUNTING = 1e-5  # m, or of the direction
OVERSPEED = 1.02  # of the larger of the rate at the start and the ordered one, and a degree a second


class Acutrol(RecordingEquipment):
    """Absolute rates, each read back; standing means below 0.01 °/s, then the interlock opens."""

    needs = (
        "rate", "interlock", "mode", "rate_read", "fault", "record", "direction", "file",
    )  # fmt: skip

    def spin(
        self, rate_deg_s: float, direction: int, seconds: float, slots: Sequence[int], radius_m: float | None = None
    ) -> Recording:
        """A record at a constant rate in °/s; ``direction`` says which way the units are mounted (1 or −1).

        Another mounting is ordered at standstill with the interlock open. ``radius_m`` is the radius of the mounting; a device
        whose profile has no such command is not told.

        Raises OperatorNeeded: the interlock has opened, by guard door or overspeed; or the rate rises beyond the order; or
            another mounting was ordered and is not confirmed: the run continues when it is.
        Raises RecordingSpoilt: the recorder has missed its trigger, or the rate has left its band.
        """
        self._require_no_fault()
        wanted = {"direction": float(direction)}
        if radius_m is not None and self.values.has("radius"):
            wanted["radius"] = radius_m
        self._mount(wanted)
        self.write_all(interlock="close 1", mode="rate 1", rate=rate_deg_s)
        self._wait(rate_deg_s, REACHED * max(rate_deg_s, 1.0))
        before = self.values.text("file")
        self.values.write("record", seconds)
        self.clock.sleep(seconds)
        self._require_no_fault()
        rate = self.values.number("rate_read")
        self._refuse_overspeed(rate, rate_deg_s)
        if not abs(rate - rate_deg_s) <= 10.0 * REACHED * max(rate_deg_s, 1.0):
            raise RecordingSpoilt(
                f"{self.name}: {rate:g} °/s after the record, {rate_deg_s:g} °/s is needed; check the drive"
            )
        return self.recorded(before, slots)

    def _mount(self, wanted: dict[str, float]) -> None:
        """Stops, orders another mounting, and waits until it is confirmed; nothing where the units are mounted so."""
        if self._mounted(wanted):
            return
        self.stop()
        self.write_all(**wanted)
        end = self.clock.now() + PATIENCE_S
        while not self._mounted(wanted):
            if self.clock.now() > end:
                way = "as marked" if wanted["direction"] > 0.0 else "the other way round"
                radius = f" at {wanted['radius']:g} m" if "radius" in wanted else ""
                raise OperatorNeeded(
                    f"{self.name}: mounting not confirmed in {PATIENCE_S:g} s, units mounted {way}{radius} are needed; mount "
                    "them, confirm it at the machine and give the command again"
                )
            self.clock.sleep(POLL_S)

    def _mounted(self, wanted: dict[str, float]) -> bool:
        return all(abs(self.values.number(name) - value) <= SAME_MOUNTING for name, value in wanted.items())

    def stop(self) -> None:
        """Rate 0, waits until it stands, opens the interlock."""
        self.values.write("rate", 0.0)
        self._wait(0.0, STANDING_DEG_S)
        self.values.write("interlock", "open 1")

    def make_safe(self) -> None:
        """Orders rate 0; the interlock opens at standstill by the machine's own logic."""
        self.values.write("rate", 0.0)

    def _wait(self, rate_deg_s: float, band: float) -> None:
        end = self.clock.now() + PATIENCE_S
        start = rate = self.values.number("rate_read")
        while not abs(rate - rate_deg_s) <= band:
            self._require_no_fault()
            self._refuse_overspeed(rate, max(start, rate_deg_s))
            if self.clock.now() > end:
                self.make_safe()
                raise StationTimeout(f"{self.name}: not at {rate_deg_s:g} °/s after {PATIENCE_S:g} s; check the drive")
            self.clock.sleep(POLL_S)
            rate = self.values.number("rate_read")

    def _refuse_overspeed(self, rate: float, most: float) -> None:
        """A drive that runs away: rate 0 and the interlock open, without waiting for its monitor."""
        if rate <= OVERSPEED * most + 1.0:
            return
        self.make_safe()
        self.values.write("interlock", "open 1")
        raise OperatorNeeded(
            f"{self.name}: {rate:.5g} °/s, at most {most:.5g} °/s was ordered: the drive runs away; the interlock was opened; "
            "have the machine inspected"
        )

    def _require_no_fault(self) -> None:
        state = self.values.text("fault")
        if state.startswith("Fault"):
            raise OperatorNeeded(
                f"{self.name}: interlock {state}; remove the cause, reset the interlock and give the command again"
            )
