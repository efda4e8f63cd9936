"""What it takes to build an FMU with all platforms and sources. Run: python -m tests.benchmarks.fmu_build

Every build is a process of its own, from the start of Python to the finished file:
  cold      nothing has ever been compiled: an empty cache folder
  changed   other numbers, same kind of model: the compiler's own files are there, all code is compiled
  warm      the same model again: its libraries come from the cache folder, after their check sums
The networks have the demo's size: four local models of six states and 81 nodes. Exit status 1 when a limit is
missed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from fmu_builder.compiler import TARGETS
from fmu_builder.llmn_fmu import build_llmn
from fmus.wbm import build_wbm
from tests.benchmarks import fmu_step_models as models

COLD, WARM, LARGEST = 20.0, 3.0, 1_000_000  # s, s, bytes
NAMES = ("wbm", "surrogate", "n4sid", "n4sid_parameter")
_ROOT = Path(__file__).parents[2]


def build(name: str, output: Path, variant: int) -> None:
    """Build one FMU for all platforms; variants differ in their numbers, the white-box model in none."""
    scales = tuple(scale * (1.0 + 1e-3 * variant) for scale in models.SCALES)
    if name == "wbm":
        build_wbm(output)
    elif name == "surrogate":
        build_llmn(models.surrogate(seed=7 + variant), output)
    else:
        build_llmn(models.n4sid("parameter" if name.endswith("parameter") else "output", scales), output)


def seconds(name: str, output: Path, variant: int, cache: Path) -> tuple[float, float]:
    """Return the wall time of a build in a process of its own, and its processor time with the compiler's."""
    environment = {**os.environ, "XDG_CACHE_HOME": str(cache), "LOCALAPPDATA": str(cache), "HOME": str(cache)}
    command = [sys.executable, "-m", "tests.benchmarks.fmu_build", name, str(output), str(variant)]
    used, begin = _processor_time(), time.perf_counter()
    subprocess.run(command, cwd=_ROOT, env=environment, check=True)
    return time.perf_counter() - begin, _processor_time() - used


def _processor_time() -> float:
    """Return what ended children, and theirs, have used [s]."""
    found = os.times()
    return found.children_user + found.children_system


def _told(one: tuple[float, float]) -> str:
    return f"{one[0]:.1f} ({one[1]:.1f})"


def main() -> int:
    """Print times and sizes, and whether the limits are kept."""
    kept = []
    print(
        f"{len(TARGETS)} platforms, {os.cpu_count()} processors; wall time of a process (processor time) [s]"
    )
    print(f"  {'':16s}{'cold':>14s}{'changed':>14s}{'warm':>14s}{'bytes':>10s}")
    with tempfile.TemporaryDirectory() as folder:
        for name in NAMES:
            output, cache = Path(folder) / f"{name}.fmu", Path(folder) / f"cache {name}"
            cold = seconds(name, output, 0, cache)
            changed = None if name == "wbm" else seconds(name, output, 1, cache)
            warm = seconds(name, output, 0, cache)
            size = output.stat().st_size
            passed = cold[0] <= COLD and warm[0] <= WARM and size < LARGEST
            kept.append(passed)
            told = "".join(f"{'-' if one is None else _told(one):>14s}" for one in (cold, changed, warm))
            print(f"  {name:16s}{told}{size:10d}  {'pass' if passed else 'FAIL'}", flush=True)
    print(f"limits: cold {COLD:g} s, warm {WARM:g} s, below {LARGEST} bytes")
    return int(not all(kept))


if __name__ == "__main__":
    if len(sys.argv) > 1:
        build(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
        sys.exit(0)
    sys.exit(main())
