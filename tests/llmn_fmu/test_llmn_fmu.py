"""The FMU of a network: the kernel's bits through fmpy, its variables, what lies inside."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import fmpy
import networks
import numpy as np
import pytest
from certified_networks import blend
from fmpy.validation import validate_fmu
from fmu_runner import opened, run_fmu

import tolerances
from fmu_builder.compiler import host_platform
from fmu_builder.errors import BuildError
from fmu_builder.kernel import Network, simulate, validities
from fmu_builder.llmn_fmu import build_llmn, interface, model_card
from fmu_builder.parameter_set import ParameterSet, load

VARIANTS = [variant for variant in networks.VARIANTS if variant[1] != "theta"]


def built(parameter_set: ParameterSet, folder: Path, **options: str) -> Path:
    return build_llmn(parameter_set, folder / "network.fmu", (host_platform(),), **options)


@pytest.mark.parametrize("variant", VARIANTS, ids="-".join)
def test_the_fmu_has_the_bits_of_the_kernel(variant: tuple[str, str, str], tmp_path: Path) -> None:
    parameter_set = networks.network(41, *variant, feedthrough=variant[2] == "hat")
    inputs = networks.inputs_of(41, 150, 3)
    found = run_fmu(
        built(parameter_set, tmp_path), inputs, parameter_set.output_names, parameter_set.sample_time
    )
    expected = simulate(parameter_set, inputs)
    assert found.shape == expected.shape
    assert np.abs(found - expected).max() == tolerances.BITS


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(networks.network(43, feedthrough=True), tmp_path_factory.mktemp("fmu"))


def test_fmpy_finds_nothing_wrong(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []


def test_validities_and_in_range_follow_the_inputs_of_the_last_tick(fmu: Path) -> None:
    parameter_set = networks.network(43, feedthrough=True)
    inputs = networks.inputs_of(43, 80, 3)
    names = [f"validity_{i}" for i in range(1, 5)]
    found = run_fmu(fmu, inputs, names, parameter_set.sample_time)
    expected = validities(parameter_set, inputs[np.maximum(np.arange(80) - 1, 0), 1])
    np.testing.assert_array_equal(found, expected)
    inside = run_fmu(fmu, inputs, ["in_range"], parameter_set.sample_time)[:, 0]
    heights = inputs[np.maximum(np.arange(80) - 1, 0), 1]
    np.testing.assert_array_equal(inside, (heights >= networks.LOW) & (heights <= networks.HIGH))
    assert 0 < inside.sum() < 80


def test_directional_derivatives_are_those_of_the_kernel(fmu: Path) -> None:
    parameter_set = networks.network(43, feedthrough=True)
    inputs = networks.inputs_of(44, 3, 3)
    kernel = Network(parameter_set)
    kernel.start(inputs[0])
    with opened(fmu, inputs[0]) as (slave, references):
        for k, row in enumerate(inputs[:2]):
            slave.setReal([0, 1, 2], row.tolist())
            kernel.tick(row)
            slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
        expected = kernel.feedthrough()
        for row, name in enumerate(parameter_set.output_names):
            for column in range(3):
                found = slave.getDirectionalDerivative([references[name]], [column], [1.0])
                assert found == [expected[row, column]]
    step = 0.25
    for column in range(3):
        moved = inputs[2] + step * np.eye(3)[column]
        slope = (kernel.outputs(moved) - kernel.outputs(inputs[2])) / step
        np.testing.assert_allclose(expected[:, column], slope, rtol=1e-9, atol=1e-6)


def test_in_initialisation_derivatives_are_those_of_the_steady_state(fmu: Path) -> None:
    parameter_set = networks.network(43, feedthrough=True)
    row = networks.inputs_of(44, 3, 3)[2]
    kernel = Network(parameter_set)
    kernel.start(row)
    expected = kernel.steady_gain(row)
    names = (*parameter_set.output_names, *(f"validity_{number}" for number in range(1, 5)))
    assert np.abs(expected).max(axis=1).all()
    with opened(fmu, row, ready=False) as (slave, references):
        unknowns = [references[name] for name in names]
        found = [slave.getDirectionalDerivative(unknowns, [column], [1.0]) for column in range(3)]
    np.testing.assert_array_equal(np.array(found).T, expected)


def test_the_description_says_what_acts_at_once() -> None:
    by_name = {v.name: v for v in interface(networks.network(43, feedthrough=False)).variables}
    assert by_name["y_0"].dependencies == ()
    assert by_name["force"].dependencies == ("u_1",)
    by_name = {v.name: v for v in interface(networks.network(43, feedthrough=True)).variables}
    assert by_name["y_0"].dependencies == ("u_0", "u_2")
    assert by_name["force"].dependencies == ("u_0", "u_1", "u_2")


def test_variables_stand_in_order_with_start_limits_and_units(fmu: Path) -> None:
    description = fmpy.read_model_description(str(fmu))
    names = [variable.name for variable in description.modelVariables]
    expected = ["u_0", "u_1", "u_2", "y_0", "y_1", "y_2", "force", "sum"]
    constants = ["stiffness", "one", "two"]
    assert names == [
        *expected,
        *(f"validity_{i}" for i in range(1, 5)),
        "in_range",
        "out_of_range",
        *constants,
    ]
    last = description.modelVariables[-1]
    assert (last.causality, last.variability, last.initial, last.start) == (
        "local",
        "constant",
        "exact",
        "2.5",
    )
    first = description.modelVariables[0]
    assert (first.start, first.min, first.max, first.unit) == ("1.3", "-2.0", "4.0", "m")
    assert description.coSimulation.modelIdentifier == "random_network"
    assert float(description.defaultExperiment.stepSize) == 1e-3


def test_the_parameter_set_and_the_model_card_are_inside(fmu: Path, tmp_path: Path) -> None:
    parameter_set = networks.network(43, feedthrough=True)
    with zipfile.ZipFile(fmu) as archive:
        (tmp_path / "set.json").write_bytes(archive.read("resources/parameter_set.json"))
        card = archive.read("documentation/index.html").decode("utf-8")
    assert load(tmp_path / "set.json") == parameter_set
    assert parameter_set.model_hash() in card
    assert "in model exchange there is a time event at every tick" in card
    assert "force = stiffness y_2 - stiffness u_1, stiffness = 50000 N/m." in card


def test_the_model_card_shows_scores_and_escapes_text() -> None:
    scores = [
        {"signal": "y_0", "split": "test", "data_set": "<whole range>", "fit": 98.76, "max_error": None}
    ]
    parameter_set = networks.network(43).replaced(scores=scores, documentation="5 < 6")
    card = model_card(parameter_set, interface(parameter_set))
    assert "<td>y_0</td><td>test</td><td>&lt;whole range&gt;</td><td>98.76</td><td></td>" in card
    assert "<p>5 &lt; 6</p>" in card
    assert "Scores" not in model_card(networks.network(43), interface(networks.network(43)))


def test_the_model_card_tells_what_was_chosen_automatically() -> None:
    choices = [{"name": "network.warp", "value": [0.5, -0.25], "reason": "less error", "place": "a < b"}]
    parameter_set = networks.network(43).replaced(provenance={"choices": choices, "seed": 5})
    card = model_card(parameter_set, interface(parameter_set))
    assert "<td>network.warp</td><td>[0.5, -0.25]</td><td>a &lt; b</td><td>less error</td>" in card
    assert "<td>seed</td>" in card and "<td>choices</td>" not in card
    foreign = parameter_set.replaced(provenance={"choices": "all by hand"})
    assert "<td>choices</td><td>all by hand</td>" in model_card(foreign, interface(foreign))


def test_the_same_parameter_set_gives_the_same_bytes(
    fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fmu_builder.compiler.kept", lambda *_: None)  # compiled anew
    assert built(networks.network(43, feedthrough=True), tmp_path).read_bytes() == fmu.read_bytes()


def test_a_parameter_set_gives_the_bytes_of_its_file(tmp_path: Path) -> None:
    """In memory, names stand in the order in which somebody gave them; in the file they are sorted."""
    given = networks.network(43).model_dump()
    first = next(iter(given["derived_outputs"][0]["parameters"].values()))
    others = {name: {**first, "value": value} for name, value in (("z_C", 2.0), ("a_C", 3.0))}
    given["derived_outputs"][0]["parameters"] = {**others, **given["derived_outputs"][0]["parameters"]}
    given["provenance"] = {"versions": {"zeta": 1, "alpha": [{"b": 1, "a": 2}]}}
    parameter_set = ParameterSet(**given)
    whole = built(parameter_set, tmp_path).read_bytes()
    again = load(parameter_set.save(tmp_path / "network.json"))
    assert built(again, tmp_path).read_bytes() == whole


def test_the_guid_changes_with_the_last_digit_of_one_number(fmu: Path, tmp_path: Path) -> None:
    content = json.loads(networks.network(43, feedthrough=True).canonical_json())
    content["local_models"][1]["A"][0][1] = np.nextafter(content["local_models"][1]["A"][0][1], 9.0)
    other = built(ParameterSet(**content), tmp_path)
    assert fmpy.read_model_description(str(other)).guid != fmpy.read_model_description(str(fmu)).guid


@pytest.mark.parametrize("platform", ["win64", "win32", "aarch64-windows"])
@pytest.mark.parametrize(("states", "models"), [(20, 4), (1, 300)])
def test_large_networks_need_no_large_frames(states: int, models: int, platform: str, tmp_path: Path) -> None:
    """On Windows a frame of more than a page asks for a function that only a run-time library has."""
    positions = np.linspace(0.5, 2.5, models).tolist()
    parameter_set = blend([0.5 * np.eye(states)] * models, positions, blending="output")
    path = build_llmn(parameter_set, tmp_path / "large.fmu", (platform,))
    assert any(name.endswith(".dll") for name in zipfile.ZipFile(path).namelist())


def test_another_identifier_can_be_given(tmp_path: Path) -> None:
    path = built(networks.network(43), tmp_path, model_identifier="pantograph_other")
    assert fmpy.read_model_description(str(path)).coSimulation.modelIdentifier == "pantograph_other"


def test_an_unknown_unit_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    content = json.loads(networks.network(43).canonical_json())
    content["outputs"][0]["unit"] = "furlong"
    with pytest.raises(BuildError, match="furlong"):
        built(ParameterSet(**content), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_start_without_steady_state_and_an_overflow_are_errors(tmp_path: Path) -> None:
    content = json.loads(networks.network(43, "none", "output").canonical_json())
    content["local_models"][0]["A"] = [[float(i == j) for j in range(5)] for i in range(5)]
    path = built(ParameterSet(**content | {"declared_unstable": True}), tmp_path)
    with pytest.raises(Exception, match="fmi2"), opened(path, np.ones(3)):
        pass
    path = built(networks.network(43, "none", "output"), tmp_path)
    with opened(path, np.ones(3)) as (slave, _):
        slave.setReal([0], [1.7e308])
        with pytest.raises(Exception, match="fmi2DoStep"):
            for k in range(3):
                slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
