"""Whether stated intervals of a fit by the norm of gravity hold the truth: `python benchmarks/recording_intervals.py --runs 60`.

Recordings of `benchmarks/recordings.py` with unequal dwells and unknown orientations. Twice the stated standard error is counted
about the bias over the record (what wanders included) and about the scales and the three angles of an upper triangular response.
Prints the share that holds, with 95 % Clopper-Pearson intervals: of single intervals, which within one recording go together.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent)]

from benchmarks import recordings  # noqa: E402  isort: skip - sets the number of threads before numpy is loaded

import numpy as np  # noqa: E402
from numpy.typing import NDArray  # noqa: E402

Floats = NDArray[np.float64]
SEEDS = {"development": 53_000_000, "judging": 97_000_000}
EFFECTS = ("bias", "scale", "misalignment")
SIZES = (24, 30, 40, 60)
WHAT = ("bias of the record", "the same by its standard error", "scale", "angles")


def upper(response: Floats) -> Floats:
    """The upper triangular matrix with the norms of a response (3, 3)."""
    return np.linalg.inv(np.linalg.cholesky(np.linalg.inv(response @ response.T)).T)


def pulls(what: recordings.Recording, seed: int) -> tuple[Floats, ...]:
    """(estimate - truth) over the stated uncertainty: bias of the record, the same by its standard error, scales, angles."""
    from pipelines.stages.unknown_poses.fit import bias_uncertainty, norms_fitted

    made = recordings.make(what, seed)
    done = norms_fitted(made.dwells, None, EFFECTS)
    coefficients, errors = done.fit.fit.coefficients[0], done.fit.fit.standard_errors[0]
    truth = upper(made.response)
    of_record = 1e-6 * bias_uncertainty(done)["bias_record_u_ug"][0] * done.scale[0]
    apart = coefficients[:, 0] - made.bias - made.response @ made.wander
    record, bias = apart / of_record, apart / errors[:, 0]
    scale = np.array([(coefficients[k, 1] - truth[k, k]) / errors[k, 1] for k in range(3)])
    places = ((0, 1, 2), (0, 2, 3), (1, 2, 2))  # axis, other axis, column: the axes after the own one in turn
    angles = np.array([(coefficients[i, c] - truth[i, j]) / errors[i, c] for i, j, c in places])
    return record, bias, scale, angles


def main() -> None:
    """Print the figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=60, help="recordings of each kind of noise")
    parser.add_argument("--first", type=int, default=0, help="number of the first seed")
    parser.add_argument("--seeds", choices=list(SEEDS), default="judging")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    whole: dict[str, list[Floats]] = {name: [] for name in WHAT}
    begin = time.process_time()
    for place, noise in enumerate(recordings.NOISES):
        rows = [
            pulls(
                recordings.Recording(SIZES[k % len(SIZES)], noise, long_first=k % 3 != 2),
                SEEDS[given.seeds] + 10_000 * place + given.first + k,
            )
            for k in range(given.runs)
        ]
        print(f"{noise}: {len(rows)} recordings")
        for name, own in zip(WHAT, map(np.concatenate, zip(*rows, strict=True)), strict=True):
            whole[name].append(own)
            print(f"  {name:20s} {_held(own)}, standard deviation of the pulls {own.std():.2f}")
    print(f"all, {time.process_time() - begin:.0f} s of computing")
    for name, parts in whole.items():
        print(f"  {name:20s} {_held(np.concatenate(parts))}")


def _held(own: Floats) -> str:
    return recordings.interval(int(np.sum(np.abs(own) <= 2.0)), own.size)


if __name__ == "__main__":
    main()
