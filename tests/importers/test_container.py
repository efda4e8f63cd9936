"""Our FMUs inside an FMU: a container made by others, whose C code takes a setter's warning for a refusal."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import tolerances
from importers.jobs import Job

COUNT = 80
HEIGHTS = 2.45 + 0.1 * np.sin(0.06 * np.arange(COUNT))  # beyond the 2.5 m of the inputs' limits, too
STARTS = {
    "pantograph_wbm.fmu": {"k_E": 61000.0, "M_pa": 1290.0},
    "surrogate.fmu": {"k_E": 8e4, "M_pa": 1350.0},
}
NAMES = {"pantograph_wbm.fmu": "wbm", "surrogate.fmu": "surrogate"}


def build_container(fmus: Mapping[str, Path], folder: Path) -> Path:
    """Both pantographs under one wire, with parameters of their own."""
    for file, name in NAMES.items():
        shutil.copy(fmus[name], folder / file)
    asked = {
        "name": "both.fmu",
        "step_size": 0.001,
        "fmu": list(NAMES),
        "input": [["eta", file, "eta"] for file in NAMES],
        "output": [[file, "F_p", f"F_{name}"] for file, name in NAMES.items()],
        "start": [
            [file, name, str(value)] for file, values in STARTS.items() for name, value in values.items()
        ]
        + [[file, "eta", str(HEIGHTS[0])] for file in NAMES],
        **dict.fromkeys(
            ("auto_link", "auto_input", "auto_output", "auto_parameter", "auto_local", "mt"), False
        ),
    }
    (folder / "both.json").write_text(json.dumps(asked))
    code = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    command = [sys.executable, "-c", code, "-container", "both.json", "-fmu-directory", str(folder)]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert run.returncode == 0, run.stdout + run.stderr
    return folder / "both.fmu"


def test_a_container_has_the_bits_of_the_fmus_in_it(fmus: Mapping[str, Path], tmp_path: Path) -> None:
    container = build_container(fmus, tmp_path)
    rows = HEIGHTS.reshape(-1, 1).tolist()
    outputs = tuple(f"both::F_{name}" for name in NAMES.values())
    inside = Job({"both": str(container)}, outputs, {"both::eta": rows[0][0]}, ("both::eta",), rows).by_hand()
    for column, (file, name) in enumerate(NAMES.items()):
        starts = {f"{name}::{key}": value for key, value in STARTS[file].items()}
        eta = f"{name}::eta"
        alone = Job({name: str(fmus[name])}, (f"{name}::F_p",), {**starts, eta: rows[0][0]}, (eta,), rows)
        assert np.abs(inside[:, column] - alone.by_hand()[:, 0]).max() == tolerances.BITS
        assert np.ptp(inside[:, column]) > 100.0
