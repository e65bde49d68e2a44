"""Scores of an archive's runs on disk, one file for each batch of newly scored runs.

They are a sealed, derived cache: a file that was edited or has another layout is computed again from the runs.
``discovery/scores/<number>.scores`` has a row for each run; the columns of one plan are nearly equal for all its runs, so that
the products of the columns are stored once per file, as means.
"""

import io
import json
import sys
from collections.abc import Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from inertial.arrays import Array, over
from inertial.discovery.scores import LotScores, Products, correlations_of
from pipelines.archive import Archive, derived, files
from pipelines.archive.keys import digest
from pipelines.archive.store import Place
from pipelines.discovery.scored_run import ScoredRun, scored_runs
from pipelines.parallel import Distributor, map_partitions
from schemas.errors import ArchiveUnusable
from schemas.units import MICRO

FOLDER = "discovery"
VERSION = 6
AXES = 3
MOST_OPEN = 32  # files whose rows are kept in memory: units measured repeatedly were often measured together
BATCH = 8  # runs that one process scores at a time
TEXTS = ("run", "when", "station", "device", "model", "who", "left_out")
_BY_UNIT = ("units", "slots", "prints")
_PACKED = ("score", "own", "information", "station_scores", "tempco")
_STEPS = 63.0  # steps per octave of a unit's share of the information
_SHARE_STEPS = 58.0  # the same of the share left after elimination of the station's errors, down to one twentieth
_MEAN_STEPS = 256.0  # steps per octave of the mean information
_FINE, _LINEAR = 16.0, 64.0  # steps of a score per standard deviation, up to 64 of them; logarithmic beyond
_NOTHING = -(2**15)
_WITHIN, _ACROSS = 2048.0, 256.0  # steps per unit correlation of columns on one axis, and on two axes


class ScoreStore:
    """The scores of an archive."""

    def __init__(self, archive: Archive) -> None:
        self.archive = archive
        self.folder: Place = archive.root / FOLDER / "scores"
        self._opened = lru_cache(MOST_OPEN)(_rows_of)

    @cached_property
    def _all(self) -> tuple[dict[str, dict[str, Any]], dict[str, Products]]:
        """The heads of all runs, and the products of each set of columns over all files, by its hash."""
        heads, products = dict[str, dict[str, Any]](), dict[str, Products]()
        for path in sorted(self._paths(), key=lambda item: item.name):
            data, state = derived.unframed(path)
            if state == derived.EDITED:
                derived.warn_of_edits(path)
            if state != derived.SOUND or (read := content_of(data)) is None:
                continue
            table, of_file = read
            for row, head in enumerate(table.select([*TEXTS, "units", "prints", "floor"]).to_pylist()):
                # interned, because many of a hundred thousand runs have equal texts
                head |= {name: sys.intern(head[name]) for name in TEXTS if name not in {"run", "when"}}
                heads.setdefault(head["run"], head | {"file": path, "row": row})
            for name, product in of_file.items():
                products[name] = product if name not in products else Products.mean([products[name], product])
        return heads, products

    @property
    def heads(self) -> dict[str, dict[str, Any]]:
        """Texts (why it was left out, …), units, noise, file and row of every run, in the order of arrival."""
        return self._all[0]

    @property
    def products(self) -> list[Products]:
        """Products of columns, for each set of columns."""
        return list(self._all[1].values())

    def run(self, run: str) -> ScoredRun:
        """The scores of a run."""
        head = self.heads[run]
        return run_of(self._opened(head["file"]).slice(head["row"], 1).to_pylist()[0], self._all[1])

    def add(self, ids: Sequence[str], workers: int, distribute: Distributor | None = None) -> int:
        """Score runs without scores, in parallel processes; returns the number of newly scored runs."""
        new = [run_id for run_id in ids if run_id not in self.heads]
        if not new:
            return 0
        parts = [(self.archive.address, new[at : at + BATCH]) for at in range(0, len(new), BATCH)]
        parts_scored = map_partitions(scored_runs, parts, distribute, workers=workers, name="scores")
        scored = [run for part in parts_scored for run in part]
        if not scored:
            return 0
        number = 1 + max((int(path.name.split(".")[0]) for path in self._paths()), default=0)
        files.publish(self.folder / f"{number:06d}.scores", derived.framed(written(scored)))
        self._opened.cache_clear()
        self.__dict__.pop("_all", None)
        return len(scored)

    def _paths(self) -> list[Place]:
        return [path for path in self.folder.iterdir() if path.name.endswith(".scores")] if self.folder.is_dir() else []


def written(runs: Sequence[ScoredRun]) -> bytes:
    """A file of scores: a table with a row for each run, and the products of each set of columns after it."""
    products, groups = dict[str, list[Products]](), list[str]()
    for run in runs:
        of_run = None if run.scores is None else run.scores.products
        groups.append("" if of_run is None else digest([of_run.columns, of_run.station])[:12])
        if of_run is not None:
            products.setdefault(groups[-1], []).append(of_run)
    columns: dict[str, list[Any]] = {name: [getattr(run, name) for run in runs] for name in TEXTS}
    columns |= {name: [list(getattr(run, name)) for run in runs] for name in _BY_UNIT}
    columns |= {"columns": groups, "floor": [0.0 if run.scores is None else run.scores.floor for run in runs]}
    packed = [dict.fromkeys(_PACKED, b"") if run.scores is None else _packed(run.scores) for run in runs]
    columns |= {name: [of_run[name] for of_run in packed] for name in _PACKED}
    named = {name: [parts[0].columns, parts[0].station, len(parts)] for name, parts in products.items()}
    about = json.dumps({"version": VERSION, "columns": named}).encode()
    sink, buffer = pa.BufferOutputStream(), io.BytesIO()
    table = pa.table(columns).replace_schema_metadata({"about": about})
    pq.write_table(table, sink, compression="zstd", compression_level=6, write_statistics=False)
    arrays = {
        f"{name}/{key}": v for name, parts in products.items() for key, v in _folded(Products.mean(parts)).items()
    }
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    data = sink.getvalue().to_pybytes()
    return len(data).to_bytes(8, "big") + data + buffer.getvalue()


def content_of(data: bytes) -> tuple[pa.Table, dict[str, Products]] | None:
    """The rows of a file of scores, and the products of its columns by their hash; None for another version of the layout."""
    length = int.from_bytes(data[:8], "big")
    table = pq.read_table(pa.BufferReader(data[8 : 8 + length]))
    about = json.loads((table.schema.metadata or {}).get(b"about", b"{}"))
    if about.get("version") != VERSION:
        return None
    products: dict[str, Products] = {}
    with np.load(io.BytesIO(data[8 + length :]), allow_pickle=False) as arrays:
        for name, (sensor, station, lots) in about["columns"].items():
            if name:
                columns, of_station = (tuple((str(e), int(k)) for e, k in listed) for listed in (sensor, station))
                parts = {key: arrays[f"{name}/{key}"] for key in ("size", "lot", "inside")}
                products[name] = Products(columns, of_station, *_unfolded(parts, len(columns)), lots=int(lots))
    return table, products


def _rows_of(path: Place) -> pa.Table:
    """The rows of a file of scores that was sound before."""
    read = content_of(derived.unframed(path)[0])
    if read is None:
        raise ArchiveUnusable(f"{path}: the scores were changed while they were read; run it again")
    return read[0]


def run_of(row: Mapping[str, Any], products: Mapping[str, Products]) -> ScoredRun:
    """The run of a row of a file."""
    scores = None if row["left_out"] else _unpacked(row, products[row["columns"]])
    fields: dict[str, Any] = {name: row[name] for name in TEXTS} | {name: tuple(row[name]) for name in _BY_UNIT}
    return ScoredRun(**fields, scores=scores)


def _packed(scores: LotScores) -> dict[str, bytes]:
    """Scores in few bytes: in sixteenths of their standard deviation, information to three digits."""
    own, mean = scores.own, scores.own.mean(axis=0)
    z = scores.score / (np.sqrt(np.where(own > 0.0, own, 1.0)) * _LINEAR)
    octaves = np.where(mean > 0.0, np.round(_MEAN_STEPS * np.log2(np.where(mean > 0.0, mean, 1.0))), _NOTHING)
    share = _logarithms(over(scores.information, len(own) * mean), _SHARE_STEPS, 254)
    # ratios between a quarter and four in steps of one per cent; zero is exact
    ratio = _logarithms(over(own, mean), _STEPS, 128)
    return {
        "score": _planes(_FINE * _LINEAR * np.arcsinh(z)),
        # a unit's ratios are similar in all columns: their differences are small and compress well
        "own": np.diff(ratio, axis=1, prepend=np.uint8(0)).tobytes(),
        "information": _planes(octaves) + share.tobytes(),
        "station_scores": scores.of_station.astype(np.float32).tobytes(),
        "tempco": (MICRO * scores.tempco).astype(np.float16).tobytes(),
    }


def _unpacked(row: Mapping[str, Any], products: Products) -> LotScores:
    """The scores of :func:`_packed`."""
    units, count = len(row["units"]), len(row["information"]) // 3
    octaves = _of_planes(row["information"][: 2 * count])
    mean = np.where(octaves > _NOTHING, 2.0 ** (octaves / _MEAN_STEPS), 0.0)
    share = _of_logarithms(np.frombuffer(row["information"][2 * count :], dtype=np.uint8), _SHARE_STEPS, 254)
    code = np.cumsum(np.frombuffer(row["own"], dtype=np.uint8).reshape(units, -1), axis=1, dtype=np.uint8)
    own = _of_logarithms(code, _STEPS, 128) * mean
    z = _LINEAR * np.sinh(_of_planes(row["score"]).reshape(own.shape) / (_FINE * _LINEAR))
    return LotScores(
        products=products,
        score=z * np.sqrt(own),
        own=own,
        information=units * mean * share,
        of_station=np.frombuffer(row["station_scores"], dtype=np.float32).astype(np.float64).reshape(2, -1),
        tempco=np.frombuffer(row["tempco"], dtype=np.float16).astype(np.float64).reshape(units, -1) / MICRO,
        floor=float(row["floor"]),
    )


def _steps(k: int) -> Array:
    """Steps per unit correlation of columns, (3·k, 3·k)."""
    return np.where(np.kron(np.eye(AXES), np.ones((k, k))) > 0.0, _WITHIN, _ACROSS)


def _folded(products: Products) -> dict[str, NDArray[Any]]:
    """Upper triangles of the correlations of columns, for sums over units, and within lots; and the sizes."""
    k = len(products.columns)
    lot, inside = _steps(k) * correlations_of(products.lot), _WITHIN * correlations_of(products.inside)
    upper = {"lot": lot[np.triu_indices(len(lot))], "inside": inside[:, *np.triu_indices(k)]}
    packed = {name: np.frombuffer(_planes(values), dtype=np.uint8) for name, values in upper.items()}
    return packed | {"size": products.size.astype(np.float32)}


def _unfolded(parts: Mapping[str, NDArray[Any]], k: int) -> tuple[Array, Array, Array]:
    """Correlations (3·k, 3·k) and (3, k, k) and sizes (3·k,), of :func:`_folded`."""
    lot, inside = np.zeros((1, AXES * k, AXES * k)), np.zeros((AXES, k, k))
    for name, square in (("lot", lot), ("inside", inside)):
        upper = np.triu_indices(square.shape[-1])
        square[:, *upper] = _of_planes(parts[name].tobytes()).reshape(len(square), -1)
        square[:, *upper[::-1]] = square[:, *upper]
    return lot[0] / _steps(k), inside / _WITHIN, parts["size"].astype(np.float64)


def _planes(values: Array) -> bytes:
    """Values rounded to two-byte integers, all high bytes first: these are nearly equal and compress well."""
    return np.round(values).astype("<i2").reshape(-1, 1).view(np.uint8).T[::-1].tobytes()


def _of_planes(data: bytes) -> Array:
    pairs = np.frombuffer(data, dtype=np.uint8).reshape(2, -1)[::-1].T
    return np.ascontiguousarray(pairs).view("<i2").astype(np.float64).reshape(-1)


def _logarithms(ratio: Array, steps: float, unity: int) -> NDArray[np.uint8]:
    """Ratios as logarithms in one byte; ``unity`` is the code of a ratio of one, zero that of zero."""
    code = np.round(steps * np.log2(np.clip(ratio, 1e-30, None))) + unity
    return np.where(ratio > 0.0, np.clip(code, 1, 255), 0).astype(np.uint8)


def _of_logarithms(code: NDArray[np.uint8], steps: float, unity: int) -> Array:
    return np.where(code > 0, 2.0 ** ((code.astype(np.float64) - unity) / steps), 0.0)
