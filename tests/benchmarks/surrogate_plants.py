"""Random linear three-mass plants: are parameters and their standard errors right?

Run: python -m tests.benchmarks.surrogate_plants. Plants are identified as linear models at one operating
point: without noise, from noisy data the whole way from n4sid to output error, and 50 times by output error
from where the whole way starts it. Plants are drawn until 20 are not refused.
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
HELP = (
    "help given to the route: none but the plant's own static map; order, block rows, closed form, frequency "
    "response and output error as they are by default"
)


def one(task: tuple[int, float, int, bool]) -> Trial:
    """One plant."""
    seed, duration, seeds, whole = task
    return trial(seed, duration, seeds, largest_condition=LARGEST_CONDITION, whole=whole)


def told(found: Trial) -> str:
    """One plant in a line."""
    if found.condition > LARGEST_CONDITION:
        return f"{found.seed:5d}  {found.condition:9.2g}  refused"
    ratios = " ".join(f"{ratio:6.2f}" for ratio in found.ratio)
    order = found.order.split(":")[0] + ("*" if "least_order" in found.order else "")
    return (
        f"{found.seed:5d}  {found.condition:9.2g}  {order:5s}  {found.clean:10.2g}  "
        f"{found.distance.max():12.2f}   {ratios}"
    )


def main() -> int:
    """Print the table; 1 when a limit is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=20)
    parser.add_argument("--seeds", type=int, default=50, help="draws of the noise, of every plant")
    parser.add_argument("--duration", type=float, default=42.0, help="of the data [s]")
    parser.add_argument("--whole", action="store_true", help="the whole way for every draw, from n4sid on")
    parser.add_argument("--processes", type=int, default=os.cpu_count())
    chosen = parser.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the processes that are started below
    print(HELP)
    print("plant  condition  order  noise-free   error / s.e.   standard error / scatter, by parameter")
    print(f"{'':51s}{' '.join(f'{name:>6s}' for name in CHAIN.names)}")
    kept: list[Trial] = []
    refused = seed = 0
    with ProcessPoolExecutor(chosen.processes, mp_context=get_context("spawn")) as pool:
        while len(kept) < chosen.plants:
            missing = range(seed, seed + chosen.plants - len(kept))
            tasks = [(next_seed, chosen.duration, chosen.seeds, chosen.whole) for next_seed in missing]
            for found in pool.map(one, tasks):
                print(told(found), flush=True)
                refused += found.condition > LARGEST_CONDITION
                kept += [] if found.condition > LARGEST_CONDITION else [found]
            seed = missing.stop
    clean = max(found.clean for found in kept)
    distance = max(found.distance.max() for found in kept)
    apart = max(np.max(np.abs(found.ratio - 1.0)) for found in kept)
    verdicts = [
        (f"noise-free: largest relative error {clean:.2g} <= {RECOVERY:g}", clean <= RECOVERY),
        (f"with noise: {distance:.2f} <= {STANDARD_ERRORS:g} standard errors", distance <= STANDARD_ERRORS),
        (f"standard error against scatter: {apart:.0%} <= {AGREEMENT:.0%} apart", apart <= AGREEMENT),
    ]
    print(f"{len(kept)} plants, {refused} more refused (condition above {LARGEST_CONDITION:g})")
    print("* the singular values show fewer states than a chain has, which it gets all the same")
    for what, holds in verdicts:
        print(f"  {'pass' if holds else 'FAIL'}  {what}")
    return int(not all(holds for _, holds in verdicts))


if __name__ == "__main__":
    sys.exit(main())
