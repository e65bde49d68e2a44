"""A small lot, a short recipe and a sink in memory, for tests that drive the simulated station."""

from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from pipelines.capture.capture import capture
from schemas.event import EventLog
from schemas.lot import Lot, Unit
from schemas.poses import Pose
from schemas.recipe import Recipe
from schemas.station import StationConfig, load_station
from stations.codec import encode
from stations.opening import make_plant, open_station
from stations.plant.plant import Plant

QUIET = {"noise_density_ug": 0.0, "bias_instability_ug": 0.0, "rate_random_walk_ug": 0.0, "thermometer_noise_K": 0.0}


def lot_of(units: int = 3, device: str = "ADXL355", seed: int = 5, repeat: int = 0) -> Lot:
    return Lot(units=[Unit(serial=f"U{i:03d}", slot=i) for i in range(units)], device=device, seed=seed, repeat=repeat)


def station_of(**simulation: Any) -> StationConfig:
    """The built-in station with other figures of its simulation."""
    config = load_station()
    assert config.simulation is not None
    made = type(config.simulation).model_validate(config.simulation.model_dump() | simulation)
    return config.model_copy(update={"simulation": made})


def short_recipe(poses: int = 2, static_s: float = 0.0, temperatures: tuple[float, ...] = (25.0,)) -> Recipe:
    return Recipe(
        name="short",
        device="ADXL355",
        local_gravity_m_s2=9.80665,
        temperatures_C=list(temperatures),
        poses=[Pose(name=f"p{i}", outer_deg=40.0 * i, inner_deg=25.0 * i) for i in range(poses)],
        verification=[Pose(name="v0", outer_deg=70.0, inner_deg=-30.0)],
        static_pose=Pose(name="up", outer_deg=0.0, inner_deg=0.0),
        static_record_s=static_s,
        dwell_s=2.0,
        rate_hz=100.0,
    )


@dataclass
class MemorySink:
    """Records in memory; ``die_after`` records it raises, as a killed process would stop."""

    die_after: int = 10**6
    records: dict[int, tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]] = field(default_factory=dict)
    state: bytes | None = None
    ahead: list[pd.DataFrame] = field(default_factory=list)

    def finished(self) -> set[int]:
        return set(self.records)

    def part(self, record: int, number: int, samples: pd.DataFrame) -> None:
        if number == 0:
            self.ahead = []
        self.ahead.append(samples)

    def put(
        self,
        record: int,
        samples: pd.DataFrame,
        readings: pd.DataFrame,
        history: pd.DataFrame,
        station_state: bytes,
        parts: int = 0,
    ) -> None:
        if len(self.records) >= self.die_after:
            raise KeyboardInterrupt
        if parts:
            samples = pd.concat([*self.ahead[:parts], samples], ignore_index=True)
        self.records[record] = (samples, readings, history)
        self.state = station_state

    def last_state(self) -> bytes | None:
        return self.state

    def all(self, part: int) -> pd.DataFrame:
        """Samples (0), readings (1) or history (2) of every record."""
        return pd.concat([self.records[n][part] for n in sorted(self.records)], ignore_index=True)


def quiet_progress(done: int, total: int, note: str) -> None:
    """Nobody listens."""


def captured(
    recipe: Recipe,
    lot: Lot | None = None,
    config: StationConfig | None = None,
    sink: MemorySink | None = None,
    *,
    events: EventLog | None = None,
    **opening: Any,
) -> MemorySink:
    """A recipe captured on the simulated station, from where the sink ends."""
    lot, sink = lot or lot_of(), sink or MemorySink()
    with open_station(config or load_station(), lot, resume=sink.last_state(), **opening) as station:
        capture(station, recipe, lot, sink, progress=quiet_progress, events=events)
    return sink


def write(plant: Plant, device_id: int, name: str, value: float | str) -> None:
    """Writes one register of a plant without a network."""
    profile = plant.banks[device_id].profile
    register = profile.register(name)
    plant.write(device_id, register.address, encode(register, profile.order(register), value))


def turn_to(plant: Plant, outer: float, inner: float) -> None:
    """Moves the table of a plant and waits until it stands."""
    for device_id, target in ((1, outer), (2, inner)):
        profile = plant.banks[device_id].profile
        values: dict[str, float | str] = {
            "data_number": 0, "operation_type": "absolute", "target": target, "speed": 30.0, "acceleration": 30.0,
            "deceleration": 30.0, "current": 100.0, "trigger": "all", "forwarding": 0,
        }  # fmt: skip
        registers = [profile.register(name) for name in profile.groups["direct_data"]]
        words = [w for r in registers for w in encode(r, profile.order(r), values[r.name])]
        plant.write(device_id, registers[0].address, words)
    plant.advance(30_000_000)


def plant_of(config: StationConfig | None = None, lot: Lot | None = None, **more: Any) -> Plant:
    return make_plant(config or load_station(), lot or lot_of(), **more)
