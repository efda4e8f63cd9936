"""State-space forms of local ARX models, and the parameter set they make, on the kernel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import control
import numpy as np
import pytest
from arx_plants import (
    COEFFICIENTS,
    INPUTS,
    OUTPUT_POINT,
    SAMPLE_TIME,
    SETTINGS,
    data_set,
    drawn_inputs,
    known_network,
    run,
)

from fmu_builder.errors import IdentificationError
from fmu_builder.kernel import simulate, validities
from fmu_builder.llmn_fmu import interface
from fmu_builder.parameter_set import (
    DerivedOutput,
    DerivedTerm,
    LocalLinearModel,
    NamedParameter,
    ParameterSet,
    load,
)
from identification.lolimot import (
    LolimotSettings,
    Origin,
    StateSpaceForm,
    as_parameter_set,
    identify,
    lolimot_parameter_set,
    with_settings,
)
from identification.lolimot.regression import Orders
from identification.lolimot.state_space import local_systems
from tolerances import SAME_NETWORK, STATIC_GAIN, WEIGHT_SUM

FORMS: tuple[StateSpaceForm, ...] = ("regressors", "observer", "controller", "modal")
ORIGINS: tuple[Origin, ...] = ("common", "own")
U = drawn_inputs(21, 400)
TRAINING = data_set(U, run(U))


def parameter_set(
    form: StateSpaceForm = "regressors", origin: Origin = "common", blending: str = "parameter"
) -> ParameterSet:
    changes = {"form": form, "origin": origin, "blending": blending}
    network = with_settings(known_network(), SETTINGS.model_copy(update=changes))
    return as_parameter_set("known", network, [TRAINING])


def test_the_parameter_set_is_the_difference_equation() -> None:
    """Constants, clipped scheduling and all: the kernel against a plain loop over the coefficients."""
    u = drawn_inputs(22, 500)
    u[:4] = u[0]
    outputs = simulate(parameter_set(), u)[:, 0]
    rest = outputs[0] - OUTPUT_POINT
    expected = run(u, (rest, rest, rest))
    assert outputs == pytest.approx(expected, abs=SAME_NETWORK * np.abs(expected).max())


def test_the_parameter_set_is_the_free_run() -> None:
    u = drawn_inputs(23, 500)
    free = known_network().free_run(u)
    assert simulate(parameter_set(), u)[:, 0] == pytest.approx(free, abs=SAME_NETWORK * np.abs(free).max())


def test_the_kernel_knows_the_same_validities() -> None:
    eta = np.linspace(0.3, 2.7, 41)
    inputs = np.column_stack([eta, np.full(41, 900.0)])
    found = validities(parameter_set(), eta)
    assert found == pytest.approx(known_network().weights(inputs), abs=16 * WEIGHT_SUM)


def transfer(model: LocalLinearModel, z: complex) -> np.ndarray:
    """C (z I - A)^-1 B."""
    A, B, C = np.array(model.A), np.array(model.B), np.array(model.C)
    return np.asarray(C @ np.linalg.solve(z * np.eye(len(A)) - A, B))


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("form", FORMS)
def test_every_form_of_a_local_model_is_its_transfer_function(form: StateSpaceForm, origin: Origin) -> None:
    """Against python-control's transfer function, and with the same rest in every form."""
    for index, model in enumerate(parameter_set(form, origin).local_models):
        a, c = COEFFICIENTS[index][:3], COEFFICIENTS[index]
        for column, b in enumerate((c[3:5], c[5:7])):
            function = control.tf([*b, 0.0], [1.0, *(-value for value in a)], SAMPLE_TIME)
            for z in (1.0, np.exp(0.3j), np.exp(2.0j)):
                assert transfer(model, z)[0, column] == pytest.approx(function(z), rel=STATIC_GAIN)


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("form", FORMS)
def test_blended_outputs_do_not_depend_on_the_form(form: StateSpaceForm, origin: Origin) -> None:
    """Every local model runs alone then: states, and what deviations are counted from, must not matter."""
    u = drawn_inputs(24, 300)
    expected = simulate(parameter_set("regressors", "common", "output"), u)
    found = simulate(parameter_set(form, origin, "output"), u)
    assert found == pytest.approx(expected, abs=SAME_NETWORK * np.abs(expected).max())


@pytest.mark.parametrize("form", FORMS)
def test_one_local_model_is_the_same_in_every_form(form: StateSpaceForm) -> None:
    u = drawn_inputs(25, 300)
    network = identify([TRAINING], INPUTS, "y", SETTINGS.model_copy(update={"most_models": 1, "form": form}))
    found = simulate(as_parameter_set("one", network, [TRAINING]), u)[:, 0]
    free = network.free_run(u)
    assert found == pytest.approx(free, abs=SAME_NETWORK * np.abs(free).max())


def test_blended_parameters_depend_on_the_form() -> None:
    """Else the forms would not be worth a study."""
    u = drawn_inputs(26, 300)
    runs = {form: simulate(parameter_set(form), u)[:, 0] for form in FORMS}
    for form in FORMS[1:]:
        assert np.abs(runs[form] - runs["regressors"]).max() > 1e-6


def test_from_data_to_a_file_and_back(tmp_path: Path) -> None:
    force = DerivedOutput(
        name="F",
        unit="N",
        terms=(
            DerivedTerm(signal="y", parameter="k", sign=1),
            DerivedTerm(signal="eta", parameter="k", sign=-1),
        ),
        parameters={"k": NamedParameter(value=50.0, unit="N/m")},
    )
    built = lolimot_parameter_set("tree", [TRAINING], INPUTS, "y", SETTINGS, [force])
    again = load(built.save(tmp_path / "tree.json"))
    assert again == built
    assert built.kind == "lolimot"
    assert not built.declared_unstable
    assert [signal.unit for signal in (*built.inputs, *built.outputs)] == ["m", "N.m", "rad"]
    u = drawn_inputs(27, 50)
    y, F = simulate(again, u).T
    assert pytest.approx(50.0 * (y - u[:, 0])) == F
    assert "a tree of local ARX models" in interface(built).description
    (minimum, maximum), column = (built.outputs[0].minimum, built.outputs[0].maximum), TRAINING.column("y")
    assert (minimum, maximum) == (column.min(), column.max())


def test_the_same_data_give_the_same_bytes() -> None:
    first, second = (
        lolimot_parameter_set("tree", [TRAINING], INPUTS, "y", SETTINGS).canonical_json() for _ in range(2)
    )
    assert first == second


def test_an_unstable_local_model_is_declared() -> None:
    u = drawn_inputs(28, 60)
    y = [0.0]
    for k in range(1, 60):
        y.append(1.05 * y[-1] + u[k - 1, 0] + 1e-3 * u[k - 1, 1])
    settings = LolimotSettings(past_outputs=1, past_inputs=1, most_models=1)
    built = lolimot_parameter_set("wild", [data_set(u, np.array(y))], INPUTS, "y", settings)
    assert built.declared_unstable
    assert built.local_models[0].A[0][0] == pytest.approx(1.05)


def test_a_form_that_does_not_exist_is_refused() -> None:
    at_once = replace(known_network(), orders=Orders(3, 2, 2, 0))
    with pytest.raises(IdentificationError, match="act at once"):
        local_systems(at_once)
    more = SETTINGS.model_copy(update={"past_outputs": 1, "form": "modal"})
    with pytest.raises(IdentificationError, match="local model 1 has more past inputs than past outputs"):
        lolimot_parameter_set("more", [TRAINING], INPUTS, "y", more)
    twice = np.array(COEFFICIENTS)
    twice[1, :3] = (1.0, -0.25, 0.0)  # (z - 1/2)^2 z
    modal = SETTINGS.model_copy(update={"form": "modal"})
    with pytest.raises(IdentificationError, match="local model 2 has a multiple pole"):
        local_systems(replace(known_network(modal), parameters=twice))


def test_two_scheduling_inputs_make_a_tree_but_no_parameter_set() -> None:
    both = {"scheduling": {"eta": (0.5, 2.5), "M_pa": (700.0, 1100.0)}, "most_models": 3}
    network = identify([TRAINING], INPUTS, "y", SETTINGS.model_copy(update=both))
    assert network.cells.centres.shape == (3, 2)
    with pytest.raises(IdentificationError, match="one scheduling input"):
        as_parameter_set("both", network, [TRAINING])


def test_the_operating_point_lies_in_the_range_wherever_the_mean_of_the_data_lies() -> None:
    u = U.copy()
    u[:, 0] += 1.2
    built = lolimot_parameter_set("high", [data_set(u, run(u))], INPUTS, "y", SETTINGS)
    assert built.inputs[0].operating_point == 2.5 < u[:, 0].mean()
    point = [signal.operating_point for signal in built.inputs]
    rest = simulate(built, [point])[0, 0]
    assert built.outputs[0].operating_point == pytest.approx(rest, abs=SAME_NETWORK)


def test_a_model_about_its_own_centre_rests_there() -> None:
    """u0 is the cell's middle, where the local model alone is at rest with the output y0."""
    network = known_network()
    for index, model in enumerate(parameter_set("observer", "own").local_models):
        assert model.u0 == (network.cells.centres[index, 0], network.input_point[1])
        alone = replace(network, parameters=np.tile(network.parameters[index], (3, 1)))
        rest = alone.at_rest(np.array([model.u0]))
        assert model.y0 == pytest.approx(rest, abs=SAME_NETWORK)
        assert model.x0 == (0.0,) * 3
