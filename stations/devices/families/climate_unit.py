"""Climate units at the chamber of the table that a host sets and starts over lines of text, one leg of a profile at a time."""

from collections.abc import Sequence

import numpy as np

from schemas.errors import OperatorNeeded
from stations.devices.equipment import Recording, RecordingEquipment

POLL_S = 10.0
GRACE_S = 60.0
ROOM = 0.0  # the humidity that orders none
TAIL = 0.1  # of the hold, over which what was reached is the mean
REACHED = {"air": (3.0, "°C"), "humidity": (5.0, "%"), "pressure": (30.0, "hPa")}
"""Largest departure from the order; IEC 60068-2-14, -2-30 and -2-13 allow 2 to 3 K, 3 to 5 % and 5 % of the pressure."""
AIR = {"air": 1.0}


class ClimateUnit(RecordingEquipment):
    """Sets temperature, humidity and pressure of the chamber's air; humidity and pressure stay until it vents."""

    needs = ("temperature", "humidity", "pressure", "change", "hold", "start", "vent", "state", "reason", "file")

    def expose(
        self,
        temperature: float,
        humidity: float | None,
        pressure: float,
        change_s: float,
        hold_s: float,
        slots: Sequence[int],
    ) -> Recording:
        """One leg to air at °C, humidity in % (None: that of the room) and pressure in hPa; the reference has these three.

        Raises RecordingSpoilt: the recorder has missed its trigger, and nothing was begun.
        Raises OperatorNeeded: the unit has aborted, or its air did not reach the order: to repeat it would be another exposure.
        """
        self.write_all(temperature=temperature, humidity=ROOM if humidity is None else humidity)
        self.write_all(pressure=pressure, change=change_s, hold=hold_s)
        before = self.values.text("file")
        self.values.write("start", "GO")
        late = f"still runs {GRACE_S:g} s after the end of the leg; check the unit"
        if self.ended(change_s + hold_s + GRACE_S, POLL_S, late) == "ABORT":
            raise OperatorNeeded(
                f"{self.name}: aborted ({self.values.text('reason')}); remove the cause, and give the command again"
            )
        recording = self.recorded(before, slots, "recording of the leg", AIR)
        ordered = (temperature, humidity, pressure)
        last = recording.reference[-max(1, round(TAIL * hold_s * recording.reference_rate_hz)) :]
        for column, (name, (most, unit)) in enumerate(REACHED.items()):
            wanted = ordered[column]
            reached = float(np.mean(last[:, column]))
            if wanted is not None and not abs(reached - wanted) <= most:
                raise OperatorNeeded(
                    f"{self.name}: {name} at {reached:.4g} {unit} at the end of the leg, {wanted:g} ± {most:g} {unit} was "
                    "ordered; check the unit, or give the leg more time"
                )
        return recording

    def make_safe(self) -> None:
        self.values.write("vent", "NOW")
