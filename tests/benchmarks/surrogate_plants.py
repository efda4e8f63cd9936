"""Random linear three-mass plants: are parameters and their standard errors right?

Run: python -m tests.benchmarks.surrogate_plants. Plants are identified as linear models at one operating
point: without noise, from noisy data the whole way from n4sid to output error, and 50 times by output error.
"""

from __future__ import annotations

import argparse
import os
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from identification.surrogate.certainty import LARGEST_CONDITION
from tests.random_chains import CHAIN, Trial, trial

RECOVERY, STANDARD_ERRORS, AGREEMENT = 1e-6, 4.0, 0.3


def one(task: tuple[int, float, int]) -> Trial:
    """One plant."""
    return trial(*task)


def main() -> int:
    """Print the table; 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=20)
    parser.add_argument("--seeds", type=int, default=50, help="draws of the noise, of every plant")
    parser.add_argument("--duration", type=float, default=42.0, help="of the data [s]")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the processes that are started below
    tasks = [(seed, chosen.duration, chosen.seeds) for seed in range(chosen.plants)]
    with ProcessPoolExecutor(chosen.processes, mp_context=get_context("spawn")) as pool:
        trials = list(pool.map(one, tasks))
    print("plant  condition  noise-free   error / s.e.   standard error / scatter, by parameter")
    print(f"{'':44s}{' '.join(f'{name:>6s}' for name in CHAIN.names)}")
    kept = []
    for seed, found in enumerate(trials):
        refused = found.condition > LARGEST_CONDITION
        ratios = " ".join(f"{ratio:6.2f}" for ratio in found.ratio)
        print(
            f"{seed:5d}  {found.condition:9.2g}  {found.clean:10.2g}  {found.distance.max():12.2f}   "
            f"{'refused' if refused else ratios}"
        )
        kept += [] if refused else [found]
    clean = max(found.clean for found in kept)
    distance = max(found.distance.max() for found in kept)
    apart = max(np.max(np.abs(found.ratio - 1.0)) for found in kept)
    verdicts = [
        (f"noise-free: largest relative error {clean:.2g} <= {RECOVERY:g}", clean <= RECOVERY),
        (f"with noise: {distance:.2f} <= {STANDARD_ERRORS:g} standard errors", distance <= STANDARD_ERRORS),
        (f"standard error against scatter: {apart:.0%} <= {AGREEMENT:.0%} apart", apart <= AGREEMENT),
    ]
    print(f"{len(kept)} of {len(trials)} plants, the others refused (condition above {LARGEST_CONDITION:g})")
    for what, holds in verdicts:
        print(f"  {'pass' if holds else 'FAIL'}  {what}")
    return int(not all(holds for _, holds in verdicts))


if __name__ == "__main__":
    sys.exit(main())
