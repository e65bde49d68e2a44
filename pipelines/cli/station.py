"""``tumbleline station``: profiles, a look at every register, and the simulated station served alone."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pipelines.cli.options import JsonOption, console, error_console, print_json, print_table

if TYPE_CHECKING:
    from schemas.recipe import Lot
    from stations.serving import Served

app = typer.Typer(
    help="Check, serve and describe stations.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

StationOption = Annotated[
    Path | None,
    typer.Option("--station", metavar="FILE", help="The station; the built-in simulated one by default."),
]
DeviceOption = Annotated[str, typer.Option("--device", help="Preset of the simulated devices under test.")]
UnitsOption = Annotated[
    int, typer.Option("--units", min=1, max=32, help="How many simulated devices sit in the slots.")
]


@app.command()
def serve(
    station: StationOption = None,
    host: Annotated[str, typer.Option("--host", help="Interface to listen on.")] = "127.0.0.1",
    port: Annotated[int, typer.Option("--port", min=0, max=65535, help="TCP port; 0 takes a free one.")] = 5020,
    speed: Annotated[
        float, typer.Option("--speed", min=0.001, max=1000.0, help="Seconds of the station per second.")
    ] = 1.0,
    device: DeviceOption = "ADXL355",
    units: UnitsOption = 8,
    seed: Annotated[int, typer.Option("--seed", min=0, help="Seed of the devices.")] = 1,
    *,
    as_json: JsonOption = False,
) -> None:
    """Serve the simulated station over Modbus TCP until interrupted, so that any Modbus client can read it."""
    import signal
    import threading

    from schemas.station import load_station
    from stations.serving import serve as run
    from stations.serving import served

    config, stop = load_station(station), threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: stop.set())
    signal.signal(signal.SIGINT, lambda *_: stop.set())

    def ready(at: str, port_found: int) -> None:
        devices = served(config, list(range(units)))
        if as_json:
            print_json({"host": at, "port": port_found, "devices": [_where(d) for d in devices]})
        else:
            lines = [[d.name, str(d.device_id), d.profile] for d in devices]
            print_table(
                ["device", "id", "profile"], lines, title=f"{config.name} on {at}:{port_found}, speed {speed:g}"
            )
            console().print("stop with Ctrl-C", markup=False)

    run(config, _lot(device, units, seed), host=host, port=port, speed=speed, stop=stop, ready=ready)


@app.command()
def check(
    station: StationOption = None,
    device: DeviceOption = "ADXL355",
    units: UnitsOption = 8,
    *,
    as_json: JsonOption = False,
) -> None:
    """Read every register of every device of a station once; exit 3 when one does not answer."""
    from dataclasses import asdict

    from schemas.errors import STATION
    from schemas.station import load_station
    from stations.serving import look

    readings = look(load_station(station), _lot(device, units, 1))
    faults = [reading for reading in readings if reading.fault]
    if as_json:
        print_json({"ok": not faults, "registers": [asdict(reading) for reading in readings]})
    else:
        lines = [[r.device, r.register, str(r.address), "—" if r.fault else r.value, r.unit] for r in readings]
        print_table(["device", "register", "address", "value", "unit"], lines)
        for reading in faults:
            error_console().print(reading.fault, markup=False)
    raise typer.Exit(STATION if faults else 0)


@app.command()
def profiles(
    name: Annotated[str, typer.Argument(metavar="[PROFILE]", help="One profile, register by register.")] = "",
    *,
    as_json: JsonOption = False,
) -> None:
    """List the register-map profiles, or one of them register by register."""
    from stations.profile_files import load_profile, profile_names

    if name:
        profile = load_profile(name)
        if as_json:
            print_json(profile.model_dump(mode="json"))
            return
        lines = [[r.name, str(r.address), r.type, r.access, r.unit, r.manual] for r in profile.registers]
        print_table(["register", "address", "type", "access", "unit", "manual"], lines, title=profile.model)
        return
    found = [load_profile(one) for one in profile_names()]
    if as_json:
        print_json({"profiles": [p.model_dump(mode="json", exclude={"registers", "groups", "fifo"}) for p in found]})
        return
    lines = [[p.name, p.kind, f"{p.maker} {p.model}", "yes" if p.verified else "no"] for p in found]
    print_table(["profile", "kind", "device", "held against hardware"], lines)


def _lot(device: str, units: int, seed: int) -> Lot:
    """A lot of made-up serial numbers, one per slot."""
    from schemas.recipe import Lot, Unit

    return Lot(units=[Unit(serial=f"SIM{i:04d}", slot=i) for i in range(units)], device=device, seed=seed)


def _where(device: Served) -> dict[str, object]:
    """A device for JSON."""
    return {"name": device.name, "device_id": device.device_id, "profile": device.profile}
