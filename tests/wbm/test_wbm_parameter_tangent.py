"""In initialisation mode: how rest follows every parameter, against Lagrange's equations in 40 digits."""

from __future__ import annotations

from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from reference import lagrangian
from wbm.test_wbm_fmu import INPUT_REFERENCES, OUTPUT_REFERENCES, REFERENCE, fmu_path, open_fmu

import tolerances
from fmus.wbm import parameter_sets

__all__ = ["fmu_path", "open_fmu"]
NAMES = tuple(entry.name for entry in parameter_sets()["A"].entries)
REALS = tuple(name for name in NAMES if name != "unilateral")  # a switch has no derivative
INPUTS = (1.2, 1250.0)
STEP = mpmath.mpf("1e-15")  # of central differences in 40 digits: nothing of it is left in 16


def balance(position: list[mpmath.mpf], parameters: list[mpmath.mpf]) -> mpmath.matrix:
    """The three forces on the model at rest, which are zero in equilibrium, and behind them the outputs."""
    phi, delta, xi = position
    state = [phi, mpmath.mpf(0), delta, mpmath.mpf(0), xi, mpmath.mpf(0)]
    inputs = [mpmath.mpf(u) for u in INPUTS]
    forces = lagrangian.equations("mpmath")(state, inputs, parameters)[9:]
    return mpmath.matrix([*forces, *lagrangian.outputs("mpmath")(state, inputs, parameters)])


def slopes(position: list[mpmath.mpf], parameters: list[mpmath.mpf]) -> mpmath.matrix:
    """Derivatives of the balance by the three coordinates, and by every parameter."""
    columns = []
    for k in range(3 + len(parameters)):
        ends = []
        for sign in (1, -1):
            moved = [*position, *parameters]
            moved[k] += sign * STEP
            ends.append(balance(moved[:3], moved[3:]))
        columns.append((ends[0] - ends[1]) / (2 * STEP))
    return mpmath.matrix([[column[row] for column in columns] for row in range(3 + len(OUTPUT_REFERENCES))])


def rest_slopes(first: list[float], values: list[float]) -> np.ndarray:
    """Derivatives of the outputs in equilibrium by every parameter, by the theorem on implicit functions."""
    with mpmath.workdps(40):
        exact = [mpmath.mpf(value) for value in values]
        position = mpmath.findroot(lambda *at: [*balance(list(at), exact)[:3]], first)
        slope = slopes(list(position), exact)
        coordinates = -mpmath.inverse(slope[:3, :3]) * slope[:3, 3:]
        return np.array((slope[3:, 3:] + slope[3:, :3] * coordinates).tolist(), dtype=np.float64)


def test_every_parameter_has_its_exact_derivative(open_fmu: Callable[..., object]) -> None:
    others = {"l2": 1.02, "k_C": 0.9, "mB": 1.3}  # values of their own, so that not all is the preset's
    with open_fmu("A", INPUTS, ready=False) as (fmu, _):
        values = fmu.getReal([REFERENCE[name] for name in REALS])
        values = [value * others.get(name, 1.0) for name, value in zip(REALS, values, strict=True)]
        fmu.setReal([REFERENCE[name] for name in REALS], values)
        position = fmu.getReal([REFERENCE[name] for name in ("phi_1", "delta", "xi")])
        columns = [fmu.getDirectionalDerivative(OUTPUT_REFERENCES, [REFERENCE[n]], [1.0]) for n in REALS]
        mixed = fmu.getDirectionalDerivative(
            OUTPUT_REFERENCES, [REFERENCE["l1"], INPUT_REFERENCES[1], REFERENCE["g"]], [0.3, -2.0, 0.7]
        )
        torque = fmu.getDirectionalDerivative(OUTPUT_REFERENCES, [INPUT_REFERENCES[1]], [1.0])
    known = dict(zip(REALS, values, strict=True)) | {"unilateral": 0.0}
    slopes_of_all = rest_slopes(position, [known[name] for name in NAMES])
    found, expected = np.array(columns).T, slopes_of_all[:, [NAMES.index(name) for name in REALS]]
    size = np.abs(expected).max(axis=0)
    resting = {"J1", "J2", "c_C", "c_d"}  # act on what moves only; what 40 digits leave of them is no number
    acting = np.array([name not in resting and not name.startswith("friction_") for name in REALS])
    assert size[acting].min() > 1e6 * size[~acting].max() and not found[:, ~acting].any()
    error = np.abs(found - expected)[:, acting] / size[acting]
    assert error.max() <= tolerances.WBM_STATIC_GAIN
    along = 0.3 * found[:, REALS.index("l1")] - 2.0 * np.array(torque) + 0.7 * found[:, REALS.index("g")]
    assert np.abs(np.array(mixed) - along).max() <= tolerances.WBM_TANGENT * np.abs(along).max()


def test_a_parameter_that_follows_another_preset_has_none(open_fmu: Callable[..., object]) -> None:
    with open_fmu("Blow", INPUTS, ready=False) as (fmu, log):
        with pytest.raises(FMICallException):
            fmu.getDirectionalDerivative(OUTPUT_REFERENCES, [REFERENCE["k_C"]], [1.0])
        assert log[-1].endswith(
            "no derivative with respect to k_C: it has its start value, so the preset decides;"
            " give it a value of its own"
        )
        fmu.setReal([REFERENCE["k_C"]], [9000.0])
        assert any(fmu.getDirectionalDerivative(OUTPUT_REFERENCES, [REFERENCE["k_C"]], [1.0]))
        assert any(fmu.getDirectionalDerivative(OUTPUT_REFERENCES, [REFERENCE["g"]], [1.0]))
