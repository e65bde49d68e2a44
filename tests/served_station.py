"""A station like one of hardware: the simulated one served on a port, in wall time, and a file of kind modbus for it."""

import shutil
import threading
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

import pytest
import tomlkit
from capture_double import recipe_file
from small_station import lot_of, station_of

from schemas.lot import Lot
from schemas.station import StationConfig
from stations import opening
from stations.plant.journal import Write
from stations.plant.plant import Plant
from stations.serving import serve

QUICK = {
    "safety": {"heartbeat_s": 0.2, "lapse_s": 1.0},
    "soak": {"band_K": 80.0, "rate_K_per_min": 60.0, "window_s": 0.4, "poll_s": 0.1},
    "link": {"timeout_s": 1.0},
    "suspenders": {"poll_s": 0.2, "clear_s": 0.2, "limit_s": 5.0},
}

FAST = {"speed_deg_s": 90.0, "acceleration_deg_s2": 200.0}
"""Limits with which moves in wall time take moments."""

SHORT = (
    ('units = ["A1", "A2", "A3"]', 'units = ["U000", "U001"]'),
    ("temperatures_C = [0.0, 50.0]", "temperatures_C = [23.0]\nsoak_min_s = 1.0\nallow_short_soak = true"),
    ("settle_s = 2.0", "settle_s = 0.2"),
    ("static_record_s = 30.0", "static_record_s = 0.0"),
    ('poses = "nine"', 'poses = "six"'),
    ('limits = "consumer"', 'limits = "line-quick.limits.toml"'),
    (', "bias_temperature", "scale_temperature"', ""),
)
"""What makes the small recipe short enough to be measured in wall time."""


def short_recipe_file(folder: Path, dwell_s: float = 1.0) -> str:
    """The small recipe as it is measured in wall time, with its limits beside it."""
    shutil.copy(Path(__file__).resolve().parents[1] / "deploy" / "recipes" / "line-quick.limits.toml", folder)
    return recipe_file(folder, *SHORT, ("dwell_s = 1.0", f"dwell_s = {dwell_s}"))


def modbus_station(port: int, host: str = "127.0.0.1", **changes: dict[str, object]) -> StationConfig:
    """A station of kind modbus, all of whose devices answer at one port; with a safety that acts within a second or two."""
    content = station_of().model_dump(mode="json")
    content |= {"kind": "modbus", "name": "served", "simulation": None, "uncertainty": None}
    for device in content["devices"].values():
        device |= {"host": host, "port": port}
    for section in {**QUICK, **changes}:
        content[section] |= QUICK.get(section, {}) | changes.get(section, {})
    return StationConfig.model_validate(content)


@contextmanager
def served(
    lot: Lot | None = None, silence_s: float = 0.0, speed: float = 1.0, **simulation: object
) -> Generator[int, None, None]:
    """The simulated station served while the block lasts; gives its port."""
    stop, listening, ports, failed = threading.Event(), threading.Event(), list[int](), list[Exception]()

    def ready(_host: str, port: int) -> None:
        ports.append(port)
        listening.set()

    def run() -> None:
        how = {"host": "127.0.0.1", "port": 0, "speed": speed, "stop": stop, "ready": ready, "silence_s": silence_s}
        try:
            serve(station_of(**simulation), lot or lot_of(), **how)
        except Exception as e:  # noqa: BLE001 - raised again in the thread of the test
            failed.append(e)
            listening.set()

    thread = threading.Thread(target=run)
    thread.start()
    try:
        assert listening.wait(60.0), "the station did not listen within 60 s"
        if not failed:
            yield ports[0]
    finally:
        stop.set()
        thread.join(20.0)
        if failed:
            raise failed[0]


@contextmanager
def served_plant(**simulation: object) -> Generator[tuple[int, Plant], None, None]:
    """The station served, and the plant behind it with its own journal of all that was ever written to it."""
    made: list[Plant] = []
    make = opening.make_plant

    def noted(*args, **more) -> Plant:
        made.append(make(*args, **more))
        return made[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(opening, "make_plant", noted)
        with served(**simulation) as port:
            yield port, made[0]


def moves_ordered(plant: Plant) -> int:
    """How many moves the drives of a plant have been ordered so far: writes of direct data, which end with the trigger."""
    with plant.lock:
        events = list(plant.journal.events())
    return sum(isinstance(e, Write) and e.device_id in {1, 2} and len(e.words) >= 16 for e in events)


def station_file(folder: Path, config: StationConfig, name: str = "served.toml") -> Path:
    """The station as a file."""
    path = folder / name
    path.write_text(tomlkit.dumps(config.model_dump(mode="json", exclude_none=True)), encoding="utf-8")
    return path
