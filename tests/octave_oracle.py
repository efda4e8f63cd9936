"""GNU Octave's control package (SLICOT) as an independent implementation; Debian: octave, octave-control."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.io import loadmat, savemat

from identification.arrays import Array
from identification.data_set import DataSet
from identification.local_model import LocalModel

MISSING = "octave-cli with the control package is not installed (Debian: octave octave-control)"
_N4SID = """
pkg load control
load('in.mat');
ny = size(y, 2);
for k = 1:numel(orders)
  n = orders(k);
  data = iddata(y, u, sample_time);
  before = cputime;
  sys = n4sid(data, n, 's', block_rows(k), 'noise', 'none');
  seconds(k) = cputime - before;
  [a, b, c, d] = ssdata(sys);
  A{k} = a; B{k} = b; C{k} = c; D{k} = d;
end
memory = 0;
lines = strsplit(fileread('/proc/self/status'), "\\n");
found = lines(strncmp(lines, 'VmHWM', 5));
if (! isempty(found)) memory = sscanf(found{1}, 'VmHWM: %f'); end
save('-v7', 'out.mat', 'A', 'B', 'C', 'D', 'seconds', 'memory');
"""
_BALANCED = """
pkg load control
load('in.mat');
sys = ss(A, B, C, D, sample_time);
values = hsvd(sys);
[r, info] = btamodred(sys, double(order));
[a, b, c, d] = ssdata(r);
save('-v7', 'out.mat', 'a', 'b', 'c', 'd', 'values');
"""


@dataclass(frozen=True)
class OctaveModel:
    """A model that Octave identified, its CPU seconds, and Octave's peak memory so far [MB]."""

    model: LocalModel
    seconds: float
    memory: float


def octave() -> str | None:
    """Return the program, None where it or its control package is missing."""
    program = shutil.which("octave-cli")
    if program is None:
        return None
    command = [program, "--quiet", "--no-init-file", "--eval", "pkg load control"]
    return program if subprocess.run(command, capture_output=True).returncode == 0 else None


def required() -> bool:
    """Whether a missing Octave is a fault: where everything that is tested must be tested."""
    return os.environ.get("CI") == "true"


def run(folder: Path, script: str, values: dict[str, Any]) -> dict[str, Any]:
    """Return the variables that a script saves in out.mat from those in in.mat."""
    program = octave()
    if program is None:
        raise FileNotFoundError(MISSING)
    savemat(folder / "in.mat", values)
    (folder / "script.m").write_text(script, encoding="ascii")
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [program, "--quiet", "--no-init-file", "script.m"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)
    if not (folder / "out.mat").is_file():
        raise RuntimeError(done.stderr or done.stdout)
    result: dict[str, Any] = loadmat(folder / "out.mat")
    return result


def n4sid(
    folder: Path,
    data: DataSet,
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    cases: list[tuple[int, int]],
) -> list[OctaveModel]:
    """Return Octave's models for pairs of order and block rows; signals come scaled and without means."""
    u, y = data.matrix(inputs), data.matrix(outputs)
    u_mean, y_mean, u_size, y_size = u.mean(axis=0), y.mean(axis=0), u.std(axis=0), y.std(axis=0)
    values = {
        "u": (u - u_mean) / u_size,
        "y": (y - y_mean) / y_size,
        "sample_time": data.sample_time,
        "orders": [float(order) for order, _ in cases],
        "block_rows": [float(rows) for _, rows in cases],
    }
    found = run(folder, _N4SID, values)
    models = []
    for k in range(len(cases)):
        A, B, C, D = (np.asarray(found[name][0, k], dtype=float) for name in "ABCD")
        model = LocalModel(
            A,
            B / u_size,
            C * y_size[:, None],
            D * y_size[:, None] / u_size,
            data.sample_time,
            inputs,
            outputs,
            u_mean,
            y_mean,
        )
        models.append(
            OctaveModel(model, float(found["seconds"].ravel()[k]), float(np.max(found["memory"])) / 1024.0)
        )
    return models


def balanced(folder: Path, model: LocalModel, order: int) -> tuple[LocalModel, Array]:
    """Return Octave's balanced truncation and the Hankel singular values."""
    values = {name: getattr(model, name) for name in "ABCD"}
    found = run(folder, _BALANCED, {**values, "sample_time": model.sample_time, "order": float(order)})
    matrices = [np.asarray(found[name], dtype=float) for name in "abcd"]
    small = LocalModel(
        *matrices,
        model.sample_time,
        model.inputs,
        model.outputs,
        model.input_operating_point,
        model.output_operating_point,
    )
    return small, np.asarray(found["values"], dtype=float).ravel()
