"""A folder in which the examples of every ``--help`` can be pasted: the files that they name, and an archive with runs."""

import importlib
import re
import shlex
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from cryptography.hazmat.primitives.asymmetric import rsa
from cryptography.hazmat.primitives.serialization import Encoding
from in_process import command
from laboratory import LABORATORY
from signing_keys import made_key, pem

from pipelines.cli import COMMANDS

ROOT = Path(__file__).resolve().parents[1]
UNITS = "SN1,SN2,SN3"
RECIPES = ROOT / "deploy" / "recipes"


def examples() -> Iterator[str]:
    """Every example of every command, each once, in the order of the help."""
    found: list[str] = []
    for stated in COMMANDS.values():
        module = importlib.import_module(f"pipelines.cli.{stated.module}")
        found += getattr(module, "EXAMPLES", ())
        for lines in getattr(module, "EXAMPLES_OF", {}).values():
            found += lines
    return iter(dict.fromkeys(found))


def words_of(example: str, names: dict[str, str]) -> list[str]:
    """An example as words, with what stands for a name of the reader's own replaced."""
    assert example.startswith("tumbleline ")
    return [re.sub("|".join(map(re.escape, names)), lambda m: names[m[0]], word) for word in shlex.split(example)[1:]]


def made_in(folder: Path) -> dict[str, str]:
    """Make the files and runs that the examples name in a folder, the working one; names of places and runs to replace."""
    line(folder)
    for recipe, repeat in (("line-six.toml", "0"), ("my.toml", "1"), ("my.toml", "0")):
        done = command(["run", recipe, "--station", "line-1.toml", "--direct", "--units", UNITS, "--repeat", repeat])
        assert done.returncode in {0, 1}, done.stderr
    recordings(folder)
    papers(folder)
    for name in (folder / "prefect" / "prefect.db", folder / "orchestrator.db"):
        name.parent.mkdir(exist_ok=True)
        with closing(sqlite3.connect(name)) as database:
            database.execute("create table flow_run (id text)")
    run_a, run_b = sorted(path.name for path in (folder / "archive" / "runs").glob("my-*"))
    (folder / "srv").mkdir()
    shutil.copytree(folder / "archive", folder / "srv" / "archive")
    return {
        "/mnt/copies": str(folder / "copies"), "/mnt/copy": str(folder / "copy"), "/srv": str(folder / "srv"),
        "SN1_1.pdf": "SN1_3.pdf", "RE-RUN": run_a, "RUN-A": run_a, "RUN-B": run_b,
    }  # fmt: skip


def line(folder: Path) -> None:
    """The recipe `my.toml`, its station, serial numbers and a model."""
    text = (RECIPES / "line-six.toml").read_text(encoding="utf-8")
    for old, new in (
        ('name = "line-six"', 'name = "my"'),
        ('units = ["LN-01", "LN-02", "LN-03", "LN-04"]', 'units = ["SN1", "SN2", "SN3"]\nseed = 3'),
        ("static_record_s = 0.0", "static_record_s = 300.0"),
    ):
        assert old in text, old
        text = text.replace(old, new)
    (folder / "my.toml").write_text(text, encoding="utf-8")
    shutil.copy(RECIPES / "line-six.toml", folder)
    shutil.copy(RECIPES / "line-quick.limits.toml", folder)
    shutil.copy(ROOT / "deploy" / "lines" / "two-chambers.toml", folder)
    station = (ROOT / "deploy" / "stations" / "simulated.toml").read_text(encoding="utf-8")
    (folder / "line-1.toml").write_text(re.sub('name = ".*"', 'name = "line-1"', station, count=1), encoding="utf-8")
    (folder / "lot-17.csv").write_text("slot,serial\n0,SN1\n1,SN2\n2,SN3\n", encoding="utf-8")
    (folder / "units.csv").write_text("serial,wafer\nSN1,W1\nSN2,W2\n", encoding="utf-8")
    (folder / "shifts.csv").write_text("run,shift\nmy-1,late\n", encoding="utf-8")
    model = '[model]\nname = "m"\nversion = 1\neffects = ["bias", "scale", "misalignment"]\n'
    (folder / "model.toml").write_text(model, encoding="utf-8")


def recordings(folder: Path) -> None:
    """Recordings, dwells and keys."""
    rng = np.random.default_rng(1)
    table = pd.read_parquet(next((folder / "archive" / "runs").glob("*/dwells.parquet")))
    table.to_csv(folder / "dwells.csv", index=False)
    for axis in "xyz":  # measured once more
        table[f"out_{axis}"] += 1e-4 * rng.normal(size=len(table))
    table.to_csv(folder / "fresh.csv", index=False)
    turned = _turned()
    time = 0.01 * np.arange(len(turned))
    counts = np.round(256000.0 * (turned * 1.002 + 0.01) + 25.0 * rng.normal(size=turned.shape))
    acc = pd.DataFrame({"t": time, **dict(zip(("ax", "ay", "az"), counts.T, strict=True))})
    for name in ("acc", "recording"):
        acc.to_csv(folder / f"{name}.csv", index=False)
    acc[:1000].to_csv(folder / "part-1.csv", index=False)
    acc[1000:].to_csv(folder / "part-2.csv", index=False)
    (folder / "columns.toml").write_text(
        'unit = "SN1"\nlocal_gravity_m_s2 = 9.80665\n[columns]\ntime = "t"\nx = "ax"\ny = "ay"\nz = "az"\n'
        '[units]\noutput = "LSB"\n',
        encoding="utf-8",
    )
    rest = np.round(256000.0 * np.array([0.01, 0.0, 1.0]) + 250.0 * rng.normal(size=(20000, 3)))
    frame = pd.DataFrame(rest, columns=["x", "y", "z"])
    frame.to_csv(folder / "rest.csv", index=False)
    frame = frame.assign(time_s=0.01 * np.arange(len(frame)), unit_C=25.0)
    turn = np.linspace(0.0, 6.0, 400)
    forces = pd.DataFrame({"force_x": np.sin(turn), "force_y": np.cos(turn), "force_z": 0.0 * turn})
    forces.assign(time_s=np.arange(400) / 100.0, unit_C=25.0).to_csv(folder / "trajectory.csv", index=False)
    shutil.copy(ROOT / "tests" / "data" / "frames" / "mbpoll-editcap.pcapng", folder / "capture.pcapng")
    command(["station", "check", "--read-only", "--record", "frames.jsonl"])
    for name in ("flight", "bench"):
        frame.to_csv(folder / f"{name}.csv", index=False)


def papers(folder: Path) -> None:
    """The laboratory of certificates, and the key that signs them."""
    (folder / "laboratory.toml").write_text(LABORATORY, encoding="utf-8")
    key = made_key(rsa.generate_private_key(public_exponent=65537, key_size=2048))
    (folder / "key.pem").write_bytes(pem(key))
    (folder / "laboratory.pem").write_bytes(key.certificate.public_bytes(Encoding.PEM))


def _turned() -> np.ndarray:
    """Specific force, g, of a unit that is turned by hand: 14 orientations of 5 s, half a second of turning between them."""
    faces = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 0, -1], [0, -1, 0], [-1, 0, 0], [0.6, 0.8, 0]])
    c, s = np.cos(0.7), np.sin(0.7)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array(
        [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    )
    ends = np.vstack([faces, faces @ turn])
    way = np.linspace(0.0, 1.0, 50)[:, None]
    pieces = [np.repeat(ends[:1], 500, axis=0)]
    for before, after in pairwise(ends):
        bent = (1.0 - way) * before + way * after + 0.3 * np.sin(np.pi * way) * np.cross(before, after)
        pieces += [bent / np.linalg.norm(bent, axis=1, keepdims=True), np.repeat(after[None], 500, axis=0)]
    return np.vstack(pieces)
