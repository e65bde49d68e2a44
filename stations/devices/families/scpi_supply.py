"""Programmable power supplies that speak SCPI; the nominal setting of the devices is in the supply's memory 1."""

import math

from schemas.errors import OperatorNeeded, StationRefused
from stations.clock import Clock
from stations.devices.commands import Values
from stations.devices.equipment import Equipment

NOMINAL = 1.0  # the memory that holds the nominal setting
SETTLE_S = 1.0
FARTHEST = 0.5  # share of the nominal voltage by which an order may differ from it, as procedures may ask
ABOVE = 0.2  # share above it where the station's file states no absolute maximum
QUEUE = 50  # errors that are read out of a supply before its first order; the queues of real supplies hold 10 to 30
REMEDY = "check limits and memory 1 of the supply"
REACHED = 0.01  # share of the order by which the measured voltage may differ
RIPPLE_REACHED = 0.02  # of the amplitude of a ripple


class ScpiSupply(Equipment):
    """Sets the voltage of the devices and measures it; an error in the supply's queue refuses the order."""

    needs = ("voltage", "measured", "output", "recall", "error")

    def __init__(self, values: Values, clock: Clock) -> None:
        super().__init__(values, clock)
        self._nominal_V = 0.0
        self._changed = True  # the setting after an earlier run is not known
        self._rippled = False

    def set_voltage(self, volt: float) -> float:
        """Sets the voltage, V, and returns its ratio to the nominal one.

        Raises StationRefused: the supply reports an error, its memory 1 holds no voltage, or the order is far from that
            voltage: a recipe that was written for devices with another supply would destroy these.
        Raises OperatorNeeded: the measured voltage is not that which was set.
        """
        self._refuse_beyond(volt, "supplies_V")
        if self._rippled:
            self._recall()
        self._changed = True
        self.values.write("voltage", volt)
        self.refuse_error(f"{volt:g} V", REMEDY)
        self.clock.sleep(SETTLE_S)
        measured = self.values.number("measured")
        if not abs(measured - volt) <= REACHED * volt:
            self._recall()
            raise OperatorNeeded(
                f"{self.name}: {measured:.4g} V measured, {volt:g} V was set; check current limit and wiring, then give the "
                "command again"
            )
        return volt / self._nominal_V

    def set_ripple(self, volt: float, hertz: float) -> None:
        """Adds a sine of ``volt`` V (peak) at ``hertz`` Hz to the nominal voltage; 0 V takes it off.

        Raises StationRefused: the supply reports an error, or the peak is far from the nominal voltage.
        Raises OperatorNeeded: the supply does not measure the ripple that was set.
        """
        self._refuse_beyond(self._nominal() + volt, "ripple_V")
        self.stand_by()  # after records at another voltage, or with another ripple
        self._changed = self._rippled = True
        self.write_all(ripple_frequency=hertz, ripple=volt)
        self.refuse_error(f"a ripple of {volt:g} V at {hertz:g} Hz", REMEDY)
        self.clock.sleep(SETTLE_S)
        measured = math.sqrt(2.0) * self.values.number("measured_ripple")
        if volt > 0.0 and not abs(measured - volt) <= RIPPLE_REACHED * volt:
            self._recall()
            raise OperatorNeeded(
                f"{self.name}: ripple of {measured:.4g} V at {hertz:g} Hz measured, {volt:g} V was set; check capacitors at the "
                "supply and its bandwidth, then give the command again"
            )

    def _nominal(self) -> float:
        """The nominal voltage of the devices, V, from the memory of the supply."""
        if self._nominal_V <= 0.0:
            self._forget_errors()
            self._recall()
            nominal = self.values.number("voltage")
            if not nominal > 0.0:
                raise StationRefused(
                    f"{self.name}: memory 1 holds {nominal:g} V, the nominal voltage of the devices is needed; store it there"
                )
            self._nominal_V = nominal
        return self._nominal_V

    def _refuse_beyond(self, volt: float, key: str) -> None:
        """Refuse a voltage far from the nominal one, or above the absolute maximum; ``key`` of the recipe asked for it."""
        if not abs(volt / self._nominal() - 1.0) <= FARTHEST:
            raise StationRefused(
                f"{self.name}: {volt:g} V was ordered, at most {100.0 * FARTHEST:g} % from the nominal {self._nominal_V:g} V of "
                f"the devices (memory 1) is allowed; correct {key} of the recipe"
            )
        stated = self.values.profile.stated.get("voltage")
        most = (1.0 + ABOVE) * self._nominal_V if stated is None else stated
        if not volt <= most:
            raise StationRefused(
                f"{self.name}: {volt:g} V was ordered, at most {most:.4g} V is allowed"
                + (
                    f" (a fifth above the nominal {self._nominal_V:g} V, since the station's file states no absolute maximum); "
                    f"add maximum = {{ voltage = … }} to its power supply, or correct {key} of the recipe"
                    if stated is None
                    else f" by maximum.voltage in the station's file; correct {key} of the recipe"
                )
            )

    def stand_by(self) -> None:
        """The nominal voltage."""
        if self._changed:
            self._recall()

    def make_safe(self) -> None:
        """The nominal voltage, with the output on: the devices keep their supply."""
        self._recall()

    def _recall(self) -> None:
        if self.values.has("ripple"):
            self.values.write("ripple", 0.0)
        self.write_all(recall=NOMINAL, output="ON")
        self.refuse_error("the nominal setting", REMEDY)
        self._changed = self._rippled = False

    def _forget_errors(self) -> None:
        """Read the errors out that earlier users of the supply left: they are not those of our orders."""
        for _ in range(QUEUE):
            if self.values.number("error") == 0.0:
                return
        raise StationRefused(
            f"{self.name}: {QUEUE} errors were read and its queue is not empty, an end is needed; restart the supply"
        )
