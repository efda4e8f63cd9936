"""CPU time of the white-box model in the FMU's own code. Run: python -m tests.benchmarks.wbm_step"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave

from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm, native, parameter_sets
from fmus.wbm.variables import DEFAULT_INNER_STEP

LIMIT = 2.0  # ms of CPU time per simulated second at the default inner step
SECONDS = 30
REPETITIONS = 5


def best(action: Callable[[], object]) -> float:
    """CPU time in ms per simulated second, the best of some repetitions."""
    times = []
    for _ in range(REPETITIONS):
        begin = time.process_time()
        action()
        times.append(time.process_time() - begin)
    return 1e3 * min(times) / SECONDS


def fmu_time(folder: Path) -> float:
    """One call of fmi2DoStep per simulated second, so that the time is the FMU's, not its caller's."""
    path = build_wbm(folder / "pantograph_wbm.fmu", (host_platform(),))
    description = read_model_description(str(path))
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(str(path), str(folder / "extracted")),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="benchmark",
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    position = 0

    def steps() -> None:
        nonlocal position
        for _ in range(SECONDS):
            fmu.setReal([0], [1.5 + 0.01 * (position % 2)])
            fmu.doStep(float(position), 1.0)
            position += 1

    result = best(steps)
    fmu.terminate()
    fmu.freeInstance()
    return result


def batch_time(sample_time: float) -> float:
    """The native batch call with moving inputs and outputs read at every sample."""
    random = np.random.default_rng(1)
    count = round(SECONDS / sample_time)
    inputs = np.column_stack([1.5 + 1e-3 * random.standard_normal(count), np.full(count, 1310.9)])
    parameters = parameter_sets()["A"]
    return best(lambda: native.simulate(parameters, inputs, sample_time))


def main() -> int:
    """Print the costs; 1 when the FMU is slower than the limit."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [
            ("FMU, fmi2DoStep of 1 s", fmu_time(Path(folder))),
            ("batch call, rows of 1 ms", batch_time(1e-3)),
        ]
    print(f"CPU ms per simulated second, inner step {1e3 * DEFAULT_INNER_STEP} ms, limit {LIMIT} ms")
    for name, cost in rows:
        verdict = "pass" if cost < LIMIT else "FAIL"
        print(f"  {name:28s} {cost:7.3f}  {verdict}  ({1e3 / cost:.0f} times faster than real time)")
    return int(any(cost >= LIMIT for _, cost in rows))


if __name__ == "__main__":
    sys.exit(main())
