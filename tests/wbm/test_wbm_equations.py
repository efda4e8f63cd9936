"""The C model's accelerations, outputs and tangent against Lagrange's equations written independently."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from reference import lagrangian

import tolerances
from fmus.wbm import PhysicalParameters, native, parameter_sets

FRICTION = {
    "friction_base": 31.0,
    "friction_knee": 7.0,
    "friction_rod_end": 5.0,
    "friction_rod_foot": 11.0,
    "friction_bend": 13.0,
    "friction_slip_rate": 0.7,
    "friction_stribeck_ratio": 1.6,
    "friction_stribeck_rate": 0.9,
}
"""Wide passages through rest, so that no term is saturated everywhere."""

OPTIONS = {
    "": {},
    " dry": FRICTION,
    " lifting": {"unilateral": 1.0},
    " dry, lifting": {**FRICTION, "unilateral": 1.0},
}
NAMES = tuple(
    name + option for name in parameter_sets() for option in OPTIONS if name in ("A", "Blow") or not option
)


def chosen(name: str) -> PhysicalParameters:
    """The set whose name comes first, with the options that follow it."""
    base, _, options = name.partition(" ")
    return parameter_sets()[base].changed(**OPTIONS[f" {options}" if options else ""])


def regular_points(name: str, count: int, seed: int) -> list[tuple[list[float], list[float]]]:
    """Random (state, input) pairs away from the ends of the linkage's range; half of them off the wire."""
    reach = native.reach(chosen(name))
    random = np.random.default_rng(seed)
    points = []
    for k in range(count):
        height = random.uniform(0.5, 2.5)
        angle = random.uniform(reach.angle_low + 0.02, reach.angle_high - 0.02)
        rates = random.uniform(-2.0, 2.0, 3)
        state = [angle, rates[0], random.uniform(-0.1, 0.1), rates[1], height, rates[2]]
        gap = random.uniform(0.001, 0.02) * (-1) ** k
        points.append((state, [height - gap, random.uniform(1000.0, 1600.0)]))
    return points


@pytest.mark.parametrize("name", NAMES)
def test_accelerations_agree_with_lagrange(name: str) -> None:
    parameters = chosen(name)
    for state, inputs in regular_points(name, 200, 1):
        expected = np.array(lagrangian.accelerations(state, inputs, parameters.vector()))
        rate = native.derivatives(parameters, state, inputs)
        error = np.abs(rate[1::2] - expected).max() / np.abs(expected).max()
        assert error < tolerances.WBM_EQUATIONS
        assert rate[0::2].tolist() == state[1::2]


@pytest.mark.parametrize("name", NAMES)
def test_outputs_agree_with_the_independent_kinematics(name: str) -> None:
    parameters = chosen(name)
    for state, inputs in regular_points(name, 50, 2):
        expected = np.array(lagrangian.outputs()(state, inputs, parameters.vector()))
        computed = native.simulate(parameters, [inputs], state=state)[0]
        assert np.abs(computed - expected).max() / np.abs(expected).max() < tolerances.WBM_EQUATIONS


def test_every_parameter_has_an_effect() -> None:
    """A parameter that is read at another's place, or not at all, cannot hide."""
    base = chosen("Blow dry")
    state, inputs = [0.3, 0.7, 0.05, -0.4, 1.5, 0.2], [1.501, 1300.0]
    reference = native.derivatives(base, state, inputs), native.simulate(base, [inputs], state=state)
    for name, value in base.values().items():
        other = base.changed(**{name: 1.0 if name == "unilateral" else value * 1.01})
        changed = native.derivatives(other, state, inputs), native.simulate(other, [inputs], state=state)
        differs = any((a != b).any() for a, b in zip(reference, changed, strict=True))
        assert differs, name


def exact_tangent(name: str, state: list[float], inputs: list[float], change: np.ndarray) -> np.ndarray:
    """Derivative of (3 accelerations, 11 outputs) along `change`: central differences with 60 digits."""
    with mpmath.workdps(60):
        parameters = [mpmath.mpf(value) for value in chosen(name).vector().tolist()]
        step = mpmath.mpf(10) ** -20
        start = [mpmath.mpf(value) for value in (*state, *inputs)]
        sides = []
        for sign in (1, -1):
            point = [x + sign * step * mpmath.mpf(float(dx)) for x, dx in zip(start, change, strict=True)]
            x, u = point[:6], point[6:]
            values = lagrangian.accelerations(x, u, parameters, "mpmath")
            sides.append([*values, *lagrangian.outputs("mpmath")(x, u, parameters)])
        return np.array([float((a - b) / (2 * step)) for a, b in zip(*sides, strict=True)])


@pytest.mark.parametrize("name", NAMES)
def test_tangent_is_the_exact_derivative(name: str) -> None:
    """Every single direction and a mixed one, each compared in units of its own largest entry."""
    parameters = chosen(name)
    directions = [*np.eye(8), np.random.default_rng(3).uniform(-1.0, 1.0, 8)]
    for state, inputs in regular_points(name, 3, 4):
        for change in directions:
            expected = exact_tangent(name, state, inputs, change)
            d_rate, d_outputs = native.tangent(parameters, state, inputs, change[:6], change[6:])
            for computed, exact in ((d_rate[1::2], expected[:3]), (d_outputs, expected[3:])):
                scale = max(np.abs(exact).max(), 1e-6)
                assert np.abs(computed - exact).max() / scale < tolerances.WBM_TANGENT


def test_linearisation_is_the_tangent_at_the_equilibrium() -> None:
    parameters = parameter_sets()["A"]
    inputs = [1.2, 1310.9]
    state = native.equilibrium(parameters, inputs)
    model = native.linearise(parameters, inputs)
    assert np.abs(native.derivatives(parameters, state, inputs)).max() < tolerances.WBM_REST
    expected = exact_tangent("A", state.tolist(), inputs, np.eye(8)[2])
    assert np.abs(model.A[1::2, 2] - expected[:3]).max() < tolerances.WBM_TANGENT * np.abs(expected[:3]).max()
    assert np.abs(model.C[:, 2] - expected[3:]).max() < tolerances.WBM_TANGENT * np.abs(expected[3:]).max()
    feedthrough = np.zeros((11, 2))
    feedthrough[native.OUTPUTS.index("F_p"), 0] = -parameters["k_E"]
    assert model.D.tolist() == feedthrough.tolist()
