"""Scores of an archive's runs on disk, one file for each batch of newly scored runs.

They are a sealed, derived cache: a file that was edited or has another layout is computed again from the runs.
``discovery/scores/<number>.scores`` has a row for each run; the columns of one plan are nearly equal for all its runs, so that
the products of the columns are stored once per file, as means.
"""

import io
import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from inertial.arrays import Array
from pipelines.archive import Archive, derived, files
from pipelines.archive.keys import digest
from pipelines.archive.store import Place
from pipelines.discovery.scored_run import ScoredRun, scored_runs
from pipelines.parallel import Distributor, map_partitions
from schemas.errors import ArchiveUnusable
from schemas.units import MICRO

FOLDER = "discovery"
VERSION = 4
TEXTS = ("run", "when", "station", "device", "model", "who", "left_out")
_STEPS = 63.0  # steps per octave of a unit's share of the information
_SHARE_STEPS = (
    58.0  # steps per octave of the share left after elimination of the station's errors, down to one twentieth
)
_MEAN_STEPS = 256.0  # steps per octave of the mean information
_FINE, _LINEAR = 16.0, 64.0  # steps of a score per standard deviation, up to 64 of them; logarithmic beyond
_NOTHING = -(2**15)
AXES = 3
_WITHIN, _ACROSS = 2048.0, 256.0  # steps per unit correlation of columns on one axis, and on two axes
MOST_OPEN = 32  # files whose rows are kept in memory: units measured repeatedly were often measured together
BATCH = 8  # runs that one process scores at a time


@dataclass(frozen=True)
class Products:
    """Means over runs: correlations of columns in sums of lots (m·k, m·k) and inside lots (m, k, k), and sizes (m·k,)."""

    columns: tuple[tuple[str, int], ...]
    of_station: tuple[tuple[str, int], ...]
    lot: Array
    inside: Array
    size: Array
    runs: int

    def with_more(self, other: "Products") -> "Products":
        """Means over the runs of both."""
        total = self.runs + other.runs
        means = {
            name: (self.runs * getattr(self, name) + other.runs * getattr(other, name)) / total
            for name in ("lot", "inside", "size")
        }
        return replace(self, runs=total, **means)


class ScoreFile(NamedTuple):
    """One file of scores, of which the packed rows stay on disk.

    heads : texts, units and noise of each run · names : columns of the sensor and of the station, and number of runs, by hash
    """

    path: Place
    heads: list[dict[str, Any]]
    names: dict[str, Any]


class ScoreStore:
    """The scores of an archive."""

    def __init__(self, archive: Archive) -> None:
        self.archive = archive
        self.folder: Place = archive.root / FOLDER / "scores"
        self._opened: dict[int, pa.Table] = {}

    @cached_property
    def _all(self) -> tuple[list[ScoreFile], list[Products]]:
        """Every intact file, in order of creation, and the products of all of them."""
        out, products = list[ScoreFile](), dict[Any, Products]()
        for path in sorted(self._paths(), key=lambda item: item.name):
            data, state = derived.unframed(path)
            if state == derived.EDITED:
                derived.warn_of_edits(path)
            if state != derived.SOUND or (read := _content(data)) is None:
                continue
            names = _names(read.about)
            heads = read.table.select([*TEXTS, "units", "floor"]).to_pylist()
            for head in heads:  # interned, because many of a hundred thousand runs have equal texts
                head.update({name: sys.intern(head[name]) for name in TEXTS if name not in {"run", "when"}})
            out.append(ScoreFile(path, heads, names))
            with np.load(io.BytesIO(read.products), allow_pickle=False) as arrays:
                for name in filter(None, names):
                    columns, station, runs = names[name]
                    product = _unfolded(name, columns, station, runs, arrays)
                    key = product.columns, product.of_station
                    products[key] = product if key not in products else products[key].with_more(product)
        return out, list(products.values())

    @property
    def files(self) -> list[ScoreFile]:
        """Every intact file, in order of creation."""
        return self._all[0]

    @property
    def products(self) -> list[Products]:
        """Products of columns, for each set of columns."""
        return self._all[1]

    @cached_property
    def rows(self) -> dict[str, tuple[int, int]]:
        """File and row of every run, in the order of arrival."""
        found: dict[str, tuple[int, int]] = {}
        for number, file in enumerate(self.files):
            for row, content in enumerate(file.heads):
                found.setdefault(content["run"], (number, row))
        return found

    def head(self, run: str) -> dict[str, Any]:
        """The texts of a run: when, station, device, model, why it was left out."""
        number, row = self.rows[run]
        return self.files[number].heads[row]

    def run(self, run: str) -> ScoredRun:
        """The scores of a run."""
        number, row = self.rows[run]
        file = self.files[number]
        if number not in self._opened:
            read = _content(derived.unframed(file.path)[0])
            if read is None:
                raise ArchiveUnusable(f"{file.path}: the scores were changed while they were read; run it again")
            while len(self._opened) >= MOST_OPEN:
                self._opened.pop(next(iter(self._opened)))
            self._opened[number] = read.table
        return _run_of(self._opened[number].slice(row, 1).to_pylist()[0], file.names)

    def add(self, ids: Sequence[str], workers: int, distribute: Distributor | None = None) -> int:
        """Score runs without scores, in parallel processes; returns the number of newly scored runs."""
        new = [run_id for run_id in ids if run_id not in self.rows]
        if not new:
            return 0
        parts = [(self.archive.address, new[at : at + BATCH]) for at in range(0, len(new), BATCH)]
        parts_scored = map_partitions(scored_runs, parts, distribute, workers=workers, name="scores")
        scored = [run for part in parts_scored for run in part]
        if not scored:
            return 0
        number = 1 + max((int(path.name.split(".")[0]) for path in self._paths()), default=0)
        files.publish(self.folder / f"{number:06d}.scores", derived.framed(written(scored)))
        self._opened.clear()
        self.__dict__.pop("_all", None)
        self.__dict__.pop("rows", None)
        return len(scored)

    def _paths(self) -> list[Place]:
        return [path for path in self.folder.iterdir() if path.name.endswith(".scores")] if self.folder.is_dir() else []


def written(runs: Sequence[ScoredRun]) -> bytes:
    """A file of scores: a table with a row for each run, and the products of each set of columns in its header."""
    groups: dict[str, list[ScoredRun]] = {}
    for run in runs:
        groups.setdefault(_group(run), []).append(run)
    products = {name: _products_of(group) for name, group in groups.items() if not group[0].left_out}
    columns: dict[str, list[Any]] = {name: [getattr(run, name) for run in runs] for name in TEXTS}
    columns |= {"units": [list(run.units) for run in runs], "slots": [list(run.slots) for run in runs]}
    columns |= {"columns": [_group(run) for run in runs], "floor": [run.floor for run in runs]}
    for name in ("score", "own", "information", "station_scores", "tempco"):
        columns[name] = [_packed(name, run) for run in runs]
    buffer = io.BytesIO()
    arrays = {f"{name}/{key}": v for name, parts in products.items() for key, v in parts.items()}
    np.savez_compressed(buffer, allow_pickle=False, **arrays)
    named = {name: [group[0].columns, group[0].of_station, len(group)] for name, group in groups.items()}
    about = {"version": VERSION, "columns": named}
    table = pa.table(columns).replace_schema_metadata({"about": json.dumps(about).encode()})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd", compression_level=6, write_statistics=False)
    data = sink.getvalue().to_pybytes()
    return len(data).to_bytes(8, "big") + data + buffer.getvalue()


def _group(run: ScoredRun) -> str:
    return "" if run.left_out else digest([run.columns, run.of_station])[:12]


def _packed(name: str, run: ScoredRun) -> bytes:
    """An array of a run in few bytes: scores in sixteenths of their standard deviation, information to three digits."""
    if run.left_out or run.score is None or run.own is None or run.information is None or run.station_scores is None:
        return b""
    if name == "tempco":
        return b"" if run.tempco is None else (MICRO * run.tempco).astype(np.float16).tobytes()
    if name == "score":
        root = np.sqrt(np.where(run.own > 0.0, run.own, 1.0))
        steps = np.round(_FINE * _LINEAR * np.arcsinh(run.score / (root * _LINEAR))).astype("<i2")
        return _planes(steps)
    mean = run.own.mean(axis=0)
    if name == "own":
        # ratios between a quarter and four in steps of one per cent; zero is exact
        ratio = run.own / np.where(mean > 0.0, mean, 1.0)
        code = _logarithms(ratio, _STEPS, 128)
        # a unit's ratios are similar in all columns: their differences are small and compress well
        return np.diff(code, axis=1, prepend=np.uint8(0)).tobytes()
    if name == "information":
        share = run.information / np.where(mean > 0.0, len(run.own) * mean, 1.0)
        octaves = np.where(mean > 0.0, np.round(_MEAN_STEPS * np.log2(np.where(mean > 0.0, mean, 1.0))), _NOTHING)
        return _planes(octaves.astype("<i2")) + _logarithms(share, _SHARE_STEPS, 254).tobytes()
    return run.station_scores.astype(np.float32).tobytes()


def _planes(values: NDArray[np.int16]) -> bytes:
    """Two-byte integers with all high bytes first: these are nearly equal and compress well."""
    return np.ascontiguousarray(values).view(np.uint8).reshape(-1, 2).T[::-1].tobytes()


def _of_planes(data: bytes) -> Array:
    pairs = np.frombuffer(data, dtype=np.uint8).reshape(2, -1)[::-1].T
    return np.ascontiguousarray(pairs).view("<i2").astype(np.float64).reshape(-1)


def _logarithms(ratio: Array, steps: float, unity: int) -> NDArray[np.uint8]:
    """Ratios as logarithms in one byte; ``unity`` is the code of a ratio of one, zero that of zero."""
    code = np.round(steps * np.log2(np.clip(ratio, 1e-30, None))) + unity
    return np.where(ratio > 0.0, np.clip(code, 1, 255), 0).astype(np.uint8)


def _of_logarithms(code: NDArray[np.uint8], steps: float, unity: int) -> Array:
    return np.where(code > 0, 2.0 ** ((code.astype(np.float64) - unity) / steps), 0.0)


def _products_of(runs: Sequence[ScoredRun]) -> dict[str, NDArray[Any]]:
    arrays = {name: np.mean([getattr(run, name) for run in runs], axis=0) for name in ("lot", "inside", "size")}
    k, matrix = arrays["inside"].shape[-1], _correlated(arrays["lot"])
    upper, lot = np.triu_indices(k), matrix.reshape(AXES, k, AXES, k)
    within = np.stack([lot[axis, :, axis] for axis in range(AXES)])
    across = np.stack([lot[axis, :, axis - 1] for axis in range(AXES)])
    return {
        "size": arrays["size"].astype(np.float32),
        "within": _steps_of(within[:, *upper], _WITHIN),
        "across": _steps_of(across, _ACROSS),
        "inside": _steps_of(_correlated(arrays["inside"])[:, *upper], _WITHIN),
    }


def _correlated(products: Array) -> Array:
    root = np.sqrt(np.maximum(np.diagonal(products, axis1=-2, axis2=-1), 1e-300))
    return products / (root[..., :, None] * root[..., None, :])


def _steps_of(correlations: Array, steps: float) -> NDArray[np.uint8]:
    return np.frombuffer(_planes(np.round(steps * correlations).astype("<i2")), dtype=np.uint8)


class _Content(NamedTuple):
    table: pa.Table
    about: dict[str, Any]
    products: bytes


def _content(data: bytes) -> _Content | None:
    """The rows, the metadata and the products of a file; None for another version of the layout."""
    length = int.from_bytes(data[:8], "big")
    table = pq.read_table(pa.BufferReader(data[8 : 8 + length]))
    about = json.loads((table.schema.metadata or {}).get(b"about", b"{}"))
    return _Content(table, about, data[8 + length :]) if about.get("version") == VERSION else None


def _names(about: dict[str, Any]) -> dict[str, Any]:
    return {name: (_pairs(entry[0]), _pairs(entry[1]), int(entry[2])) for name, entry in about["columns"].items()}


def _pairs(listed: Sequence[Sequence[Any]]) -> tuple[tuple[str, int], ...]:
    return tuple((str(name), int(column)) for name, column in listed)


def _unfolded(
    name: str, columns: tuple[tuple[str, int], ...], station: tuple[tuple[str, int], ...], runs: int, arrays: Any
) -> Products:
    k = len(columns)
    upper, lot = np.triu_indices(k), np.zeros((AXES, k, AXES, k))
    inside, within = np.zeros((2, AXES, k, k))
    for kind, square in (("inside", inside), ("within", within)):
        flat = _of_planes(arrays[f"{name}/{kind}"].tobytes()).reshape(AXES, -1) / _WITHIN
        square[:, *upper] = flat
        square[:, *upper[::-1]] = flat
    across = _of_planes(arrays[f"{name}/across"].tobytes()).reshape(AXES, k, k) / _ACROSS
    for axis in range(AXES):
        lot[axis, :, axis] = within[axis]
        lot[axis, :, axis - 1], lot[axis - 1, :, axis] = across[axis], across[axis].T
    size = arrays[f"{name}/size"].astype(np.float64)
    return Products(columns, station, lot.reshape(AXES * k, AXES * k), inside, size, runs)


def _run_of(row: dict[str, Any], names: dict[str, Any]) -> ScoredRun:
    texts = {name: row[name] for name in TEXTS}
    units = tuple(row["units"])
    if row["left_out"]:
        return ScoredRun(**texts, units=units)
    columns, station, _ = names[row["columns"]]
    packed, count = row["information"], len(row["information"]) // 3
    octaves = _of_planes(packed[: 2 * count])
    mean = np.where(octaves > _NOTHING, 2.0 ** (octaves / _MEAN_STEPS), 0.0)
    share = _of_logarithms(np.frombuffer(packed[2 * count :], dtype=np.uint8), _SHARE_STEPS, 254)
    information = len(units) * mean * share
    code = np.cumsum(np.frombuffer(row["own"], dtype=np.uint8).reshape(len(units), -1), axis=1, dtype=np.uint8)
    own = _of_logarithms(code, _STEPS, 128) * mean
    steps = _of_planes(row["score"]).reshape(own.shape)
    z = _LINEAR * np.sinh(steps / (_FINE * _LINEAR))
    return ScoredRun(
        **texts,
        units=units,
        slots=tuple(row["slots"]),
        columns=columns,
        of_station=station,
        score=z * np.sqrt(own),
        own=own,
        information=information,
        station_scores=np.frombuffer(row["station_scores"], dtype=np.float32).astype(np.float64).reshape(2, -1),
        tempco=np.frombuffer(row["tempco"], dtype=np.float16).astype(np.float64).reshape(len(units), -1) / MICRO,
        floor=float(row["floor"]),
    )
