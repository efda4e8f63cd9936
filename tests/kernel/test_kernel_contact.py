"""Unilateral contact of a network: what acts, the same bits in C and specification, the right motion."""

from __future__ import annotations

import json

import networks
import numpy as np
import pytest
from contact_networks import linearised, touching
from hypothesis import given, settings
from hypothesis import strategies as st
from theta_networks import inputs_of, theta_network

import tolerances
from fmu_builder.errors import ParameterSetError
from fmu_builder.kernel import contact_of, simulate, specification
from fmu_builder.parameter_set import ParameterSet
from fmus.wbm import native, parameter_sets

POINT = (1.5, 1310.9)


def test_the_contact_is_found_by_what_the_signals_are() -> None:
    found = contact_of(theta_network())
    assert found is not None
    assert (found.output, found.rate, found.half_tick) == (0, 1, 0.0005)
    base = networks.network(5, feedthrough=False)
    assert contact_of(base) is None  # no velocity of y_2
    renamed = contact_of(touching(("none", "parameter", "hat"), 5))
    assert renamed is not None
    assert (renamed.output, renamed.rate) == (2, 0)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ('"sign": -1, "signal": "u_1"', '"sign": 1, "signal": "u_1"'),
        ('"sign": -1, "signal": "u_1"', '"sign": -1, "signal": "u_0"'),
        ('"scheduling": "u_1"', '"scheduling": "u_0"'),
        ('"sign": 1, "signal": "y_2"', '"sign": 1, "signal": "u_2"'),
        ('"parameter": "stiffness", "sign": -1', '"parameter": "other", "sign": -1'),
    ],
)
def test_what_is_no_spring_on_the_wire_is_no_contact(right: str, wrong: str) -> None:
    content = json.loads(touching(("none", "parameter", "hat"), 5).canonical_json())
    content["derived_outputs"][0]["parameters"]["other"] = {"value": 40000.0, "unit": "N/m"}
    text = json.dumps(content)
    assert contact_of(ParameterSet.model_validate_json(text)) is not None
    assert text.count(right) == 1
    assert contact_of(ParameterSet.model_validate_json(text.replace(right, wrong))) is None


def test_a_pan_head_on_which_inputs_act_at_once_has_no_contact() -> None:
    text = networks.network(5, feedthrough=True).canonical_json().replace('"y_0"', '"y_2_dot"')
    assert contact_of(ParameterSet.model_validate_json(text)) is None


@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_specification_and_kernel_agree_to_the_last_bit(variant: tuple[str, str, str]) -> None:
    compared = 0
    for seed in range(100):
        if compared == 2:
            break
        parameter_set, inputs = touching(variant, seed), networks.inputs_of(seed, 60, 3)
        contact = contact_of(parameter_set)
        try:
            expected = np.array(specification.simulate(parameter_set, inputs.tolist(), unilateral=True))
        except ParameterSetError:
            with pytest.raises(ParameterSetError, match="not on the wire in the steady state"):
                simulate(parameter_set, inputs, contact)
            continue
        found = simulate(parameter_set, inputs, contact)
        assert found.tobytes() == expected.tobytes()
        force = found[:, networks.OUTPUTS]
        assert force.min() >= 0.0
        compared += bool((force == 0.0).any()) and bool((found != simulate(parameter_set, inputs)).any())
    assert compared == 2


def test_without_loss_of_contact_not_a_bit_changes() -> None:
    parameter_set, inputs = theta_network(), inputs_of(400)
    inputs[:, 0] = 1.5 + 1e-5 * np.sin(np.arange(400) * 0.3)
    inputs[:, 1] = 1310.9
    expected = simulate(parameter_set, inputs)
    assert expected[:, -1].min() > 0.0
    assert simulate(parameter_set, inputs, contact_of(parameter_set)).tobytes() == expected.tobytes()


@settings(max_examples=60, deadline=None)
@given(
    moves=st.lists(
        st.tuples(st.floats(-0.05, 0.05), st.floats(1200.0, 1500.0), st.integers(1, 60)),
        min_size=1,
        max_size=8,
    )
)
def test_force_is_never_negative(moves: list[tuple[float, float, int]]) -> None:
    rows = [(1.5 + rise, torque) for rise, torque, count in moves for _ in range(count)]
    parameter_set = theta_network()
    inputs = np.array([POINT, *rows])
    found = simulate(parameter_set, inputs, contact_of(parameter_set))
    assert found[:, -1].min() >= 0.0
    off = inputs[:, 0] > found[:, 0]
    assert (found[off, -1] == 0.0).all()


@pytest.mark.parametrize("name", ["A", "Blow"])
@pytest.mark.parametrize("rise", [0.02, -0.02])
def test_jumps_of_the_wire_are_those_of_the_white_box_model(name: str, rise: float) -> None:
    """A linearisation against the nonlinear model, whose bounces have an integrator of order four."""
    parameters = parameter_sets()[name]
    network = linearised(parameters, POINT)
    inputs = np.array([POINT, *[(POINT[0] + rise, POINT[1])] * 300])
    found = simulate(network, inputs, contact_of(network))
    expected = native.simulate(parameters.changed(unilateral=1.0), inputs)
    xi, force = (expected[:, native.OUTPUTS.index(one)] for one in ("xi", "F_p"))
    assert 0.5 < (force == 0.0).mean() < 1.0
    gap = np.abs(found[:, 0] - xi).max()
    assert gap <= tolerances.LIFTED_NETWORK * np.ptp(xi), gap / np.ptp(xi)
    touched = [int(np.argmax(one[2:] > 0.0)) for one in (found[:, -1], force)]
    assert abs(touched[0] - touched[1]) <= 1
