"""Files that people bring, one of each kind and format, and their readers with the rules that whatever is accepted keeps."""

import contextlib
import gzip
import io
import json
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from root_process import ROOT
from scipy.io import savemat

from pipelines.archive import files as archive_files
from pipelines.audit.rules import load_rules
from pipelines.export.waveforms import WRITERS, Channel, write_waveforms
from pipelines.importers import exchange, files, inspection, mapping, record
from pipelines.importers.values import BOUNDS, LARGEST
from pipelines.jobs.model_files import read_model
from pipelines.jobs.recipes import load_recipe, read_limits
from pipelines.jobs.seating import read_seating
from schemas.bounds import COLDEST_C, HOTTEST_C, LONGEST_WAIT_S
from schemas.errors import TumblelineError
from schemas.profile import Profile
from schemas.serials import is_serial
from schemas.station import load_station
from schemas.toml_files import parse_as, read_text

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
    """A small recording in every format that is written, as text of other programs, and of R."""
    frame = raw().drop(columns="heat")
    rows = "\n".join(";".join(f"{value:.6f}" for value in row) for row in frame.to_numpy()).replace(".", ",")
    stamps = (pd.Timestamp("2026-01-01") + pd.to_timedelta(frame["t"], unit="s")).dt.strftime("%d.%m.%Y %H:%M:%S.%f")
    recordings = [
        (".csv", f"Recorder: R-9\nStarted;12:00\n\n{';'.join(frame)}\n{rows}\n".encode()),
        (".csv", "\ufeff0;1;2;3\n".encode("utf-8") + rows.encode()),
        (".csv", csv(frame.assign(t=stamps))),
    ]
    channels = [Channel(name, "g", "A1", frame[name].to_numpy(), 0.1, k) for k, name in enumerate(("ax", "ay", "az"))]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.rda"
        with contextlib.suppress(ImportError):
            import rdata

            rdata.write_rda(path, {"imu": frame.astype("float64")}, compression=None)
            recordings.append((".rda", path.read_bytes()))
        for form, writer in WRITERS.items():
            path = path.with_suffix(writer.suffix)
            with contextlib.suppress(ImportError, TumblelineError):  # its library is not installed
                write_waveforms(form, channels, path)
                recordings.append((writer.suffix, path.read_bytes()))
    return recordings


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
    "profile": lambda path: parse_as(Profile, read_text(path, "profile"), path.name),
    "policy": load_rules,
    "mapping": lambda path: mapping.build(mapping.from_file(path), path.name),
    "manifest": archive_files.read_json,
}
