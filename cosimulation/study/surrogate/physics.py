"""What the linearised white-box model says of theta and of the modes: what a surrogate is held to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cosimulation.fmu_file import open_fmu
from cosimulation.linearise import Linearisation, linearise
from cosimulation.pantograph import OUTPUTS, TORQUE, operating_point_name
from cosimulation.report.modes import matched, mode_name, modes, reference_poles
from fmus.wbm import parameter_sets
from identification.local_model import LocalModel
from identification.surrogate import (
    STATE_NAMES,
    Head,
    SurrogateResult,
    Which,
    exact_chain9,
    lower_framework,
)

_STATES = ("phi_1", "delta", "xi", "phi_1_dot", "delta_dot", "xi_dot")
"""Of the white-box model, coordinates first."""
_CURVE_POINTS = 41
THETA_ERROR, FREQUENCY_ERROR = "error of theta", "error of frequency"
WHICH: tuple[Which, ...] = ("physical", "tuned")


def head_of(wbm: str) -> Head:
    """Return the collector head of a white-box set, known and not identified."""
    chosen = parameter_sets()[wbm]
    return Head(m_C=chosen["mC"], k_C=chosen["k_C"], c_C=chosen["c_C"], k_E=chosen["k_E"])


def linearisations(fmu: Path, wbm: str, heights: Sequence[float]) -> tuple[Linearisation, ...]:
    """Return the white-box model linearised at rest at every height."""
    with open_fmu(fmu) as opened:
        return tuple(
            linearise(opened, {"eta": height, "M_pa": TORQUE}, OUTPUTS, {"preset": wbm}) for height in heights
        )


def exact_theta(linearisation: Linearisation, head: Head) -> dict[str, float]:
    """Return the coefficients of chain9 that behave as the linearised white-box model does, by name."""
    order = [linearisation.states.index(name) for name in _STATES]
    A = linearisation.A[np.ix_(order, order)]
    torque = linearisation.B[order, linearisation.inputs.index("M_pa")]
    point = linearisation.C[linearisation.outputs.index("zeta")][order][:2]
    return exact_chain9(*lower_framework(A, torque, point, head.k_C, head.c_C))


def theta_records(
    result: SurrogateResult, truth: Sequence[Linearisation], labels: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return a record per theta, local model and parameter, and how far the physical one is from the truth.

    Args:
        result: The surrogate.
        truth: The reference linearised at its centres.
        labels: What identifies the surrogate.
    """
    found: list[dict[str, Any]] = []
    for index, linearisation in enumerate(truth):
        exact = exact_theta(linearisation, result.head)
        height = float(result.frame.centres[index])
        for place, parameter in enumerate(result.structure.parameters):
            about = {**labels, "height": height, "parameter": parameter.name, "unit": parameter.unit}
            right = 1.0 / exact["b_M"] if parameter.name == "r_M" else exact[parameter.name]
            for which in WHICH:
                sure = float(result.standard_errors(which)[index, place])
                value = float(result.theta(which)[index, place])
                tuned = which == "tuned" and result.tuning is not None
                found.append(
                    {
                        "theta": which,
                        **about,
                        "value": value,
                        "exact": right,
                        "error": sure if np.isfinite(sure) else None,
                        "found": "output error" if tuned else _start(result, index),
                        "bound": result.at_bound(which)[index].get(parameter.name, ""),
                    }
                )
                error = 100.0 * abs(value / right - 1.0) if right else None
                found.append({"measure": THETA_ERROR, **about, "which": which, "value": error, "unit": "%"})
    return found


def exact_records(
    fmu: Path, wbm: str, result: SurrogateResult, labels: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return the exact chain9 over the whole range, a record per parameter of the surrogate's structure."""
    known = result.local.settings
    heights = np.linspace(known.low, known.high, _CURVE_POINTS).tolist()
    table = [exact_theta(one, result.head) for one in linearisations(fmu, wbm, heights)]
    return [
        {"exact": name, **labels, "heights": heights, "values": [row[name] for row in table]}
        for name in result.structure.names
        if name in table[0]
    ]


def information_records(result: SurrogateResult, labels: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the Fisher information of every parameter in every state, summed over the local models."""
    told = result.certainty
    if told is None:
        return []
    found = []
    for kind, table in (("partial", told.partial), ("coupled", told.coupled)):
        total = table.sum(axis=1)
        for row, state in enumerate(STATE_NAMES):
            for column, name in enumerate(result.structure.names):
                value = float(total[row, column])
                found.append(
                    {"information": kind, **labels, "state": state, "parameter": name, "value": value}
                )
    return found


def _start(result: SurrogateResult, index: int) -> str:
    fit = result.responses[index]
    return f"frequency response from {'random starts' if fit.start == 'random' else 'the closed form'}"


def frequency_errors(
    models: Sequence[LocalModel], truth: Sequence[Linearisation], labels: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """Return how far the frequency of every mode is from the reference's, in percent; None: no such mode.

    Args:
        models: Local models at the heights of `truth`.
        truth: The reference linearised there.
        labels: What identifies the models.
    """
    found = []
    for model, linearisation in zip(models, truth, strict=True):
        step = model.sample_time
        reference = [mode for mode in modes(reference_poles(linearisation, step), step) if mode.oscillates]
        poles = np.linalg.eigvals(model.A).astype(np.complex128)
        own = [mode for mode in modes(poles, step) if mode.oscillates]
        height = float(linearisation.input_operating_point[linearisation.inputs.index("eta")])
        for index, (right, mine) in enumerate(zip(reference, matched(reference, own), strict=True)):
            error = None if mine is None else 100.0 * abs(mine.frequency / right.frequency - 1.0)
            found.append(
                {
                    "measure": FREQUENCY_ERROR,
                    **labels,
                    "height": height,
                    "point": operating_point_name(height),
                    "mode": mode_name(index, len(reference)),
                    "reference": right.frequency,
                    "value": error,
                    "unit": "%",
                }
            )
    return found
