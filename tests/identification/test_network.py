from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np
import pytest
from linear_plants import (
    CONTACT_STIFFNESS,
    THREE_MASS_OUTPUTS,
    THREE_MASS_UNITS,
    asymmetric,
    contact_force,
    recorded,
    rest_state,
    three_mass,
    three_mass_data,
)
from pydantic import ValidationError
from scipy.linalg import expm

from fmu_builder.errors import DataError, IdentificationError, ParameterSetError
from fmu_builder.kernel.native import simulate
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification.excitation import ExcitationSettings, random_stream, whole_range_inputs
from identification.linear import discretised, linear_parameter_set
from identification.local_model import LocalModel
from identification.n4sid import LocalModels, N4sidSettings, identify, network
from identification.network import RECOMMENDED, THESIS, NetworkSettings, equilibrium_shift
from identification.scores import fit_percent
from identification.static_map import StaticMap
from tolerances import BITS, EQUILIBRIUM_NETWORK, NOISE_FREE_FIT, ZERO_ORDER_HOLD

HEIGHTS = (0.75, 1.25, 1.75, 2.25)
FORCE = DerivedOutput(
    name="F_p",
    unit="N",
    terms=(
        DerivedTerm(signal="xi", parameter="k_E", sign=1),
        DerivedTerm(signal="eta", parameter="k_E", sign=-1),
    ),
    parameters={"k_E": NamedParameter(value=CONTACT_STIFFNESS, unit="N/m")},
)
WHOLE_RANGE = recorded(
    three_mass(),
    whole_range_inputs(7, (1,), 20.0, settings=ExcitationSettings(noise_rms=0.0024)),
    THREE_MASS_UNITS,
)


def exact_map(plant: LocalModel, count: int = 5) -> StaticMap:
    positions = np.linspace(0.5, 2.5, count)
    values = plant.output_operating_point + np.outer(positions - 1.5, plant.dc_gain[:, 0])
    return StaticMap(positions, values, plant.outputs)


def local_plants(random_coordinates: bool) -> LocalModels:
    """The three-mass plant four times, each about its own height; every field as identification leaves it."""
    plant = three_mass()
    base = identify([three_mass_data(3, height, 3.0) for height in HEIGHTS])
    models = []
    for index, height in enumerate(HEIGHTS):
        u = np.array([height, 1310.9])
        y = plant.output_operating_point + plant.dc_gain @ (u - plant.input_operating_point)
        model = replace(plant, input_operating_point=u, output_operating_point=y)
        T = np.linalg.qr(random_stream(index).standard_normal((6, 6)))[0]  # other coordinates, same rounding
        models.append(model.transformed(T) if random_coordinates else model)
    return replace(base, models=tuple(models), static_map=exact_map(plant))


def settings_of(**changes: Any) -> NetworkSettings:
    return RECOMMENDED.model_copy(update=changes)


def worst(parameter_set: ParameterSet) -> float:
    """Largest error relative to the largest deviation of that output from a straight line in eta."""
    reference = WHOLE_RANGE.matrix(THREE_MASS_OUTPUTS)
    found = simulate(parameter_set, WHOLE_RANGE.matrix(("eta", "M_pa")))[:, :4]
    eta = WHOLE_RANGE.column("eta")[:, None]
    size = np.abs(reference - [[1, 0, 1, 0]] * eta).max(axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        return float((np.abs(found - reference) / size).max())


@pytest.mark.parametrize("validity", ["gaussian", "hat", "hat_clamped"])
@pytest.mark.parametrize("offsets", ["scheduled_equilibrium", "affine"])
@pytest.mark.parametrize("blending", ["output", "parameter"])
def test_a_network_of_one_plant_is_that_plant(validity: str, offsets: str, blending: str) -> None:
    local = local_plants(random_coordinates=blending == "output")
    chosen = settings_of(validity=validity, offsets=offsets, blending=blending)
    assert worst(network("same", local, chosen)) < EQUILIBRIUM_NETWORK


def test_raw_coordinates_cannot_be_blended() -> None:
    assert not worst(network("raw", local_plants(True), RECOMMENDED)) < 0.1


def test_low_pass_is_right_at_rest_and_follows_slowly() -> None:
    local = local_plants(False)
    plant = three_mass()
    parameter_set = network("thesis", local, THESIS, [FORCE])
    assert parameter_set.offsets.corner_frequency == 0.25
    inputs = np.tile([1.1, 1310.9], (12_000, 1))
    inputs[1000:, 0] = 1.13
    found = simulate(parameter_set, inputs)
    expected = plant.simulate(inputs, rest_state(plant, inputs[0]))
    assert np.allclose(found[0, :4], expected[0], atol=1e-9)
    assert np.allclose(found[-1, :4], expected[-1], atol=1e-5)
    assert 1e-4 < np.abs(found[1000:3000, 0] - expected[1000:3000, 0]).max() < 0.03


def test_identified_network_recovers_the_plant_whole_path() -> None:
    """The whole path on a plant with known equations: data, identification, kernel; F_p FIT >= 99.9."""
    data = [three_mass_data(11, height, 6.0) for height in HEIGHTS]
    local = identify(data)
    for settings in (RECOMMENDED, settings_of(blending="output")):
        found = simulate(network("found", local, settings, [FORCE]), WHOLE_RANGE.matrix(("eta", "M_pa")))
        reference = WHOLE_RANGE.matrix(THREE_MASS_OUTPUTS)
        force = contact_force(reference, WHOLE_RANGE.column("eta"))
        assert fit_percent(force, found[:, 4]) > 100.0 - 100 * NOISE_FREE_FIT
        assert min(map(fit_percent, reference.T, found[:, :4].T)) > 100.0 - 100 * NOISE_FREE_FIT
    thesis = simulate(network("thesis", local, THESIS, [FORCE]), WHOLE_RANGE.matrix(("eta", "M_pa")))
    assert 50.0 < fit_percent(force, thesis[:, 4]) < 99.9


def test_order_of_experiments_changes_no_bit() -> None:
    data = [three_mass_data(11, height, 3.0) for height in HEIGHTS]
    one = network("net", identify(data), RECOMMENDED)
    other = network("net", identify([data[k] for k in (2, 0, 3, 1)]), RECOMMENDED)
    assert one.canonical_json() == other.canonical_json()


def test_signals_carry_units_limits_and_operating_point() -> None:
    data = [three_mass_data(11, height, 3.0) for height in HEIGHTS]
    found = network("net", identify(data, descriptions={"eta": "height"}), RECOMMENDED)
    eta, torque = found.inputs
    assert (eta.name, eta.unit, eta.operating_point, eta.description) == ("eta", "m", 1.5, "height")
    assert eta.minimum == min(one.column("eta").min() for one in data)
    assert torque.maximum == max(one.column("M_pa").max() for one in data)
    assert [signal.unit for signal in found.outputs] == list(THREE_MASS_UNITS)
    assert found.outputs[2].operating_point == pytest.approx(1.53, abs=1e-6)
    provenance: Any = found.provenance
    hashes = [one["content_hash"] for one in provenance["training"]]
    assert hashes == [one.content_hash for one in data]
    assert found.partition.centres == HEIGHTS


def test_node_table_is_the_weighted_sum_of_the_models() -> None:
    local = local_plants(True)
    found = network("net", local, RECOMMENDED)
    table = found.node_table
    assert table is not None and table.positions == (0.5, *HEIGHTS, 2.5)
    assert table.models[1] == found.local_models[0]
    low, first, second = table.models[0], found.local_models[0], found.local_models[1]
    for field in ("A", "B", "C", "D", "g"):
        expected = 1.5 * np.array(getattr(first, field)) - 0.5 * np.array(getattr(second, field))
        assert np.allclose(getattr(low, field), expected, rtol=1e-14, atol=1e-14)
    g = np.array(first.g)
    model = local.models[0]
    assert np.allclose(model.A @ g + model.B[:, 0], g, atol=1e-9)
    assert np.array_equal(g, equilibrium_shift(model, "eta"))
    output = network("net", local, settings_of(blending="output")).node_table
    assert output is not None and output.models == () and output.weights == table.weights
    assert network("net", local, THESIS).node_table is None
    assert network("net", local, settings_of(offsets="affine")).local_models[2].u0 == (1.75, 1310.9)


def test_identification_refuses_everything_at_once() -> None:
    data = [three_mass_data(11, height, 2.0) for height in (0.75, 1.25, 2.04)]
    with pytest.raises(IdentificationError) as error:
        identify(data)
    text = str(error.value)
    assert (
        "lies at eta = 2.04, the nearest centre is 2.25" in text and "eta = 1.75: has no experiment" in text
    )
    short = [three_mass_data(11, height, 0.1) for height in HEIGHTS]
    with pytest.raises(IdentificationError) as error:
        identify(short)
    assert len(error.value.problems) == 4 and "local model at eta = 0.75" in str(error.value)
    with pytest.raises(DataError, match="xi_dot"):
        identify([one.select(("eta", "M_pa", "xi", "zeta", "zeta_dot")) for one in short])
    mixed = [short[0], replace(short[1], units=("mm", *short[1].units[1:])), replace(short[2], sample_time=1)]
    with pytest.raises(DataError) as mixture:  # no local model knows of the others
        identify(mixed)
    assert [problem.what for problem in mixture.value.problems] == [
        "has 'eta' in 'mm', the others in 'm'",
        "has the sample time 1 s, not 0.001 s like the others",
    ]
    with pytest.raises(ValidationError, match="finite"):
        N4sidSettings(centres=(0.75, float("nan")))
    wrong = N4sidSettings(scheduling="height", low=2.0, high=1.0, operating_point={"eta": 1.5, "etta": 1.0})
    with pytest.raises(IdentificationError) as error:
        identify(data, wrong)
    assert [one.place for one in error.value.problems] == [
        "n4sid.operating_point.etta",
        "scheduling",
        "range",
    ]
    with pytest.raises(ParameterSetError, match="name"):
        network("not a name", local_plants(False), RECOMMENDED)


def test_another_plant_with_other_names() -> None:
    """Three inputs, two outputs, the second input schedules: nothing in the room knows a pantograph."""
    plant = asymmetric()
    random = random_stream(4)
    data = []
    for centre in (-6.0, 2.0):
        values = [0.5, centre, 30.0] + random.standard_normal((3000, 3)) * [0.1, 0.5, 2.0]
        base = three_mass_data(1, duration=3.0)
        inputs = replace(base, names=plant.inputs, units=("N", "m", "K"), sample_time=0.004, values=values)
        data.append(recorded(plant, inputs, ("rad", "rad/s")))
    settings = N4sidSettings(
        inputs=plant.inputs,
        outputs=plant.outputs,
        scheduling="load",
        low=-10.0,
        high=6.0,
        local_models=2,
        operating_point={"drive": 0.5, "load": -2.0, "heat": 30.0},
        subspace={"order": 5, "block_rows": 20},
    )
    parameter_set = network("other", identify(data, settings), RECOMMENDED)
    rows = np.array([0.5, -9.0, 30.0]) + np.linspace(0, 1, 2000)[:, None] * [0.2, 14.0, -3.0]
    rows = rows + random.standard_normal((2000, 3)) * [0.05, 0.1, 1.0]
    expected = plant.simulate(rows, rest_state(plant, rows[0]))
    found = simulate(parameter_set, rows)
    assert np.abs(found - expected).max() < 1e-6 * np.abs(expected - expected.mean(axis=0)).max()


def test_linear_baseline() -> None:
    A = np.array([[0.0, 1.0], [-400.0, -1.2]])
    B = np.array([[0.0, 0.0], [400.0, 0.1]])
    C, D = np.array([[1.0, 0.0], [0.0, 1.0], [-2.0, 0.5]]), np.array([[0.0, 0.0], [0.0, 0.0], [3.0, -0.25]])
    rest = np.array([1.2, 1300.0]), np.array([7.0, 0.0, -4.0])
    model = discretised((A, B, C, D), 0.005, ("eta", "M_pa"), ("a", "b", "c"), *rest)
    both = expm(np.block([[A, B], [np.zeros((2, 4))]]) * 0.005)
    assert np.allclose(model.A, both[:2, :2], rtol=0, atol=ZERO_ORDER_HOLD)
    assert np.allclose(model.B, both[:2, 2:], rtol=0, atol=ZERO_ORDER_HOLD)
    base = identify([three_mass_data(3, height, 3.0) for height in HEIGHTS])
    outputs = tuple(base.signals[1][k].model_copy(update={"name": name}) for k, name in enumerate("abc"))
    found = linear_parameter_set("baseline", model, "eta", (0.5, 2.5), (base.signals[0], outputs))
    assert (found.kind, found.offsets.kind, found.partition.centres) == ("linear", "affine", (1.2,))
    inputs = rest[0] + random_stream(2).standard_normal((500, 2)) * [0.3, 20.0]
    expected = model.simulate(inputs, rest_state(model, inputs[0]))
    assert np.abs(simulate(found, inputs) - expected).max() < 1e-9
    step = control.forced_response(
        control.ss(A, B, C, D), U=np.tile([[0.0], [1.0]], 101), T=0.005 * np.arange(101)
    )
    kept = simulate(found, np.array([[1.2, 1300.0]] + [[1.2, 1301.0]] * 100))
    assert np.abs(kept[0] - rest[1]).max() == pytest.approx(BITS, abs=1e-12)
    assert np.abs(kept[1:, 0] - 7.0 - step.outputs[0, :100]).max() < 1e-9


def test_linearisation_that_cannot_be_discretised() -> None:
    good = np.eye(2)
    for matrices in ((good, good, good, np.zeros((3, 2))), (good * np.nan, good, good, good)):
        with pytest.raises(IdentificationError, match="linearisation"):
            discretised(matrices, 0.01, ("a", "b"), ("c", "d"), np.zeros(2), np.zeros(2))
