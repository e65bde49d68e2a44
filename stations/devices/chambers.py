"""Chambers by the family of their controllers."""

from __future__ import annotations

from typing import ClassVar

from schemas.errors import OperatorNeeded
from stations.devices.chamber import AUTOMATIC, ThermalChamber

RUNNING = {"runs", "paused", "program_runs", "program_holds", "holds", "start_timed"}
CELSIUS = "celsius"


def _refuse_program(name: str, state: str) -> None:
    """A program that somebody started is not ended from here."""
    if state in RUNNING:
        raise OperatorNeeded(
            f"{name}: the controller's own program is in state {state}, none is needed; end it at the panel"
        )


class SetPointChamber(ThermalChamber):
    """A controller that keeps its set point and has nothing else to say; with ``actual_mode`` it must be ``automatic``."""

    def mode(self) -> str:
        """The actual mode, the mode that was set, or automatic where the controller tells none."""
        told = next((name for name in ("actual_mode", "mode") if self._values.has(name)), "")
        return self._values.text(told) if told else AUTOMATIC

    def require_ready(self) -> None:
        """Nothing: there is nothing that such a controller could tell."""


class F4TChamber(ThermalChamber):
    """Watlow F4T: floats, a mode of its own, programs, alarms."""

    needs: ClassVar[tuple[str, ...]] = (
        "temperature", "set_point", "set_point_low", "set_point_high", "mode", "actual_mode", "alarm_1", "temperature_unit",
        "program_state", "program_end",
    )  # fmt: skip

    def mode(self) -> str:
        """The actual mode of the loop."""
        return self._values.text("actual_mode")

    def require_ready(self) -> None:
        """Degrees Celsius, no alarm, no program."""
        unit, alarm = self._values.text("temperature_unit"), self._values.text("alarm_1")
        if unit != CELSIUS:
            self.refuse(f"shows {unit}", CELSIUS, "set the controller's unit")
        if not alarm.startswith("inactive"):
            raise OperatorNeeded(f"{self.name}: alarm 1 in state {alarm}, none is needed; clear its cause at the panel")
        _refuse_program(self.name, self._values.text("program_state"))

    def off(self) -> None:
        """Ends a program that runs, then switches the loop off."""
        if self._values.text("program_state") in RUNNING:
            self._values.write("program_end", "act")
        super().off()


class F4Chamber(ThermalChamber):
    """Watlow F4: whole numbers in the controller's own decimals; a static set point, or a program."""

    needs: ClassVar[tuple[str, ...]] = (
        "temperature", "set_point", "set_point_low", "set_point_high", "decimals", "status", "temperature_unit", "program_end",
    )  # fmt: skip

    def mode(self) -> str:
        """Automatic while the set point is static: the F4 has no register that switches its loop off."""
        state = self._values.text("status")
        return AUTOMATIC if state.startswith("static") else state

    def require_ready(self) -> None:
        """Degrees Celsius, no program."""
        unit = self._values.text("temperature_unit")
        if unit != CELSIUS:
            self.refuse(f"shows {unit}", CELSIUS, "set the controller's unit")
        _refuse_program(self.name, self._values.text("status"))

    def off(self) -> None:
        """Ends a program that runs; the set point itself cannot be switched off, which is told."""
        if self._values.text("status") in RUNNING:
            self._values.write("program_end", "act")
        super().off()


class BinderChamber(ThermalChamber):
    """Binder MB1 and MB2: an active set point to read, others to write."""

    written: ClassVar[tuple[str, ...]] = ("set_point_basic", "set_point_manual")
    needs: ClassVar[tuple[str, ...]] = ("temperature", "set_point", "set_point_manual")

    def mode(self) -> str:
        """Basic and manual operation both keep a set point; the MB2 tells no mode."""
        found = self._values.text("mode") if self._values.has("mode") else "manual"
        return AUTOMATIC if found in {"basic", "manual"} else found

    def require_ready(self) -> None:
        """No program."""
        if self.mode() == "program":
            _refuse_program(self.name, "runs")

    def order(self, temperature: float) -> None:
        """Writes every set point that the controller has: sources disagree which is of which mode."""
        for name in self.written:
            if self._values.has(name):
                self._values.write(name, temperature)


class EurothermChamber(ThermalChamber):
    """Eurotherm 3200: the remote set point alone, which wears no memory, and only then switched over to it."""

    needs: ClassVar[tuple[str, ...]] = ("temperature", "set_point", "remote_enable", "program_status")

    def mode(self) -> str:
        """Automatic while the remote set point is the one that counts."""
        state = self._values.text("remote_enable")
        return AUTOMATIC if state == "remote" else state

    def require_ready(self) -> None:
        """No program."""
        _refuse_program(self.name, self._values.text("program_status"))

    def order(self, temperature: float) -> None:
        """The remote set point first, so that switching over jumps nowhere."""
        self._values.write("set_point", temperature)
        if self._values.text("remote_enable") != "remote":
            self._values.write("remote_enable", "remote")


class P300Chamber(ThermalChamber):
    """ESPEC P300: lines of text, constant operation."""

    needs: ClassVar[tuple[str, ...]] = ("temperature", "set_point", "set_point_low", "set_point_high", "mode", "alarms")
    running: ClassVar[str] = "CONSTANT"
    standing: ClassVar[str] = "STANDBY"

    def mode(self) -> str:
        """OFF, STANDBY, CONSTANT, or RUN while a program does."""
        return self._values.text("mode")

    def require_ready(self) -> None:
        """No alarm, no program."""
        count = int(self._values.number("alarms"))
        if count:
            raise OperatorNeeded(f"{self.name}: {count} alarms, none is needed; clear their cause at the panel")
        if self.mode().startswith(("RUN", "RMT")):
            _refuse_program(self.name, "runs")

    def order(self, temperature: float) -> None:
        """The set point first, then constant operation where the chamber stands by."""
        self._values.write("set_point", temperature)
        if self.mode() != self.running:
            self._values.write("mode", self.running)
