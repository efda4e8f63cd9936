"""The switch `unilateral` of a network's FMU: the kernel's bits, derivatives on both sides, refusals."""

from __future__ import annotations

from pathlib import Path

import fmpy
import networks
import numpy as np
import pytest
from contact_networks import linearised
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmu_runner import opened
from theta_networks import theta_network

from fmu_builder.compiler import host_platform
from fmu_builder.kernel import contact_of, simulate
from fmu_builder.llmn_fmu import build_llmn, interface, model_card
from fmu_builder.parameter_set import ParameterSet
from fmus.wbm import parameter_sets

POINT = (1.5, 1310.9)
NETWORKS = {
    "theta": theta_network,
    "linear": lambda: linearised(parameter_sets()["Blow"], POINT),
}
INPUTS = np.array([POINT, *[(1.52, 1310.9)] * 60, *[(1.49, 1330.0)] * 60])


@pytest.fixture(scope="module", params=NETWORKS)
def fmu(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[ParameterSet, Path]:
    parameter_set = NETWORKS[request.param]()
    path = tmp_path_factory.mktemp("contact") / "network.fmu"
    return parameter_set, build_llmn(parameter_set, path, (host_platform(),))


def run(fmu: tuple[ParameterSet, Path], kind: str, **start: object) -> np.ndarray:
    """Outputs and derived outputs, row k read after the inputs of row k were set."""
    parameter_set, path = fmu
    names = parameter_set.output_names
    times = np.arange(len(INPUTS)) * 1e-3
    if kind == "CoSimulation":
        with opened(path, INPUTS[0], ready=False) as (slave, references):
            slave.setBoolean([references["unilateral"]], [bool(start.get("unilateral"))])
            slave.exitInitializationMode()
            rows = []
            for k, row in enumerate(INPUTS):
                slave.setReal([0, 1], row.tolist())
                rows.append(slave.getReal([references[name] for name in names]))
                slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
        return np.array(rows)
    signals = np.rec.fromarrays([times, *INPUTS.T], names=["time", "eta", "M_pa"])
    found = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=times[-1],
        output_interval=1e-3,
        input=signals,
        output=names,
        start_values=dict(start),
        record_events=False,
    )
    return np.array([[row[name] for name in names] for row in found])


def test_the_fmu_has_the_bits_of_the_kernel_with_and_without_the_switch(
    fmu: tuple[ParameterSet, Path],
) -> None:
    parameter_set = fmu[0]
    expected = simulate(parameter_set, INPUTS, contact_of(parameter_set))
    assert (expected[:, -1] == 0.0).sum() > 10
    assert run(fmu, "CoSimulation", unilateral=True).tobytes() == expected.tobytes()
    assert run(fmu, "CoSimulation").tobytes() == simulate(parameter_set, INPUTS).tobytes()


def test_fmpy_finds_nothing_wrong_and_nothing_pulls_in_model_exchange(fmu: tuple[ParameterSet, Path]) -> None:
    assert validate_fmu(str(fmu[1])) == []
    found = run(fmu, "ModelExchange", unilateral=True)[:, -1]
    assert found.min() == 0.0 < found.max()
    assert run(fmu, "ModelExchange")[:, -1].min() < -100.0


def test_a_wire_that_was_left_has_no_derivative(fmu: tuple[ParameterSet, Path]) -> None:
    with opened(fmu[1], INPUTS[0], ready=False) as (slave, references):
        slave.setBoolean([references["unilateral"]], [True])
        slave.exitInitializationMode()
        sides = {}
        for height in (1.5, 1.52):
            slave.setReal([0], [height])
            sides[height] = [
                slave.getDirectionalDerivative([references["F_p"], references["xi"]], [known], [1.0])
                for known in (0, 1)
            ]
    assert sides == {1.5: [[-1e5, 0.0], [0.0, 0.0]], 1.52: [[0.0, 0.0], [0.0, 0.0]]}


def test_a_start_without_contact_is_refused(fmu: tuple[ParameterSet, Path]) -> None:
    with opened(fmu[1], np.array([1.5, 0.0]), ready=False) as (slave, references):
        slave.setBoolean([references["unilateral"]], [True])
        if simulate(fmu[0], [[1.5, 0.0]])[0, -1] < 0.0:
            with pytest.raises(FMICallException):
                slave.exitInitializationMode()
        else:
            slave.exitInitializationMode()


def test_a_network_without_a_contact_has_no_switch() -> None:
    assert contact_of(networks.network(3)) is None
    assert "unilateral" not in {variable.name for variable in interface(networks.network(3)).variables}
    assert "unilateral" not in model_card(networks.network(3), interface(networks.network(3)))
    card = model_card(theta_network(), interface(theta_network()))
    assert "then min(eta, xi) acts in the place of eta" in card
