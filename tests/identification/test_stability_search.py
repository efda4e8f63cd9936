"""Looking for certificates: what is found is proved, and what cannot be had is said."""

from __future__ import annotations

import json

import certified_networks as networks
import networks as any_networks
import numpy as np
import pytest

import tolerances
from fmu_builder.errors import CertificateError
from fmu_builder.parameter_set import ParameterSet
from identification.stability import found_certificate, proved, verify
from identification.stability.programme import Exclusion, Solution, Triangle, common_solution

WIDE = np.array([0.0, 4.0])


def proof_of(network: ParameterSet, rate: float, or_less: bool = False) -> tuple[float | None, float]:
    """Rate and decay of the certificate found, both as proved."""
    found = proved(network.replaced(certificate=found_certificate(network, rate, or_less=or_less)))
    assert found is not None and found.model_hash == network.model_hash()
    return found.rate, found.decay


def test_the_decay_falls_with_the_rate_and_ends_at_that_of_the_slowest_model() -> None:
    network = networks.oscillators()
    assert network.node_table is not None
    radius = max(np.abs(np.linalg.eigvals(np.array(m.A))).max() for m in network.node_table.models)
    slowest = -np.log(radius) / network.sample_time
    decays = [proof_of(network, rate)[1] for rate in (0.01, 1.0, 4.0)]
    assert slowest > decays[0] > decays[1] > decays[2] > 0.0
    assert decays[0] > 0.9 * slowest


def test_where_the_rate_is_too_high_the_largest_one_is_named_and_can_be_had() -> None:
    network = networks.oscillators(damping=0.02)
    with pytest.raises(
        CertificateError, match="no certificate was found for a rate of 45; one was found for"
    ):
        found_certificate(network, 45.0)
    rate, decay = proof_of(network, 45.0, or_less=True)
    assert rate is not None and 1.0 < rate < 40.0 and decay >= 0.0


def test_a_rate_that_crosses_more_than_a_cell_per_tick_is_too_high() -> None:
    rate, _ = proof_of(networks.oscillators(), 60.0, or_less=True)
    assert rate is not None and rate <= 50.0  # cells of 0.5 m, ticks of 10 ms


def test_equal_models_have_a_common_matrix_and_no_bound_on_the_rate() -> None:
    A = np.array([[0.9, 0.4], [-0.3, 0.7]])
    rate, decay = proof_of(networks.blend([A, A, A], [0.0, 1.0, 3.0]), 2.0)
    assert rate is None
    assert 0.9 * -np.log(np.abs(np.linalg.eigvals(A)).max()) < decay


def test_where_no_common_matrix_exists_that_is_proved_too() -> None:
    network = networks.oscillators()
    certificate = found_certificate(network, 1.0)
    assert certificate.method == "nodes" and certificate.exclusion is not None
    content = json.loads(network.replaced(certificate=certificate).canonical_json())
    assert verify.verify(content).common_excluded


def test_blended_outputs_need_stable_local_models_only() -> None:
    models = [np.array([[0.9, 5.0], [0.0, 0.8]]), np.array([[0.5, 0.0], [-7.0, 0.95]])]
    network = networks.blend(models, [0.0, 4.0], blending="output")
    certificate = found_certificate(network, 1.0)
    assert certificate.method == "local_models" and certificate.rate is None
    rate, decay = proof_of(network, 1.0)
    assert rate is None and 0.9 * -np.log(0.95) < decay < -np.log(0.95)


@pytest.mark.parametrize("blending", ["output", "parameter"])
@pytest.mark.parametrize("radius", [1.0, 1.1])
def test_an_unstable_model_has_no_certificate(blending: str, radius: float) -> None:
    models = [np.diag([0.5, 0.2]), np.diag([0.1, radius])]
    with pytest.raises(CertificateError, match=r"unstable|spectral radius"):
        found_certificate(networks.blend(models, WIDE.tolist(), blending=blending), 0.1)


def test_a_blend_that_is_unstable_between_the_nodes_has_no_certificate() -> None:
    left = np.array([[0.5, 2.0], [0.0, 0.5]])
    with pytest.raises(CertificateError, match="no certificate was found for any rate"):
        found_certificate(networks.blend([left, left.T], WIDE.tolist()), 0.1)


def test_gaussians_that_blend_parameters_have_none() -> None:
    network = any_networks.network(1, "scheduled_equilibrium", "parameter", "gaussian")
    with pytest.raises(CertificateError, match="Gaussians"):
        found_certificate(network, 1.0)


def test_a_certificate_of_another_model_proves_nothing() -> None:
    network = networks.oscillators()
    certificate = found_certificate(network, 1.0)
    moved = network.model_dump() | {"certificate": certificate.model_dump(), "sample_time": 0.011}
    with pytest.raises(CertificateError, match="the certificate is of the model"):
        proved(ParameterSet(**moved))
    assert proved(network) is None


def test_the_same_network_gives_the_same_certificate() -> None:
    network = networks.oscillators(3)
    first, second = (found_certificate(network, 2.0) for _ in range(2))
    assert first == second


def test_other_state_coordinates_change_little() -> None:
    """SI units of wild sizes: the search balances them."""
    network = networks.oscillators(3)
    assert network.node_table is not None
    T = np.array([[1e3, 2.0, 0.0], [0.0, 1e-2, 5e-3], [1.0, 0.0, 4.0]])
    models = [T @ np.array(m.A) @ np.linalg.inv(T) for m in network.node_table.models]
    other = networks.blend(models, network.node_table.positions, network.sample_time)
    assert proof_of(other, 2.0)[1] > 0.8 * proof_of(network, 2.0)[1]


@pytest.mark.parametrize("n", [1, 2, 5])
def test_vectors_of_symmetric_matrices_keep_scalar_products_and_congruences(n: int) -> None:
    random, triangle = np.random.default_rng(n), Triangle(n)
    P, Q = ((half + half.T) for half in random.standard_normal((2, n, n)))
    X, Y = random.standard_normal((2, n, n))
    p, q = (triangle.to_vector @ one.ravel() for one in (P, Q))
    assert p @ q == pytest.approx(np.trace(P @ Q), rel=tolerances.TRIANGLE)
    np.testing.assert_allclose(triangle.matrices(p), P, rtol=tolerances.TRIANGLE)
    product = X.T @ P @ Y
    found = triangle.matrices(triangle.congruence(X, Y) @ p)
    np.testing.assert_allclose(found, 0.5 * (product + product.T), atol=10.0 * tolerances.TRIANGLE)
    np.testing.assert_allclose(
        triangle.matrices(triangle.congruence(X, X) @ p), X.T @ P @ X, atol=10.0 * tolerances.TRIANGLE
    )


def test_equal_models_at_the_ends_do_not_hide_that_no_common_matrix_exists() -> None:
    """As clamped hats have them: the table goes on to the ends of the range with the outer models."""
    plain = networks.oscillators()
    assert plain.node_table is not None
    models = [np.array(m.A) for m in plain.node_table.models]
    clamped = networks.blend([models[0], *models, models[-1]], np.linspace(0.0, 3.0, 7).tolist(), 0.01)
    certificate = found_certificate(clamped, 1.0)
    assert certificate.method == "nodes" and certificate.exclusion is not None
    assert set(certificate.exclusion.nodes) <= set(range(6)) - {1}


def test_the_common_programme_answers_either_way() -> None:
    A = np.array([[0.9, 0.4], [-0.3, 0.7]])
    assert isinstance(common_solution(np.array([A, 0.9 * A]), 1.0), Solution)
    left = np.array([[0.0, 2.0], [0.0, 0.0]])
    found = common_solution(np.array([left, left.T]), 1.0)
    assert isinstance(found, Exclusion) and found.nodes == (0, 1)
    total = sum(A @ Z @ A.T - Z for A, Z in zip((left, left.T), found.Z, strict=True))
    assert (np.linalg.eigvalsh(total) > 0.0).all()
