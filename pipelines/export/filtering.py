"""A low-pass filter behind a correction: chosen from the measured bandwidth, run by sample, its state stored between files."""

import json
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from inertial.arrays import Array
from inertial.dynamics.output_filter import HIGHEST, KINDS, Kind, OutputFilter, designed
from inertial.noise.bias_filter import BiasState
from inertial.noise.gauss_markov import FlickerTerms
from pipelines.archive import Archive, files
from pipelines.export.corrected import Corrected, KeptTrack, rate_and_gaps
from pipelines.export.documents import FilterDocument
from pipelines.export.recording import CorrectableRecording
from schemas.errors import DataRejected, WrongUse, did_you_mean
from schemas.foreign import shown

FIGURES = ("sweep_bandwidth_hz", "random_bandwidth_hz")
_SAME_RATE = 1e-3


def measured_bandwidth(archive: Archive, unit: str) -> tuple[float, str] | None:
    """The bandwidth of a unit, Hz, as the newest run of the archive that measured it states it, and the run."""
    for info in reversed(archive.runs()):
        run = archive.run(info.id) if unit in info.units else None
        for name in ("figures", "procedure_figures"):
            if run is None or name not in run.tables():
                continue
            table = run.table(name)
            values = table.loc[(table["unit"] == unit) & table["figure"].isin(FIGURES), "value"].astype(float)
            if np.isfinite(values).any():
                return float(values[np.isfinite(values)].min()), run.id
    return None


def chosen_filter(
    kind: str, cutoff_hz: float | None, rate_hz: float, archive: Archive, unit: str
) -> tuple[OutputFilter, str]:
    """The filter, and what its cut-off is from.

    Raises
    ------
    WrongUse
        There is no such filter, or no cut-off is given and none was measured; it does not suit the rate.
    """
    known: dict[str, Kind] = {name: name for name in KINDS}
    if kind not in known:
        raise WrongUse(f"--filter: found '{shown(kind)}'; {did_you_mean(kind, KINDS)}")
    source = "given"
    if cutoff_hz is None:
        measured = measured_bandwidth(archive, unit)
        if measured is None:
            raise WrongUse(
                f"--filter: no bandwidth of unit {unit} was measured (procedures sweep, random_vibration) and no cut-off is "
                f"given; give it as --filter {kind}:HZ"
            )
        cutoff_hz, source = measured[0], f"bandwidth of unit {unit} in run {measured[1]}"
        if cutoff_hz > HIGHEST * rate_hz:
            cutoff_hz, source = HIGHEST * rate_hz, f"{source}, {cutoff_hz:.4g} Hz, is more than the rate carries"
    try:
        return designed(known[kind], cutoff_hz, rate_hz), source
    except ValueError as problem:
        raise WrongUse(f"--filter: {problem}; give another frequency") from None


@dataclass(frozen=True)
class Kept:
    """The stored state between two recordings of a unit: of the filter (m, 3), of the tracked bias, or of both."""

    unit: str
    time_s: float
    filter: tuple[OutputFilter, Array] | None = None
    track: KeptTrack | None = None


def filtered(
    recording: CorrectableRecording, done: Corrected, chosen: OutputFilter, begin: Kept | None
) -> tuple[Corrected, Array]:
    """The correction with its force behind the filter, and the filter's state at the end.

    After a gap in the recording, and at its beginning, the filter begins as if its input had always been the first value. The
    white noise of a sample, where the uncertainty includes it, falls by the filter's noise gain; what lasts longer passes.
    """
    rate, gap = rate_and_gaps(recording.time)
    state = None
    if begin is not None and begin.filter is not None:
        before, state = begin.filter
        if before.kind != chosen.kind or not np.array_equal(before.numerator, chosen.numerator):
            raise WrongUse(
                f"--state: it was kept by {before.kind} of {before.cutoff_hz:.4g} Hz at {before.rate_hz:.6g} Hz, and now "
                f"{chosen.kind} of {chosen.cutoff_hz:.4g} Hz at {chosen.rate_hz:.6g} Hz is asked; give the same filter, or no "
                "--state"
            )
    parts: list[Array] = []
    for first, last in pairwise([0, *np.flatnonzero(gap).tolist(), len(done.force)]):
        begun = chosen.steady(done.force[first]) if state is None or first else state
        smooth, state = chosen.apply(done.force[first:last], begun)
        parts.append(smooth)
    if state is None:
        raise DataRejected(f"{recording.name}: no samples, some are needed for a filter; record them")
    covariance = done.covariance
    if done.white is not None:
        covariance = covariance - np.diag(done.white**2) * rate * (1.0 - chosen.noise_gain)
    return replace(done, force=np.concatenate(parts), covariance=covariance), state


def filter_document(chosen: OutputFilter, source: str) -> FilterDocument:
    """A filter as it is stated."""
    return {
        "kind": chosen.kind,
        "rate_hz": chosen.rate_hz,
        "cutoff_hz": chosen.cutoff_hz,
        "cutoff_from": source,
        "delay_s": chosen.delay_s,
        "noise_bandwidth_hz": chosen.noise_bandwidth_hz,
        "numerator": chosen.numerator.tolist(),
        "denominator": chosen.denominator.tolist(),
    }


def read_state(path: Path, unit: str) -> Kept | None:
    """The state that an earlier correction stored; None where there is no file yet.

    Raises
    ------
    DataRejected
        The file is no state, or that of another unit.
    """
    if not path.is_file():
        return None
    try:
        content: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        state = _kept(content)
    except (ValueError, KeyError, TypeError, UnicodeDecodeError):
        raise DataRejected(
            f"{path.name}: not the state that 'tumbleline correct --state' keeps, one is needed; name another file"
        ) from None
    if state.unit != unit:
        raise DataRejected(f"{path.name}: the state of unit {state.unit}, that of {unit} is needed; name another file")
    return state


def _kept(content: dict[str, Any]) -> Kept:
    low_pass, track = content["filter"], content["track"]
    passed = followed = None
    if low_pass is not None:
        taps = (np.array(low_pass[name], dtype=np.float64) for name in ("numerator", "denominator"))
        passed = (
            OutputFilter(low_pass["kind"], float(low_pass["rate_hz"]), *taps),
            np.array(low_pass["state"], dtype=np.float64),
        )
    if track is not None:
        state = BiasState(*(np.array(track[name], dtype=np.float64) for name in ("x", "p")))
        arrays = {name: np.array(track[name]) for name in ("sd", "correlation_s")}
        flicker = FlickerTerms(**arrays, **{name: track[name] for name in ("shortest_s", "longest_s", "flatness")})
        followed = KeptTrack(state, float(track["time_s"]), flicker)
    return Kept(str(content["unit"]), float(content["time_s"]), passed, followed)


def write_state(path: Path, state: Kept) -> None:
    """Keep the state; the numbers are written so that they are read back bit for bit.

    The names of its keys are those of the attributes of filter, bias and flicker: whoever renames one changes the file's format.
    """
    low_pass, track = state.filter, state.track
    content = {
        "unit": state.unit,
        "time_s": state.time_s,
        "filter": None if low_pass is None else _plain(vars(low_pass[0]) | {"state": low_pass[1]}),
        "track": None if track is None else _plain({"time_s": track.time_s} | vars(track.state) | vars(track.flicker)),
    }
    files.publish(path, files.json_bytes(content), "correct", files.ELSEWHERE)


def _plain(content: dict[str, Any]) -> dict[str, Any]:
    return {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in content.items()}


def filter_rate(recording: CorrectableRecording, begin: Kept | None) -> float:
    """The rate of the samples, Hz; that of the stored filter where both agree but for the last digits."""
    rate = rate_and_gaps(recording.time)[0]
    if begin is None or begin.filter is None:
        return rate
    before = begin.filter[0].rate_hz
    return before if abs(rate / before - 1.0) < _SAME_RATE else rate
