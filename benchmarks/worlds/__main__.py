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
import time
import traceback
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parents[1])]

import part  # noqa: E402
from physics import OUTSIDE  # noqa: E402
from scipy import stats  # noqa: E402
from tables import LOOP, RIGHT, TABLES, WRONG  # noqa: E402
from world import Made, World, make  # noqa: E402

SEEDS = {"development": 41_000_000, "judging": 87_000_000}
BASE = ("bias", "scale", "misalignment", "bias_temperature", "scale_temperature")
DATA = {"data"}


def interval(hits: int, runs: int) -> str:
    """A rate with its Clopper-Pearson interval."""
    limits = stats.binomtest(hits, runs).proportion_ci(0.95, "exact")
    return f"{hits}/{runs} [{limits.low:.2f}, {limits.high:.2f}]"


def diagnosed(task: tuple[str, str, int]) -> tuple[str, dict[str, Any]]:
    """What the diagnosis says of one run, beside the truth."""
    from pipelines.diagnosis.diagnose import diagnose

    table, name, seed = task
    world: World = TABLES[table][name]
    made = make(world, seed)
    begin = time.process_time()
    try:
        document = diagnose(made.dwells, made.history)
    except Exception:  # noqa: BLE001  # a benchmark tells what broke and goes on
        return name, {"broken": traceback.format_exc(), "seed": seed}
    return name, {"seed": seed, "seconds": time.process_time() - begin, **judged(world, made, document)}


def judged(world: World, made: Made, document: dict[str, Any]) -> dict[str, Any]:
    """The verdict on a document."""
    groups = document["classes"]
    physics = [g for g in groups if g.get("scope") not in DATA]
    own = {name for name, _ in world.hidden}
    stray = [g["effects"] for g in physics if not own & set(g["effects"])]
    # a fault that stands in a class with physics is told, and physics alone is not
    for told in made.faults:
        stray = [effects for effects in stray if not set(told.names) & set(effects)]
    said = [(set(g["effects"]), g.get("units") or [], g.get("dwells") or []) for g in groups]
    said += _blocked(document)
    return {
        "adequate": document["adequate"],
        "named": [g["effects"] for g in groups],
        "stray": stray,
        "unexplained": document["unexplained"] is not None,
        "left_out": _left_out(made, document),
        "blocked": [(b["fault"], b["units"], b["dwells"]) for b in document["blocked_by"]],
        "found": all(any(_agrees(told, *one) for one in said) for told in made.faults) if made.faults else None,
        "false": [(sorted(one[0]), *one[1:]) for one in said if not any(_agrees(told, *one) for told in made.faults)],
        "first": bool(groups) and bool(own & set(groups[0]["effects"])),
        "outside": bool(own & set(OUTSIDE)),
        "held": all(any(name in g["effects"] for g in groups) for name in own) if own - set(OUTSIDE) else None,
        "alone": len(physics) == len(own) and not any(g.get("scope") in DATA for g in groups) if own else None,
        "p": document["error"]["p_value"],
        "hidden": [list(own)],
        "first_p": [g["p_value"] for g in groups],
        "said": [(sorted(a), b, c) for a, b, c in said],
        "truth": [(told.names, told.units, told.dwells) for told in made.faults],
    }


def _blocked(document: dict[str, Any]) -> list[tuple[set[str], list[str], list[int]]]:
    """Data faults: one of several units in the same dwells is one."""
    together: dict[tuple[str, tuple[int, ...]], list[str]] = defaultdict(list)
    for b in document["blocked_by"]:
        together[b["fault"], tuple(b["dwells"])] += b["units"]
    return [({fault}, units, list(dwells)) for (fault, dwells), units in together.items()]


def _left_out(made: Made, document: dict[str, Any]) -> bool | None:
    """Whether every spoilt dwell was left out, named or not; None where none was spoilt."""
    spoilt = [(told.units[0], dwell) for told in made.faults if told.names == ("bad_dwell",) for dwell in told.dwells]
    gone = {(d["unit"], d["dwell"]) for d in (document.get("removed") or {"dwells": []})["dwells"]}
    return set(spoilt) <= gone if spoilt else None


def _agrees(told: Any, names: set[str], units: list[str], dwells: list[int]) -> bool:
    """Whether what was said is the fault: its name, its units, a dwell within one of its own."""
    if not names & set(told.names):
        return False
    if told.units and set(told.units) != set(units):
        return not units and names != {"bad_dwell"}
    return not told.dwells or not dwells or any(abs(d - t) <= 1 for d in dwells for t in told.dwells)


def looped(task: tuple[str, str, int]) -> tuple[str, dict[str, Any]]:
    """Whether wrong effects are confirmed, and right ones of two floors, with and without a fresh run."""
    _, name, seed = task
    confirmed: dict[str, list[tuple[str, bool | None]]] = defaultdict(list)
    empty = make(LOOP[name], seed)
    for kind, effects in (("wrong", WRONG), ("right", RIGHT)):
        for effect in effects:
            made = empty if kind == "wrong" else make(replace(LOOP[name], hidden=((effect, 2.0),)), seed)
            ways = {"fresh": (made.fresh, made.fresh_history), "left out": (None, None)}
            if LOOP[name].fresh_noise is not None:
                del ways["left out"]
            for where, again in ways.items():
                confirmed[f"{kind} {where}"].append((effect, _confirmed(made, effect, again)))
    return name, dict(confirmed)


def _confirmed(made: Made, effect: str, again: tuple[Any, Any]) -> bool | None:
    """The verdict on an effect that is added to the plain model."""
    from pipelines.diagnosis.compare import compare
    from pipelines.diagnosis.model_history import evolution
    from pipelines.jobs.model_files import Version

    versions = [Version(1, BASE, (), (), None), Version(2, (*BASE, effect), (effect,), (), None)]
    return evolution(versions, lambda model, before: compare(made.dwells, model, made.history, *again, before=before))[
        -1
    ]["confirmed"]


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
