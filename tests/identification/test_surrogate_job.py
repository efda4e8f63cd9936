"""The whole surrogate job on a known plant: data -> n4sid -> frequency response -> output error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fmu_builder import parameter_set
from fmu_builder.errors import DataError, IdentificationError
from fmu_builder.kernel import simulate
from fmu_builder.parameter_set import DerivedOutput, DerivedTerm, NamedParameter, ParameterSet
from identification import n4sid, surrogate
from identification.data_set import DataSet
from identification.excitation import operating_point_inputs, whole_range_inputs, with_measurement_noise
from identification.scores import fit_percent
from identification.surrogate import Head, SurrogateResult, SurrogateSettings
from identification.surrogate.job import _choose, training_problem
from identification.surrogate.output_error import SIGNALS, OutputErrorFit
from identification.surrogate.structure import OUTPUT_NAMES, STRUCTURES
from tolerances import SURROGATE_RECOVERY, SURROGATE_RECURSION

HEAD = Head(m_C=5.609, k_C=10384.8, c_C=32.0, k_E=1e5)
CHAIN7 = STRUCTURES["chain7"]
PLANT = np.array([8.0, 14.0, 25343.9, 25.0, 0.3, 1200.0, 30.0])
UNITS = ("m", "m/s", "m", "m/s", "N", "N")
FAST = {"frequency_response": {"random_starts": 2}, "output_error": {"iterations": 15}}


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


def test_a_known_plant_is_recovered_end_to_end(clean) -> None:
    result, network, _, test = clean
    np.testing.assert_allclose(result.physical, np.tile(PLANT, (4, 1)), rtol=SURROGATE_RECOVERY)
    outputs = simulate(network, test.matrix(("eta", "M_pa")))
    for index, name in enumerate(SIGNALS):
        assert fit_percent(test.column(name), outputs[:, index]) >= 99.9, name
    assert not any(result.at_bound("physical"))


def test_a_known_plant_is_recovered_from_noisy_data() -> None:
    local, training, test = experiments(noise=1.0)
    result = surrogate.identify(n4sid.identify(local), [training], HEAD, SurrogateSettings(**FAST))
    for theta in (result.physical, result.tuned):
        np.testing.assert_allclose(theta, np.tile(PLANT, (4, 1)), rtol=0.03)  # k_W is the weakest, 0.9 %
    outputs = simulate(surrogate.network("noisy", result, forces()), test.matrix(("eta", "M_pa")))
    assert fit_percent(test.column("F_p"), outputs[:, 5]) >= 99.9


def test_the_network_says_what_it_is(clean, tmp_path: Path) -> None:
    result, network, training, _ = clean
    assert (network.kind, network.blending, network.offsets.kind) == (
        *("surrogate", "parameter", "scheduled_equilibrium"),
    )
    assert network.partition.validity == "hat_clamped" and network.partition.range == (0.5, 2.5)
    stored = network.surrogate
    assert stored is not None and stored.structure == "chain7"
    for which, table in (("physical", stored.physical), ("tuned", stored.tuned)):
        values = [[row[name] for name in CHAIN7.names] for row in table]
        np.testing.assert_array_equal(values, result.theta(which))
    assert stored.head["k_E"].value == 1e5 and stored.head["c_C"].unit == "N.s/m"
    assert stored.units == dict(
        zip(CHAIN7.names, ("kg", "kg", "N/m", "N.s/m", "m", "N/m", "N.s/m"), strict=True)
    )
    assert stored.at_bound == ((), (), (), ())
    data = network.provenance["surrogate"]["training"]
    assert data == [{"name": training.name, "content_hash": training.content_hash}]
    network.save(tmp_path / "surrogate.json")
    assert parameter_set.load(tmp_path / "surrogate.json") == network


def test_local_models_are_made_of_the_theta_asked_for(clean) -> None:
    result, _, _, _ = clean
    moved = replace(result, physical=result.physical * 1.1)
    for which in ("physical", "tuned"):
        network = surrogate.network("chosen", moved, which=which)
        for row, model in zip(moved.theta(which), network.local_models, strict=True):
            np.testing.assert_array_equal(model.A, CHAIN7.discretise(row, HEAD, 1e-3).A)
        assert network.provenance["theta"] == which


@pytest.mark.parametrize("validity", ["hat_clamped", "hat", "gaussian"])
def test_the_recursion_computes_what_the_kernel_computes(clean, validity: str) -> None:
    result, _, training, _ = clean
    spread = PLANT * np.array(
        [[0.8, 1.1, 0.9, 1, 1, 1, 1], [1] * 7, [1.2, 1, 1.1, 2, 1, 3, 1], [1, 2, 1, 1, 1.5, 1, 4]]
    )
    settings = SurrogateSettings(validity=validity, **FAST)
    partition = surrogate.job.partition_of(
        settings.network, "eta", (0.5, 2.5), list(result.partition.centres)
    )
    varied = replace(result, settings=settings, partition=partition, tuned=spread)
    outputs = simulate(
        surrogate.network("varied", varied, forces(), "tuned"), training.matrix(("eta", "M_pa"))
    )
    problem = training_problem(result.local, [training], partition, CHAIN7, HEAD, settings.output_error)
    deviation = problem.simulate(spread, problem.experiments[0])
    mine = training.matrix(SIGNALS) - problem.experiments[0].target + deviation
    for index, name in enumerate(SIGNALS):
        size = np.abs(outputs[:, index]).max()
        assert np.abs(mine[:, index] - outputs[:, index]).max() <= SURROGATE_RECURSION * size, name


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
    settings = SurrogateSettings(
        frequency_response=FAST["frequency_response"], output_error={"enabled": False}
    )
    plain = surrogate.identify(result.local, [training], HEAD, settings)
    assert plain.recommended == "physical" and plain.tuning is None
    np.testing.assert_array_equal(plain.tuned, plain.physical)
    np.testing.assert_array_equal(plain.physical, result.physical)


def test_a_tuning_that_is_worse_is_not_used() -> None:
    start, end = np.tile(PLANT, (2, 1)), np.tile(PLANT * 1.1, (2, 1))
    worse = OutputErrorFit(end, cost_before=1.0, cost_after=1.5, history=(), converged=True)
    theta, recommended, reason = _choose(start, worse)
    assert recommended == "physical" and theta is start and "raise" in reason
    theta, recommended, reason = _choose(start, replace(worse, cost_after=0.5))
    assert recommended == "tuned" and theta is end and "lowers" in reason
    unknown = float("inf")
    with pytest.raises(IdentificationError, match="unstable"):
        _choose(start, replace(worse, cost_before=unknown, cost_after=unknown))


def test_what_does_not_fit_is_refused_together(clean) -> None:
    result, _, training, _ = clean
    slow = DataSet("slow", 0.01, training.names, training.units, training.values[:100])
    other = replace(result.local, settings=result.local.settings.model_copy(update={"scheduling": "M_pa"}))
    with pytest.raises(IdentificationError) as caught:
        surrogate.identify(other, [slow], HEAD)
    assert len(caught.value.problems) == 2
    with pytest.raises(IdentificationError, match="no training data"):
        surrogate.identify(result.local, [], HEAD)
    with pytest.raises(DataError, match="F_p"):
        surrogate.identify(result.local, [training.select(("eta", "M_pa", *OUTPUT_NAMES, "F_H"))], HEAD)
