"""From physical parameters to a node table: the C against scipy and against the search."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg
from theta_networks import BASE, CENTRES, HEAD, inputs_of, shares_of, theta_network, theta_of

import tolerances
from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel import CHAINS, Chain, chain_of, simulate, with_parameters
from identification.surrogate.chain import SCALE
from identification.surrogate.chain import Head as KnownHead
from identification.surrogate.structure import STRUCTURES

EVERY = pytest.mark.parametrize("structure", CHAINS)
POSITIONS = np.linspace(0.5, 2.5, 17)
STIFF = {"k_L": 4e6, "c_L": 3e3, "m_H": 5.5}


def chain(structure: str, **other: float) -> Chain:
    theta = theta_of(structure)
    for name, value in other.items():
        theta[:, [one.name for one in CHAINS[structure]].index(name)] = value
    return Chain(structure, HEAD, theta, shares_of(POSITIONS), 1e-3)


def scaled(matrix: np.ndarray) -> np.ndarray:
    rows, columns = matrix.shape[-2:]
    return matrix / SCALE[:rows, None] * (SCALE[None, :6] if columns == 6 else 1.0)


@EVERY
@pytest.mark.parametrize("other", [{}, STIFF], ids=["usual", "stiff"])
def test_the_discretisation_is_scipys(structure: str, other: dict[str, float]) -> None:
    made, known = chain(structure, **other), STRUCTURES[structure]
    theta = known.blended(made.theta, made.weights)
    A, B = known.continuous(theta, KnownHead(**HEAD))
    for k, model in enumerate(made.models()):
        augmented = np.zeros((8, 8))
        augmented[:6, :6], augmented[:6, 6:] = A[k], B[k]
        exact = scipy.linalg.expm(augmented * 1e-3 * SCALE[None, :] / SCALE[:, None])
        for mine, reference in ((np.array(model.A), exact[:6, :6]), (np.array(model.B), exact[:6, 6:])):
            assert np.abs(scaled(mine) - reference).max() <= tolerances.CHAIN_TABLE * np.abs(reference).max()


@EVERY
def test_identification_searches_with_the_same_models(structure: str) -> None:
    made, known = chain(structure), STRUCTURES[structure]
    local = known.discretise(
        known.blended(made.theta, made.weights), KnownHead(**HEAD), 1e-3, derivatives=False
    )
    for k, model in enumerate(made.models()):
        for mine, other in ((model.A, local.A[k]), (model.B, local.B[k])):
            assert np.abs(scaled(np.array(mine)) - scaled(other)).max() <= tolerances.CHAIN_TABLE
        assert np.abs(np.array(model.g) - local.g[k]).max() <= tolerances.SURROGATE_EQUILIBRIUM


@EVERY
def test_what_rests_moves_by_g(structure: str) -> None:
    for model in chain(structure).models():
        A, B, g = np.array(model.A), np.array(model.B), np.array(model.g)
        assert np.abs(A @ g + B[:, 0] - g).max() <= tolerances.STAYS_AT_REST


def test_at_a_bound_the_blend_stays_there() -> None:
    parameters = CHAINS["chain8"]
    theta = np.tile([one.upper if one.name == "m_H" else BASE[one.name] for one in parameters], (4, 1))
    beyond = theta.copy()
    beyond[1, 0] = 60.0  # never computed with: 50 kg is the limit
    weights = shares_of(POSITIONS)
    made = [Chain("chain8", HEAD, one, weights, 1e-3).models() for one in (theta, beyond)]
    assert made[0] == made[1]


def test_an_unstable_node_and_springs_that_hold_nothing_are_refused() -> None:
    with pytest.raises(ParameterSetError, match=r"node \d+: is unstable"):
        chain("chain8", c_W=-1000.0).models()
    with pytest.raises(ParameterSetError, match="node 1: is unstable"):
        chain("chain8", k_W=-2e6).models()
    nothing = chain("chain8", k_W=0.0)
    soft = Chain("chain8", {**HEAD, "k_C": 0.0}, nothing.theta, np.eye(4), 1e-3)
    with pytest.raises(ParameterSetError, match="springs hold nothing"):
        soft.models()


@EVERY
def test_the_theta_of_a_table_is_found_again(structure: str) -> None:
    network = theta_network(structure)
    found = chain_of(network)
    assert found is not None and network.surrogate is not None
    np.testing.assert_array_equal(found.theta, theta_of(structure))
    surrogate = network.surrogate
    swapped = surrogate.model_copy(update={"physical": surrogate.tuned, "tuned": surrogate.physical})
    found = chain_of(network.replaced(surrogate=swapped))
    assert found is not None
    np.testing.assert_array_equal(found.theta, theta_of(structure))
    other = surrogate.model_copy(update={"tuned": surrogate.physical})
    assert chain_of(network.replaced(surrogate=other)) is None
    assert chain_of(network.replaced(surrogate=None)) is None


def test_a_changed_surrogate_is_one_made_of_other_parameters() -> None:
    network = theta_network()
    theta = theta_of("chain8")
    assert with_parameters(network, theta).node_table == network.node_table
    theta[2, 0] *= 1.2
    changed = with_parameters(network, theta)
    found = chain_of(changed)
    assert found is not None and changed.node_table != network.node_table
    np.testing.assert_array_equal(found.theta, theta)
    assert changed.scores == () and changed.offsets == network.offsets
    inputs = inputs_of(300)
    assert np.abs(simulate(changed, inputs) - simulate(network, inputs))[:, 0].max() > 1e-5


def test_another_contact_spring_leaves_the_frame_where_the_force_is_the_same() -> None:
    network = theta_network()
    softer = with_parameters(network, contact_stiffness=2e4)
    before, after = network.offsets.static_map, softer.offsets.static_map
    assert before is not None and after is not None and after.values == before.values
    force = 1e5 * (np.array(before.values)[:, 0] - np.array(before.positions))
    np.testing.assert_allclose(
        2e4 * (np.array(after.values)[:, 0] - np.array(after.positions)), force, rtol=1e-9
    )
    row = np.array([[1.5, 1310.9]])
    contact = [simulate(one, row)[0, -1] for one in (network, softer)]
    assert abs(contact[1] - contact[0]) < 0.02  # N: the force at rest hardly changes, 3 N per metre
    assert simulate(softer, row)[0, 0] - simulate(network, row)[0, 0] == pytest.approx(
        70.5 / 2e4 - 70.5 / 1e5, rel=1e-2
    )
    assert len(CENTRES) == len(softer.local_models)


def test_parameters_outside_their_limits_are_named_all_at_once() -> None:
    network, theta = theta_network(), theta_of("chain8")
    theta[1, 0], theta[3, 2] = 51.0, np.nan
    with pytest.raises(ParameterSetError) as found:
        with_parameters(network, theta, contact_stiffness=-1.0)
    assert [problem.place for problem in found.value.problems] == ["m_H[2]", "k_L[4]", "k_E"]
    with pytest.raises(ParameterSetError, match="one row per local model"):
        with_parameters(network, theta[:2])
    with pytest.raises(ParameterSetError, match="theta is blended"):
        with_parameters(network.replaced(surrogate=None))
