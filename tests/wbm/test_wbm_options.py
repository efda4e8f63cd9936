"""Unilateral contact and friction as an importer sees them: parameters, events, bounces, refusals."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import fmpy
import numpy as np
import pytest
from dry_joints import DRY
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE

import tolerances
from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm, interface, native, parameter_sets
from fmus.wbm.native import INPUTS, OUTPUTS, STATES

REFERENCE = {variable.name: k for k, variable in enumerate(interface().variables)}
INPUT_REFERENCES = [REFERENCE[name] for name in INPUTS]
OUTPUT_REFERENCES = [REFERENCE[name] for name in OUTPUTS]
RATE_REFERENCES = [REFERENCE[f"der_{name}"] for name in STATES]
START = (1.5, 1310.9)


@pytest.fixture(scope="module")
def fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wbm(tmp_path_factory.mktemp("wbm") / "pantograph_wbm.fmu", (host_platform(),))


@pytest.fixture(scope="module")
def folder(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    return str(fmpy.extract(str(fmu_path), str(tmp_path_factory.mktemp("wbm-extracted"))))


@contextmanager
def initialising(
    kind: type, folder: str, start: tuple[float, float] = START, unilateral: bool = True, **reals: float
) -> Iterator[tuple[FMU2Model | FMU2Slave, list[str]]]:
    """An instance of the set Blow in initialisation mode, and what it logs."""
    log: list[str] = []
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *entry: log.append(entry[-1].decode()))
    guid = fmpy.read_model_description(folder).guid
    fmu = kind(guid=guid, unzipDirectory=folder, modelIdentifier="pantograph_wbm", instanceName="wbm")
    fmu.instantiate(callbacks=callbacks)
    fmu.setInteger([REFERENCE["preset"]], [list(parameter_sets()).index("Blow") + 1])
    fmu.setBoolean([REFERENCE["unilateral"]], [unilateral])
    fmu.setReal([REFERENCE[name] for name in reals], list(reals.values()))
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    fmu.setReal(INPUT_REFERENCES, list(start))
    try:
        yield fmu, log
    finally:
        fmu.freeInstance()


@contextmanager
def integrated(folder: str, unilateral: bool = True, **reals: float) -> Iterator[FMU2Model]:
    """An instance for model exchange in continuous-time mode."""
    with initialising(FMU2Model, folder, unilateral=unilateral, **reals) as (fmu, _):
        fmu.exitInitializationMode()
        fmu.newDiscreteStates()
        fmu.enterContinuousTimeMode()
        yield fmu


def put(fmu: FMU2Model, state: np.ndarray, inputs: tuple[float, float]) -> None:
    array = np.ascontiguousarray(state)
    fmu.setContinuousStates(array.ctypes.data_as(ctypes.POINTER(ctypes.c_double)), len(array))
    fmu.setReal(INPUT_REFERENCES, list(inputs))


def indicator(fmu: FMU2Model) -> float:
    value = (ctypes.c_double * 1)(np.nan)
    fmu.getEventIndicators(value, 1)
    return float(value[0])


@pytest.mark.parametrize("preset", ["A", "Blow"])
def test_co_simulation_has_the_bits_of_the_native_model(fmu_path: Path, preset: str) -> None:
    random = np.random.default_rng(5)
    times = np.arange(400) * 1e-3
    wire = 1.5 + np.repeat(random.uniform(-0.02, 0.02, 8), 50)
    wire[0] = 1.5
    torque = np.full(times.size, START[1])
    signals = np.rec.fromarrays([times, wire, torque], names=["time", *INPUTS])
    number = list(parameter_sets()).index(preset) + 1
    rows = fmpy.simulate_fmu(
        str(fmu_path),
        fmi_type="CoSimulation",
        stop_time=0.398,
        output_interval=1e-3,
        input=signals,
        output=list(STATES),
        start_values={"preset": number, "unilateral": True, **DRY},
    )
    parameters = parameter_sets()[preset].changed(unilateral=1.0, **DRY)
    expected = native.simulate(parameters, np.column_stack([wire, torque]))
    columns = [OUTPUTS.index(name) for name in STATES]
    assert (expected[:, OUTPUTS.index("F_p")] == 0.0).any()
    found = np.array([[row[name] for name in STATES] for row in rows])
    assert found.tolist() == expected[: len(rows), columns].tolist()


def test_the_indicator_is_the_gap_and_stands_still_where_nothing_happens(folder: str) -> None:
    state = native.equilibrium(parameter_sets()["Blow"], START)
    for height in (1.49, 1.5, 1.53):
        with integrated(folder) as fmu:
            put(fmu, state, (height, START[1]))
            assert indicator(fmu) == state[STATES.index("xi")] - height
        with integrated(folder, unilateral=False) as fmu:
            put(fmu, state, (height, START[1]))
            assert indicator(fmu) == 1.0


@pytest.mark.parametrize("height", [1.49, 1.53])
def test_derivatives_on_both_sides_are_those_of_the_native_tangent(folder: str, height: float) -> None:
    parameters = parameter_sets()["Blow"].changed(unilateral=1.0, **DRY)
    state = native.equilibrium(parameters, START) + np.array([0.01, 0.02, 0.001, -0.03, 0.0, 0.1])
    inputs = (height, START[1])
    with integrated(folder, **DRY) as fmu:
        put(fmu, state, inputs)
        knowns = [REFERENCE[name] for name in (*STATES, *INPUTS)]
        unknowns = RATE_REFERENCES + OUTPUT_REFERENCES
        columns = [fmu.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
        rates = fmu.getReal(RATE_REFERENCES)
    at = native.linearise(parameters, inputs, state)
    assert np.array(columns).T.tolist() == np.block([[at.A, at.B], [at.C, at.D]]).tolist()
    assert rates == native.derivatives(parameters, state, inputs).tolist()
    force = [*at.C[OUTPUTS.index("F_p")], *at.D[OUTPUTS.index("F_p")]]
    on_wire = [0.0, 0.0, 0.0, 0.0, parameters["k_E"], 0.0, -parameters["k_E"], 0.0]
    assert force == ([0.0] * 8 if height > state[STATES.index("xi")] else on_wire)


def runs(
    path: Path, preset: str, step: float, options: dict[str, float], **keywords: object
) -> list[np.ndarray]:
    """The same second in model exchange with CVode and in co-simulation: the wire jumps after 50 ms."""
    times, jump = np.array([0.0, 0.05, 0.05, 1.0]), np.array([0.0, 0.0, step, step])
    signals = np.rec.fromarrays([times, 1.5 + jump, np.full(4, START[1])], names=["time", *INPUTS])
    number = list(parameter_sets()).index(preset) + 1
    return [
        fmpy.simulate_fmu(
            str(path),
            fmi_type=kind,
            stop_time=1.0,
            output_interval=1e-3,
            relative_tolerance=1e-9,
            input=signals,
            output=list(OUTPUTS),
            start_values={"preset": number, "unilateral": True, "inner_step": 1e-4, **options},
            **{"record_events": False, **keywords},
        )
        for kind in ("ModelExchange", "CoSimulation")
    ]


@pytest.mark.parametrize("options", [{}, DRY], ids=["smooth", "dry"])
@pytest.mark.parametrize("step", [0.02, -0.02])
@pytest.mark.parametrize("preset", ["A", "Blow"])
def test_an_integrator_of_the_importer_bounces_as_co_simulation_does(
    fmu_path: Path, preset: str, step: float, options: dict[str, float]
) -> None:
    exchange, stepping = runs(fmu_path, preset, step, options)
    assert len(exchange) == len(stepping) == 1001
    assert (np.diff(exchange["F_p"] > 0.0) != 0).sum() >= 4
    assert exchange["F_p"].min() == 0.0 == stepping["F_p"].min()
    for name in set(OUTPUTS) - {"F_p"}:  # co-simulation records it with the height before the jump
        gap = np.abs(exchange[name] - stepping[name]).max()
        assert gap <= tolerances.WBM_BOUNCE_INTEGRATORS * np.ptp(stepping[name]), (name, gap)
    after = exchange["time"] > 0.06
    force_gap = np.abs(exchange["F_p"] - stepping["F_p"])[after].max()
    assert force_gap <= tolerances.WBM_BOUNCE_INTEGRATORS * np.ptp(stepping["F_p"])


def test_events_are_where_contact_is_lost_or_regained_and_not_many(fmu_path: Path) -> None:
    """Rows between the grid of 1 ms are state events: the gap is closed there, and they come two by two."""
    exchange, _ = runs(fmu_path, "Blow", 0.02, {}, record_events=True)
    steps = exchange["time"] / 1e-3
    events = exchange[np.abs(steps - np.round(steps)) > 1e-6]
    wire = 1.52
    assert np.abs(events["xi"] - wire).max() <= tolerances.STATE_EVENT
    changes = (np.diff(exchange["F_p"][exchange["time"] > 0.051] > 1e-6) != 0).sum()
    assert 8 <= len(np.unique(events["time"])) <= changes + 4


def test_a_start_without_contact_is_refused(folder: str) -> None:
    with initialising(FMU2Slave, folder, (1.5, 1000.0)) as (fmu, log), pytest.raises(FMICallException):
        fmu.exitInitializationMode()
    assert "M_pa = 1000 N.m does not hold the pan-head on a wire" in log[-1]
    with initialising(FMU2Slave, folder, (1.5, 1000.0), unilateral=False) as (fmu, _):
        fmu.exitInitializationMode()


def test_too_long_a_step_for_the_friction_is_refused_where_the_fmu_steps_by_itself(folder: str) -> None:
    stiff = {"friction_bend": 20.0, "friction_slip_rate": 1e-4}
    with initialising(FMU2Slave, folder, **stiff) as (fmu, log):
        fmu.exitInitializationMode()
        with pytest.raises(FMICallException):
            fmu.doStep(0.0, 1e-3)
        assert "inner_step = 0.0005 s is too long for this friction" in log[-1]
    with integrated(folder, **stiff) as fmu:
        assert np.isfinite(fmu.getReal(RATE_REFERENCES)).all()


def test_a_saved_flight_goes_on_with_the_same_bits(folder: str) -> None:
    with initialising(FMU2Slave, folder) as (fmu, _):
        fmu.exitInitializationMode()
        fmu.setReal(INPUT_REFERENCES, [1.52, START[1]])
        fmu.doStep(0.0, 0.03)
        assert fmu.getReal([REFERENCE["F_p"]]) == [0.0]
        saved = fmu.serializeFMUstate(fmu.getFMUstate())
        ends = []
        for _ in range(2):
            fmu.doStep(0.03, 0.045)
            ends.append(fmu.getReal(OUTPUT_REFERENCES))
            fmu.setFMUstate(fmu.deSerializeFMUstate(saved))
    assert ends[0] == ends[1]
    assert ends[0][OUTPUTS.index("F_p")] > 0.0
