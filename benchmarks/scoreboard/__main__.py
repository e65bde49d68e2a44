"""Every bed of the diagnosis at once: ``python -m benchmarks.scoreboard [--against CHECKOUT]``.

Lots are made once for a seed and kept in ``build/scoreboard``; the same lots are judged by this checkout and by another. Prints
for each row the number of cases, the rate with its 95 % Clopper-Pearson interval, and beside it that of the other checkout, with
the cases that became better and worse and the probability of such a difference by chance (exact McNemar test). Exit status 1: a
row is worse beyond chance. ``--write FILE`` keeps the rows as JSON.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import subprocess
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

from scipy import stats

from benchmarks.scoreboard.beds import RARER, Bed, beds, generators

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
CHANCE = 0.01
"""Probability below which a row is called worse: with a hundred rows one is called so in a comparison of equals."""
Row = tuple[str, str]  # bed, outcome
Outcomes = dict[tuple[str, ...], dict[str, bool]]


def main() -> int:
    """Judge, print, compare."""
    given = _arguments()
    seed = given.seed if given.seed is not None else random.SystemRandom().randrange(1_000_000)
    chosen = [bed for bed in beds() if not given.only or bed.bed in given.only or bed.family in given.only]
    if not chosen:
        raise SystemExit(f"scoreboard: no bed is named {', '.join(given.only)}; there are {', '.join(_names())}")
    begin = time.monotonic()
    here, seconds = judged(ROOT, chosen, seed, given.share, given.jobs)
    there = judged(Path(given.against), chosen, seed, given.share, given.jobs)[0] if given.against else None
    table, worse = rows(here, there)
    print(f"seed {seed}, {len(here)} cases, {time.monotonic() - begin:.0f} s")
    print(_text(table))
    print(f"{sum(seconds) / max(1, len(seconds)):.2f} s of computing a case")
    if given.write:
        document = {"seed": seed, "share": given.share, "cases": len(here), "rows": table}
        Path(given.write).write_text(json.dumps(document, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    return 1 if worse else 0


def _names() -> list[str]:
    return sorted({name for bed in beds() for name in (bed.family, bed.bed)})


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.scoreboard", description=__doc__)
    parser.add_argument("--against", metavar="CHECKOUT", help="folder of another checkout of the product")
    parser.add_argument("--seed", type=int, help="drawn and printed when not given")
    parser.add_argument("--share", type=float, default=1.0, help="of the cases of the whole scoreboard")
    parser.add_argument("--only", action="append", default=[], metavar="BED")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--write", metavar="FILE")
    return parser.parse_args()


def judged(product: Path, chosen: list[Bed], seed: int, share: float, jobs: int) -> tuple[Outcomes, list[float]]:
    """Outcomes of every case with the product of a checkout, from processes of its own."""
    if not (product / "inertial").is_dir():
        raise SystemExit(f"scoreboard: {product} is no checkout: it has no folder 'inertial'")
    stamp = hashlib.sha256(b"".join(path.read_bytes() for path in generators())).hexdigest()[:12]
    work = ROOT / "build" / "scoreboard"
    lots = work / "lots" / stamp
    parts: list[tuple[str, list[Any]]] = []
    for family in dict.fromkeys(bed.family for bed in chosen):
        cases = [case for bed in chosen if bed.family == family for case in bed.cases(seed, share)]
        size = max(1, -(-len(cases) // (4 * jobs)))
        parts += [(family, cases[k : k + size]) for k in range(0, len(cases), size)]
    waiting, running, answers = list(enumerate(parts)), list[tuple[Any, Path]](), list[Path]()
    while waiting or running:
        while waiting and len(running) < jobs:
            number, (family, cases) = waiting.pop(0)
            listed, told = (work / f"{os.getpid()}-{number}.{kind}" for kind in ("cases", "answers"))
            work.mkdir(parents=True, exist_ok=True)
            listed.write_text("".join(json.dumps(case) + "\n" for case in cases), encoding="utf-8")
            running.append((_started(family, product, lots, listed, told), told))
        for process, told in running[:]:
            if process.poll() is not None:
                running.remove((process, told))
                answers.append(told)
                if process.returncode:
                    raise SystemExit(f"scoreboard: judging {product} ended with status {process.returncode}")
        time.sleep(0.05)
    lines = [json.loads(line) for path in answers for line in path.read_text("utf-8").splitlines()]
    for path in answers:
        path.unlink()
        path.with_suffix(".cases").unlink()
    return {tuple(one["case"]): one["outcome"] for one in lines}, [one["seconds"] for one in lines]


def _started(family: str, product: Path, lots: Path, listed: Path, told: Path) -> subprocess.Popen[bytes]:
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-W", "ignore", HERE / "judge.py", family, product, lots / family, listed, told]
    return subprocess.Popen(list(map(str, command)), env={**os.environ, **threads}, cwd=ROOT)


def rows(here: Outcomes, there: Outcomes | None) -> tuple[list[dict[str, Any]], bool]:
    """The table, and whether a row of it became worse beyond chance."""
    cases: dict[Row, list[tuple[bool, bool | None]]] = defaultdict(list)
    for case, outcome in here.items():
        other = None if there is None else there.get(case, {})
        for name, hit in outcome.items():
            said, _, effect = name.partition(": ")
            cases[f"{case[0]} {case[1]}", said if effect else name].append((hit, other.get(name) if other else None))
    table, worse = [], False
    for (bed, name), each in sorted(cases.items()):
        hits, n = sum(hit for hit, _ in each), len(each)
        limits = stats.binomtest(hits, n).proportion_ci(0.95, "exact")
        row: dict[str, Any] = {"bed": bed, "outcome": name, "rarer is better": _mistake(name), "n": n, "hits": hits}
        row |= {"low": round(float(limits.low), 4), "high": round(float(limits.high), 4)}
        pairs = [(hit, other) for hit, other in each if other is not None]
        if there is not None:
            changed = [hit for hit, other in pairs if hit is not other]
            better = sum(hit is not _mistake(name) for hit in changed)
            p = float(stats.binomtest(better, len(changed)).pvalue) if changed else 1.0
            row |= {"other hits": sum(bool(other) for _, other in pairs), "other n": len(pairs)}
            row |= {"better": better, "worse": len(changed) - better, "p": round(p, 4)}
            row["verdict"] = "" if p >= CHANCE else "BETTER" if 2 * better > len(changed) else "WORSE"
            worse |= row["verdict"] == "WORSE"
        table.append(row)
    return table, worse


def _mistake(name: str) -> bool:
    return name in RARER or name.startswith("wrong")


def _text(table: list[dict[str, Any]]) -> str:
    lines = []
    for row in table:
        rate = f"{row['hits']}/{row['n']} [{row['low']:.3f}, {row['high']:.3f}]"
        sign = "≤" if row["rarer is better"] else "≥"
        line = f"{row['bed']:24s} {sign} {row['outcome']:38s} {rate:28s}"
        if "p" in row:
            line += f" other {row['other hits']}/{row['other n']}, +{row['better']} −{row['worse']}"
            line += f" p {row['p']:.2g} {row['verdict']}"
        lines.append(line.rstrip())
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
