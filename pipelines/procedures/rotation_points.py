"""A rotation as a part of a recipe, its records as points, and points as the arrays of the model."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
import pandas as pd
from pydantic import Field, model_validator

from inertial.arrays import Array, Places
from inertial.dynamics.rotation import RotationData
from inertial.dynamics.rotation_diagnosis import DEFAULT
from inertial.dynamics.rotation_effects import EFFECTS
from inertial.dynamics.rotations import Rotations
from inertial.dynamics.turn_record import Sweep, parts_of
from inertial.errors import NotIdentified
from pipelines.procedures.base import NominalScale, refuse_unknown_effects, scale_of
from pipelines.procedures.recorded import REFERENCE, Device, ProcedureRecord, Taken, point_rows
from schemas.bounds import Positive
from schemas.units import axes_among

Plane = Literal["xy", "yz", "xz"]
AT_REST: dict[str, tuple[str, float]] = {"xy": ("inner", 90.0), "yz": ("outer", 0.0), "xz": ("outer", 90.0)}
"""The axis of the table that turns a plane of the device through gravity, and the angle of the other one."""
BINS = 36  # of a turn: ten degrees
FEWEST_SAMPLES = 4  # in a bin, so that its noise is seen beside its slope
COMMON = ("outer_deg", "inner_deg", "turned", "span_deg", "rate_deg_s", "acceleration_deg_s2")
UNCERTAIN = tuple(f"angle_{k}_deg" for k in range(6))


class RotationPart(NominalScale):
    """Whole turns of planes of the device through gravity, forward and back, at steady rates.

    ``planes`` are two or three: ``xy`` turns the inner axis with the outer one at 90°, ``yz`` and ``xz`` the outer one with the
    inner at 0° and 90°. The axis runs up over ``lead_deg`` before the whole ``turns`` and stands for ``stand_s`` at each end.
    ``times`` repeats both directions. A second rate separates a lag in time from hysteresis. ``effects`` is the model to be
    judged; the diagnosis names what is missing.
    """

    kind: Literal["rotation"]
    rates_deg_s: Annotated[list[Annotated[Positive, Field(le=360.0)]], Field(min_length=1, max_length=4)] = Field(
        default_factory=lambda: [24.0]
    )
    planes: Annotated[list[Plane], Field(min_length=2, max_length=3)] = Field(
        default_factory=lambda: list[Plane](["xy", "yz", "xz"])
    )
    turns: Annotated[int, Field(ge=1, le=20)] = 1
    times: Annotated[int, Field(ge=1, le=20)] = 1
    lead_deg: Annotated[Positive, Field(ge=1.0, le=180.0)] = 20.0
    stand_s: Annotated[Positive, Field(ge=0.5, le=60.0)] = 1.0
    effects: Annotated[list[str], Field(max_length=6)] = Field(default_factory=lambda: list(DEFAULT))

    @model_validator(mode="after")
    def _known(self) -> Self:
        refuse_unknown_effects(self.effects, EFFECTS, "rotations")
        for name in ("planes", "rates_deg_s"):
            values = getattr(self, name)
            if len(set(values)) < len(values):
                raise ValueError(f"{name}: {', '.join(map(str, values))}, each may be there once; times repeats them")
        return self

    @property
    def end_deg(self) -> float:
        """Angle on each side at which a turn begins and ends."""
        return 180.0 * self.turns + self.lead_deg


def points_of_record(
    part: RotationPart, number: int, record: ProcedureRecord, units: Sequence[Taken], device: Device
) -> Iterator[dict[str, Any]]:
    """Points of every unit in the record of one plane: means over parts of ten degrees, and at rest.

    Raises
    ------
    NotIdentified
        The readings of the encoder do not show the turns.
    """
    readings = record.samples[REFERENCE]
    pose, turns = record.step.pose, record.step.turns
    begin = pose.outer_deg if turns[0].axis == "outer" else pose.inner_deg
    ends = np.radians([begin, *(turn.to_deg for turn in turns)])
    sweeps, still = parts_of(readings.time, np.radians(readings.output[:, 0]), ends.tolist(), part.turns, part.stand_s)
    for unit in units:
        yield from _points(part, number, unit, sweeps, still, device)


def _points(
    part: RotationPart, number: int, taken: Taken, sweeps: Sequence[Sweep], still: Array, device: Device
) -> list[dict[str, Any]]:
    time, letters = taken.samples.time, taken.samples.letters
    output = taken.samples.output / scale_of(part, device, taken.unit)[: len(letters)]
    clipped = device.at_end(taken.samples.output) > 0
    turned, plane = taken.record.step.turns[0].axis == "inner", taken.record.step.name
    other = float(taken.reading["outer_deg" if turned else "inner_deg"])
    spread = _white([output[(time >= s.begin) & (time < s.end)] for s in sweeps])
    rows: list[dict[str, Any]] = []

    def add(
        where: Places, angle: Array, span: float, motion: tuple[float, float], sweep: int, uncertain: Array
    ) -> None:
        turned_to = float(np.degrees(angle.mean()))
        common = (other, turned_to, 1.0) if turned else (turned_to, other, 0.0)
        steady = np.degrees([span, *motion]).tolist()
        rows.extend(
            point_rows(
                unit=taken.unit, axis=letters, series=plane, point=1000 * number + len(rows) // len(letters), setting=turned_to,
                value=np.full(len(letters), np.nan) if clipped else output[where].mean(axis=0),
                uncertainty=spread / np.sqrt(len(where)), time_s=float(time[where].mean()), sweep=float(sweep),
                **dict(zip(COMMON, (*common, *steady), strict=True)),
                **dict(zip(UNCERTAIN, np.degrees(uncertain).tolist(), strict=True)),
            )
        )  # fmt: skip

    for k, (begin, end, angle) in enumerate(still):
        where = np.flatnonzero((time > begin) & (time <= end))
        if where.size:
            add(where, np.array([angle]), 0.0, (0.0, 0.0), -1, np.zeros(len(UNCERTAIN)))
        if k == len(sweeps):
            break
        turn = sweeps[k]
        inside = np.flatnonzero((time >= turn.begin) & (time < turn.end))
        angles, (rates, accelerations) = turn.angle(time[inside]), turn.motion(time[inside])
        way = np.abs(angles - turn.angle(np.array([turn.begin])))
        sectors = np.minimum((way * BINS / (2.0 * np.pi)).astype(int), BINS * part.turns - 1)
        for sector in range(BINS * part.turns):
            pick = np.flatnonzero(sectors == sector)
            if pick.size < FEWEST_SAMPLES:
                text = f"{pick.size} samples in {360.0 / BINS:g}°, {FEWEST_SAMPLES} are needed"
                raise NotIdentified(f"rotation: {text}; turn more slowly, or raise rate_hz")
            # of evenly spaced angles the standard deviation is that of a span, whose mean the model takes
            span = float(np.sqrt(12.0) * angles[pick].std())
            motion = float(rates[pick].mean()), float(accelerations[pick].mean())
            uncertain = turn.uncertain(time[inside[pick]]).mean(axis=0)
            add(inside[pick], angles[pick], span, motion, len(sweeps) * number + k, uncertain)
    return rows


def _white(outputs: Sequence[Array]) -> Array:
    """Standard deviation (axes,) of a sample by white noise: second differences, which a turn and wander do not reach."""
    seconds = np.concatenate([np.diff(output, n=2, axis=0) for output in outputs])
    return np.sqrt(np.mean(seconds**2, axis=0) / 6.0)


def data_of(rows: pd.DataFrame) -> RotationData:
    """The points of one unit as arrays of the model.

    Raises
    ------
    NotIdentified
        The output is constant or clipped.
    """
    letters = axes_among(rows["axis"])
    by_axis = [rows[rows["axis"] == axis].sort_values("time_s") for axis in letters]
    values, errors = (
        np.column_stack([rows[name].to_numpy(dtype=float) for rows in by_axis]) for name in ("value", "uncertainty")
    )
    if not np.all(np.isfinite(values)):
        raise NotIdentified("the output reaches the end of its range; choose a wider one")
    if still := [axis for axis, output in zip(letters, values.T, strict=True) if np.ptp(output) == 0.0]:
        raise NotIdentified(f"the output of axis {' and '.join(still)} is constant; check the unit")

    def of(*names: str) -> Array:
        return by_axis[0][list(names)].to_numpy(dtype=float)

    common = dict(zip(COMMON, of(*COMMON).T, strict=True))
    turned, sweep = common.pop("turned"), of("sweep")[:, 0].astype(int)
    outer, inner, span, rate, acceleration = (np.radians(column) for column in common.values())
    uncertain = np.radians(of(*UNCERTAIN))
    points = Rotations(outer, inner, turned, span, rate, acceleration, of("time_s")[:, 0], sweep, uncertain)
    return RotationData(points, values, np.maximum(errors, 1e-12), tuple(letters))
