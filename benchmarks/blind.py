"""Scores the diagnosis on blind runs: `python benchmarks/blind.py --runs 400 --jobs 2`.

Each run is made from a seed; its truth stays here, and the diagnosis gets only the tables: in this process, or with `--cli`
through the command line and files. `--runs` is the number of runs over all scenarios (distributed by weight), or per scenario
with `--each`.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(
        _name, "1"
    )  # before the import of numpy: threads of two processes would compete for two cores

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import pandas as pd  # noqa: E402

from benchmarks.score import Score, score, table, text  # noqa: E402
from benchmarks.truth import SCENARIOS, Run, case  # noqa: E402

Answer = tuple[dict[str, Any], float | None]  # the document, and the RMS error of the fresh run after extension, µg
Method = Callable[[Run], Answer]

WAYS = ("tumbleline", "cli", "bic", "bonferroni", "stlsq", "lasso")
WEIGHTS = {
    "lot8_size2": 35, "lot8_size1": 35, "lot8_size05": 35, "lot8_size4": 35, "single_size2": 30,
    "lot4_size2": 10, "lot16_size2": 10, "station_size2": 20, "null_white": 60, "null_flicker": 60,
    "null_walk": 10, "null_single": 20, "pairs": 35, "triples": 25, "covariate_line": 15, "covariate_curve": 15,
    "withheld": 21, "invisible": 18, "faults": 28, "bare_model": 6,
}  # fmt: skip


@dataclass(frozen=True)
class Job:
    """One run of one scenario, and its method of diagnosis."""

    scenario: str
    index: int
    seed: int
    method: str


Result = tuple[Job, Score, dict[str, Any], dict[str, Any]]  # with the document and the truth


def in_process(run: Run) -> Answer:
    """The product's diagnosis, called as a function."""
    from pipelines.diagnosis.compare import compare
    from pipelines.diagnosis.diagnose import diagnose

    truth = run.sealed
    effects = list(truth.spec.base) if truth.spec.base else None
    history = run.history if truth.spec.history else None
    document = diagnose(run.dwells, history=history, effects=effects)
    model = [*truth.base, *document["recommended"]]
    if truth.faults or any(name.startswith("covariate:") and name[10:] not in run.fresh for name in model):
        return document, None
    fresh_history = run.fresh_history if truth.spec.history else None
    compared = compare(run.dwells, effects=model, history=history, fresh=run.fresh, fresh_history=fresh_history)
    return document, float(compared["fresh_rms_ug"])


def write(run: Run, folder: Path) -> list[Path]:
    """Writes the measurements only: dwells, history, fresh, fresh_history."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for name in ("dwells", "history", "fresh", "fresh_history"):
        paths.append(folder / f"{name}.parquet")
        getattr(run, name).to_parquet(paths[-1])
    return paths


def _command(*arguments: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-m", "pipelines.cli", *arguments, "--json"],
        capture_output=True,
        text=True,
        cwd=ROOT,
        check=False,
    )
    if done.returncode not in {0, 1}:
        raise RuntimeError(f"blind: {' '.join(arguments)} ended with status {done.returncode}: {done.stderr[-2000:]}")
    return json.loads(done.stdout)


def by_command_line(run: Run) -> Answer:
    """The product's diagnosis through files and the command line."""
    with tempfile.TemporaryDirectory() as folder:
        dwells, history, fresh, fresh_history = write(run, Path(folder))
        spec = run.sealed.spec
        known = ["--history", str(history)] if spec.history else []
        again = ["--fresh-history", str(fresh_history)] if spec.history else []
        judged = ["--effects", ",".join(spec.base)] if spec.base else []
        document = _command("diagnose", str(dwells), *known, *judged)
        if run.sealed.faults:
            return document, None
        model = ",".join([*run.sealed.base, *document["recommended"]])
        compared = _command("compare", str(dwells), "--effects", model, "--fresh", str(fresh), *known, *again)
        return document, float(compared["fresh_rms_ug"])


def method(name: str) -> Method:
    """The method of diagnosis with a name: `tumbleline`, `cli`, or a baseline."""
    if name == "tumbleline":
        return in_process
    if name == "cli":
        return by_command_line
    from baselines import BASELINES

    return BASELINES[name]


def one(job: Job) -> Result:
    """The score of one job, with the document and the truth for the analysis of failures."""
    run = case(job.scenario, job.index, job.seed)
    begin = time.perf_counter()
    try:
        document, fresh = method(job.method)(run)
    except Exception as problem:
        problem.add_note(f"blind: in {job.scenario}[{job.index}] of seed {job.seed}: {run.sealed.spec}")
        raise
    seconds = time.perf_counter() - begin
    return (
        job,
        score(document, run.sealed, scenario=job.scenario, fresh_rms_ug=fresh, seconds=seconds),
        document,
        run.sealed.document(),
    )


def deal(scenarios: list[str], runs: int, *, each: bool) -> Iterator[tuple[str, int]]:
    """Scenario and index of every run: `runs` in all by weight, or of each scenario."""
    total = sum(WEIGHTS[name] for name in scenarios)
    for name in scenarios:
        for index in range(runs if each else max(1, round(runs * WEIGHTS[name] / total))):
            yield name, index


def work(jobs: list[Job], processes: int) -> Iterator[Result]:
    """The results of the jobs in their order, with a progress line on standard error."""
    with ProcessPoolExecutor(processes) as pool:
        results = pool.map(one, jobs) if processes > 1 else map(one, jobs)
        for count, result in enumerate(results, 1):
            print(f"\r{count}/{len(jobs)} {result[0].scenario:20}", end="", file=sys.stderr, flush=True)
            yield result
    print(file=sys.stderr)


def failures(results: list[Result]) -> list[str]:
    """One line for each wrong run: its seed, the hidden effects, the named effects."""
    lines = []
    for job, got, document, truth in results:
        wrong = (
            got.exact is False
            or (got.named_something and got.scenario.startswith("null"))
            or False
            in {got.driver_right, got.fault_caught, got.none_of_catalogue, got.invisible_listed, got.scope_right}
            or got.false_fault
        )
        if wrong:
            variants = [effect["variant"] for effect in truth["effects"] if effect["variant"]]
            spec = truth["spec"]
            plan = f"{spec['plan']}/{spec['soaks']}x{spec['repeats']} 1/f {spec['flicker']:.1f} {spec['device']}"
            named = " ".join("|".join(group) for group in got.named) or document.get("unexplained") or "nothing"
            hidden = ",".join([*got.truth, *variants, *spec["faults"]])
            lines.append(f"{job.scenario}[{job.index}] {hidden} -> {named} ({plan})")
    return lines


def save(folder: Path, results: list[Result]) -> None:
    """Scores as Parquet, documents with truths as JSON lines."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = [{"method": j.method, "index": j.index, "seed": j.seed} | s.row() for j, s, _, _ in results]
    scores = pd.DataFrame(rows)
    for column in ("truth", "named"):
        scores[column] = scores[column].map(json.dumps)
    scores.to_parquet(folder / "scores.parquet")
    with (folder / "runs.jsonl").open("w") as lines:
        for job, result, document, truth in results:
            entry = {"job": vars(job), "score": result.row(), "document": document, "truth": truth}
            lines.write(json.dumps(entry, default=str) + "\n")


def dump(folder: Path, cases: Iterator[tuple[str, int]], seed: int) -> None:
    """Writes runs as files to FOLDER/runs, and their truths to FOLDER-truth, separate from the measurements."""
    sealed = folder.with_name(folder.name + "-truth")
    sealed.mkdir(parents=True, exist_ok=True)
    for name, index in cases:
        run = case(name, index, seed)
        write(run, folder / f"{name}-{index:03d}")
        (sealed / f"{name}-{index:03d}.json").write_text(json.dumps(run.sealed.document(), indent=1))


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=100, help="runs over all scenarios, or of each with --each")
    parser.add_argument("--each", action="store_true", help="--runs counts runs of each scenario")
    parser.add_argument("--scenario", action="append", choices=list(SCENARIOS), help="only these (repeatable)")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument(
        "--method", action="append", choices=WAYS, help="methods of diagnosis (repeatable); tumbleline is the default"
    )
    parser.add_argument("--cli", action="store_true", help="the same as --method cli")
    parser.add_argument("--failures", action="store_true", help="list the wrong runs")
    parser.add_argument("--out", type=Path, help="folder for scores.parquet, runs.jsonl and figures.json")
    parser.add_argument(
        "--dump", type=Path, help="only write the runs into this folder, and their truth into FOLDER-truth"
    )
    return parser.parse_args()


def main() -> None:
    options = arguments()
    scenarios = options.scenario or list(SCENARIOS)
    cases = list(deal(scenarios, options.runs, each=options.each))
    if options.dump:
        dump(options.dump, iter(cases), options.seed)
        return
    figures: dict[str, list[dict[str, Any]]] = {}
    everything: list[Result] = []
    try:
        for way in options.method or ["cli" if options.cli else "tumbleline"]:
            jobs = [Job(name, index, options.seed, way) for name, index in cases]
            results: list[Result] = []
            for result in work(jobs, options.jobs):
                results.append(result)
                everything.append(result)
            figures[way] = table(s for _, s, _, _ in results)
            show(way, results, options.seed)
            if options.failures:
                print("\n".join(failures(results)))
    finally:  # a failure in the last run does not lose the results of the others
        if options.out and everything:
            save(options.out, everything)
            (options.out / "figures.json").write_text(json.dumps(figures, indent=1))


def show(way: str, results: list[Result], seed: int) -> None:
    """Prints the table of figures of one method."""
    times = sorted(s.seconds for _, s, _, _ in results)
    print(
        f"\n{way}: {len(results)} runs, seed {seed}, median {times[len(times) // 2]:.2f} s, longest {times[-1]:.2f} s"
    )
    print(text(table(s for _, s, _, _ in results)), flush=True)


if __name__ == "__main__":
    main()
