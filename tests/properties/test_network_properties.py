"""What must hold for every network, whatever its numbers."""

from __future__ import annotations

from typing import Any

import networks
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

import tolerances
from fmu_builder.kernel import Network, simulate, static_outputs, validities
from fmu_builder.parameter_set import ParameterSet, nested

variants = st.sampled_from(networks.VARIANTS)
seeds = st.integers(0, 2**32 - 1)
quick = settings(max_examples=40, deadline=None)


def dumped(parameter_set: ParameterSet) -> dict[str, Any]:
    return parameter_set.model_dump()


def assert_same(found: networks.Array, expected: networks.Array) -> None:
    size = np.abs(expected).max(axis=0)
    assert (np.abs(found - expected).max(axis=0) <= tolerances.SAME_NETWORK * size).all()


@quick
@given(seeds, st.sampled_from(networks.VALIDITIES), st.floats(-1e6, 1e6))
def test_weights_sum_to_one_everywhere(seed: int, validity: str, position: float) -> None:
    parameter_set = networks.network(seed, validity=validity)
    assert abs(validities(parameter_set, [position]).sum() - 1.0) <= 10 * tolerances.WEIGHT_SUM


@quick
@given(seeds, st.floats(-3.0, 6.0))
def test_gaussian_weights_are_shares(seed: int, position: float) -> None:
    weights = validities(networks.network(seed), [position])
    assert (weights >= 0.0).all() and (weights <= 1.0 + tolerances.WEIGHT_SUM).all()


def test_narrow_gaussians_far_from_every_centre_still_share_the_weight() -> None:
    content = dumped(networks.network(1))
    content["partition"] |= {"spreads": (0.01, 0.02, 0.01, 0.015), "k_sigma": 0.1, "range": (-50.0, 50.0)}
    weights = validities(ParameterSet(**content), np.linspace(-60.0, 60.0, 101))
    assert np.isfinite(weights).all()
    assert np.abs(weights.sum(axis=1) - 1.0).max() <= tolerances.WEIGHT_SUM


def test_at_a_node_the_weights_are_those_of_the_table() -> None:
    parameter_set = networks.network(3, validity="hat")
    table = parameter_set.node_table
    assert table is not None
    np.testing.assert_array_equal(validities(parameter_set, table.positions), table.weights)


@quick
@given(variants, seeds, st.floats(networks.LOW - 1.0, networks.HIGH + 1.0), st.booleans())
def test_constant_inputs_leave_the_network_at_rest(
    variant: tuple[str, str, str], seed: int, height: float, feedthrough: bool
) -> None:
    parameter_set = networks.network(seed, *variant, feedthrough)
    row = np.array([1.1, height, 1.9])
    network = Network(parameter_set)
    network.start(row)
    before, outputs = network.states.copy(), network.outputs(row)
    for _ in range(50):
        network.tick(row)
    scale = np.abs(before).max() + np.abs(outputs[:3]).max() + 1.0
    assert np.abs(network.states - before).max() <= tolerances.STAYS_AT_REST * scale
    assert np.abs(network.outputs(row) - outputs)[:3].max() <= tolerances.STAYS_AT_REST * scale


@quick
@given(st.sampled_from(networks.OFFSETS), seeds, st.booleans())
def test_with_one_local_model_both_blendings_are_the_same(offsets: str, seed: int, feedthrough: bool) -> None:
    inputs = networks.inputs_of(seed, 60, 3)
    output, parameter = (
        simulate(networks.network(seed, offsets, blending, "gaussian", feedthrough, 3, 1), inputs)
        for blending in ("output", "parameter")
    )
    assert_same(parameter, output)


@quick
@given(variants, seeds)
def test_blending_identical_models_changes_nothing(variant: tuple[str, str, str], seed: int) -> None:
    content = dumped(networks.network(seed, *variant))
    model = content["local_models"][0]
    content["local_models"] = [model] * 4
    if content["node_table"] is not None and content["node_table"]["models"]:
        content["node_table"]["models"] = [model] * len(content["node_table"]["models"])
    alone = {**content, "local_models": [model], "blending": "output", "node_table": None}
    alone["partition"] = {
        **content["partition"], "validity": "gaussian", "centres": [1.0], "spreads": [1.0], "k_sigma": 1.0,
    }  # fmt: skip
    inputs = networks.inputs_of(seed, 60, 3)
    assert_same(simulate(ParameterSet(**content), inputs), simulate(ParameterSet(**alone), inputs))


def transformed(model: dict[str, Any], T: networks.Array) -> dict[str, Any]:
    """The same model in the state coordinates T x."""
    inverse = np.linalg.inv(T)
    moved = {"A": T @ model["A"] @ inverse, "B": T @ model["B"], "C": model["C"] @ inverse}
    moved |= {name: T @ model[name] for name in ("g", "x0") if model[name] is not None}
    return {**model, **{name: nested(array) for name, array in moved.items()}}


@quick
@given(variants, seeds)
def test_other_state_coordinates_change_nothing(variant: tuple[str, str, str], seed: int) -> None:
    """One transformation for all models; with output blending one for each, since each has its own state."""
    content = dumped(networks.network(seed, *variant))
    inputs = networks.inputs_of(seed, 60, 3)
    expected = simulate(ParameterSet(**content), inputs)
    random = np.random.default_rng(seed)
    size, own = networks.STATES, variant[1] == "output"
    bases = [np.eye(size) + 0.3 * random.uniform(-1.0, 1.0, (size, size)) for _ in range(4)]
    pick = [bases[i] if own else bases[0] for i in range(4)]
    content["local_models"] = [transformed(m, T) for m, T in zip(content["local_models"], pick, strict=True)]
    if content["node_table"] is not None:
        nodes = content["node_table"]["models"]
        content["node_table"]["models"] = [transformed(node, bases[0]) for node in nodes]
    assert_same(simulate(ParameterSet(**content), inputs), expected)


@quick
@given(variants, seeds, st.integers(1, 18))
def test_a_row_shows_its_inputs_only_in_derived_outputs(
    variant: tuple[str, str, str], seed: int, changed: int
) -> None:
    """The row rule: outputs of row k come from the inputs up to row k - 1; a force like F_p uses row k."""
    parameter_set = networks.network(seed, *variant, feedthrough=False)
    inputs = networks.inputs_of(seed, 20, 3)
    before = simulate(parameter_set, inputs)
    inputs[changed] += 0.1
    after = simulate(parameter_set, inputs)
    np.testing.assert_array_equal(after[:changed], before[:changed])
    np.testing.assert_array_equal(after[changed, [0, 1, 2, 4]], before[changed, [0, 1, 2, 4]])
    assert after[changed, 3] == pytest.approx(before[changed, 3] - 5000.0, rel=1e-6, abs=1e-4)
    assert (after[changed + 1, :3] != before[changed + 1, :3]).all()


@quick
@given(variants, seeds)
def test_row_zero_is_the_steady_state_of_its_inputs(variant: tuple[str, str, str], seed: int) -> None:
    parameter_set = networks.network(seed, *variant)
    inputs = networks.inputs_of(seed, 5, 3)
    network = Network(parameter_set)
    network.start(inputs[0])
    np.testing.assert_array_equal(simulate(parameter_set, inputs)[0], network.outputs(inputs[0]))


def test_reading_outputs_leaves_no_trace() -> None:
    network = Network(networks.network(2))
    network.start(np.array([1.0, 1.5, 2.0]))
    before = network.state.copy()
    network.outputs(np.array([9.0, 9.0, 9.0]))
    np.testing.assert_array_equal(network.state, before)


@pytest.mark.parametrize("validity", networks.VALIDITIES)
@pytest.mark.parametrize("beyond", [0.3, -0.4])
def test_beyond_the_range_weights_stay_and_the_static_map_goes_on(validity: str, beyond: float) -> None:
    parameter_set = networks.network(4, validity=validity)
    end = networks.HIGH if beyond > 0 else networks.LOW
    at_end, outside = validities(parameter_set, [end, end + beyond])
    np.testing.assert_array_equal(outside, at_end)
    inside, at, out = static_outputs(parameter_set, [end - 0.1 * beyond, end, end + beyond])
    np.testing.assert_allclose(out - at, 10.0 * (at - inside), rtol=1e-9)
    assert np.abs(out - at).min() > 0.0


def lti(seed: int, offsets: str, blending: str) -> dict[str, Any]:
    """One local model; for a scheduled equilibrium with the static map that its own steady states make."""
    content = dumped(networks.network(seed, offsets, blending, feedthrough=False, models=1))
    if offsets == "scheduled_equilibrium":
        model = content["local_models"][0]
        operating_point = content["inputs"][1]["operating_point"]
        rest = np.array([output["operating_point"] for output in content["outputs"]])
        gain = np.array(model["C"]) @ np.array(model["g"])
        positions = np.array([0.0, 1.0, 3.0])
        values = rest + np.outer(positions - operating_point, gain)
        content["offsets"]["static_map"] = {"positions": nested(positions), "values": nested(values)}
    return content


@pytest.mark.parametrize("blending", ["output", "parameter"])
@pytest.mark.parametrize("offsets", ["none", "scheduled_equilibrium"])
def test_one_local_model_is_the_linear_system_scipy_simulates(offsets: str, blending: str) -> None:
    """A scheduled equilibrium is exact for a linear system, rebasing and all."""
    content = lti(6, offsets, blending)
    model = content["local_models"][0]
    u_op = np.array([signal_["operating_point"] for signal_ in content["inputs"]])
    y_op = np.array([signal_["operating_point"] for signal_ in content["outputs"]])
    inputs = networks.inputs_of(6, 150, 3)
    A, B = np.array(model["A"]), np.array(model["B"])
    start = np.linalg.solve(np.eye(len(A)) - A, B @ (inputs[0] - u_op))
    system = (A, B, np.array(model["C"]), np.zeros((3, 3)), 1e-3)
    _, expected, _ = signal.dlsim(system, inputs - u_op, x0=start)
    assert_same(simulate(ParameterSet(**content), inputs)[:, :3], expected + y_op)


def test_the_low_pass_answers_a_step_like_a_first_order_lag() -> None:
    content = dumped(networks.network(8, "low_pass", "output", feedthrough=False))
    for model in content["local_models"]:
        model["C"] = np.zeros((3, 5))
    content["offsets"]["static_map"] = {
        "positions": (0.0, 1.0),
        "values": ((0.0, 0.0, 0.0), (1.0, 2.0, -1.0)),
    }
    inputs = np.tile([1.0, 2.0, 1.0], (400, 1))
    inputs[0, 1] = 1.0
    rows = np.arange(400)
    time = 1e-3 * np.maximum(rows - 1, 0)
    expected = 1.0 + (1.0 - np.exp(-2.0 * np.pi * 0.25 * time))
    found = simulate(ParameterSet(**content), inputs)[:, :3]
    np.testing.assert_allclose(found, np.outer(expected, [1.0, 2.0, -1.0]), rtol=1e-12)


def test_affine_offsets_of_a_shifted_model_only_shift_the_outputs() -> None:
    """With x0 = 0, u0 = u_op, y0 = y_op the affine form is the deviation form (thesis eq. 3.33-3.34)."""
    plain = dumped(networks.network(9, "none", "parameter"))
    affine = {**plain, "offsets": {"kind": "affine"}}
    u_op = tuple(signal_["operating_point"] for signal_ in plain["inputs"])
    y_op = tuple(signal_["operating_point"] for signal_ in plain["outputs"])
    extra = {"x0": (0.0,) * networks.STATES, "u0": u_op, "y0": y_op}
    affine["local_models"] = [{**model, **extra} for model in plain["local_models"]]
    inputs = networks.inputs_of(9, 60, 3)
    assert_same(simulate(ParameterSet(**affine), inputs), simulate(ParameterSet(**plain), inputs))
