"""The whole surrogate job on a known plant: data -> n4sid -> frequency response -> output error."""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmu_builder import parameter_set
from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.kernel import chain_of, simulate
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification import n4sid, surrogate
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, whole_range_inputs, with_measurement_noise
from identification.scores import fit_percent
from identification.surrogate import SIGNALS, THESIS, Head, SurrogateResult, SurrogateSettings
from identification.surrogate.chain import OUTPUT_NAMES
from identification.surrogate.job import judged
from identification.surrogate.problem import NetworkParameters
from identification.surrogate.structure import STRUCTURES
from identification.validity import weights
from tolerances import CHAIN_TABLE, SURROGATE_EQUILIBRIUM, SURROGATE_RECOVERY, SURROGATE_RECURSION

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN7, CHAIN8 = STRUCTURES["chain7"], STRUCTURES["chain8"]
PLANT = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0])
PLANT8 = CHAIN8.from_coefficients(dict(zip(CHAIN7.names, PLANT.tolist(), strict=True)), HEAD)
UNITS = ("m", "m/s", "m", "m/s", "N", "N")
FAST = {"output_error": {"iterations": 15}}


def forces() -> tuple[DerivedOutput, DerivedOutput]:
    given = {"k_C": (HEAD.k_C, "N/m"), "c_C": (HEAD.c_C, "N.s/m"), "k_E": (HEAD.k_E, "N/m")}
    named = {name: NamedParameter(value=value, unit=unit) for name, (value, unit) in given.items()}

    def output(name: str, *terms: tuple[str, str, int]) -> DerivedOutput:
        used = {parameter for _, parameter, _ in terms}
        rows = tuple(DerivedTerm(signal=s, parameter=p, sign=sign) for s, p, sign in terms)  # type: ignore[arg-type]
        return DerivedOutput(name=name, unit="N", terms=rows, parameters={p: named[p] for p in used})

    head = (("zeta", "k_C", 1), ("xi", "k_C", -1), ("zeta_dot", "c_C", 1), ("xi_dot", "c_C", -1))
    return output("F_H", *head), output("F_p", ("xi", "k_E", 1), ("eta", "k_E", -1))


def measured(inputs: DataSet, theta: np.ndarray = PLANT) -> DataSet:
    """The plant's answer, linear over the whole range, x from rest about eta = 0, some outputs raised."""
    dynamics = CHAIN7.discretise(theta, HEAD, 1e-3)
    u = inputs.matrix(("eta", "M_pa")) - [0.0, 1310.9]
    x = np.linalg.solve(np.eye(6) - dynamics.A, dynamics.B @ u[0])
    rows = []
    for row in u:
        rows.append(x[:4])
        x = dynamics.A @ x + dynamics.B @ row
    y = np.array(rows) + np.array([0.002, 0.0, 0.012, 0.0])
    xi, xi_dot, zeta, zeta_dot = y.T
    head = HEAD.k_C * (zeta - xi) + HEAD.c_C * (zeta_dot - xi_dot)
    y = np.column_stack([y, head, HEAD.k_E * (xi - inputs.column("eta"))])
    return inputs.with_columns(SIGNALS, UNITS, y)


def experiments(noise: float = 0.0) -> tuple[list[DataSet], DataSet, DataSet]:
    heights = (0.75, 1.25, 1.75, 2.25)
    local = [measured(operating_point_inputs(h, 1, (1, i), duration=8.0)) for i, h in enumerate(heights)]
    training, test = (measured(whole_range_inputs(1, (2, i), duration=20.0)) for i in (0, 1))
    if noise:
        deviations = {"xi": 1e-5, "zeta": 1e-5, "xi_dot": 1e-3, "zeta_dot": 1e-3, "F_p": 1.0, "F_H": 0.2}
        local = [with_measurement_noise(data, deviations, 1, (3, i)) for i, data in enumerate(local)]
        training = with_measurement_noise(training, deviations, 1, (4,))
    return local, training, test


@pytest.fixture(scope="module")
def clean() -> tuple[SurrogateResult, ParameterSet, DataSet, DataSet]:
    local, training, test = experiments()
    result = surrogate.identify(n4sid.identify(local), [training], HEAD, SurrogateSettings(**FAST))
    return result, surrogate.network("lti_surrogate", result, forces()), training, test


def small(name: str) -> bool:
    """Whether a parameter is zero in the plant, so that it has no relative error."""
    return bool(PLANT8[CHAIN8.names.index(name)] == 0.0)


def test_a_known_plant_is_recovered_end_to_end(clean) -> None:
    result, network, _, test = clean
    for index, name in enumerate(CHAIN8.names):
        found = result.physical[:, index]
        if small(name):
            assert np.abs(found).max() < SURROGATE_RECOVERY
        else:
            np.testing.assert_allclose(found, PLANT8[index], rtol=SURROGATE_RECOVERY, err_msg=name)
    outputs = simulate(network, test.matrix(("eta", "M_pa")))
    for index, name in enumerate(SIGNALS):
        assert fit_percent(test.column(name), outputs[:, index]) >= 99.9, name
    assert not any(result.at_bound("physical"))
    assert {fit.start for fit in result.responses} == {"closed form"}


def test_a_known_plant_is_recovered_from_noisy_data() -> None:
    local, training, test = experiments(noise=1.0)
    settings = SurrogateSettings(structure="chain7", **FAST)
    result = surrogate.identify(n4sid.identify(local), [training], HEAD, settings)
    for theta in (result.physical, result.tuned):
        np.testing.assert_allclose(theta, np.tile(PLANT, (4, 1)), rtol=0.03)  # k_W is the weakest, 0.9 %
    outputs = simulate(surrogate.network("noisy", result, forces()), test.matrix(("eta", "M_pa")))
    assert fit_percent(test.column("F_p"), outputs[:, 5]) >= 99.9


def test_the_network_says_what_it_is(clean, tmp_path: Path) -> None:
    result, network, training, _ = clean
    assert (network.kind, network.blending, network.offsets.kind) == (
        *("surrogate", "theta", "scheduled_equilibrium"),
    )
    assert network.partition.validity == "cubic_warp" and network.partition.range == (0.5, 2.5)
    stored = network.surrogate
    assert stored is not None and stored.structure == "chain8"
    for which, table in (("physical", stored.physical), ("tuned", stored.tuned)):
        values = [[row[name] for name in CHAIN8.names] for row in table]
        np.testing.assert_array_equal(values, result.theta(which))
    assert stored.head["k_E"].value == 1e5 and stored.head["c_C"].unit == "N.s/m"
    assert stored.units == dict(
        zip(CHAIN8.names, ("kg", "kg", "N/m", "N.s/m", "1/m", "1/m", "N/m", "N.s/m"), strict=True)
    )
    assert stored.at_bound == ((), (), (), ()) and stored.starts == ("closed form",) * 4
    assert (stored.recommended, stored.reason) == (result.recommended, result.reason)
    assert "no validation data" in stored.reason
    data = network.provenance["surrogate"]["training"]
    assert data == [{"name": training.name, "content_hash": training.content_hash}]
    network.save(tmp_path / "surrogate.json")
    assert parameter_set.load(tmp_path / "surrogate.json") == network


def varied_theta() -> np.ndarray:
    factors = np.ones((4, 8))
    factors[0, [0, 2, 6]], factors[2, [0, 3]], factors[3, [1, 4, 7]] = (
        (0.8, 0.9, 2.0),
        (1.2, 2.0),
        (1.4, 0.8, 4.0),
    )
    theta: np.ndarray = PLANT8 * factors
    theta[:, CHAIN8.names.index("b_H")] = [-0.2, -0.1, 0.0, 0.1]
    return theta


@pytest.mark.parametrize("which", ["physical", "tuned"])
def test_local_models_and_nodes_are_made_of_the_theta_asked_for(clean, which) -> None:
    result, _, _, _ = clean
    moved = replace(
        result,
        physical_parameters=NetworkParameters(varied_theta() * 1.1, warp=(0.2, -0.1)),
        tuned_parameters=NetworkParameters(varied_theta(), gain=0.8),
    )
    network = surrogate.network("chosen", moved, which=which)
    theta, table = moved.theta(which), network.node_table
    assert network.provenance["theta"] == which and table is not None
    local = CHAIN8.discretise(theta, HEAD, 1e-3)
    for k, model in enumerate(network.local_models):
        np.testing.assert_array_equal(model.A, local.A[k])
    # The table again, from what the parameter set stores: theta, centres, warp.
    shares = weights(network.partition, np.array(table.positions))
    np.testing.assert_array_equal(table.weights, shares)
    stored = network.surrogate
    rows = np.array([[row[name] for name in CHAIN8.names] for row in getattr(stored, which)])
    nodes = CHAIN8.discretise(CHAIN8.blended(rows, shares), HEAD, 1e-3)
    for k, node in enumerate(table.models):
        for mine, other in ((node.A, nodes.A[k]), (node.B, nodes.B[k])):
            assert np.abs(np.array(mine) - other).max() <= CHAIN_TABLE * np.abs(other).max()
        np.testing.assert_allclose(node.g, nodes.g[k], rtol=0.0, atol=SURROGATE_EQUILIBRIUM)
    found = chain_of(network)
    assert found is not None
    np.testing.assert_array_equal(found.theta, theta)


CONFIGURATIONS = {
    "theta": SurrogateSettings(),
    "theta, a deviation also schedules": SurrogateSettings(deviation_gain=0.9),
    "theta, hats": SurrogateSettings(validity="hat"),
    "theta, hats held": SurrogateSettings(validity="hat_clamped"),
    "matrices, cubics": SurrogateSettings(blending="matrices"),
    "matrices, hats": SurrogateSettings(blending="matrices", validity="hat"),
    "matrices, Gaussians": SurrogateSettings(blending="matrices", validity="gaussian"),
    "matrices, Gaussians, affine": SurrogateSettings(
        blending="matrices", validity="gaussian", offsets="affine"
    ),
    "matrices, cubics, affine": SurrogateSettings(blending="matrices", validity="cubic", offsets="affine"),
}


@pytest.mark.parametrize("settings", CONFIGURATIONS.values(), ids=CONFIGURATIONS)
def test_the_recursion_computes_what_the_kernel_computes(clean, settings: SurrogateSettings) -> None:
    result, _, training, _ = clean
    frame = replace(result.frame, settings=settings)
    offsets = np.zeros((0, 0))
    if settings.offsets == "affine":
        generator = np.random.default_rng(3)
        scale = [0.0, 20.0, 0.01, 0.05, 0.01, 0.05]
        offsets = generator.normal(size=(4, 6)) * scale + [0.0, 1310.9, 0.0, 0.0, 0.0, 0.0]
    warp = (0.2, -0.1) if settings.chosen_validity == "cubic_warp" else (0.0, 0.0)
    gain = 0.0 if settings.deviation_gain == "tuned" else settings.deviation_gain
    point = NetworkParameters(varied_theta(), offsets, warp, gain)
    varied = replace(result, frame=frame, tuned_parameters=point)
    outputs = simulate(
        surrogate.network("varied", varied, forces(), "tuned"), training.matrix(("eta", "M_pa"))
    )
    problem = varied.problem([training])
    found = problem.simulate(point, problem.experiments[0])
    mine = training.matrix(SIGNALS) - problem.experiments[0].target + found
    for index, name in enumerate(SIGNALS):
        size = np.abs(outputs[:, index]).max()
        assert np.abs(mine[:, index] - outputs[:, index]).max() <= SURROGATE_RECURSION * size, name


@pytest.mark.parametrize("settings", CONFIGURATIONS.values(), ids=CONFIGURATIONS)
def test_the_gradient_is_the_slope_of_the_cost(clean, settings: SurrogateSettings) -> None:
    result, _, training, _ = clean
    if settings.deviation_gain != 0.0:
        settings = settings.model_copy(update={"deviation_gain": "tuned"})
    problem = replace(result.frame, settings=settings).problem([training])
    offsets = np.tile([0.0, 1310.9, 0.002, 0.001, 0.012, 0.0], (4, 1)) if problem.affine else np.zeros((0, 0))
    warp = (0.15, -0.1) if problem.warp_free else (0.0, 0.0)
    point = NetworkParameters(varied_theta(), offsets, warp, 0.7 if problem.gain_free else 0.0)
    search = problem.to_search(point)
    assert len(problem.names) == search.size
    normal = problem.normal_equations(point)
    scale = np.sqrt(np.diag(normal.gram) * normal.cost)
    for index, step in enumerate(1e-5 * np.eye(search.size)):
        up, down = (problem.cost(problem.from_search(search + s * step, point)) for s in (1.0, -1.0))
        slope = -(up - down) / 4e-5
        assert abs(slope - normal.gradient[index]) <= 2e-6 * scale[index] + 1e-12, problem.names[index]
    if problem.schedule_size:
        few = problem.normal_equations(point, free="schedule")
        count = problem.schedule_size
        np.testing.assert_allclose(few.gradient[-count:], normal.gradient[-count:], rtol=1e-7)
        np.testing.assert_allclose(few.gram[-count:, -count:], normal.gram[-count:, -count:], rtol=1e-7)
        assert not few.gradient[:-count].any()


def test_the_jacobian_adds_up_to_the_information(clean) -> None:
    result, _, training, _ = clean
    problem = result.problem([training])
    noise = np.array([1e-5, 1e-3, 1e-5, 1e-3, 0.2, 1.0]) ** -2.0
    jacobian = problem.jacobian(result.tuned_parameters, problem.experiments[0])
    expected = np.einsum("kqi,q,kqj->ij", jacobian, noise, jacobian)
    found = problem.information(result.tuned_parameters, noise)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-11 * np.abs(expected).max())


def test_before_and_after_are_scored_with_the_network_itself(clean) -> None:
    result, _, training, _ = clean
    for which, scores in (("physical", result.fit_before), ("tuned", result.fit_after)):
        network = surrogate.network("scored", result, forces(), which)
        outputs = simulate(network, training.matrix(("eta", "M_pa")))
        for index, name in enumerate(SIGNALS):
            assert scores[name] == pytest.approx(
                fit_percent(training.column(name), outputs[:, index]), abs=1e-5
            )


def test_without_output_error_the_physical_theta_stands(clean) -> None:
    result, _, training, _ = clean
    settings = SurrogateSettings(output_error={"enabled": False})
    plain = surrogate.identify(result.local, [training], HEAD, settings)
    assert plain.recommended == "physical" and plain.tuning is None
    np.testing.assert_array_equal(plain.tuned, plain.physical)
    np.testing.assert_array_equal(plain.physical, result.physical)


@pytest.mark.parametrize(
    ("cost", "contact_force", "which", "word"),
    [
        ((1.0, 0.5), (90.0, 91.0), "tuned", "neither"),
        ((1.0, 1.0), (90.0, 90.0), "tuned", "neither"),
        ((1.0, 1.1), (90.0, 91.0), "physical", "makes the cost worse"),
        ((1.0, 0.5), (90.0, 89.9), "physical", "makes the contact force worse"),
        ((1.0, float("inf")), (90.0, -float("inf")), "physical", "the cost and the contact force"),
        ((float("inf"), 1.0), (-float("inf"), 50.0), "tuned", "neither"),
    ],
)
def test_the_tuned_theta_is_recommended_only_if_it_is_in_no_respect_worse(
    cost, contact_force, which, word
) -> None:
    found = judged(cost, contact_force, validated=True)
    assert found.which == which and word in found.reason and found.judged_on == "validation"
    assert "no validation data" in judged(cost, contact_force, validated=False).reason
    assert judged(cost, contact_force, validated=True, tuned=False).which == "physical"


def test_the_recommendation_is_judged_on_validation_data() -> None:
    """Data of another plant for validation: tuning to the training data can only lose there."""
    local, training, _ = experiments(noise=1.0)
    models = n4sid.identify(local)
    other = measured(whole_range_inputs(1, (2, 5), duration=20.0))
    wrong = training.values * np.where(np.array(training.names) == "F_p", 1.3, 1.0)
    spoiled = DataSet("spoiled", training.sample_time, training.names, training.units, wrong)
    settings = SurrogateSettings(**FAST)
    misled = surrogate.identify(models, [spoiled], HEAD, settings, [other])
    assert misled.recommended == "physical" and "on validation data" in misled.reason
    assert misled.recommendation.judged_on == "validation"
    unaware = surrogate.identify(models, [spoiled], HEAD, settings)
    assert unaware.recommended == "tuned" and unaware.recommendation.judged_on == "training"
    np.testing.assert_array_equal(misled.tuned, unaware.tuned)


def test_the_thesis_route_of_the_documents_is_the_one_of_the_code() -> None:
    text = (Path(__file__).resolve().parents[2] / "docs" / "settings.md").read_text(encoding="utf-8")
    (block,) = [part.split("```")[0] for part in text.split("```toml\n") if "stages" in part.split("```")[0]]
    assert SurrogateSettings(**tomllib.loads(block)["surrogate"]) == THESIS


def test_the_thesis_route_goes_through_its_stages() -> None:
    """One start, 1 -> 2 -> 4 local models with affine offsets, on a cut of the training data."""
    local, training, _ = experiments()
    models = n4sid.identify(local)
    tuning = {
        "stages": (1, 2, 4),
        "iterations": 40,
        "single_start": dict(zip(CHAIN7.names, PLANT * 1.15, strict=True)),
    }
    settings = SurrogateSettings(
        **{**THESIS.model_dump(), "training_rows": (2001, 14000), "output_error": tuning}
    )
    result = surrogate.identify(models, [training], HEAD, settings)
    network = surrogate.network("thesis", result, forces(), "tuned")
    assert (network.blending, network.offsets.kind, network.partition.validity) == (
        *("parameter", "affine", "gaussian"),
    )
    assert result.tuning is not None and result.tuned.shape == (4, 7)
    assert all(
        one.x0 == (0.0,) * 6 and one.u0 is not None and one.u0[0] == 0.0 for one in network.local_models
    )
    # On the rows it was tuned on, it is the plant: a linear one with offsets.
    assert result.fit_after["F_p"] > 99.0
    with pytest.raises(IdentificationError, match="training_rows"):
        surrogate.identify(models, [training], HEAD, THESIS)


@pytest.mark.parametrize("count", [1, 2])
def test_few_local_models_have_nothing_to_blend_or_little(count: int) -> None:
    heights = n4sid.N4sidSettings(local_models=count).positions
    local = [measured(operating_point_inputs(h, 1, (1, i), duration=8.0)) for i, h in enumerate(heights)]
    training = measured(whole_range_inputs(1, (2, 0), duration=20.0))
    models = n4sid.identify(local, n4sid.N4sidSettings(local_models=count))
    result = surrogate.identify(models, [training], HEAD, SurrogateSettings(deviation_gain="tuned", **FAST))
    network = surrogate.network("few", result, forces())
    assert len(network.local_models) == count
    assert (network.partition.deviation_gain == 0.0 and network.partition.warp == (0.0, 0.0)) or count > 1
    outputs = simulate(network, training.matrix(("eta", "M_pa")))
    assert fit_percent(training.column("F_p"), outputs[:, 5]) >= 99.9


def test_what_does_not_fit_is_refused_together(clean) -> None:
    result, _, training, _ = clean
    slow = DataSet("slow", 0.01, training.names, training.units, training.values[:100])
    other = replace(result.local, settings=result.local.settings.model_copy(update={"scheduling": "M_pa"}))
    with pytest.raises(IdentificationError) as caught:
        surrogate.identify(other, [slow], HEAD)
    assert len(caught.value.problems) == 2
    with pytest.raises(IdentificationError, match="no training data"):
        surrogate.identify(result.local, [], HEAD)
    stages = SurrogateSettings(output_error={"stages": (1, 2, 5)})
    with pytest.raises(IdentificationError, match="end with 5 local models, but there are 4"):
        surrogate.identify(result.local, [training], HEAD, stages)
    with pytest.raises(IdentificationError, match="12 rows are too few for the 34 numbers"):
        surrogate.identify(result.local, [training], HEAD, SurrogateSettings(training_rows=(1, 12)))
    fast = SurrogateSettings(frequency_response={"highest": 500.0})
    with pytest.raises(IdentificationError, match="500 Hz is not below half the sampling frequency"):
        surrogate.identify(result.local, [training], HEAD, fast)
    with pytest.raises(DataError, match="F_p"):
        surrogate.identify(result.local, [training.select(("eta", "M_pa", *OUTPUT_NAMES, "F_H"))], HEAD)
