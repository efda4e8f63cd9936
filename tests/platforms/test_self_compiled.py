"""What an importer's own compiler makes of an FMU's sources, without any of our flags: gcc."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tolerances
from fmu_builder.compiler import host_platform
from fmu_builder.fmi2 import fmi_headers
from platforms import machines
from platforms.conftest import NAMES, Machines
from platforms.machines import number
from platforms.scenarios import all_of

LEVELS = {
    "plain": (),
    "fast": ("-O3",),
    "fused": ("-O2", "-mfma", "-ffp-contract=fast"),  # another arithmetic: products are not rounded
}


def _fused_runs() -> bool:
    return "fma" in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split()


@pytest.mark.parametrize("level", list(LEVELS))
@pytest.mark.parametrize("name", NAMES)
def test_sources_compiled_by_gcc_answer_the_same(
    all_machines: Machines, name: str, level: str, tmp_path: Path
) -> None:
    gcc = shutil.which("gcc")
    machines.require(gcc is not None and host_platform() == "linux64", "needs gcc on linux64 (Debian: gcc)")
    machines.require(level != "fused" or _fused_runs(), "needs a processor with fused multiply-add")
    fmu = all_machines.fmus[name]
    library = tmp_path / f"{fmu.identifier}.so"
    source = fmu.path.with_suffix("") / "sources" / "all.c"
    flags = (*LEVELS[level], "-shared", "-fPIC", "-Wall", "-Werror", "-Wno-unused-function")
    subprocess.run([str(gcc), *flags, f"-I{fmi_headers()}", str(source), "-o", str(library)], check=True)
    expected = all_machines.lines("linux64", name)
    for scenario in ("moving-1ms", "moving-16.67ms", "model-exchange"):
        commands = [f"load {library}", *all_of(fmu)[scenario]]
        found = all_machines.machine("linux64").run(commands)
        rows = [
            np.array([list(map(number, line.split())) for line in lines if line.count(" ") > 1])
            for lines in (found, expected[scenario])
        ]
        assert rows[0].shape == rows[1].shape
        error = np.abs(rows[0] - rows[1]).max(axis=0) / np.abs(rows[1]).max(axis=0)
        assert error.max() <= tolerances.SELF_COMPILED, (scenario, error)
        if level != "fused":
            assert error.max() == tolerances.BITS, scenario
