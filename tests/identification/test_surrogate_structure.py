"""The chain structures against springs and dampers assembled independently, and their exact derivatives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fmu_builder.errors import SettingsError
from identification.surrogate.chain import Head
from identification.surrogate.structure import STRUCTURES, Structure
from tolerances import SURROGATE_EQUILIBRIUM, SURROGATE_EXPONENTIAL

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN7, CHAIN10 = STRUCTURES["chain7"], STRUCTURES["chain10"]
PLANT = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0])
CHAIN8, CHAIN9 = STRUCTURES["chain8"], STRUCTURES["chain9"]
EVERY = pytest.mark.parametrize("structure", STRUCTURES.values(), ids=STRUCTURES)


def springs_and_dampers(
    values: dict[str, float],
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """M q'' + C q' + K q = F u of a chain, element by element; q = xi, zeta, delta_M."""
    mass = np.diag([values["m_C"], values["m_H"], values["m_M"]])
    stiffness, damping = np.zeros((3, 3)), np.zeros((3, 3))
    for matrix, elements in (
        (stiffness, [(0, None, "k_E"), (0, 1, "k_C"), (1, 2, "k_L"), (2, None, "k_W")]),
        (damping, [(0, 1, "c_C"), (1, 2, "c_L"), (2, None, "c_W"), (1, None, "c_H")]),
    ):
        for first, second, name in elements:
            direction = np.zeros(3)
            direction[first] = 1.0
            if second is not None:
                direction[second] = -1.0
            matrix += values.get(name, 0.0) * np.outer(direction, direction)
    force = np.array([[values["k_E"], 0.0], [0.0, values.get("b_H", 0.0)], [0.0, values["b_M"]]])
    return mass, damping, stiffness, force


def second_order_state_space(values: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    mass, damping, stiffness, force = springs_and_dampers(values)
    inverse = np.linalg.inv(mass)
    order = [0, 3, 1, 4, 2, 5]  # q, q' to the interleaved state of eq. 3.21
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ stiffness, -inverse @ damping]])
    B = np.vstack([np.zeros((3, 2)), inverse @ force])
    return A[np.ix_(order, order)], B[order]


@EVERY
@settings(max_examples=25, deadline=None)
@given(place=st.lists(st.floats(0.02, 0.98), min_size=10, max_size=10))
def test_matrices_are_those_of_springs_and_dampers(structure: Structure, place: list[float]) -> None:
    lower, upper = structure.start_bounds
    theta = structure.from_search(lower + (upper - lower) * np.array(place[: len(lower)]))
    values = {"m_C": HEAD.m_C, "k_C": HEAD.k_C, "c_C": HEAD.c_C, "k_E": HEAD.k_E}
    values |= dict(zip(structure.names, theta.tolist(), strict=True))
    if "r_M" in values:
        values["b_M"] = 1.0 / values["r_M"]
    A, B = second_order_state_space(values)
    given_A, given_B = structure.continuous(theta, HEAD)
    np.testing.assert_allclose(given_A, A, rtol=1e-13, atol=1e-13 * np.abs(A).max())
    np.testing.assert_allclose(given_B, B, rtol=1e-13)


def test_entries_of_equation_3_22() -> None:
    A, B = CHAIN7.continuous(PLANT, HEAD)
    assert A[1, 0] == -(1e5 + 10384.8) / 5.609
    assert A[3, 2] == -(10384.8 + 25343.9) / 8.0
    assert A[5, 5] == -(25.0 + 30.0) / 14.0
    assert A[5, 4] == -(25343.9 + 1200.0) / 14.0
    assert B[5, 1] == pytest.approx(1.0 / (0.3 * 14.0), rel=1e-15)
    assert B[1, 0] == 1e5 / 5.609
    assert np.count_nonzero(A) == 3 + 4 + 6 + 4 and np.count_nonzero(B) == 2


def theta_inside(structure: Structure, seed: int) -> np.ndarray:
    lower, upper = structure.start_bounds
    return structure.from_search(np.random.default_rng(seed).uniform(lower, upper))


def augmented(structure: Structure, theta: np.ndarray) -> np.ndarray:
    A, B = structure.continuous(theta, HEAD)
    matrix = np.zeros((8, 8), dtype=A.dtype)
    matrix[:6, :6], matrix[:6, 6:] = A, B
    return matrix


def exact_exponential(matrix: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """exp and its derivative in 40 digits: exp([[X, E], [0, X]]) holds both (scipy errs 1e-12)."""
    with mpmath.workdps(40):
        block = mpmath.matrix(np.block([[matrix, direction], [np.zeros((8, 8)), matrix]]).tolist())
        result = mpmath.expm(block, method="taylor")
        table = np.array([[float(result[row, column]) for column in range(16)] for row in range(8)])
    return table[:, :8], table[:, 8:]


@EVERY
@pytest.mark.parametrize("seed", [None, 2])
def test_discretisation_and_its_derivatives(structure: Structure, seed: int | None) -> None:
    theta = structure.from_search(structure.to_search(np.resize(PLANT, len(structure.names))))
    if seed is not None:
        theta = theta_inside(structure, seed)
    dynamics = structure.discretise(theta, HEAD, 1e-3)
    for index in range(len(theta)):
        direction = complex_step(structure, theta, index, lambda moved: augmented(structure, moved))
        held, slope = exact_exponential(augmented(structure, theta) * 1e-3, direction * 1e-3)
        for mine, exact in (
            *((dynamics.A, held[:6, :6]), (dynamics.B, held[:6, 6:])),
            *((dynamics.dA[index], slope[:6, :6]), (dynamics.dB[index], slope[:6, 6:])),
        ):
            assert np.abs(mine - exact).max() <= SURROGATE_EXPONENTIAL * np.abs(exact).max(), index


def complex_step(structure: Structure, theta: np.ndarray, index: int, what: Callable) -> np.ndarray:
    """Derivative of `what` to one parameter; what it computes is rational, so a tiny step is exact."""
    moved = theta.astype(complex)
    moved[index] += 1e-30j
    return what(moved).imag / 1e-30


def test_equilibrium_per_height_and_its_derivative() -> None:
    dynamics = CHAIN7.discretise(PLANT, HEAD, 1e-3)
    np.testing.assert_allclose(
        dynamics.g, np.linalg.solve(np.eye(6) - dynamics.A, dynamics.B[:, 0]), atol=SURROGATE_EQUILIBRIUM
    )

    def at_rest(theta: np.ndarray) -> np.ndarray:
        A, B = CHAIN7.continuous(theta, HEAD)
        return -np.linalg.inv(A) @ B[:, 0]

    for index in range(len(PLANT)):
        exact = complex_step(CHAIN7, PLANT, index, at_rest) * PLANT[index]
        np.testing.assert_allclose(
            dynamics.dg[index] * PLANT[index], exact, rtol=0, atol=SURROGATE_EQUILIBRIUM
        )


def test_without_derivatives_the_matrices_are_the_same() -> None:
    full, plain = (CHAIN7.discretise(PLANT, HEAD, 1e-3, derivatives=flag) for flag in (True, False))
    np.testing.assert_array_equal(full.A, plain.A)
    np.testing.assert_array_equal(full.B, plain.B)
    np.testing.assert_array_equal(full.g, plain.g)
    assert plain.dA.shape == (0, 6, 6)


@EVERY
def test_search_coordinates_go_there_and_back(structure: Structure) -> None:
    theta = np.stack([theta_inside(structure, seed) for seed in (4, 5, 6)])
    back = structure.from_search(structure.to_search(theta))
    np.testing.assert_allclose(back, theta, rtol=1e-13)
    search = structure.to_search(theta[0])
    for index in range(search.size):
        step = np.zeros_like(search)
        step[index] = 1e-6
        change = (structure.from_search(search + step) - structure.from_search(search - step)) / 2e-6
        assert change[index] == pytest.approx(structure.slope(theta[0])[index], rel=1e-8)


def test_values_outside_the_bounds_are_moved_in_and_flagged() -> None:
    theta = CHAIN7.from_search(CHAIN7.to_search(np.array([4.0, 60.0, 0.0, 25.0, 0.3, 0.0, 3e5])))
    assert theta[0] == 5.0 and theta[1] == 50.0 and theta[6] == 2e5
    assert CHAIN7.at_bound(theta) == {
        **{"m_H": "lower", "m_M": "upper", "k_L": "lower", "k_W": "lower", "c_W": "upper"}
    }
    assert CHAIN7.at_bound(PLANT) == {}


def test_bounds_are_those_of_table_4_2() -> None:
    table = {
        **{"m_H": (5, 50), "m_M": (5, 50), "k_L": (0, 1e7), "c_L": (1e-3, 2e5), "r_M": (1e-3, 0.6)},
        **{"k_W": (0, 1e7), "c_W": (0, 2e5), "m_C": (1, 30), "k_C": (1e-7, 1e7), "c_C": (1e-3, 2e5)},
    }
    assert CHAIN10.names == tuple(table) and CHAIN7.names == tuple(table)[:7]
    for parameter in CHAIN10.parameters:
        assert (parameter.lower, parameter.upper) == table[parameter.name]


def test_an_impossible_head_is_refused_with_all_problems() -> None:
    with pytest.raises(SettingsError) as caught:
        Head(m_C=-1.0, k_C=float("nan"), c_C=32.0, k_E=1e5)
    assert len(caught.value.problems) == 2


def test_bounds_of_the_balanced_frame() -> None:
    assert CHAIN9.names == (*CHAIN8.names, "c_H")
    bounds = {one.name: (one.lower, one.upper) for one in CHAIN9.parameters}
    assert bounds["m_H"] == (0.3, 50.0)
    assert (bounds["k_L"], bounds["c_L"]) == ((0.0, 1e7), (1e-3, 2e5))
    for name in ("b_H", "k_W", "c_W", "c_H"):
        assert bounds[name][0] == -bounds[name][1] < 0.0
    assert all(one.scaling == ("linear" if one.lower < 0.0 else "log") for one in CHAIN9.parameters)


def test_several_chains_at_once_are_each_by_itself() -> None:
    theta = np.stack([theta_inside(CHAIN8, seed) for seed in (1, 2, 3)])
    together = CHAIN8.discretise(theta, HEAD, 1e-3)
    for index, row in enumerate(theta):
        alone = CHAIN8.discretise(row, HEAD, 1e-3)
        for name in ("A", "B", "g", "dA", "dB", "dg"):
            mine, one = getattr(together, name)[index], getattr(alone, name)
            assert np.abs(mine - one).max() <= SURROGATE_EXPONENTIAL * np.abs(one).max() * 10.0, name


def test_the_blend_is_geometric_for_positive_and_linear_for_free_signs() -> None:
    theta = np.array(
        [[2.0, 9.0, 9000.0, 1.0, 0.3, -0.1, -20.0, 5.0], [8.0, 4.0, 1000.0, 4.0, 0.2, 0.3, 40.0, -3.0]]
    )
    middle, beyond = CHAIN8.blended(theta, np.array([[0.5, 0.5], [1.5, -0.5]]))
    np.testing.assert_allclose(middle, [4.0, 6.0, 3000.0, 2.0, np.sqrt(0.06), 0.1, 10.0, 1.0], rtol=1e-14)
    np.testing.assert_allclose(beyond[[0, 5, 6]], [1.0, -0.3, -50.0], rtol=1e-13)


def test_coefficients_of_another_structure_become_theta() -> None:
    values = {
        "m_H": 8.0,
        "m_M": 14.0,
        "k_L": 2e4,
        "c_L": 25.0,
        "b_M": 2.5,
        "b_H": 0.3,
        "k_W": 9.0,
        "c_W": 3.0,
    }
    np.testing.assert_array_equal(CHAIN8.from_coefficients(values, HEAD), list(values.values()))
    assert dict(zip(CHAIN10.names, CHAIN10.from_coefficients(values, HEAD), strict=True)) == {
        **{"m_H": 8.0, "m_M": 14.0, "k_L": 2e4, "c_L": 25.0, "r_M": 0.4, "k_W": 9.0, "c_W": 3.0},
        **{"m_C": HEAD.m_C, "k_C": HEAD.k_C, "c_C": HEAD.c_C},
    }
    assert CHAIN8.from_coefficients({"r_M": 0.25}, HEAD)[CHAIN8.names.index("b_M")] == 4.0


def test_the_documents_draw_every_structure() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "surrogate.md").read_text(encoding="utf-8")
    drawn = {
        line.split()[0]: line.strip().split(maxsplit=1)[1]
        for line in text.splitlines()
        if "    chain" in line
    }
    assert drawn == {name: structure.diagram for name, structure in STRUCTURES.items()}


@EVERY
def test_a_step_along_the_curve_is_tangent(structure: Structure) -> None:
    search = structure.to_search(np.stack([theta_inside(structure, seed) for seed in (4, 5)]))
    step = np.random.default_rng(8).normal(size=search.shape)
    change = (structure.moved(search, 1e-6 * step) - structure.moved(search, -1e-6 * step)) / 2e-6
    np.testing.assert_allclose(change, step, rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(structure.moved(search, np.zeros_like(step)), search, rtol=1e-12)


@pytest.mark.parametrize("name", ["chain8", "chain9"])
def test_along_the_curve_the_lower_mass_keeps_its_frequency(name: str) -> None:
    structure = STRUCTURES[name]
    theta = theta_inside(structure, 4)
    m, k, c, wall, damper = (structure.names.index(one) for one in ("m_M", "k_L", "c_L", "k_W", "c_W"))
    step = np.zeros(len(theta))
    step[m] = 0.5
    for total, at in ((theta[k] + theta[wall], wall), (theta[c] + theta[damper], damper)):
        step[at] = 0.5 * total / structure.parameters[at].size
    found = structure.from_search(structure.moved(structure.to_search(theta), step))
    for one, other in ((k, wall), (c, damper)):
        before, after = ((x[one] + x[other]) / x[m] for x in (theta, found))
        assert after == pytest.approx(before, rel=1e-12)
    assert found[m] == pytest.approx(theta[m] * np.exp(0.5), rel=1e-12)
