"""Recordings by hand-held placement, orientations unknown: `python benchmarks/recordings.py nulls bad --runs 40`.

Every recording has its own number of positions (6-160), lengths of rest (one long first rest, then 2-60 s), order and noise.
The force is turned by random rotations, the sensor is a full matrix with a bias in raw counts, and 1/f noise is made by
fractional summation: nothing is shared with the estimator. Prints, with 95 % Clopper-Pearson intervals, how many adequate
recordings were called inadequate or could not be judged, how many effects were named that are not there, and how many
spoilt dwells were named. `--seeds development` are for setting constants, `judging` (the default) only for measuring.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from collections import Counter
from dataclasses import replace
from functools import partial
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent)]

import numpy as np  # noqa: E402
from scipy import stats  # noqa: E402

from benchmarks.made_recordings import NOISES, Made, Recording, make  # noqa: E402

SEEDS = {"development": 52_000_000, "judging": 96_000_000}

POSITIONS = (30, 40, 60, 100, 160, 24, 18, 12, 6)


def nulls(runs: int) -> list[Recording]:
    """Recordings with nothing hidden: every number of positions with every noise in turn."""
    names = list(NOISES)
    return [Recording(POSITIONS[k % len(POSITIONS)], names[k % len(names)], long_first=k % 3 != 2) for k in range(runs)]


def bad(runs: int, sigma: float = 0.0) -> list[Recording]:
    """24 positions, one or two of them off by 5 mg or by ``sigma``: a hand on the table, a unit that had not settled."""
    names = list(NOISES)
    return [Recording(24, names[k % 3], bad=1 + k % 2, bad_ug=5000.0, bad_sigma=sigma) for k in range(runs)]


def hidden(runs: int) -> list[Recording]:
    """40-100 positions with a cubic term of 1 mg/g³, or a drift of 2 mg after switching on."""
    recordings = [Recording((40, 60, 100)[k % 3], "white 280, B 30") for k in range(runs)]
    return [replace(one, cubic=1000.0) if k % 2 else replace(one, warm_up=2000.0) for k, one in enumerate(recordings)]


def interval(hits: int, runs: int) -> str:
    """A rate with its Clopper-Pearson interval."""
    low = float(stats.beta.ppf(0.025, hits, runs - hits + 1)) if hits else 0.0
    high = float(stats.beta.ppf(0.975, hits + 1, runs - hits)) if hits < runs else 1.0
    return f"{hits}/{runs} [{low:.3f}, {high:.3f}]"


def judged(what: Recording, seed: int) -> dict[str, object]:
    """What the diagnosis says of one recording."""
    from pipelines.diagnosis.diagnose import diagnose
    from schemas.errors import DataRejected

    made = make(what, seed)
    begin = time.process_time()
    try:
        document = diagnose(made.dwells)
    except DataRejected:
        return {
            "adequate": None,
            "physics": [],
            "unexplained": False,
            "named": set(),
            "spoilt": set(made.spoilt),
            "searched": searched(made),
            "seconds": 0.0,
            "p": None,
        }
    said = [(g["effects"], set(g.get("dwells") or ())) for g in document["classes"]]
    physics = [effects for effects, _ in said if effects != ["bad_dwell"]]
    named = set().union(*(dwells for effects, dwells in said if effects == ["bad_dwell"]), set())
    return {
        "adequate": document["adequate"],
        "physics": physics,
        "unexplained": document["unexplained"] is not None,
        "named": named,
        "spoilt": set(made.spoilt),
        "searched": searched(made),
        "seconds": time.process_time() - begin,
        "p": document["error"]["p_value"],
    }


def searched(made: Made) -> set[int]:
    """Dwells beyond the limit of a test with the true noise, at the product's probability over all dwells.

    No test that has to search finds more single dwells at this probability.
    """
    from inertial.data_errors.bad_norms import BAD_NORM

    if made.known is None:
        return set()
    limit = stats.norm.isf(0.5 * BAD_NORM / len(made.known))
    return set(np.flatnonzero(np.abs(made.known) > limit).tolist())


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("sets", nargs="*", default=["nulls", "bad", "hidden"])
    parser.add_argument("--runs", type=int, default=40)
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    parser.add_argument("--seeds", choices=list(SEEDS), default="judging")
    parser.add_argument(
        "--sigma", type=float, default=0.0, help="size of bad dwells, standard deviations; 5 mg by default"
    )
    parser.add_argument("--verbose", action="store_true")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    for name in given.sets:
        sets = {"nulls": nulls, "bad": partial(bad, sigma=given.sigma), "hidden": hidden}
        kinds = sets[name](given.first + given.runs)[given.first :]
        first = SEEDS[given.seeds] + 1000 * ["nulls", "bad", "hidden"].index(name) + given.first
        rows = [(kind, judged(kind, first + k)) for k, kind in enumerate(kinds)]
        print(f"{name}: {len(rows)} recordings, {sum(float(str(r['seconds'])) for _, r in rows):.0f} s of computing")
        _print(name, rows)
        if given.verbose:
            for k, (kind, row) in enumerate(rows):
                print(f"  {k:3d} {kind.positions:4d} {kind.noise:24s} {row}")


def _print(name: str, rows: list[tuple[Recording, dict[str, object]]]) -> None:
    verdicts = Counter(str(row["adequate"]) for _, row in rows)
    able = len(rows) - verdicts["None"]
    print(
        f"  not judged {interval(verdicts['None'], len(rows))}; of the others not adequate {interval(verdicts['False'], able)}"
    )
    if name == "nulls":
        print(f"  an effect named {interval(sum(bool(r['physics'] or r['unexplained']) for _, r in rows), len(rows))}")
        print(f"  a dwell called bad {interval(sum(bool(r['named']) for _, r in rows), len(rows))}")
    if name == "bad":
        for count, word in ((1, "one"), (2, "two")):
            own = [r for kind, r in rows if kind.bad == count]
            spoilt = sum(len(r["spoilt"]) for r in own)  # type: ignore[arg-type]
            hits, known = (sum(len(r["spoilt"] & r[key]) for r in own) for key in ("named", "searched"))  # type: ignore[operator]
            others = sum(len(r["named"] - r["spoilt"]) for r in own)  # type: ignore[operator]
            print(f"  {word} spoilt: named {interval(hits, spoilt)}, other dwells named {others}")
            if rows[0][0].bad_sigma:
                print(f"    beyond the limit if the noise were known: {interval(known, spoilt)}")
        print(f"  an effect named {interval(sum(bool(r['physics']) for _, r in rows), len(rows))}")
    if name == "hidden":
        own = [("third_order", "cubic") if kind.cubic else ("warm_up", "warm") for kind, _ in rows]
        right = sum(any(o[0] in effects for effects in r["physics"]) for o, (_, r) in zip(own, rows, strict=True))  # type: ignore[union-attr]
        print(f"  the hidden effect is in a class {interval(right, len(rows))}")


if __name__ == "__main__":
    main()
