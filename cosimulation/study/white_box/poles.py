"""Modes over the operating range by linearising the FMU: Figure 2.8, and how smoothly they move."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cosimulation.fmu_file import OpenFmu
from cosimulation.linearise import Linearisation, linearise
from cosimulation.pantograph import SIGNALS, TORQUE, operating_point_name
from cosimulation.report.modes import Poles, mode_name, modes, reference_poles
from fmu_builder.errors import IdentificationError
from identification.arrays import Array
from identification.excitation import ACCEPTANCE
from identification.height import ModeTable
from identification.linear import discretised

Record = dict[str, Any]
OPERATING_POINTS = (0.75, 1.25, 1.75, 2.25)
"""OP25, OP45, OP65, OP85 [m]."""
MODE, STEP, UNSTABLE, PIECES = "mode", "largest step after halving", "unstable", "mode over the height"
_CONSTANT = 1e-9


@dataclass(frozen=True, eq=False)
class ModePaths:
    """Modes of one white-box set over the height.

    Attributes:
        linearisations: At every height.
        poles: In the upper half of the z plane, by frequency, (heights, modes).
        table: Their frequencies and dampings over the height.
    """

    linearisations: tuple[Linearisation, ...]
    poles: Poles
    table: ModeTable

    @property
    def names(self) -> tuple[str, ...]:
        """L, M, H."""
        return tuple(mode_name(index, self.table.modes) for index in range(self.table.modes))


def linearised_over(fmu: OpenFmu, wbm: str, heights: Array) -> tuple[Linearisation, ...]:
    """Linearise the FMU about its rest points at the operating point of the torque.

    Raises:
        FmuError: It has no directional derivatives, or cannot rest there.
    """
    start = {"preset": wbm}
    return tuple(linearise(fmu, {"eta": float(h), "M_pa": TORQUE}, SIGNALS, start) for h in heights)


def mode_paths(linearisations: Sequence[Linearisation]) -> ModePaths:
    """Return the oscillating modes of linearisations in ascending order of their height, held for 1 ms.

    Raises:
        IdentificationError: Their number changes, so that there are no paths to follow.
        DataError: A mode does not decay.
    """
    sample_time = ACCEPTANCE.sample_time
    rows = [
        [mode for mode in modes(reference_poles(one, sample_time), sample_time) if mode.oscillates]
        for one in linearisations
    ]
    counts = {len(row) for row in rows}
    if len(counts) != 1 or not counts - {0}:
        what = f"have {', '.join(map(str, sorted(counts)))} oscillating modes"
        mend = "Study a range of heights in which their number stays the same"
        raise IdentificationError.of("linearisations over the height", what, mend)
    heights = np.array([one.input_operating_point[one.inputs.index("eta")] for one in linearisations])
    table = ModeTable(
        heights,
        np.array([[mode.frequency for mode in row] for row in rows]),
        np.array([[mode.damping for mode in row] for row in rows]),
    )
    return ModePaths(tuple(linearisations), np.array([[mode.pole for mode in row] for row in rows]), table)


def step_ratio(path: Array | Poles) -> float:
    """Return the largest step of a path over the largest step when every other point is left out.

    About 1/2 of a path without jumps, 1 of one with a jump.

    Args:
        path: Values at equidistant points, their number odd, (points,).
    """
    return float(np.abs(np.diff(path)).max() / np.abs(np.diff(path[::2])).max())


def matrix_paths(found: ModePaths) -> Iterator[tuple[str, Array]]:
    """Yield the entries of the discrete A and B that change over the height, by name, (heights,)."""
    models = [
        discretised(
            (one.A, one.B, one.C, one.D),
            ACCEPTANCE.sample_time,
            one.inputs,
            one.outputs,
            one.input_operating_point,
            one.output_operating_point,
        )
        for one in found.linearisations
    ]
    for name in ("A", "B"):
        stack = np.array([getattr(model, name) for model in models])
        for row, column in np.ndindex(stack.shape[1:]):
            entry = stack[:, row, column]
            if np.ptp(entry) > _CONSTANT * np.abs(entry).max():
                yield f"{name}[{row + 1}, {column + 1}]", entry


def pole_records(found: ModePaths, at: ModePaths, labels: Record) -> Iterator[Record]:
    """Yield modes at operating points, how the paths go, and the largest steps of poles and matrices.

    Args:
        found: Over the whole range.
        at: At `OPERATING_POINTS`.
        labels: Of every record.
    """
    for row, height in enumerate(at.table.heights):
        for column, name in enumerate(at.names):
            pole = complex(at.poles[row, column])
            yield {
                "measure": MODE, **labels, "point": operating_point_name(float(height)), "mode": name,
                "value": float(at.table.frequencies[row, column]), "unit": "Hz",
                "damping": float(at.table.dampings[row, column]), "real": pole.real, "imag": pole.imag,
            }  # fmt: skip
    slopes = found.table.slopes_at(found.table.heights)
    for column, name in enumerate(found.names):
        path, slope = found.table.frequencies[:, column], slopes[:, column]
        yield {
            "measure": PIECES, **labels, "mode": name, "unit": "heights of one frequency",
            "value": 1 + int(np.count_nonzero(np.diff(np.sign(np.diff(path))))),
            "low": float(path.min()), "high": float(path.max()), "rises": bool(path[-1] > path[0]),
            "least_slope": float(np.abs(slope).min()), "largest_slope": float(np.abs(slope).max()),
        }  # fmt: skip
        yield {
            "measure": STEP, **labels, "path": f"pole {name}", "unit": "",
            "value": step_ratio(found.poles[:, column]),
        }  # fmt: skip
    entries = {name: step_ratio(path) for name, path in matrix_paths(found)}
    worst = max(entries, key=lambda name: entries[name])
    yield {"measure": STEP, **labels, "path": f"matrices, {worst} worst", "unit": "", "value": entries[worst]}
    unstable = int(np.count_nonzero(np.abs(found.poles).max(axis=1) >= 1.0))
    yield {"measure": UNSTABLE, **labels, "value": unstable, "unit": ""}
