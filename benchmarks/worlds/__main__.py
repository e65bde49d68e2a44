"""Verdicts in worlds that nobody prepared: `python benchmarks/worlds nulls faults small hidden outside loop part --runs 10`.

Prints for every world how many runs were called inadequate, named physics, and told the fault that was made, each with its 95 %
Clopper-Pearson interval. `--seeds development` are for setting constants, `judging` (the default) only for measuring.
`scenes` are plans with a blind spot; `part` goes on measuring there as a diagnosis proposes, and prints what was parted.
`--write FOLDER WORLD SEED` writes the tables of one run in the exchange format.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

import part  # noqa: E402
from scipy import stats  # noqa: E402
from tables import LOOP, TABLES  # noqa: E402
from verdict import diagnosed, looped  # noqa: E402
from world import make  # noqa: E402

SEEDS = {"development": 41_000_000, "judging": 87_000_000}


def interval(hits: int, runs: int) -> str:
    """A rate with its Clopper-Pearson interval."""
    limits = stats.binomtest(hits, runs).proportion_ci(0.95, "exact")
    return f"{hits}/{runs} [{limits.low:.2f}, {limits.high:.2f}]"


def _pooled(work: Callable[..., Any], tasks: list[Any], jobs: int) -> Iterator[Any]:
    if jobs <= 1:
        yield from map(work, tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(work, tasks)


def main() -> int:
    """Run tables and print them."""
    parser = argparse.ArgumentParser(prog="python benchmarks/worlds", description=__doc__)
    parser.add_argument("tables", nargs="*", default=["nulls", "faults"], choices=[*TABLES, "loop", "scenes", "part"])
    parser.add_argument("--world", action="append", default=[])
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--seeds", choices=SEEDS, default="judging")
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--rows", type=Path)
    parser.add_argument("--write", nargs=3, metavar=("FOLDER", "WORLD", "SEED"))
    options = parser.parse_args()
    if options.write:
        return _write(*options.write)
    seeds = range(SEEDS[options.seeds] + options.first, SEEDS[options.seeds] + options.first + options.runs)
    for table in options.tables:
        worlds = {"loop": LOOP, "part": part.SCENES, "scenes": part.SCENES}.get(table) or TABLES[table]
        names = [n for n in worlds if not options.world or n in options.world]
        # seeds of its own for each world: the same draw in all of them would count as many
        places = {name: 1000 * k for k, name in enumerate(worlds)}
        tasks = [
            (name, seed + places[name]) if table == "part" else (table, name, seed + places[name])
            for name in names
            for seed in seeds
        ]
        rows: dict[str, list[dict[str, Any]]] = defaultdict(list)
        for name, row in _pooled(WORK.get(table, diagnosed), tasks, options.jobs):
            rows[name].append(row)
            if options.rows:
                with options.rows.open("a", encoding="utf-8") as file:
                    file.write(json.dumps({"table": table, "world": name, **row}, default=str) + "\n")
            if len(rows[name]) == options.runs:
                print(LINES.get(table, _line)(name, rows[name]), flush=True)
        if table == "part":
            print(_part_line("all", [row for each in rows.values() for row in each]))
    return 0


def _line(name: str, rows: list[dict[str, Any]]) -> str:
    whole = [r for r in rows if "broken" not in r]
    n = len(whole)
    if not n:
        return f"{name:28s} broken: {rows[0]['broken'].splitlines()[-1]}"
    parts = [f"{name:28s} not adequate {interval(sum(r['adequate'] is False for r in whole), n)}"]
    parts.append(f"names physics beside the truth {interval(sum(bool(r['stray']) for r in whole), n)}")
    if whole[0]["found"] is not None:
        parts.append(f"fault told {interval(sum(r['found'] for r in whole), n)}")
        if whole[0].get("left_out") is not None:
            parts.append(f"spoilt dwells left out {interval(sum(r['left_out'] for r in whole), n)}")
        parts.append(f"another fault told {sum(bool(_other(r)) for r in whole)}")
    if whole[0]["held"] is not None:
        parts.append(
            f"in class {interval(sum(r['held'] for r in whole), n)}, exact {sum(r['held'] and r['alone'] for r in whole)}"
        )
    if whole[0]["outside"]:
        parts.append(f"a fault told {interval(sum(bool(_other(r)) for r in whole), n)}")
        parts.append(f"unexplained {interval(sum(r['unexplained'] for r in whole), n)}")
    told = Counter("+".join("|".join(e) for e in r["named"]) or "-" for r in whole)
    faults = Counter(b[0] for r in whole for b in r["blocked"])
    parts.append("; ".join(f"{k} ×{v}" for k, v in told.most_common(6)) + (f" {dict(faults)}" if faults else ""))
    parts.append(
        f"{sum(r['seconds'] for r in whole) / n:.1f} s" + (f", {len(rows) - n} broken" if n < len(rows) else "")
    )
    return " · ".join(parts)


def _other(row: dict[str, Any]) -> list[Any]:
    """Faults that were told and not made."""
    physics = {name for group in row["stray"] for name in group}
    own = {name for group in row["hidden"] for name in group}
    return [one for one in row["false"] if not set(one[0]) & (physics | own)]


def _loop_line(name: str, rows: list[dict[str, Any]]) -> str:
    parts = [f"{name:16s}"]
    for key in ("wrong fresh", "wrong left out", "right fresh", "right left out"):
        every = [v for r in rows for _, v in r.get(key, [])]
        if every:
            confirmed = interval(sum(v is True for v in every), len(every))
            parts.append(f"{key}: confirmed {confirmed}, refuted {sum(v is False for v in every)}")
    return " · ".join(parts)


def _part_line(name: str, rows: list[dict[str, Any]]) -> str:
    """How runs began, and what the proposals for the class with the truth parted."""
    told = Counter(r["ended"] for r in rows)
    made = [p for r in rows for p in r.get("proposals", [])]
    line = [f"{name:26s}", ", ".join(f"{k} {v}" for k, v in told.most_common())]
    if made:
        ratios = sorted(p["measured"] / p["promised"] for p in made if p["measured"] is not None)
        inside = sum(0.7 <= r <= 1.3 for r in ratios)
        line.append(f"parted {interval(sum(p['parted'] for p in made), len(made))}")
        if ratios:
            middle = ratios[len(ratios) // 2]
            line.append(f"within 30 % of the promise {interval(inside, len(ratios))}, median {middle:.2f}")
            for said, key in (("without noise", "added"), ("and at the noise of the promise", "same_noise")):
                clean = sorted(p[key] for p in made if p[key] is not None)
                inside = sum(0.7 <= r <= 1.3 for r in clean)
                line.append(f"{said} {interval(inside, len(clean))}, median {clean[len(clean) // 2]:.2f}")
        line.append(
            "; ".join(
                " | ".join(p["pair"]) + f" {p['promised']:.0f}→{p['measured']:.0f}"
                for p in made[:6]
                if p["measured"] is not None
            )
        )
    return " · ".join(line)


def _scene_line(name: str, rows: list[dict[str, Any]]) -> str:
    n = len(rows)
    told = Counter("+".join("|".join(e) for e in r["named"]) or "-" for r in rows)
    told.update(f"unexplained {r['unexplained']}" for r in rows if r["unexplained"])
    parts = [
        f"{name:26s} in class {interval(sum(r['held'] for r in rows), n)}",
        f"alone {sum(r['alone'] for r in rows)}",
    ]
    parts.append(f"another effect named {interval(sum(bool(r['beside']) for r in rows), n)}")
    parts.append("; ".join(f"{k} ×{v}" for k, v in told.most_common(6)))
    return " · ".join([*parts, f"{sum(r['seconds'] for r in rows) / n:.1f} s"])


WORK = {"loop": looped, "part": part.followed, "scenes": part.first_looks}
LINES = {"loop": _loop_line, "part": _part_line, "scenes": _scene_line}


def _write(folder: str, name: str, seed: str) -> int:
    worlds = {k: v for table in TABLES.values() for k, v in table.items()}
    made = make(worlds[name], int(seed))
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    for kind in ("dwells", "history", "fresh", "fresh_history"):
        getattr(made, kind).to_parquet(path / f"{kind.replace('_', '-')}.parquet")
    print(f"{path}: {name}, {made.told}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
