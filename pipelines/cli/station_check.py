"""``tumbleline station check``: the self-test before a shift."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from inertial.counts import number_of
from pipelines.cli import options
from pipelines.cli.inputs import made_up
from pipelines.cli.options import option
from pipelines.cli.printing import print_json, print_table, remark
from schemas.errors import STATION

if TYPE_CHECKING:
    from schemas.lot import Lot
    from schemas.station import StationConfig
    from stations.self_test import CheckResult
    from stations.serving import RegisterReading


def check(
    station: options.StationOption = None,
    device: options.SimulatedDeviceOption = "ADXL355",
    units: options.SimulatedUnitsOption = 8,
    *,
    registers: Annotated[bool, option("--read-only", "Only read every register once; no motion.")] = False,
    record: options.RecordOption = None,
    as_json: options.JsonOption = False,
) -> None:
    """Test a station before a shift: registers, instruments, moves, noise of every slot, a check standard.

    No run can use the station meanwhile; the test leaves it in its safe state. Exit status 3: a test failed.
    """
    from schemas.station import load_station
    from stations.links.recorder import recorded
    from stations.serving import look

    config = load_station(station)
    with recorded(record, f"station check of {config.name}"):
        readings = look(config, made_up(device, units, 1))
        silent = [reading.fault for reading in readings if reading.fault]
        findings = [] if registers or silent else _tested(config, device, units)
    failed = [*silent, *(finding.message for finding in findings if not finding.ok)]
    if as_json:
        document = {"ok": not failed, "failed": failed, "registers": readings}
        print_json(document if registers else {**document, "checks": findings})
    else:
        _print(readings, findings, registers=registers)
        for message in failed:
            remark(message)
    raise typer.Exit(STATION if failed else 0)


def _tested(config: StationConfig, device: str, units: int) -> list[CheckResult]:
    """The findings of the self-test; results of a check standard within its limits are added to its history."""
    from stations.opening import open_station
    from stations.safety.folder import state_folder
    from stations.self_test import CheckResult, SelfTestBench, keep, read_history

    path = state_folder() / "checks" / f"{config.name}.jsonl"
    history = read_history(path)
    lot = made_up(device, units, 1, repeat=len(history)) if config.kind == "simulated" else _seated(config)
    if lot is None:
        message = "reader: no slot is occupied, at least one unit is needed; seat a unit"
        return [CheckResult("slots", "reader", ok=False, message=message)]
    with open_station(config, lot, run="station check") as opened:
        bench = SelfTestBench(opened, config.self_test, history)
        findings = bench.run()
    controlled = [finding.ok for finding in bench.findings if finding.check in {"offset", "scale"}]
    if bench.standard is not None and controlled and all(controlled):
        keep(path, bench.standard)
    return findings


def _seated(config: StationConfig) -> Lot | None:
    """The units in the slots of hardware, by the serial numbers that they report; None for an empty fixture."""
    from schemas.lot import Lot, Unit
    from stations.overview import looked_at

    with looked_at(config, made_up("hardware", 1, 1)) as look:
        units = [Unit(serial=s.serial or f"slot-{s.slot}", slot=s.slot) for s in look().slots]
    return Lot(units=units, device="hardware") if units else None


def _print(readings: list[RegisterReading], findings: list[CheckResult], *, registers: bool) -> None:
    if registers:
        lines = [[r.device, r.register, str(r.address), "—" if r.fault else r.value, r.unit] for r in readings]
        print_table(["device", "register", "address", "value", "unit"], lines)
        return
    devices = len({reading.device for reading in readings})
    print_table(
        ["", "part", "test", "measured", "limits", "unit"],
        [["✓", number_of(devices, "device"), "registers", f"{len(readings)} read", "", ""], *map(_line, findings)]
        if findings
        else [["✗", number_of(devices, "device"), "registers", "some did not answer", "all", ""]],
    )


def _line(finding: CheckResult) -> list[str]:
    value = finding.value if isinstance(finding.value, str) else f"{finding.value:.4g}"
    sides = ["" if side is None else f"{side:.4g}" for side in (finding.low, finding.high)]
    if finding.high is not None and finding.low == -finding.high:
        allowed = f"± {sides[1]}"
    else:
        allowed = " to ".join(sides) if all(sides) else f"from {sides[0]}" if sides[0] else ""
    return ["✓" if finding.ok else "✗", finding.part, finding.check, value, allowed, finding.unit]
