"""Waveforms of a record as files of other programs: the channels of a captured record, and a writer for each format.

A writer gives the bytes of the file, so that all formats are written in one way: complete or not at all.
"""

import io
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from inertial.arrays import Array
from pipelines.archive import Run, files
from schemas.errors import WrongUse, did_you_mean
from schemas.library import library
from schemas.units import AXES
from stations.devices.equipment import REFERENCE


@dataclass(frozen=True)
class Channel:
    """A channel of a recording: evenly spaced samples with unit and interval.

    Attributes
    ----------
    name, unit : texts in the file · group : channels of one clock, ``units`` or ``reference``
    samples : (n,) · interval_s, start_s : s
    axis : 0 to 2, in the axes of the units
    """

    name: str
    unit: str
    group: str
    samples: Array
    interval_s: float
    axis: int
    start_s: float = 0.0

    @property
    def time(self) -> Array:
        """(n,), s."""
        return np.asarray(self.start_s + self.interval_s * np.arange(len(self.samples)), dtype=np.float64)


def channels_of(run: Run, number: int, unit: str) -> list[Channel]:
    """The channels of a unit and of the reference in a record.

    Raises
    ------
    WrongUse
        The run has no samples, or no such record or unit.
    """
    if run.records is None:
        raise WrongUse(f"run {run.id}: no captured samples, they are needed; name the run of a station")
    readings = run.table("readings")
    tables = list(run.records.samples([number])) if number in set(readings["record"]) else []
    if not tables:
        last = int(readings["record"].max())
        raise WrongUse(f"run {run.id}: no record {number}, 0 to {last} are there; choose one of them")
    names = [str(name) for name in readings.loc[readings["record"] == number, "unit"]]
    serial = unit or names[0]
    if serial not in names:
        raise WrongUse(f"run {run.id}: no unit '{serial}'; {did_you_mean(serial, names)}")
    out_unit = str(readings["out_unit"].iloc[0])
    channels: list[Channel] = []
    for name, label, text, group in ((serial, serial, out_unit, "units"), (REFERENCE, "reference", "g", "reference")):
        rows = [table[table["unit"] == name] for table in tables]
        time = np.concatenate([row["time_s"].to_numpy(dtype=float) for row in rows])
        if time.size < 2:
            continue
        interval = float((time[-1] - time[0]) / (time.size - 1))
        for k, axis in enumerate(AXES):
            values = np.concatenate([table[axis].to_numpy(dtype=float) for table in rows])
            if np.isfinite(values).any():  # an axis without an output has no samples
                channels.append(Channel(f"{label} {axis}", text, group, values, interval, k))
    return _same_length(channels)


def _same_length(channels: list[Channel]) -> list[Channel]:
    """Channels of one interval cut to the shortest of them, so that they share a clock."""
    intervals = {round(channel.interval_s, 15) for channel in channels}
    if len(intervals) > 1 and max(intervals) - min(intervals) > 1e-9 * max(intervals):
        return channels
    count = min(len(channel.samples) for channel in channels)
    first = channels[0].interval_s
    return [replace(channel, samples=channel.samples[:count], interval_s=first) for channel in channels]


class Writer(NamedTuple):
    """A format: the suffix of its files, whether a file has one clock for all channels, and what makes its bytes."""

    suffix: str
    one_clock: bool
    made: Callable[[Sequence[Channel]], bytes]


def _csv(channels: Sequence[Channel]) -> bytes:
    """Time in s and a column for each channel, the unit in brackets; 17 digits, which represent every double exactly."""
    columns = {"time [s]": channels[0].time}
    columns |= {f"{channel.name} [{channel.unit}]": channel.samples for channel in channels}
    return pd.DataFrame(columns).to_csv(index=False, lineterminator="\n", float_format="%.17g").encode()


def _hdf5(channels: Sequence[Channel]) -> bytes:
    """A dataset for each channel with the attributes ``unit`` and ``sample_interval_s``, and ``time`` in s."""
    h5py = library("h5py", "hdf5", "waveforms: an HDF5 file")
    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        file.create_dataset("time", data=channels[0].time).attrs["unit"] = "s"
        for channel in channels:
            stored = file.create_dataset(channel.name, data=channel.samples)
            stored.attrs["unit"], stored.attrs["sample_interval_s"] = channel.unit, channel.interval_s
    return sink.getvalue()


def _lvm(channels: Sequence[Channel]) -> bytes:
    """LabVIEW measurement file: text with ``Delta_X`` and the unit of each channel in the header; 17 digits."""
    count, end = len(channels), "***End_of_Header***"
    head = [
        "LabVIEW Measurement",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        "Decimal_Separator\t.",
        "Multi_Headings\tNo",
        "X_Columns\tOne",
        "Time_Pref\tRelative",
        end,
        "",
        f"Channels\t{count}",
        "Samples" + "".join(f"\t{len(channel.samples)}" for channel in channels),
        "Y_Unit_Label" + "".join(f"\t{channel.unit}" for channel in channels),
        "X_Dimension" + "\tTime" * count,
        "X0" + "".join(f"\t{channel.start_s:.17g}" for channel in channels),
        "Delta_X" + "".join(f"\t{channel.interval_s:.17g}" for channel in channels),
        end,
        "X_Value" + "".join(f"\t{channel.name}" for channel in channels) + "\tComment",
    ]
    rows = np.column_stack([channels[0].time, *(channel.samples for channel in channels)])
    body = ["\t".join(f"{value:.17g}" for value in row) for row in rows.tolist()]
    return "\n".join([*head, *body, ""]).encode()


def _mat(channels: Sequence[Channel]) -> bytes:
    """MATLAB 5: a vector for each channel, ``time`` in s, the units as texts; blanks in names become underscores."""
    from scipy.io import savemat  # a third of a second

    content: dict[str, Any] = {"time": channels[0].time}
    for channel in channels:
        name = "".join(letter if letter.isalnum() else "_" for letter in channel.name)
        content |= {name: channel.samples, f"{name}_unit": channel.unit}
    sink = io.BytesIO()
    savemat(sink, content, oned_as="column")
    return sink.getvalue()


def _tdms(channels: Sequence[Channel]) -> bytes:
    """A group for each clock, channels with ``wf_increment``, ``wf_start_offset`` and ``unit_string``."""
    nptdms = library("nptdms", "tdms", "waveforms: a TDMS file")
    made: list[Any] = []
    for channel in channels:
        about = {"wf_increment": channel.interval_s, "wf_start_offset": channel.start_s}
        about |= {"wf_samples": len(channel.samples), "unit_string": channel.unit}
        made.append(nptdms.ChannelObject(channel.group, channel.name, channel.samples, about))
    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as file:
        file.write_segment([nptdms.RootObject({}), *made])
    return sink.getvalue()


TIME, ACCELERATION, UNKNOWN = 17, 12, 0
DOUBLE = 4  # ordinate of double precision, real


def _uff58(channels: Sequence[Channel]) -> bytes:
    """Universal file, dataset 58: time records (function type 1) in binary, which keeps every double.

    The interval has 6 digits, the name is identification line 1, the axis the direction of the response. Source: SDRC Universal
    File Formats, dataset 58: abscissa type 17 is time, ordinate type 12 acceleration, 0 unknown.
    """
    pyuff = library("pyuff", "uff", "waveforms: a universal file (UFF)")
    # pyuff writes to a path only
    with TemporaryDirectory() as folder:
        path = Path(folder) / "waveforms.uff"
        file = pyuff.UFF(str(path))
        for number, channel in enumerate(channels, start=1):
            known = ACCELERATION if channel.unit in {"g", "m/s^2"} else UNKNOWN
            content = {
                "type": 58, "binary": 1, "func_type": 1, "rsp_node": number, "rsp_dir": channel.axis + 1,
                "ref_node": 0, "ref_dir": 0, "data": np.asarray(channel.samples, dtype=np.float64), "x": channel.time,
                "num_pts": len(channel.samples), "id1": channel.name, "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                "abscissa_spacing": 1, "abscissa_min": channel.start_s, "abscissa_inc": channel.interval_s,
                "abscissa_spec_data_type": TIME, "abscissa_axis_units_lab": "s",
                "ordinate_spec_data_type": known, "ordinate_axis_units_lab": channel.unit, "orddenom_spec_data_type": UNKNOWN,
                "ord_data_type": DOUBLE,
            }  # fmt: skip
            with warnings.catch_warnings():  # pyuff leaves the file to the collector; "overwrite" loses binary samples
                warnings.simplefilter("ignore", ResourceWarning)
                file.write_sets(content, "add")
        return path.read_bytes()


def _wav(channels: Sequence[Channel]) -> bytes:
    """WAV, 64-bit float: the rate and the channels in order. It states neither unit nor scale, and only whole rates."""
    from scipy.io import wavfile  # a third of a second

    rate = 1.0 / channels[0].interval_s
    if abs(rate - round(rate)) > 1e-6 * rate:
        raise WrongUse(f"waveforms: {rate:.6g} Hz, a WAV file has whole rates only; choose another format")
    sink = io.BytesIO()
    wavfile.write(sink, round(rate), np.column_stack([channel.samples for channel in channels]))
    return sink.getvalue()


WRITERS = {
    "csv": Writer(".csv", one_clock=True, made=_csv),
    "hdf5": Writer(".h5", one_clock=True, made=_hdf5),
    "lvm": Writer(".lvm", one_clock=True, made=_lvm),
    "mat": Writer(".mat", one_clock=True, made=_mat),
    "tdms": Writer(".tdms", one_clock=False, made=_tdms),
    "uff58": Writer(".uff", one_clock=False, made=_uff58),
    "wav": Writer(".wav", one_clock=True, made=_wav),
}


def writer_of(form: str) -> Writer:
    """The writer of a format; an unknown format is refused with similar names."""
    if form not in WRITERS:
        raise WrongUse(f"waveforms: no format is called '{form}'; {did_you_mean(form, WRITERS)}")
    return WRITERS[form]


def files_of_waveforms(form: str, channels: Sequence[Channel], path: Path) -> dict[Path, bytes]:
    """The files of the channels: one, or one for each clock where the format holds only one.

    Raises
    ------
    WrongUse
        The format is not known, there is no channel, or a library is missing.
    """
    writer = writer_of(form)
    if not channels:
        raise WrongUse("waveforms: no channel, at least one is needed; name another record")
    clocks: dict[tuple[float, int, str], list[Channel]] = {}
    for channel in channels:
        clocks.setdefault((channel.interval_s, len(channel.samples), channel.group), []).append(channel)
    if not writer.one_clock or len({clock[:2] for clock in clocks}) == 1:
        return {path: writer.made(channels)}
    return {
        path.with_name(f"{path.stem}_{clock[2]}{path.suffix}"): writer.made(channels)
        for clock, channels in clocks.items()
    }


def write_waveforms(form: str, channels: Sequence[Channel], path: Path) -> list[Path]:
    """Write the files of the channels, each complete or not at all, and return their paths."""
    made = files_of_waveforms(form, channels, path)
    for target, data in made.items():
        files.publish(target, data, "waveforms", files.ELSEWHERE)
    return list(made)
