"""Does the frequency-response fit find the global optimum every time?

Run: python -m tests.benchmarks.global_optima. Eight operating points (four heights on both white-box sets),
twenty seeds of the data each, measurement noise: the part "Local optima" of `llmn study surrogate` by itself.
The optimum is the best of the fit and of twenty random starts.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

from cosimulation.progress import SILENT
from cosimulation.settings import load_shipped_settings
from cosimulation.study.limits import judge
from cosimulation.study.runner import Pool
from cosimulation.study.surrogate import SurrogateStudySettings, run_task
from cosimulation.study.surrogate.local_optima import MISSED, OptimaTask, optima_tasks
from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm


def main() -> int:
    """Print the count; 1 when a search misses."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=None, help="all cores by default")
    chosen = parser.parse_args()
    settings = load_shipped_settings(SurrogateStudySettings, "surrogate.toml")
    (limit,) = (one for one in settings.limits if one.measure == MISSED)
    with tempfile.TemporaryDirectory() as folder:
        fmu = build_wbm(Path(folder) / "pantograph_wbm.fmu", (host_platform(),))
        tasks = optima_tasks(settings, fmu)
        results = Pool[OptimaTask](chosen.processes).run(run_task, tasks, SILENT, "")
    found = [record for result in results for record in result]
    runs = [one for one in found if "optima" in one]
    for wbm, point in dict.fromkeys((one["wbm"], one["point"]) for one in runs):
        mine = [one for one in runs if (one["wbm"], one["point"]) == (wbm, point)]
        lowest = [min([one["error"], *one["random"]]) for one in mine]
        hits = np.mean(
            [np.array(one["random"]) <= 1.0005 * best for one, best in zip(mine, lowest, strict=True)]
        )
        starts = ", ".join(f"{name} {count}" for name, count in Counter(one["start"] for one in mine).items())
        print(
            f"{wbm:5s}{point}: {len(mine)} runs from {starts}; random starts needed in "
            f"{sum(bool(one['fallback']) for one in mine)}; relative error at most "
            f"{max(one['error'] for one in mine):.2g}; of random starts {hits:.0%} end there"
        )
    verdict = judge(limit, [], [one for one in found if "measure" in one])
    print(verdict.line())
    return int(verdict.passed is not True)


if __name__ == "__main__":
    sys.exit(main())
