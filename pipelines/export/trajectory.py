"""A trajectory through a calibrated unit: the raw output, with all of its errors, that the unit would have given."""

import io
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.io import savemat

from inertial.arrays import Array
from inertial.correction import predict
from inertial.dynamics.output_filter import OutputFilter
from inertial.noise.gauss_markov import BiasModel, bias_model
from inertial.state import T_REFERENCE
from pipelines.archive import files
from pipelines.export.corrected import FitOfUnit, rate_and_gaps, steps_flicker, terms_of_unit
from pipelines.export.documents import SimulateDocument
from pipelines.export.recording import CorrectableRecording
from schemas.errors import DataRejected, WrongUse
from schemas.units import AXES, MICRO, STANDARD_GRAVITY_M_S2

UNITS = {"g": 1.0, "m/s^2": 1.0 / STANDARD_GRAVITY_M_S2}
_ABOUT_ZERO = 0.1
"""Zero over full scale below which the output is meant to be zero at 0 g: its range is symmetrical about that."""
ENDINGS = (".csv", ".parquet", ".mat", ".npy")


@dataclass(frozen=True)
class SimulatedOutput:
    """Raw output (n, m) in output units, the force (n, 3) in g that made it, and what was added.

    noise : terms by axis in µg, none where it is empty · clipped : samples at the end of the range · told : what was assumed
    """

    recording: CorrectableRecording
    output: Array
    force: Array
    noise: dict[str, list[float]]
    clipped: int
    told: tuple[str, ...]


def with_temperature(recording: CorrectableRecording) -> tuple[CorrectableRecording, tuple[str, ...]]:
    """The recording with a temperature, that of the calibration's reference where none is recorded; a sentence says so."""
    if recording.state.temperature is not None:
        return recording, ()
    state = replace(recording.state, temperature=np.full(len(recording.time), T_REFERENCE))
    return replace(recording, state=state), (f"no unit_C: {T_REFERENCE:g} °C taken",)


def simulated(
    recording: CorrectableRecording, unit_of_force: str, fit: FitOfUnit, low_pass: OutputFilter | None, seed: int | None
) -> SimulatedOutput:
    """What the unit gives for a trajectory: filter of the sensor, the fitted model, noise, whole counts, end of the range.

    Parameters
    ----------
    recording : its output is the true specific force, in ``unit_of_force``
    low_pass : of the sensor; None: it follows at once
    seed : of the noise; None: none is added

    Raises
    ------
    DataRejected
        A sample of the model is not finite.
    """
    if unit_of_force not in UNITS:
        raise WrongUse(
            f"simulate: unit of force '{unit_of_force}', one of {', '.join(UNITS)} is needed; correct --unit-of force=…"
        )
    recording, told = with_temperature(recording)
    force = recording.output * UNITS[unit_of_force]
    felt = force if low_pass is None else low_pass.apply(force, low_pass.steady(force[0]))[0]
    state = replace(recording.state, force=felt, axes=fit.exported.axes, memory={})
    output = predict(fit.effects, state, fit.coefficients, fit.nonlinear)
    added: dict[str, list[float]] = {}
    if seed is not None:
        output, added = _with_noise(output, recording.time, fit, seed)
    if not np.isfinite(output).all():
        raise DataRejected(
            f"{recording.name}: the model gives no finite output for it; forces within the range are needed"
        )
    if fit.exported.out_unit == "LSB":
        output = np.rint(output)
    clipped = 0
    if fit.exported.full_scale is not None:
        zero = fit.exported.bias[0]
        zero = np.where(np.abs(zero) < _ABOUT_ZERO * fit.exported.full_scale, 0.0, zero)
        inside = np.clip(output, zero - fit.exported.full_scale, zero + fit.exported.full_scale)
        clipped = int(np.count_nonzero(np.any(inside != output, axis=1)))
        output = np.rint(inside) if fit.exported.out_unit == "LSB" else inside
    if clipped == len(output) and unit_of_force == "g":
        told = (
            *told,
            "all samples are at the end of the range: the force was taken in g; for m/s², give --unit-of force=m/s^2",
        )
    return SimulatedOutput(recording, output, force, added, clipped, told)


def _with_noise(output: Array, time: Array, fit: FitOfUnit, seed: int) -> tuple[Array, dict[str, list[float]]]:
    """The output with white noise, flicker and walk of the unit's static record."""
    rate = rate_and_gaps(time)[0]
    terms = terms_of_unit(fit, "the noise of a simulation", ", or give --seed none: no noise")[0]
    flicker = steps_flicker(1.0 / rate, float(time[-1] - time[0]))
    model = bias_model(terms.white, terms.instability, terms.walk, 0.0, flicker)
    rng = np.random.default_rng(seed)
    noise = drawn_bias(model, np.diff(time, prepend=time[0] - 1.0 / rate), rng)
    noise += model.white * np.sqrt(rate) * rng.normal(size=noise.shape)
    per_g = np.diagonal(fit.exported.response[0])
    rows = {"N_ug_rtHz": terms.white, "B_ug": terms.instability, "K_ug_rts": terms.walk}
    return output + per_g * noise, {name: (MICRO * values).tolist() for name, values in rows.items()}


def drawn_bias(model: BiasModel, steps: Array, rng: np.random.Generator) -> Array:
    """The bias (n, 3), g, of Gauss–Markov processes that are stationary at the beginning, and of a walk from zero.

    Parameters
    ----------
    steps : (n,), s, time since the sample before
    """
    n, (axes, parts) = len(steps), model.sd.shape
    keep = np.exp(-steps[:, None] / model.correlation_s)
    wander = model.sd * rng.normal(size=(axes, parts))
    bias = np.empty((n, axes))
    kicks = rng.normal(size=(n, axes, parts))
    for k in range(n):
        wander = keep[k] * wander + model.sd * np.sqrt(1.0 - keep[k] ** 2) * kicks[k]
        bias[k] = wander.sum(axis=1)
    return bias + np.cumsum(model.walk * np.sqrt(steps)[:, None] * rng.normal(size=(n, axes)), axis=0)


def table_of_output(made: SimulatedOutput) -> pd.DataFrame:
    """One row per sample: time, raw output, conditions, and the true force in g."""
    columns: dict[str, Any] = {"time_s": made.recording.time}
    columns |= dict(zip(AXES, made.output.T, strict=False))
    columns |= {"unit_C": made.recording.state.temperature}
    return pd.DataFrame(columns | {f"force_{axis}": made.force[:, i] for i, axis in enumerate(AXES)})


def write_output(made: SimulatedOutput, output: Path) -> None:
    """Write the samples as CSV, Parquet, MATLAB (one vector per column) or NumPy (records with named fields).

    Raises
    ------
    WrongUse
        The name has another ending.
    """
    table, sink = table_of_output(made), io.BytesIO()
    if output.suffix == ".csv":
        sink.write(table.to_csv(index=False, lineterminator="\n", float_format="%.10g").encode())
    elif output.suffix == ".parquet":
        table.to_parquet(sink, index=False)
    elif output.suffix == ".mat":
        savemat(sink, {name: values.to_numpy()[:, None] for name, values in table.items()})
    elif output.suffix == ".npy":
        np.save(sink, table.to_records(index=False))
    else:
        raise WrongUse(
            f"--output: found '{output.name}', a name that ends in {', '.join(ENDINGS)} is needed; correct it"
        )
    files.publish(output, sink.getvalue(), "simulate", files.ELSEWHERE)


def simulation_document(
    made: SimulatedOutput, fit: FitOfUnit, low_pass: OutputFilter | None, seed: int | None, output: Path
) -> SimulateDocument:
    """The document of a simulation: unit, samples, noise, clipping and error."""
    unit, full = fit.exported, fit.exported.with_every_axis
    output_of_all = made.force.copy()
    output_of_all[:, list(unit.axes)] = made.output
    error = (np.linalg.solve(full.response[0], (output_of_all - full.bias[0]).T).T - made.force)[:, list(unit.axes)]
    return {
        "file": made.recording.name,
        "run": fit.run,
        "unit": fit.exported.unit,
        "out_unit": fit.exported.out_unit,
        "samples": len(made.output),
        "bandwidth_hz": None if low_pass is None else low_pass.cutoff_hz,
        "seed": seed,
        "noise": made.noise,
        "clipped": made.clipped,
        "error_at_25_C_ug": dict(zip(unit.letters, (MICRO * np.sqrt(np.mean(error**2, axis=0))).tolist(), strict=True)),
        "told": list(made.told),
        "output": str(output),
    }
