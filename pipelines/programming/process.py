"""The writing of coefficients into devices: archive the memory, write, read back, power cycle, read back, verify.

A unit that fails a step is not certified, and its previously valid copy is unchanged: the older of the two copies is written, and
a device uses it only when it is complete.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.frames import force_from_angles
from pipelines.archive.store import Place
from pipelines.certificates.programmed import add
from pipelines.export.device_block import block_of, pack, unpack
from pipelines.export.polynomials import UnitCalibration
from pipelines.programming.outcome import (
    Choice,
    ProgrammingOutcome,
    require_in_pose,
    require_moved,
    write_offsets_again,
)
from pipelines.programming.supply import BOOT_S, power_cycle, require_safe
from schemas.errors import OperatorNeeded, StationError, StationRefused, TumblelineError, WrongUse
from schemas.recipe import Recipe
from schemas.units import STANDARD_GRAVITY_M_S2
from stations.devices.memory import COPIES
from stations.station import Station

POSES = 2
LARGEST_STEP = 2**15 - 1


@dataclass
class Programmer:
    """The programming of the devices of one run.

    run : its id; recipe : gives poses, dwell time and gravity of the verification
    door_closed : whether the station's rules ask for a closed door
    before_first_write : ends the certificate of a unit before its device changes; returns the number of its next certificate,
        which the block contains, and 0 for a unit that gets none
    saved : called after every step, so that a simulated station can be continued
    """

    station: Station
    root: Place
    run: str
    recipe: Recipe
    choice: Choice
    door_closed: bool
    before_first_write: Callable[[str], int]
    report: Callable[[str], None]
    saved: Callable[[], None]

    def program(self, units: Sequence[tuple[int, UnitCalibration]]) -> list[ProgrammingOutcome]:
        """Writes units (slot, calibration); the outcome of each.

        Raises StationError, LeaseLost, EmergencyStop: the station fails for all units; every unit whose programming has begun
        is recorded as failed.
        """
        slots, clock = self.station.reader.slots, self.station.clock
        outcomes = [ProgrammingOutcome(unit.unit, slot, unit, slots[slot].memory(clock)) for slot, unit in units]
        self._check(outcomes)
        step = "archive the memory"
        try:
            for step, act in (
                ("archive the memory", self._archive), ("write", self._write), ("read back", self._read_back),
            ):  # fmt: skip
                self._each(outcomes, step, act)
            if any(outcome.open for outcome in outcomes):
                step = "power cycle"
                self._power_cycle()
            self._each(outcomes, "read back after the power cycle", self._after_power)
            step = "verify"
            self._verify(outcomes)
        except BaseException as problem:
            self._all_failed(outcomes, step, problem)
            raise
        for outcome in outcomes:
            if outcome.open:
                outcome.outcome = "proved"
                add(self.root, outcome.serial, "proved", {"run": self.run, **outcome.document()})
        self.saved()
        return outcomes

    def _all_failed(self, outcomes: Sequence[ProgrammingOutcome], step: str, problem: BaseException) -> None:
        """Records every unit whose programming has begun as failed; a failing record does not hide the others.

        A beginning without an end counts as failed as well, so a missing record leaves no unit certified.
        """
        for outcome in outcomes:
            if outcome.open and outcome.block is not None:
                try:
                    self._failed(outcome, step, str(problem) or type(problem).__name__)
                except (TumblelineError, OSError) as second:
                    problem.add_note(f"the failure of unit {outcome.serial} could not be recorded either: {second}")

    def _require(self) -> None:
        """Ends the programming where the lease is lost, the emergency stop is pressed or the door is open.

        Called before power and axes change, and after each dwell.
        """
        require_safe(self.station, self.door_closed)

    def _check(self, outcomes: Sequence[ProgrammingOutcome]) -> None:
        """Refuses, before anything is written, units and stations that cannot be verified."""
        reader = self.station.reader
        reader.require_switch()
        self._require()
        for pose in self._poses():
            self.station.table.check(pose.outer_deg, pose.inner_deg)
        if not reader.powered():
            reader.switch("on")
            self.station.clock.sleep(BOOT_S)
        if reader.sampling() == "running":
            reader.stop()
        for outcome in outcomes:
            outcome.memory.require()
            if not reader.slots[outcome.slot].holds(outcome.serial):
                raise OperatorNeeded(
                    f"slot {outcome.slot}: unit {outcome.serial} is not in it; seat the unit, or correct the lot"
                )
            outcome.step_counts = outcome.memory.offset_step if self.choice.with_offsets else 0
            if self.choice.with_offsets and not outcome.step_counts:
                raise WrongUse(
                    f"program: unit {outcome.serial} has no offset registers, they are needed; "
                    "leave --set offset_registers=yes out"
                )

    def _each(
        self, outcomes: Sequence[ProgrammingOutcome], step: str, act: Callable[[ProgrammingOutcome], None]
    ) -> None:
        """A step for every unit that has not failed; a unit that fails does not stop the others."""
        for outcome in outcomes:
            if not outcome.open:
                continue
            self.report(f"{outcome.serial}: {step}")
            self.station.require()
            try:
                act(outcome)
            except (StationError, WrongUse) as problem:
                if outcome.block is None:  # nothing has been written
                    outcome.outcome, outcome.step, outcome.reason = "failed", step, str(problem)
                else:
                    self._failed(outcome, step, str(problem))
            self.saved()

    def _failed(self, outcome: ProgrammingOutcome, step: str, reason: str) -> None:
        outcome.outcome, outcome.step, outcome.reason = "failed", step, reason
        add(
            self.root, outcome.serial, "failed", {"run": self.run, "step": step, "reason": reason, **outcome.document()}
        )

    def _archive(self, outcome: ProgrammingOutcome) -> None:
        """Archives the content of the memory, chooses the copy to write, and records the beginning in the journal."""
        memory, status = outcome.memory, outcome.memory.wait()
        there = {copy: memory.read(copy) for copy in COPIES}
        valid = {copy: block for copy in COPIES if (block := unpack(there[copy])) is not None}
        newest = max(valid, key=lambda copy: valid[copy].sequence, default=None)
        outcome.copy = "b" if newest == "a" else "a"
        if status.erases[outcome.copy] >= status.endurance:
            raise StationRefused(
                f"{memory.name}: copy {outcome.copy.upper()} has {status.erases[outcome.copy]} erasures, {status.endurance} are "
                "specified; the memory is worn out: replace the device"
            )
        block = block_of(
            outcome.unit, self.choice.form, sequence=valid[newest].sequence + 1 if newest else 1, certificate=0,
            date=self.choice.date, offsets=self._offsets(outcome), step=outcome.step_counts,
        )  # fmt: skip
        pack(block)  # coefficients that the block cannot represent are refused while the certificate still holds
        before = {
            "copies": {copy.upper(): content.hex() for copy, content in there.items()},
            "erasures": {copy.upper(): status.erases[copy] for copy in COPIES},
            "offsets": list(memory.offsets()) if memory.offset_step else None,
        }
        outcome.certificate = self.before_first_write(outcome.serial)
        outcome.block = replace(block, certificate=outcome.certificate)
        outcome.content = pack(outcome.block)
        add(self.root, outcome.serial, "begun", {
            "run": self.run, "station": self.station.name, "slot": outcome.slot, "before": before, **outcome.document(),
            "content": outcome.content.hex(),
        })  # fmt: skip

    def _offsets(self, outcome: ProgrammingOutcome) -> tuple[int, int, int]:
        """Steps that bring the output at 25 °C nearest to zero: the registers add, so they get the bias with its sign changed."""
        if not outcome.step_counts:
            return 0, 0, 0
        x, y, z = (
            int(np.clip(round(-float(b) / outcome.step_counts), -LARGEST_STEP, LARGEST_STEP))
            for b in outcome.unit.bias[0]
        )
        return x, y, z

    def _write(self, outcome: ProgrammingOutcome) -> None:
        outcome.memory.program(outcome.copy, outcome.content)
        if outcome.block is not None and outcome.step_counts:
            outcome.memory.set_offsets(outcome.block.offsets)

    def _read_back(self, outcome: ProgrammingOutcome) -> None:
        """Refuses a copy that differs from the written bytes."""
        read_back = outcome.memory.read(outcome.copy)[: len(outcome.content)]
        if read_back != outcome.content:
            offset = next(i for i, (a, b) in enumerate(zip(read_back, outcome.content, strict=True)) if a != b)
            raise StationRefused(
                f"{outcome.memory.name}: copy {outcome.copy.upper()} differs from what was written from byte {offset} on "
                f"({read_back[offset]:#04x}, {outcome.content[offset]:#04x} is needed); replace the device"
            )

    def _power_cycle(self) -> None:
        self.report("power cycle")
        power_cycle(self.station, self.door_closed)

    def _after_power(self, outcome: ProgrammingOutcome) -> None:
        """Refuses a device whose new copy changed, or whose other copy has the larger sequence number."""
        self._read_back(outcome)
        valid = [(block.sequence, copy) for copy in COPIES if (block := unpack(outcome.memory.read(copy))) is not None]
        if max(valid)[1] != outcome.copy:
            raise StationRefused(
                f"{outcome.memory.name}: copy {max(valid)[1].upper()} is the newest after the power cycle, copy "
                f"{outcome.copy.upper()} is needed; replace the device"
            )

    def _poses(self) -> list[Any]:
        poses = list({(p.outer_deg, p.inner_deg): p for p in (*self.recipe.verification, *self.recipe.poses)}.values())
        if len(poses) < POSES:
            raise WrongUse(
                f"program: recipe {self.recipe.name} has {len(poses)} poses, {POSES} are needed to verify; add some"
            )
        return poses[:POSES]

    def _verify(self, outcomes: Sequence[ProgrammingOutcome]) -> None:
        """Two poses: the coefficients in the device, applied to its output, give the force of the pose."""
        for number, pose in enumerate(self._poses()):
            if not any(outcome.open for outcome in outcomes):
                return
            self.report(f"verify in pose {pose.name}")
            self._require()
            self.station.table.move(pose.outer_deg, pose.inner_deg)
            plain = self._means(outcomes)
            if number == 0 and self.choice.with_offsets:
                self._each(outcomes, "write offset registers", write_offsets_again)
                moved = self._means(outcomes)
                self._each(
                    outcomes,
                    "verify offset registers",
                    lambda outcome, a=plain, b=moved: require_moved(
                        outcome, a[outcome.slot], b[outcome.slot], self.choice.tolerance_ug
                    ),
                )
                plain = moved
            outer, inner = self.station.table.angles()
            force = force_from_angles(np.radians(outer), np.radians(inner))
            force = force * self.recipe.local_gravity_m_s2 / STANDARD_GRAVITY_M_S2
            temperatures = self.station.reader.instruments().temperature_C
            self._each(
                outcomes,
                "verify",
                lambda outcome, f=force, m=plain, t=temperatures, p=pose.name: require_in_pose(
                    outcome,
                    p,
                    f,
                    outcome.unit.with_forces(m[outcome.slot], f),
                    t[outcome.slot],
                    self.choice.tolerance_ug,
                ),
            )

    def _means(self, outcomes: Sequence[ProgrammingOutcome]) -> dict[int, Array]:
        """Mean outputs (m,) of the axes with an output by slot, over a dwell of the recipe."""
        reader, clock, recipe = self.station.reader, self.station.clock, self.recipe
        clock.sleep(recipe.settle_s)
        reader.start(recipe.rate_hz)
        clock.sleep(recipe.dwell_s + 2.0 / recipe.rate_hz)
        reader.stop()
        self._require()
        return {
            outcome.slot: reader.slots[outcome.slot].take().outputs.mean(axis=0) for outcome in outcomes if outcome.open
        }
