"""The white-box model in model exchange: derivatives and tangent at any point, an importer's integrator."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

import tolerances
from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm, interface, native, parameter_sets
from fmus.wbm.native import INPUTS, OUTPUTS, STATES

REFERENCE = {variable.name: k for k, variable in enumerate(interface().variables)}
INPUT_REFERENCES = [REFERENCE[name] for name in INPUTS]
OUTPUT_REFERENCES = [REFERENCE[name] for name in OUTPUTS]
RATE_REFERENCES = [REFERENCE[f"der_{name}"] for name in STATES]
START = (1.5, 1310.9)
_POINTER = ctypes.POINTER(ctypes.c_double)


@pytest.fixture(scope="module")
def fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wbm(tmp_path_factory.mktemp("wbm") / "pantograph_wbm.fmu", (host_platform(),))


@pytest.fixture(scope="module")
def open_model(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., object]:
    folder = fmpy.extract(str(fmu_path), str(tmp_path_factory.mktemp("wbm-extracted")))
    description = fmpy.read_model_description(str(fmu_path))

    @contextmanager
    def opened(preset: str = "A") -> Iterator[tuple[FMU2Model, list[str]]]:
        log: list[str] = []
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *entry: log.append(entry[-1].decode()))
        model = FMU2Model(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.modelExchange.modelIdentifier,
            instanceName="wbm",
        )
        model.instantiate(callbacks=callbacks)
        model.setInteger([REFERENCE["preset"]], [list(parameter_sets()).index(preset) + 1])
        model.setupExperiment(startTime=0.0)
        model.enterInitializationMode()
        model.setReal(INPUT_REFERENCES, list(START))
        model.exitInitializationMode()
        assert model.newDiscreteStates() == (False, False, False, False, False, 0.0)
        model.enterContinuousTimeMode()
        try:
            yield model, log
        finally:
            model.freeInstance()

    return opened


def put(model: FMU2Model, state: np.ndarray, inputs: np.ndarray) -> None:
    array = np.ascontiguousarray(state)
    model.setContinuousStates(array.ctypes.data_as(_POINTER), len(array))
    model.setReal(INPUT_REFERENCES, inputs.tolist())


def read(function: Callable[..., object]) -> np.ndarray:
    values = np.full(len(STATES), np.nan)
    function(values.ctypes.data_as(_POINTER), len(values))
    return values


def points(count: int, seed: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    random = np.random.default_rng(seed)
    rest = native.equilibrium(parameter_sets()["Blow"], np.array(START))
    for _ in range(count):
        state = rest + random.uniform(-1.0, 1.0, 6) * np.array([0.1, 2.0, 0.02, 3.0, 0.2, 2.0])
        yield state, np.array([random.uniform(1.0, 2.0), random.uniform(0.0, 2000.0)])


def test_states_derivatives_and_outputs_at_any_point(open_model: Callable[..., object]) -> None:
    parameters = parameter_sets()["Blow"]
    with open_model("Blow") as (model, log):
        for state, inputs in points(25, 3):
            put(model, state, inputs)
            assert read(model.getContinuousStates).tolist() == state.tolist()
            rates = native.derivatives(parameters, state, inputs).tolist()
            assert read(model.getDerivatives).tolist() == rates == model.getReal(RATE_REFERENCES)
            shown = dict(zip(OUTPUTS, model.getReal(OUTPUT_REFERENCES), strict=True))
            assert [shown[name] for name in STATES] == state.tolist()
            assert shown["F_p"] == parameters["k_E"] * (state[STATES.index("xi")] - inputs[0])
    assert log == []


def test_directional_derivatives_are_the_tangent_at_any_point(open_model: Callable[..., object]) -> None:
    parameters = parameter_sets()["Blow"]
    knowns = [REFERENCE[name] for name in (*STATES, *INPUTS)]
    unknowns = RATE_REFERENCES + OUTPUT_REFERENCES
    with open_model("Blow") as (model, _):
        for state, inputs in points(5, 4):
            put(model, state, inputs)
            columns = [model.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
            at = native.linearise(parameters, inputs, state)
            assert np.array(columns).T.tolist() == np.block([[at.A, at.B], [at.C, at.D]]).tolist()


def test_nominals_are_those_of_the_description(open_model: Callable[..., object], fmu_path: Path) -> None:
    described = {v.name: v for v in fmpy.read_model_description(str(fmu_path)).modelVariables}
    with open_model() as (model, _):
        nominals = read(model.getNominalsOfContinuousStates)
    assert nominals.tolist() == [float(described[name].nominal) for name in STATES]
    assert set(nominals) == {0.01, 0.1, 1.0}


def test_the_description_lists_derivatives_in_the_order_of_the_states(fmu_path: Path) -> None:
    description = fmpy.read_model_description(str(fmu_path))
    assert description.numberOfContinuousStates == 6
    assert [unknown.variable.name for unknown in description.derivatives] == [
        f"der_{name}" for name in STATES
    ]
    assert [unknown.variable.derivative.name for unknown in description.derivatives] == list(STATES)
    initial = [REFERENCE[unknown.variable.name] for unknown in description.initialUnknowns]
    assert initial == sorted({*OUTPUT_REFERENCES, *RATE_REFERENCES})


def test_states_the_linkage_cannot_take_ask_for_a_smaller_step(open_model: Callable[..., object]) -> None:
    rest = native.equilibrium(parameter_sets()["A"], np.array(START))
    with open_model() as (model, log):
        put(model, rest + np.array([1.5, 0, 0, 0, 0, 0]), np.array(START))
        with pytest.raises(FMICallException) as caught:
            read(model.getDerivatives)
        assert caught.value.status == 2
        assert "the motion leaves the linkage's regular range" in log[-1]
        put(model, rest, np.array([3.6, START[1]]))
        with pytest.raises(FMICallException):
            model.getReal(OUTPUT_REFERENCES)
        assert "eta = 3.6 m is out of reach" in log[-1]
        put(model, rest, np.array(START))
        assert np.abs(read(model.getDerivatives)).max() <= tolerances.WBM_REST


@pytest.mark.parametrize("preset", ["A", "Blow"])
def test_an_integrator_of_the_importer_agrees_with_co_simulation(fmu_path: Path, preset: str) -> None:
    """fmpy with CVode against the fixed step of the FMU: torque and height jump and stay."""
    times = np.array([0.0, 0.05, 0.05, 0.3, 0.3, 0.6])
    torque = np.array([1310.9, 1310.9, 1400.0, 1400.0, 1340.0, 1340.0])
    height = np.array([1.5, 1.5, 1.5, 1.5, 1.501, 1.501])
    signals = np.rec.fromarrays([times, height, torque], names=["time", *INPUTS])
    runs = {
        kind: fmpy.simulate_fmu(
            str(fmu_path),
            fmi_type=kind,
            stop_time=0.6,
            output_interval=1e-3,
            relative_tolerance=1e-9,
            input=signals,
            output=list(OUTPUTS),
            start_values={"preset": list(parameter_sets()).index(preset) + 1, "inner_step": 1e-4},
            record_events=False,
        )
        for kind in ("ModelExchange", "CoSimulation")
    }
    exchange, stepping = runs["ModelExchange"], runs["CoSimulation"]
    assert len(exchange) == len(stepping) == 601
    for name in set(OUTPUTS) - {"F_p"}:  # co-simulation records it with the height before the jump
        size = np.ptp(stepping[name])
        gap = np.abs(exchange[name] - stepping[name]).max()
        assert gap <= tolerances.WBM_INTEGRATORS * size, (name, gap / size)
