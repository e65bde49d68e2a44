"""The operating characteristic of every number that decides a diagnosis: `python benchmarks/characteristics.py --only COMMON`.

`HOW` says for each number of `inertial/decisions.py` where its characteristic comes from, and a test holds that none is
missing. A derived number has its derivation beside it; here its false rate is checked by a simulation of the decision alone. The
others are measured: at half, at their value and at twice as much, in the part of a diagnosis that decides (`decision_parts.py`,
`search_parts.py`; whole diagnoses: `benchmarks/decisions.py`); by the rates of the decisions about the noise
(`benchmarks/decision_rates.py`), by effects put into models (`benchmarks/worlds loop`), or by what effects leave over
(`benchmarks/remainders.py`). Rates have 95 % Clopper-Pearson intervals.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")  # before numpy
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE / "worlds"), str(HERE.parent)]
sys.path.append(str(HERE))  # last: tests have modules of the same names


import noise_kinds  # noqa: E402
import numpy as np  # noqa: E402
from decision_parts import BASE, PARTS, lines, rate, run_of  # noqa: E402
from noise import Noise  # noqa: E402
from scipy import stats  # noqa: E402
from search_parts import SEARCH_PARTS  # noqa: E402
from tables import NULLS  # noqa: E402
from world import World  # noqa: E402

from inertial import decisions  # noqa: E402

SEED = 66_000_000


def shares(runs: int, first: int) -> Iterator[str]:
    """Random walks recovered from lots: K of the fit over K of the device."""
    for units in (8, 1):
        for walk in (2.0, 4.0, 8.0):
            ratios = np.array(
                [_walk(World(units=units, noise=Noise(walk=walk)), first + seed) / walk for seed in range(runs)]
            )
            low, middle, high = np.quantile(ratios, [0.1, 0.5, 0.9])
            cells = f"{low:.2f} · {middle:.2f} · {high:.2f}"
            yield f"{units} units, K {walk:g}: K of the fit over K, 10 · 50 · 90 % of {runs} lots: {cells}"


def _walk(world: World, seed: int) -> float:
    """K of the noise that is fitted to a lot without hidden effects, µg/√s."""
    model = run_of(world, SEED + seed).model()
    noise, covariance = model.noise, model.problem.covariance
    return 1e6 * float(np.sqrt(noise.shares.walk * covariance.white * np.mean(noise.scale**2) / covariance.span))


def prior_grid(runs: int, first: int) -> Iterator[str]:
    """What is lost in the likelihood if the prior degrees of freedom lie between two of the grid."""
    from inertial.estimation.noise_shares import _deviances

    rng, fine = np.random.default_rng(SEED + first), np.geomspace(2.0, 256.0, 57)
    lost = []
    for _ in range(40 * runs):
        dof, prior = np.full(24, 60.0), float(np.exp(rng.uniform(np.log(2.0), np.log(64.0))))
        squares = rng.chisquare(60.0, 24) * prior / rng.chisquare(prior, 24)
        best = min(_deviances(squares, dof, tuple(fine))[0])
        lost.append(min(_deviances(squares, dof)[0]) - best)
    yield (
        f"24 series, {len(lost)} draws: deviance lost to the grid, median {np.median(lost):.3f}, 95 % "
        f"{np.quantile(lost, 0.95):.3f}; of {decisions.PRIOR_BETTER} that decide"
    )


def common_dwells(runs: int, first: int) -> Iterator[str]:
    """How often sound dwells pass for a wrong pose: the median over the units of a chi-square of three axes."""
    rng, limit, draws = np.random.default_rng(SEED + first), stats.chi2.isf(decisions.COMMON, 3), 100_000 * runs
    for units in (3, 4, 8):
        hits = sum(
            int(np.count_nonzero(np.median(rng.chisquare(3, (10_000, units)), axis=1) > limit))
            for _ in range(draws // 10_000)
        )
        half = units // 2 + units % 2
        bound = float(stats.binom.sf(half - 1, units, decisions.COMMON))
        yield f"{units} units: {rate(hits, draws)} of a dwell; bound, {half} of {units} beyond the limit: {bound:.1e}"
    for off in (3.0, 4.0, 5.0):
        medians = np.median(rng.noncentral_chisquare(3, off**2, (10_000, 8)), axis=1)
        left = rate(int(np.count_nonzero(medians > limit)), 10_000)
        yield f"8 units, a pose off by {off:g} standard deviations of each: left for the poses {left}"


def most_bad(runs: int, first: int) -> Iterator[str]:
    """Dwells that are left out, against their limit."""
    worlds = {"normal": World(), "t3": NULLS["t3"], "t3, one unit": NULLS["t3_one_unit"]}
    for name, world in worlds.items():
        gone = np.array([len(run_of(world, SEED + first + seed).removed) for seed in range(runs)])
        most = int(decisions.MOST_BAD * world.units * world.poses * len(world.soaks)) + 1
        reached = rate(int(np.count_nonzero(gone >= most)), runs)
        yield f"{name}: dwells left out, mean {gone.mean():.2f}, most {gone.max()}; limit {most} reached in {reached}"


def looks(runs: int, first: int) -> Iterator[str]:
    """The most telling of all looks of a diagnosis in noise of a known covariance, charged with their number."""
    from inertial.criticism.examination import candidates_of
    from inertial.criticism.field import Candidates
    from inertial.estimation.penalty import log_p_value
    from inertial.estimation.space import Space

    rng, charged = np.random.default_rng(SEED + first), []
    for name in ("B30", "K4", "one_unit"):
        run = run_of(NULLS[name], SEED + first)
        model = run.model()
        problem, noise = model.problem, model.noise
        field = Candidates(problem, candidates_of(model, run.effects))
        pieces = list(field.pieces())
        white = rng.standard_normal((problem.blocks, problem.n, 10 * runs))
        drawn = problem.covariance.coloured(noise, np.swapaxes(white, 1, 2).copy())
        for k in range(10 * runs):
            space, least, count = Space(problem.covariance, noise, drawn[:, k], model.local, model.shared), 0.0, 0
            for piece in pieces:
                gain = space.gain(piece)
                count += gain.drop.size
                for drop, rank in zip(gain.drop.tolist(), gain.rank.tolist(), strict=True):
                    least = min(least, log_p_value(space, drop, rank))
            charged.append(least + np.log(count))
    every = np.array(charged)
    cells = [
        f"below {limit:g}: {rate(int(np.count_nonzero(every < np.log(limit))), every.size)}"
        for limit in (0.3, 0.1, 0.01, 1e-3)
    ]
    yield f"smallest probability times the number of looks, three worlds: {'; '.join(cells)}"


def rivals(runs: int, first: int) -> Iterator[str]:
    """How often the wrong one of two effects leads by the width of a class, at the distance where it does so most often."""
    rng, draws = np.random.default_rng(SEED + first), 200_000 * runs
    for width in (decisions.CLEAR_LEAD, 10.0, decisions.CLASS_WIDTH):
        # difference of two chi-squares of nested fits whose means differ by D: normal, mean D, variance 4·D
        apart = width
        leads = apart + 2.0 * np.sqrt(apart) * rng.standard_normal(draws) < -width
        bound = float(stats.norm.sf(np.sqrt(width)))
        yield f"width {width:g}: {rate(int(np.count_nonzero(leads)), draws)}; Φ(−√{width:g}) = {bound:.1e}"


def draws(runs: int, first: int) -> Iterator[str]:
    """The verdict of draws that end early, for a run whose probability is known."""
    from inertial.criticism.adequacy import _BATCH
    from inertial.probability import passes

    rng, count = np.random.default_rng(SEED + first), 4000 * runs

    def fails(p: np.ndarray) -> int:
        failed = 0
        for one in p.tolist():
            drawn = beyond = 0
            while drawn < decisions.DRAWS and beyond < decisions.ENOUGH:
                drawn, beyond = drawn + _BATCH, beyond + int(rng.binomial(_BATCH, one))
            failed += passes((1.0 + beyond) / (1.0 + drawn), decisions.ADEQUATE_ABOVE) is not True
        return failed

    yield f"an adequate model, probability uniform: called inadequate {rate(fails(rng.uniform(size=count)), count)}"
    for p in (0.005, 0.01, 0.02, 0.03, 0.05, 0.1):
        yield f"probability {p:g}: called inadequate {rate(fails(np.full(count // 4, p)), count // 4)}"


def reproduced(runs: int, first: int) -> Iterator[str]:
    """Confirmed and refuted by λ with its standard error, from the normal distribution."""
    rng, count = np.random.default_rng(SEED + first), 100_000 * runs
    for error in (0.05, 0.15, 0.3, 0.5):
        noise = error * rng.standard_normal(count)
        cells = []
        for true in (0.0, 1.0):
            part = true + noise
            cells.append(
                f"λ = {true:g}: confirmed {rate(int(np.count_nonzero(part > decisions.CONFIRMED * error)), count)}"
            )
            cells.append(f"refuted {rate(int(np.count_nonzero(part + 2.0 * error < decisions.REFUTED)), count)}")
        yield f"standard error {error:g}: {', '.join(cells)}"


def rises(runs: int, first: int) -> Iterator[str]:
    """The error on dwells left out with an effect in the model over that without it: true effects, and wrong ones."""
    from tables import HIDDEN, RIGHT, WRONG

    from inertial import effects as catalogue
    from inertial.criticism.examination import worst
    from inertial.criticism.left_out import left_out
    from inertial.estimation.model import Model
    from inertial.estimation.refinement import terms_of

    ratios: dict[str, list[float]] = {"true": [], "wrong": []}
    for seed in range(first, first + runs):
        worlds = [("true", HIDDEN[f"{name}_1"], (name,)) for name in RIGHT if f"{name}_1" in HIDDEN]
        for kind, world, names in [*worlds, ("wrong", World(), WRONG)]:
            model = run_of(world, SEED + seed).model()
            before = left_out(model)
            for name in names:
                terms = terms_of([*catalogue.get_all(BASE), catalogue.get(name)], model.problem)
                old, new = worst(before, left_out(Model(model.problem, terms, near=model.noise)))
                ratios[kind].append(new / old)
    for kind, values in ratios.items():
        every = np.array([v for v in values if np.isfinite(v)])
        cells = [
            f"rises by more than {100 * limit:g} %: {rate(int(np.count_nonzero(every > 1.0 + limit)), every.size)}"
            for limit in (0.5 * decisions.RISES, decisions.RISES, 2.0 * decisions.RISES)
        ]
        yield f"{kind} effects, {every.size} of {len(values)} can be judged: {'; '.join(cells)}"


DERIVED: dict[str, Callable[[int, int], Iterator[str]]] = {
    "SHARE_STEP": shares,
    "PRIOR_DOF": prior_grid,
    "OWN_SHARES": noise_kinds.own_shares,
    "LOUDER_BELOW": noise_kinds.louder,
    "MOST_BAD": most_bad,
    "COMMON": common_dwells,
    "NAMED_BELOW": looks,
    "CLASS_WIDTH": rivals,
    "ADEQUATE_ABOVE": draws,
    "CONFIRMED": reproduced,
    "RISES": rises,
}
"""Simulations of a decision alone."""

SAME = {
    "OWN_SUSPECT": "OWN_SHARES",
    "LEAST_SHARE": "SHARE_STEP",
    "LARGEST_SHARE": "SHARE_STEP",
    "CERTAIN_BELOW": "NAMED_BELOW",
    "DRAWS": "ADEQUATE_ABOVE",
    "ENOUGH": "ADEQUATE_ABOVE",
    "REFUTED": "CONFIRMED",
    "BLOCKS": "LEFT_OUT",
    "CLEAR_LEAD": "CLASS_WIDTH",
    "FOREIGN_LOT": "FOREIGN_UNIT",
}
"""Numbers that are measured with another."""

COMMANDS: dict[str, tuple[str, ...]] = {
    "PRIOR_BETTER": ("decision_rates.py",),
    "BAD_DWELL": ("decision_rates.py",),
    "HEAVY": ("decision_rates.py",),
    "TAILS_REACH": ("decision_rates.py",),
    "TOGETHER": ("decision_rates.py",),
    "LEFT_OUT": ("worlds", "loop"),
    "REMAINDER": ("remainders.py",),
    "JUMPS_RARE": ("worlds", "noises"),
    "FOREIGN_UNIT": ("priors.py", "--characteristic"),
}
"""Numbers with a command of their own."""


def how() -> dict[str, str]:
    """For every number where its characteristic comes from: a simulation, a part of the diagnosis, or a command."""
    ways = dict.fromkeys(PARTS | SEARCH_PARTS, "part") | dict.fromkeys(DERIVED, "simulation")
    ways |= {name: " ".join(("python", f"benchmarks/{command[0]}", *command[1:])) for name, command in COMMANDS.items()}
    return ways | {name: ways[other] for name, other in SAME.items()}


def main() -> int:
    """Print the characteristics."""
    parser = argparse.ArgumentParser(prog="python benchmarks/characteristics.py", description=__doc__)
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", action="append", default=[], choices=sorted(how()))
    options = parser.parse_args()
    done, parts = set(), PARTS | SEARCH_PARTS
    for name in options.only or how():
        own = SAME.get(name, name)
        if own in done:
            continue
        done.add(own)
        if own in DERIVED:
            for line in DERIVED[own](options.runs, options.first):
                print(f"{own:16s} {line}", flush=True)
            continue
        if own in parts:
            for line in lines(own, parts[own], options.runs, options.first, rate):
                print(f"{own:16s} {line}", flush=True)
            continue
        command = COMMANDS[own]
        further = ["--runs", str(options.runs), "--first", str(options.first)]
        subprocess.run([sys.executable, str(HERE / command[0]), *command[1:], *further], check=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
