"""Outcome of a capture under each simulated fault: the cases, their execution, and the page of results.

The reference is the true state of the plant: every mean of an accepted unit is compared with the true output of the unit in
the true pose and at the true temperature. A mean that differs is bad data, whatever the station reports.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd
from small_station import QUIET, MemorySink, lot_of, quiet_progress

from inertial import poses
from pipelines.capture.capture import capture
from pipelines.schedule.steps import steps
from pipelines.stages.reduce import reduce
from pipelines.stages.validate import validate
from pipelines.tables.summaries import summarised
from schemas.errors import StationError
from schemas.event import MemoryLog
from schemas.fault import parse_fault
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station
from stations.opening import make_plant, serve_plant
from stations.plant.device import PlantDevices
from stations.plant.faults.catalogue import kinds
from stations.plant.plant import Plant

UNITS = 3
FAR_UG = 100.0  # limit of the error of a mean; quiet devices in a station without faults stay below 10 µg
RECOVERED, UNIT, RUN = "recovered", "unit refused", "run refused"


@dataclass(frozen=True)
class Case:
    """A fault and its required outcome. ``says`` is a part of the message to the operator."""

    fault: str
    outcome: str
    says: str = ""
    spoilt: bool = False
    temperatures: tuple[float, ...] = (25.0, 45.0)

    @property
    def kind(self) -> str:
        return parse_fault(self.fault).kind

    @property
    def of_the_second_soak(self) -> bool:
        """Whether the fault begins, or shows, no earlier than in the second soak."""
        return parse_fault(self.fault).at_s >= SOAKING or any(name in self.fault for name in SLOW_TO_SHOW)


@dataclass
class CaseResult:
    """The outcome of a case."""

    outcome: str
    message: str
    status: int
    refused: list[str]
    records: int
    planned: int
    spoilt: list[str] = field(default_factory=list)
    bad: list[str] = field(default_factory=list)


def recipe_of(temperatures: tuple[float, ...]) -> Recipe:
    plan = [Pose(name=f"p{i}", outer_deg=o, inner_deg=n) for i, (o, n) in enumerate(poses.plan("six").tolist())]
    return Recipe(
        name="matrix",
        device="ADXL355",
        local_gravity_m_s2=9.80665,
        temperatures_C=list(temperatures),
        poses=plan,
        verification=[Pose(name="v0", outer_deg=70.0, inner_deg=-30.0)],
        static_pose=Pose(name="up", outer_deg=0.0, inner_deg=0.0),
        dwell_s=2.0,
        rate_hz=100.0,
        soak_min_s=300.0,
        allow_short_soak=True,
    )


def station_under(fault: str) -> StationConfig:
    """The built-in station with quiet devices, short patience and one fault."""
    config = load_station()
    assert config.simulation is not None
    quiet = config.simulation.model_copy(
        update={"preset_overrides": QUIET, "faults": [parse_fault(fault)] if fault else [], "slot_gradient_K": 0.02}
    )
    patience = config.link.model_copy(update={"timeout_s": 0.15, "read_attempts": 2})
    soak = config.soak.model_copy(update={"limit_s": 3600.0})
    rules = config.suspenders.model_copy(update={"limit_s": 600.0, "attempts": 3})
    return config.model_copy(update={"simulation": quiet, "link": patience, "soak": soak, "suspenders": rules})


def run_case(case: Case) -> CaseResult:
    """Capture under the fault, validation of its data, and comparison of every mean with the truth of the plant."""
    config, lot, recipe = station_under(case.fault), lot_of(UNITS), recipe_of(case.temperatures)
    sink, events, plant = MemorySink(), MemoryLog(), make_plant(station_under(case.fault), lot_of(UNITS))
    message, status = "", 0
    with serve_plant(config, lot, plant) as station:
        try:
            capture(station, recipe, lot, sink, progress=quiet_progress, events=events)
        except StationError as problem:
            message, status = str(problem), problem.exit_status
    planned = len(steps(recipe))
    spoilt = [event.reason for event in events.recorded() if event.kind in {"spoilt", "suspended"}]
    if not sink.records:
        return CaseResult(RUN, message, status, [], 0, planned, spoilt)
    readings = sink.all(1)
    summaries = summarised([sink.records[n][0] for n in sorted(sink.records)], readings)
    judged = validate(summaries, readings, lot.units)
    refused = judged.loc[judged["refused"], "unit"].tolist()
    if not message and refused:
        message = judged.loc[judged["refused"], "reason"].iloc[0]
    outcome = RUN if status else UNIT if refused else RECOVERED
    dwells = reduce(summaries, readings, judged, recipe.local_gravity_m_s2)
    bad = list(far_from_the_truth(plant, dwells))
    return CaseResult(outcome, message, status, refused, len(sink.records), planned, spoilt, bad)


def far_from_the_truth(plant: Plant, dwells: pd.DataFrame) -> Iterator[str]:
    """Means of accepted units that differ from the true output; the truth is that of the plant, not of the station."""
    by_serial = {truth.serial: truth for truth in (plant.truth(unit.serial) for unit in lot_of(UNITS).units)}
    for row in dwells.itertuples():
        truth = by_serial[row.unit]
        device = PlantDevices(plant.preset, [truth])
        force = (truth.slot_rotation @ np.array([row.force_x, row.force_y, row.force_z]))[None, None, :]
        true = device.output(force, np.array([[row.unit_C]]))[0, 0]
        measured = np.array([row.out_x, row.out_y, row.out_z]) / plant.preset.scale
        off = 1e6 * float(np.abs(measured - true).max())
        if off > FAR_UG:
            yield f"{row.unit} {row.pose}: {off:.0f} µg"


WITHIN, MOVING, SOAKING, LATE = (
    437.5,
    443.0,
    900.0,
    1500.0,
)  # s: in the third dwell, in the move after it, in the second soak, later
SLOW_TO_SHOW = ("chamber_unsettled", "chamber_overshoot", "frozen_temperature")
"""Faults that a soak shows alone."""

CASES: tuple[Case, ...] = (
    # the wire
    Case(f"time_out:at_s={WITHIN}", RECOVERED),
    Case(f"time_out:at_s={WITHIN}:frames=500", RUN, "no answer to"),
    Case(f"time_out:at_s={MOVING}", RECOVERED),
    Case(f"delay:at_s={WITHIN}:frames=5:delay_s=0.05", RECOVERED),
    Case(f"reset:at_s={WITHIN}", RECOVERED),
    Case(f"reset:at_s={WITHIN}:frames=500", RUN, "check power, network and port"),
    Case(f"half_open:at_s={WITHIN}", RECOVERED),
    Case(f"late_reply:at_s={WITHIN}", RECOVERED),
    Case(f"other_transaction:at_s={WITHIN}", RECOVERED),
    Case(f"truncated:at_s={WITHIN}", RECOVERED),
    Case(f"byte_garbage:at_s={WITHIN}", RECOVERED),
    Case(f"byte_garbage:at_s={MOVING}:frames=200", RUN, "check gateway and cable"),
    # answers of devices
    Case(f"silent:at_s={WITHIN}:serial=U001", UNIT, "slot 1: no answer"),
    Case(f"silent:at_s={WITHIN}:device=reader:for_s=15", RECOVERED, spoilt=True),
    Case(f"silent:at_s={WITHIN}:device=chamber", RUN, "chamber"),
    Case(f"mute:at_s={WITHIN}:serial=U001", UNIT, "slot 1: no answer"),
    Case(f"mute:at_s={WITHIN}:device=reader:for_s=15", RECOVERED, spoilt=True),
    Case(f"mute:at_s={SOAKING}:device=chamber", RUN, "no answer to 'read chamber"),
    Case(f"exception_code:at_s={WITHIN}:serial=U001:code=6", UNIT, "slot 1: implausible answer"),
    Case(f"exception_code:at_s={WITHIN}:device=reader", RUN, "exception 4 (device failure)"),
    Case(f"exception_code:at_s={MOVING}:device=outer:code=2", RUN, "exception 2"),
    Case(f"exceptions_off:at_s={WITHIN}:serial=U001", UNIT, "slot 1: implausible answer"),
    Case(f"exceptions_off:at_s={WITHIN}:device=outer", RUN, "outer axis: stands at"),
    Case(f"exceptions_off:at_s={WITHIN}:device=chamber", RUN, "check the controller's panel"),
    Case(f"exceptions_off:at_s={WITHIN}:device=reader", RUN, "sampling is running, stopped is needed"),
    Case(f"partial_write:at_s={WITHIN}:device=outer", RUN, "direct_data"),
    Case(f"partial_write:at_s={WITHIN}:device=chamber", RUN, "write chamber set_point"),
    Case(f"swapped_words:at_s={WITHIN}:device=outer", RUN, "outer axis"),
    Case(f"swapped_words:at_s={WITHIN}:device=chamber", RUN, "chamber"),
    Case(f"swapped_words:at_s={WITHIN}:device=reader", RUN, "check supply, sensors, word order"),
    Case(f"swapped_words:at_s={WITHIN}:serial=U001", UNIT, "slot 1: implausible answer"),
    Case("swapped_words:serial=U001", UNIT, "slot 1: implausible answer"),
    Case(f"garbage:at_s={WITHIN}:device=inner", RUN, "inner axis"),
    Case(f"garbage:at_s={WITHIN}:device=chamber", RUN, "chamber"),
    Case(f"garbage:at_s={WITHIN}:device=reader", RUN, "reader"),
    Case(f"garbage:at_s={WITHIN}:serial=U001", UNIT, "slot 1: implausible answer"),
    # the table
    Case(f"stuck_encoder:at_s={WITHIN}:device=outer", RUN, "outer axis: stands at"),
    Case(f"stuck_encoder:at_s={MOVING}:device=outer", RUN, "outer axis: stands at"),
    Case(f"backlash:at_s={WITHIN}:device=outer", RUN, "check zero and gears"),
    Case("backlash:device=inner", RUN, "check zero and gears"),
    Case(f"table_stall:at_s={MOVING}:device=outer", RUN, "axis at rest is needed"),
    Case(f"table_stall:at_s={MOVING}:device=outer:for_s=20", RECOVERED),
    Case(f"lost_home:at_s={WITHIN}:device=outer", RUN, "home the axis"),
    Case(f"lost_home:at_s={WITHIN}:device=inner:admitted=0", RUN, "its zero is lost"),
    Case(f"lost_home:at_s={MOVING}:device=outer:admitted=0", RUN, "outer axis: stands at"),
    # the chamber
    Case(f"chamber_unsettled:at_s={WITHIN}", RUN, "soak: a device at"),
    Case("chamber_overshoot", RECOVERED),
    Case(f"chamber_power:at_s={SOAKING}", RUN, "soak: a device at"),
    Case(f"chamber_power:at_s={SOAKING}:for_s=300", RECOVERED),
    Case(f"frozen_temperature:at_s={WITHIN}:serial=U001", UNIT, "slot 1: does not settle at 45"),
    Case(f"frozen_temperature:at_s={WITHIN}:device=reader", RUN, "soak: a device at"),
    Case(f"frozen_temperature:at_s={WITHIN}:device=chamber", RUN, "the chamber's air is at", spoilt=True),
    # the devices under test and their reader
    Case(f"dead:at_s={WITHIN}:serial=U001", UNIT, "constant output"),
    Case("swapped_slots:serial=U001", RUN, "'U002' sits there, 'U001' is needed"),
    Case(f"swapped_slots:at_s={WITHIN}:serial=U001", RUN, "'U001' is no longer there"),
    Case(f"fifo_overflow:at_s={WITHIN}:serial=U001", RECOVERED, spoilt=True),
    Case(f"dropped_samples:at_s={WITHIN}", RECOVERED, spoilt=True),
    Case(f"dropped_samples:at_s={WITHIN}:numbered=0", RECOVERED, spoilt=True),
    Case(f"supply_sag:at_s={WITHIN}:serial=U001", UNIT, "supply out of tolerance", spoilt=True),
    Case(f"supply_sag:at_s={WITHIN}:device=reader:for_s=60", RECOVERED, spoilt=True),
    # environment of the station
    Case(f"clock_jump:at_s={WITHIN}", RECOVERED, spoilt=True),
    Case(f"clock_jump:at_s={WITHIN}:step_s=-30", RECOVERED, spoilt=True),
    Case(f"clock_jump:at_s={SOAKING}:step_s=3000", RECOVERED, spoilt=True),
    Case(f"door:at_s={WITHIN}:for_s=100", RECOVERED, spoilt=True),
    Case(f"door:at_s={WITHIN}", RUN, "the chamber's door is open", spoilt=True),
    Case(f"vibration:at_s={WITHIN}:for_s=30", RECOVERED, spoilt=True),
    Case(f"vibration:at_s={WITHIN}", RUN, "vibration", spoilt=True),
    Case(f"emergency_stop:at_s={WITHIN}", RUN, "the emergency stop is pressed"),
    Case(f"emergency_stop:at_s={MOVING}:for_s=2000", RUN, "the emergency stop is pressed"),
)


PAGE = Path(__file__).resolve().parents[1] / "docs" / "reference" / "faults.md"
HEAD = """\
# Simulated faults and their outcome

This page lists the outcome of a run under each simulated fault. `python tests/fault_matrix.py` writes it from the test results;
the tests check every row. A fault is defined in a station file or in a recipe
(`faults = [{ kind = "door", at_s = 437.5, for_s = 100 }]`), on the command line
(`tumbleline run --fault door:at_s=437.5:for_s=100`), or in a test. Each row is a capture of three units at two temperatures. The
fault starts within the third dwell (437.5 s), in the move after it (443 s), in the second soak (900 s), or with the run.

- **recovered**: the run was completed, and every mean of every unit is within 100 µg of the true value of the simulation.
  *Measured again* means that affected dwells were discarded and repeated, with the reason in the journal of the run
  (`tumbleline show RUN events`).
- **unit refused**: the run was completed; the affected unit gets no coefficients, no grade and no certificate, the results of
  the others are correct.
- **run refused**: the run ended with exit status 3 and this message; finished records are kept, and the same command resumes
  the run.

Faults of test equipment (exciter, shock machine, centrifuge) are not in the matrix: a spoilt recording is discarded and repeated,
an abort, an open guard door, an overspeed, a drive that runs away or a loose cable of the reference ends the run for a person,
and a unit whose cable is off has no figure (`test_equipment_faults`).

"""


def row(case: Case, result: CaseResult) -> str:
    """The row of a case in the page."""
    fault = parse_fault(case.fault)
    figures = ", ".join(f"{name} {value:g}" for name, value in fault.figures.items())
    target = "a unit" if fault.serial else fault.device or "the station"
    start = "with the run" if fault.at_s == 0.0 else f"{fault.at_s:g} s"
    duration = "" if fault.for_s is None else f", for {fault.for_s:g} s"
    again = " (measured again)" if result.spoilt and result.outcome == RECOVERED else ""
    message = f"…{case.says}…" if case.says else ""
    return f"| `{fault.kind}` | {target} | {start}{duration} | {figures} | {result.outcome}{again} | {message} |"


def page(rows: list[str]) -> str:
    """The complete page."""
    descriptions = [f"| `{name}` | {kind.meaning} |" for name, kind in kinds().items()]
    parts = [
        HEAD + "## Outcomes\n",
        "| fault | target | start | figures | outcome | part of the message |",
        "|---|---|---|---|---|---|",
        *rows,
        "",
        HOST,
        "## Kinds of faults\n",
        "| kind | description |",
        "|---|---|",
        *descriptions,
        "",
    ]
    return "\n".join(parts)


HOST = """\
## Faults of the computer

| fault | outcome | test |
|---|---|---|
| disk full, at any write | refused with exit status 2; with free space the same command resumes | `test_full_disk` |
| killed (SIGKILL) at every stage boundary | the same command gives the same bytes; no dwell is measured twice | `test_killed` |
| killed at 50 random times of the capture | as above, bit by bit | `test_killed` |
"""


if __name__ == "__main__":
    PAGE.write_text(page([row(case, run_case(case)) for case in CASES]), encoding="utf-8")
