"""Files that people bring, one of each kind and format, and their readers with the rules that whatever is accepted keeps."""

import contextlib
import gzip
import io
import json
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat, wavfile

from pipelines.archive import files as archive_files
from pipelines.audit.rules import load_rules
from pipelines.importers import exchange, files, inspection, mapping, record
from pipelines.importers.values import BOUNDS, LARGEST
from pipelines.jobs.model_files import read_model
from pipelines.jobs.recipes import load_recipe, read_limits
from pipelines.jobs.seating import read_seating
from schemas.bounds import COLDEST_C, HOTTEST_C, LONGEST_WAIT_S
from schemas.errors import TumblelineError
from schemas.profile import parse_profile
from schemas.serials import is_serial
from schemas.station import load_station
from schemas.toml_files import read_text

ROOT = Path(__file__).resolve().parents[2]
MODEL = """[model]
name = "line"
version = 2
effects = ["bias", "scale", "misalignment", "own"]

[[formula]]
id = "own"
columns = ["f**2", "T*f"]

[[change]]
version = 2
effect = "own"
by = "me"
at = 2026-01-02T03:04:05Z
why = "it was there"
"""
MAPPING = """unit = "A1"
rows = "samples"
rate_hz = 100.0
local_gravity_m_s2 = 9.80665
poses = { up = "+z" }

[columns]
time = "t"
x = "ax"
y = "ay"
z = "az"

[units]
output = "g"
time = "s"
"""


# -- samples --------------------------------------------------------------------------------------------------------------


def dwells():
    n = np.arange(24)
    rng = np.random.default_rng(5)
    out = rng.normal(size=(24, 3))
    frame = pd.DataFrame({"unit": np.where(n < 12, "A1", "B2"), "dwell": n % 12, "time_s": 10.0 * n, "slot": n // 12})
    frame[["out_x", "out_y", "out_z"]] = frame[["force_x", "force_y", "force_z"]] = (
        out / np.linalg.norm(out, axis=1)[:, None]
    )
    return frame.assign(
        n=1000, duration_s=10.0, unit_C=25.0 + n, sd_x=1e-3, sd_y=1e-3, sd_z=1e-3, hum=40.0 + n, out_unit="g"
    )


def raw():
    rng = np.random.default_rng(6)
    frame = pd.DataFrame(0.002 * rng.normal(size=(120, 3)) + [0.0, 0.6, 0.8], columns=["ax", "ay", "az"])
    frame.insert(0, "t", np.arange(120) / 10.0)
    return frame.assign(heat=25.0)


def history():
    return pd.DataFrame({"time_s": np.arange(30) * 60.0, "unit_C": 25.0 + np.arange(30), "chamber_C": 26.0})


def csv(frame, **how):
    return frame.to_csv(index=False, **how).encode()


def parquet(frame, **how):
    sink = io.BytesIO()
    frame.to_parquet(sink, **how)
    return sink.getvalue()


def mat(frame, *, packed):
    sink = io.BytesIO()
    columns = {name: frame[name].to_numpy() for name in frame}
    savemat(sink, {**columns, "about": {"rate": 10.0, "of": {"who": "me"}}}, do_compression=packed)
    return sink.getvalue()


def packed(data):
    return gzip.compress(data, mtime=0)


def product(*parts):
    return ROOT.joinpath(*parts).read_bytes()


def samples():
    """Name of a reader → what it reads, as (ending of the file, bytes)."""
    stamped = raw().assign(t=pd.Timestamp("2026-01-01") + pd.to_timedelta(raw()["t"], unit="s"))
    manifest = {"sha256": "ab" * 32, "rows": 7, "files": {"a": 1}, "inputs": [1.0, None, "x"]}
    return {
        "dwells": [
            (".csv", csv(dwells())),
            (".csv", csv(dwells(), sep=";")),
            (".parquet", parquet(dwells())),
            (".csv.gz", packed(csv(dwells()))),
        ],
        "raw": [
            (".csv", csv(raw())),
            (".tsv", csv(raw(), sep="\t")),
            (".parquet", parquet(raw())),
            (".parquet", parquet(stamped, compression="gzip")),
            (".parquet", parquet(raw().astype({"heat": "category"}), compression=None)),
            (".mat", mat(raw(), packed=False)),
            (".mat", mat(raw(), packed=True)),
            (".csv.gz", packed(csv(raw()))),
            (".mat.gz", packed(mat(raw(), packed=False))),
        ],
        "recording": recordings_of_others(),
        "history": [(".csv", csv(history())), (".parquet", parquet(history()))],
        "recipe": [(".toml", product("schemas", "samples", "production.toml"))],
        "limits": [(".toml", product("schemas", "samples", "limits-consumer.toml"))],
        "station": [(".toml", product("stations", "simulated.toml"))],
        "model": [(".toml", MODEL.encode())],
        "slots": [
            (".csv", b"slot,serial,remark\n0,A1,\n1,B2,new\n5,C3,\n"),
            (".csv", b"\xef\xbb\xbfslot;serial\r\n0;A1\r\n1;B2\r\n"),
            (".toml", b'[slots]\n0 = "A1"\n3 = "B2"\n'),
        ],
        "profile": [(".toml", product("stations", "profiles", "oriental_az.toml"))],
        "policy": [(".toml", product("pipelines", "audit", "default.toml"))],
        "mapping": [(".toml", MAPPING.encode())],
        "manifest": [(".json", json.dumps(manifest, indent=1).encode())],
    }


def recordings_of_others():
    """A small recording in every format whose library is installed."""
    frame = raw().drop(columns="heat")
    rows = "\n".join(";".join(f"{value:.6f}" for value in row) for row in frame.to_numpy()).replace(".", ",")
    names = list(frame)
    lvm = "\n".join("\t".join(f"{value:.6f}" for value in row) for row in frame.to_numpy())
    head = "LabVIEW Measurement\nSeparator\tTab\nDecimal_Separator\t.\n***End_of_Header***\nChannels\t3\nDelta_X\t0.1\t0.1\t0.1\n"
    recordings = [
        (".csv", f"Recorder: R-9\nStarted;12:00\n\n{';'.join(names)}\n{rows}\n".encode()),
        (".csv", "\ufeff0;1;2;3\n".encode("utf-8") + rows.encode()),
        (".lvm", (head + "***End_of_Header***\nX_Value\tax\tay\taz\tComment\n" + lvm + "\n").encode()),
    ]
    sink = io.BytesIO()
    wavfile.write(sink, 10, (20000 * frame[["ax", "ay", "az"]].to_numpy()).astype(np.int16))
    recordings.append((".wav", sink.getvalue()))
    stamped = frame.assign(
        t=(pd.Timestamp("2026-01-01") + pd.to_timedelta(frame["t"], unit="s")).dt.strftime("%d.%m.%Y %H:%M:%S.%f")
    )
    recordings.append((".csv", csv(stamped)))
    for make in (_hdf5, _tdms, _uff, _rdata):
        with contextlib.suppress(ImportError):
            recordings.append(make(frame))
    return recordings


def _hdf5(frame):
    import h5py

    sink = io.BytesIO()
    with h5py.File(sink, "w") as file:
        for name in frame:
            file.create_dataset(
                f"imu/{name}", data=frame[name].to_numpy(), compression="gzip" if name == "ay" else None
            )
    return ".h5", sink.getvalue()


def _tdms(frame):
    import nptdms

    sink = io.BytesIO()
    with nptdms.TdmsWriter(sink) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("log", name, frame[name].to_numpy(), properties={"unit_string": "g"})
                for name in frame
            ]
        )
    return ".tdms", sink.getvalue()


def _uff(frame):
    import pyuff

    with tempfile.TemporaryDirectory() as folder:
        file = pyuff.UFF(str(Path(folder) / "a.uff"))
        for number, name in enumerate(("ax", "ay", "az")):
            one = {"type": 58, "func_type": 1, "rsp_node": 1, "rsp_dir": number + 1, "ref_node": 0, "ref_dir": 0, "id1": name,
                   "data": frame[name].to_numpy(), "x": frame["t"].to_numpy(), "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
                   "abscissa_spacing": 1, "abscissa_spec_data_type": 17, "ordinate_spec_data_type": 12,
                   "ordinate_axis_units_lab": "g", "orddenom_spec_data_type": 0, "abscissa_inc": 0.1, "abscissa_min": 0.0,
                   "num_pts": len(frame), "ord_data_type": 4, "binary": 0}  # fmt: skip
            file.write_sets(one, "add" if number else "overwrite")
        return ".uff", (Path(folder) / "a.uff").read_bytes()


def _rdata(frame):
    import rdata

    with tempfile.TemporaryDirectory() as folder:
        rdata.write_rda(Path(folder) / "a.rda", {"imu": frame.astype("float64")}, compression=None)
        return ".rda", (Path(folder) / "a.rda").read_bytes()


# -- readers, with the rules that whatever is accepted keeps --------------------------------------------------------------


def _within(frame):
    for column in frame:
        if pd.api.types.is_numeric_dtype(frame[column]):
            low, high = BOUNDS.get(column, (-LARGEST, LARGEST))
            values = frame[column].dropna()
            assert bool(((values >= low) & (values <= high)).all()), f"{column} outside {low} to {high}"
    if "unit" in frame:
        assert all(map(is_serial, frame["unit"])), "a serial number that is none"


def read_dwells(path):
    frame = exchange.read_dwells(path)
    assert np.isfinite(frame[["time_s", "out_x", "out_y", "out_z"]].to_numpy()).all()
    assert not frame.duplicated(["unit", "dwell"]).any()
    _within(frame)


def read_raw(path):
    how = {"columns": {"time": "t", "x": "ax", "y": "ay", "z": "az"}, "units": {"output": "g"}, "unit": "A1"}
    table, _ = files.read(path)
    for rows in ("samples", "dwells"):
        data = record.imported(table, mapping.build({**how, "rows": rows}, "fuzz"), path.name)
        for frame in (data.samples, data.dwells):
            if frame is not None:
                assert np.isfinite(frame["time_s"].to_numpy()).all()
                _within(frame)
        if data.samples is not None:
            assert (np.diff(data.samples["time_s"]) >= 0.0).all()
            assert table["t"].dtype.kind != "M" or data.samples["time_s"].iloc[-1] < 1e9, "units of time mistaken"


def read_recording(path):
    """A first look, and an import by the numbers of the columns."""
    inspection.inspect([path])
    content, _ = files.read_content(path)
    how = {"columns": {"time": "1", "x": "2", "y": "3", "z": "4"}, "units": {"output": "LSB"}, "unit": "A1"}
    for more in ({}, {"gaps": "split", "faulty": "leave-out"}):
        try:
            data = record.imported(content.table, mapping.build({**how, **more}, "fuzz"), path.name, content)
        except TumblelineError:
            continue
        for frame in (data.samples, data.dwells):
            if frame is not None:
                _within(frame)
        assert (np.diff(data.samples["time_s"]) >= 0.0).all()
        if data.dwells is not None:
            assert np.isfinite(data.dwells[["out_x", "out_y", "out_z"]].to_numpy()).all()


def read_history(path):
    frame = exchange.read_history(path)
    _within(frame)
    assert np.isfinite(frame["time_s"].to_numpy()).all()


def read_recipe(path):
    recipe = load_recipe(str(path))
    for name in ("soak_min_s", "settle_s", "dwell_s", "static_record_s"):
        assert 0.0 <= getattr(recipe, name) <= LONGEST_WAIT_S
    assert all(COLDEST_C <= t <= HOTTEST_C for t in recipe.temperatures_C)
    assert recipe.planned_records < 1e8


def read_slots(path):
    seating = read_seating(str(path))
    assert all(map(is_serial, seating.units))
    assert len(set(seating.units)) == len(set(seating.slots)) == len(seating.slots) == len(seating.units)
    if path.suffix == ".csv":
        text = read_text(path, "slot map")
        assert '"' in text or len(seating.slots) == sum(bool(line.strip(" ,;\t")) for line in text.splitlines()[1:]), (
            "row dropped"
        )


READERS = {
    "dwells": read_dwells,
    "raw": read_raw,
    "recording": read_recording,
    "history": read_history,
    "recipe": read_recipe,
    "limits": lambda path: read_limits(str(path)),
    "station": load_station,
    "model": read_model,
    "slots": read_slots,
    "profile": lambda path: parse_profile(read_text(path, "profile"), path.name),
    "policy": load_rules,
    "mapping": lambda path: mapping.build(mapping.from_file(path), path.name),
    "manifest": archive_files.read_json,
}
