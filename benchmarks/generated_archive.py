"""A generated archive of many lots in the archive's own format: `python benchmarks/generated_archive.py FOLDER --lots 10000`.

Each lot has ten units, 24 poses at three temperatures for the fit (72 dwells) and four for verification. Half of the lots have
new units, half have units that return about every half year. The hidden events (a drifting unit, two exchanged
serials, a change of the level of a table, a shifted slot, a bad lot, a gauge study) are written beside the
archive, as FOLDER.truth.json.

Files are written without fsync and without the stages of the product: ordinary least squares represents an earlier version of
the program. There are no records (raw samples): re-runs start with the fit, and `tumbleline verify` correctly reports for
every run that its capture and its report are missing.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
import time
from datetime import UTC, datetime, timedelta
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from benchmarks.generated_lots import PER_LOT, Factory, Lot  # noqa: E402 - run as a script from any folder
from benchmarks.generated_tables import EFFECTS, Measured, base_tables, decided_tables, fitted_tables  # noqa: E402
from inertial import poses  # noqa: E402
from pipelines.archive import files, parquet  # noqa: E402
from pipelines.archive.archive import FORMAT  # noqa: E402
from pipelines.archive.keys import digest, libraries, stage_key  # noqa: E402
from pipelines.stages.figures import UNITS  # noqa: E402
from pipelines.tables.calibration import column_names, unit_texts  # noqa: E402
from schemas import tables  # noqa: E402
from schemas.decisions import describe_rule  # noqa: E402
from schemas.limits import limits_of  # noqa: E402
from schemas.poses import Pose  # noqa: E402
from schemas.recipe import Recipe  # noqa: E402
from schemas.station import load_station  # noqa: E402
from stations.plant.device import stream  # noqa: E402

BEGIN = datetime(2021, 1, 4, 6, tzinfo=UTC)
CODE = "0" * 64  # of an earlier version: the present stages have other keys
VERIFICATION = ((35.0, 15.0), (70.0, 140.0), (105.0, -100.0), (140.0, 60.0))
LIMITS = {
    "verification_norm_ug": (1500.0, "µg"), "verification_ratio": (1.5, "1"), "bias_error_ug": (1000.0, "µg"),
    "zero_g_offset_mg": (35.0, "mg"), "misalignment_mrad": (15.0, "mrad"), "bias_temperature_ug_K": (200.0, "µg/K"),
    "scale_temperature_ppm_K": (800.0, "ppm/K"),
}  # fmt: skip
STAGES = {
    **dict.fromkeys(("readings", "history"), "capture"), "verdicts": "validate", "dwells": "reduce",
    **dict.fromkeys(("coefficients", "covariance", "residuals", "predictions", "wander"), "fit"),
    **dict.fromkeys(("verification", "verification_poses"), "verify"), **dict.fromkeys(("allan", "noise"), "noise"),
    **dict.fromkeys(("figures", "grades"), "grade"),
}  # fmt: skip
ALLAN = ("tau_s", "deviation_ug", "low_ug", "high_ug", "fitted_ug")
_context: dict[str, Any] = {}  # common data of the writers, made before the fork


def recipe_for(device: str) -> Recipe:
    """The recipe: 24 directions spread over the sphere, three temperatures, no static record."""
    fit = [Pose(name=f"p{i:02d}", outer_deg=a, inner_deg=b) for i, (a, b) in enumerate(_directions(24), start=1)]
    check = [Pose(name=f"v{i:02d}", outer_deg=a, inner_deg=b) for i, (a, b) in enumerate(VERIFICATION, start=1)]
    return Recipe(
        name="line", description="24 directions, 3 temperatures, 4 verification poses", device=device,
        local_gravity_m_s2=9.80665, temperatures_C=[-10.0, 25.0, 60.0], poses=fit, verification=check,
        static_pose=Pose(name="static", outer_deg=0.0, inner_deg=0.0), effects=list(EFFECTS), limits="line",
    )  # fmt: skip


def _directions(count: int) -> list[tuple[float, float]]:
    """Outer and inner angle of directions spread over the sphere, degrees."""
    return [(round(float(a), 6), round(float(b), 6)) for a, b in poses.plan(f"fibonacci{count}")]


def write_archive(folder: Path, lots: int, *, years: float = 5.0, seed: int = 1, workers: int = 2) -> dict[str, Any]:
    """Write the archive; its hidden events."""
    factory = Factory(lots, years, seed)
    made = factory.lots()
    folder.mkdir(parents=True)
    (folder / "archive.json").write_bytes(files.json_bytes({"product": "tumbleline", "format": FORMAT}))
    recipes = {device: recipe_for(device) for device in factory.presets}
    limits = limits_of(
        {"name": "line", "figures": {name: {"max": limit, "unit": unit} for name, (limit, unit) in LIMITS.items()}},
        UNITS,
    )
    station = load_station().model_dump(mode="json")
    _context.update(
        folder=folder, lots=made, recipes=recipes, limits=limits, station=station, presets=factory.presets, seed=seed
    )
    _context["names"] = [list(axis) for axis in column_names(EFFECTS)]
    _context["texts"] = {device: _texts(preset.output_unit) for device, preset in factory.presets.items()}
    chunks = [range(k, min(k + 50, lots)) for k in range(0, lots, 50)]
    if workers > 1:
        with get_context("fork").Pool(workers) as pool:
            pool.map(_write_chunk, chunks, chunksize=1)
    else:
        for chunk in chunks:
            _write_chunk(chunk)
    truth = {"begin": BEGIN.isoformat(), "days": factory.days, "seed": seed, **_dated(factory.events, made)}
    (folder.parent / f"{folder.name}.truth.json").write_bytes(files.json_bytes(truth))
    return truth


def _dated(events: dict[str, Any], made: list[Lot]) -> dict[str, Any]:
    """The events with their dates and runs."""
    out: dict[str, Any] = {}
    for name, event in events.items():
        out[name] = dict(event)
        if "day" in event:
            out[name]["date"] = (BEGIN + timedelta(days=event["day"])).isoformat()
        if "lot" in event:
            lot = made[event["lot"]]
            out[name] |= {"run": _run_id(lot), "date": (BEGIN + timedelta(days=lot.day)).isoformat()}
    return out


def _texts(unit: str) -> list[str]:
    from inertial import effects

    return [text for name in EFFECTS for text in unit_texts(effects.get(name), unit)]  # type: ignore[arg-type]


def _run_id(lot: Lot) -> str:
    return f"line-{digest({'lot': lot.number, 'day': lot.day, 'kind': lot.kind})[:10]}"


def _write_chunk(numbers: range) -> int:
    for number in numbers:
        _write_lot(_context["lots"][number])
    return len(numbers)


def _write_lot(lot: Lot) -> None:
    limits, device = _context["limits"], lot.device
    recipe, preset = _context["recipes"][device], _context["presets"][device]
    measured = Measured(lot, recipe, preset, stream(_context["seed"], lot.number, "dwells"))
    content = base_tables(measured)
    content |= fitted_tables(measured, _context["names"], _context["texts"][device])
    content |= decided_tables(measured, limits, describe_rule(limits))
    content |= _no_static_record()
    run = _context["folder"] / "runs" / _run_id(lot)
    run.mkdir(parents=True)
    capture = digest({"lot": lot.number})[:16]
    _write_run_json(run, lot, recipe, capture)
    _write_tables(run, content, _when(lot), capture)
    (run / "report.html").write_text("<!DOCTYPE html><title>not drawn</title>\n", encoding="utf-8")


def _when(lot: Lot) -> str:
    return (BEGIN + timedelta(days=lot.day)).isoformat(timespec="milliseconds")


def _provenance(when: str) -> dict[str, Any]:
    return {"who": "generator", "where": "generated", "when": when, "libraries": libraries()}


def _write_run_json(run: Path, lot: Lot, recipe: Recipe, capture: str) -> None:
    about = {
        **_provenance(_when(lot)), "capture": capture, "recipe": recipe.model_dump(mode="json"),
        "limits": _context["limits"].model_dump(mode="json"), "station": {**_context["station"], "name": lot.station},
        "lot": {"units": [{"serial": a, "slot": b} for a, b in zip(lot.serials, lot.slots, strict=True)],
                "device": lot.device, "seed": 0, "repeat": 0},
    }  # fmt: skip
    (run / "run.json").write_bytes(files.json_bytes(about))


def _no_static_record() -> dict[str, dict[str, Any]]:
    text, number = np.empty(0, dtype=object), np.empty(0)
    return {
        "allan": {"unit": text, "axis": text, **dict.fromkeys(ALLAN, number)},
        "noise": {"unit": text, "axis": text, "term": text, **dict.fromkeys(("value", "low", "high"), number),
                  "identified": np.empty(0, dtype=bool), "unit_text": text},
    }  # fmt: skip


def _write_tables(run: Path, content: dict[str, dict[str, Any]], when: str, capture: str) -> None:
    hashes: dict[str, str] = {}
    inputs_of = {
        "capture": {"records": digest({})}, "validate": ("readings",), "reduce": ("readings", "verdicts"),
        "fit": ("dwells", "history"), "verify": ("dwells", "history", "coefficients", "covariance", "predictions"),
        "noise": ("readings", "coefficients", "covariance"),
        "grade": ("verdicts", "coefficients", "covariance", "residuals", "verification", "verification_poses", "noise"),
    }  # fmt: skip
    for name, stage in STAGES.items():
        own = inputs_of[stage]
        inputs = own if isinstance(own, dict) else {one: hashes[one] for one in own}
        code, parameters = ("", {"capture": capture}) if stage == "capture" else (CODE, {})
        data = _parquet(name, content[name])
        hashes[name] = hashlib.sha256(data).hexdigest()
        (run / f"{name}.parquet").write_bytes(data)
        rows = len(next(iter(content[name].values())))
        manifest = {
            **_provenance(when), "stage": stage, "key": stage_key(stage, inputs, parameters, code), "sha256": hashes[name],
            "rows": rows, "inputs": inputs, "parameters": parameters, "code": code, "schema": tables.VERSION,
        }  # fmt: skip
        (run / f"{name}.json").write_bytes(files.json_bytes(manifest))


def _parquet(name: str, columns: dict[str, Any]) -> bytes:
    arrays = {key: pa.array(v, pa.string()) if v.dtype.kind in "OU" else pa.array(v) for key, v in _arrays(columns)}
    marks = {parquet.TABLE_MARK: name.encode(), parquet.SCHEMA_MARK: str(tables.VERSION).encode()}
    sink = pa.BufferOutputStream()
    pq.write_table(pa.table(arrays).replace_schema_metadata(marks), sink, compression="zstd", compression_level=1)
    return sink.getvalue().to_pybytes()


def _arrays(columns: dict[str, Any]) -> list[tuple[str, np.ndarray]]:
    return [(key, np.asarray(value)) for key, value in columns.items()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder of the archive; must not exist")
    parser.add_argument("--lots", type=int, default=10000, help="number of lots of ten units")
    parser.add_argument("--years", type=float, default=5.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    if options.folder.exists():
        print(
            f"generated_archive: {options.folder} exists already, a new folder is needed; give another", file=sys.stderr
        )
        return 2
    start = time.perf_counter()
    truth = write_archive(options.folder, options.lots, years=options.years, seed=options.seed, workers=options.workers)
    seconds = time.perf_counter() - start
    print(f"{options.lots} lots, {options.lots * PER_LOT} unit calibrations and check standards: {seconds:.0f} s "
          f"({1e3 * seconds / options.lots:.1f} ms a lot)")  # fmt: skip
    print(json.dumps(truth, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
