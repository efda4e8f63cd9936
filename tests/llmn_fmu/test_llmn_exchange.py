"""A network in model exchange: a time event at every tick, the bits of the kernel and of co-simulation."""

from __future__ import annotations

from pathlib import Path

import fmpy
import networks
import numpy as np
import pytest
from fmpy.fmi2 import FMU2Model
from fmu_runner import QUIET

import tolerances
from fmu_builder.compiler import host_platform
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn, interface
from fmu_builder.parameter_set import ParameterSet

VARIANTS = [("affine", "output", "gaussian"), ("low_pass", "parameter", "hat"), networks.VARIANTS[-1]]
SHOWN = ["y_0", "y_1", "y_2", "sum", "validity_1", "validity_3", "in_range"]


def built(parameter_set: ParameterSet, folder: Path) -> Path:
    return build_llmn(parameter_set, folder / "network.fmu", (host_platform(),))


def by_events(path: Path, parameter_set: ParameterSet, inputs: networks.Array) -> networks.Array:
    """Row k: outputs, derived ones behind, read at the event of t_k, after the inputs of row k were set."""
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    fmu = FMU2Model(
        guid=description.guid,
        unzipDirectory=fmpy.extract(str(path), str(path.parent / "unpacked")),
        modelIdentifier=description.modelExchange.modelIdentifier,
        instanceName="one",
    )
    fmu.instantiate(callbacks=QUIET)
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.setReal(list(range(inputs.shape[1])), inputs[0].tolist())
    fmu.exitInitializationMode()
    rows = []
    for row in inputs:
        again, end, _, _, defined, next_time = fmu.newDiscreteStates()
        assert (again, end, defined) == (False, False, True)
        fmu.setReal(list(range(len(row))), row.tolist())
        rows.append(fmu.getReal([references[name] for name in parameter_set.output_names]))
        fmu.enterContinuousTimeMode()
        fmu.setTime(next_time)
        fmu.enterEventMode()
    fmu.terminate()
    fmu.freeInstance()
    return np.array(rows)


@pytest.mark.parametrize("variant", VARIANTS, ids="-".join)
def test_events_have_the_bits_of_the_kernel(variant: tuple[str, str, str], tmp_path: Path) -> None:
    parameter_set = networks.network(41, *variant)
    inputs = networks.inputs_of(41, 150, 3)
    found = by_events(built(parameter_set, tmp_path), parameter_set, inputs)
    assert np.abs(found - simulate(parameter_set, inputs)).max() == tolerances.BITS


@pytest.mark.parametrize("solver", ["CVode", "Euler"])
def test_fmpy_simulates_both_interfaces_to_the_same_bits(tmp_path: Path, solver: str) -> None:
    """Inputs jump between the ticks; outputs that hold are the same at every tick."""
    parameter_set = networks.network(43, "low_pass", "output", "gaussian", feedthrough=False)
    path = built(parameter_set, tmp_path)
    jumps = (np.arange(1, 10) * 7 + 0.4) * 1e-3
    levels = networks.inputs_of(43, 10, 3)
    times = np.concatenate([[0.0], np.repeat(jumps, 2), [0.1]])
    signals = np.rec.fromarrays([times, *np.repeat(levels, 2, axis=0).T], names=["time", "u_0", "u_1", "u_2"])
    runs = {
        kind: fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=0.08,
            output_interval=1e-3,
            step_size=1e-3,
            solver=solver,
            input=signals,
            output=SHOWN,
            start_values=dict(zip(("u_0", "u_1", "u_2"), levels[0], strict=True)),
            record_events=False,
            validate=True,
        )
        for kind in ("ModelExchange", "CoSimulation")
    }
    exchange, stepping = runs["ModelExchange"], runs["CoSimulation"]
    assert len(exchange) == 81 < len(stepping)  # fmpy ends a communication step at every jump
    stepping = stepping[np.isclose(stepping["time"], np.round(stepping["time"], 3), rtol=0, atol=1e-9)]
    assert len(stepping) == 81
    assert all((exchange[name] == stepping[name]).all() for name in SHOWN)
    assert len(set(exchange["y_0"])) > 40


def test_outputs_that_hold_between_ticks_are_discrete() -> None:
    variables = {v.name: v.variability for v in interface(networks.network(43, feedthrough=False)).variables}
    assert variables == {
        **dict.fromkeys(("u_0", "u_1", "u_2", "force"), "continuous"),
        **dict.fromkeys(("y_0", "y_1", "y_2", "sum", "in_range"), "discrete"),
        "out_of_range": "fixed",
        **{f"validity_{number}": "discrete" for number in range(1, 5)},
        **dict.fromkeys(("stiffness", "one", "two"), "constant"),
    }
    variables = {v.name: v.variability for v in interface(networks.network(43, feedthrough=True)).variables}
    assert {variables[name] for name in ("y_0", "y_2", "force", "sum")} == {"continuous"}


def test_the_description_has_no_states_and_both_interfaces(tmp_path: Path) -> None:
    description = fmpy.read_model_description(str(built(networks.network(43), tmp_path)))
    assert description.numberOfContinuousStates == description.numberOfEventIndicators == 0
    for one in (description.modelExchange, description.coSimulation):
        assert one.modelIdentifier == "random_network"
        assert one.canGetAndSetFMUstate and one.canSerializeFMUstate and one.providesDirectionalDerivative
