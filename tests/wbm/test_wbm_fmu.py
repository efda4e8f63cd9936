"""The FMU, driven by fmpy, is the native model bit for bit; derivatives, state and refusals included."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from fmpy import extract, read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import FMU2Slave, fmi2CallbackFunctions, fmi2CallbackLoggerTYPE
from fmpy.validation import validate_fmu

import tolerances
from fmu_builder.compiler import host_platform
from fmus.wbm import build_wbm, interface, native, parameter_sets
from fmus.wbm.native import INPUTS, OUTPUTS, STATES

REFERENCE = {variable.name: k for k, variable in enumerate(interface().variables)}
INPUT_REFERENCES = [REFERENCE[name] for name in INPUTS]
OUTPUT_REFERENCES = [REFERENCE[name] for name in OUTPUTS]
STEP = 1e-3


@pytest.fixture(scope="module")
def fmu_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_wbm(tmp_path_factory.mktemp("wbm") / "pantograph_wbm.fmu", (host_platform(),))


@pytest.fixture(scope="module")
def open_fmu(fmu_path: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., object]:
    folder = extract(str(fmu_path), str(tmp_path_factory.mktemp("wbm-extracted")))
    description = read_model_description(str(fmu_path))

    @contextmanager
    def opened(
        preset: str = "A",
        start: tuple[float, float] = (1.5, 1310.9),
        inner_step: float = 5e-4,
        ready: bool = True,
    ) -> Iterator[tuple[FMU2Slave, list[str]]]:
        log: list[str] = []
        callbacks = fmi2CallbackFunctions()
        callbacks.logger = fmi2CallbackLoggerTYPE(lambda *entry: log.append(entry[-1].decode()))
        fmu = FMU2Slave(
            guid=description.guid,
            unzipDirectory=folder,
            modelIdentifier=description.coSimulation.modelIdentifier,
            instanceName="wbm",
        )
        fmu.instantiate(callbacks=callbacks)
        fmu.setInteger([REFERENCE["preset"]], [list(parameter_sets()).index(preset) + 1])
        fmu.setReal([REFERENCE["inner_step"]], [inner_step])
        fmu.setupExperiment(startTime=0.0)
        fmu.enterInitializationMode()
        fmu.setReal(INPUT_REFERENCES, list(start))
        if ready:
            fmu.exitInitializationMode()
        try:
            yield fmu, log
        finally:
            fmu.freeInstance()

    return opened


def run(fmu: FMU2Slave, inputs: np.ndarray, first: int = 0) -> np.ndarray:
    """Row k: outputs read after the inputs of row k were set and before the step."""
    rows = []
    for k, values in enumerate(inputs, start=first):
        fmu.setReal(INPUT_REFERENCES, values.tolist())
        rows.append(fmu.getReal(OUTPUT_REFERENCES))
        if k + 1 < first + len(inputs):
            fmu.doStep(k * STEP, STEP)
    return np.array(rows)


def excitation(count: int, seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    wire = 1.4 + 0.2 * np.linspace(0.0, 1.0, count) + 1e-3 * random.standard_normal(count)
    return np.column_stack([wire, 1310.9 + random.uniform(-75.0, 75.0, count)])


def test_description_is_valid(fmu_path: Path) -> None:
    assert validate_fmu(str(fmu_path)) == []


def test_build_is_reproducible(fmu_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fmu_builder.compiler.kept", lambda *_: None)  # compiled anew
    again = build_wbm(tmp_path / "other name.fmu", (host_platform(),))
    assert again.read_bytes() == fmu_path.read_bytes()


@pytest.mark.parametrize(
    ("preset", "inner_step"), [("A", 5e-4), ("A60", 1e-3), ("B", 2.5e-4), ("Blow", 5e-4)]
)
def test_same_bits_as_the_native_model(
    open_fmu: Callable[..., object], preset: str, inner_step: float
) -> None:
    inputs = excitation(1500, 7)
    with open_fmu(preset, tuple(inputs[0]), inner_step) as (fmu, log):
        rows = run(fmu, inputs)
    expected = native.simulate(parameter_sets()[preset], inputs, STEP, inner_step)
    assert rows.tolist() == expected.tolist()
    assert log == []


def test_directional_derivatives_are_the_tangent(open_fmu: Callable[..., object]) -> None:
    inputs = excitation(200, 8)
    parameters = parameter_sets()["Blow"]
    with open_fmu("Blow", tuple(inputs[0])) as (fmu, _):
        outputs = run(fmu, inputs)
        knowns = [REFERENCE[name] for name in (*STATES, *INPUTS)]
        unknowns = [REFERENCE[f"der_{name}"] for name in STATES] + OUTPUT_REFERENCES
        columns = [fmu.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
        rates = fmu.getReal([REFERENCE[f"der_{name}"] for name in STATES])
        both = fmu.getDirectionalDerivative(unknowns, knowns[:2], [0.5, -2.0])
    state = outputs[-1][[OUTPUTS.index(name) for name in STATES]]
    model = native.linearise(parameters, inputs[-1], state)
    expected = np.block([[model.A, model.B], [model.C, model.D]])
    assert np.array(columns).T.tolist() == expected.tolist()
    assert rates == native.derivatives(parameters, state, inputs[-1]).tolist()
    along = 0.5 * expected[:, 0] - 2.0 * expected[:, 1]
    np.testing.assert_allclose(
        both, along, rtol=0, atol=tolerances.WBM_TANGENT * np.abs(expected[:, :2]).max()
    )


def test_in_initialisation_derivatives_are_those_of_the_equilibrium(
    open_fmu: Callable[..., object],
) -> None:
    parameters, inputs = parameter_sets()["Blow"], np.array([1.2, 1250.0])
    knowns = [*INPUT_REFERENCES, REFERENCE["inner_step"]]
    unknowns = OUTPUT_REFERENCES + [REFERENCE[f"der_{name}"] for name in STATES]
    with open_fmu("Blow", tuple(inputs), ready=False) as (fmu, _):
        columns = [fmu.getDirectionalDerivative(unknowns, [known], [1.0]) for known in knowns]
    found = np.array(columns).T
    model = native.linearise(parameters, inputs, native.equilibrium(parameters, inputs))
    expected = model.D - model.C @ np.linalg.solve(model.A, model.B)
    size = np.abs(expected).max(axis=1, keepdims=True)
    assert (np.abs(found[: len(OUTPUTS), :2] - expected) <= tolerances.WBM_STATIC_GAIN * size).all()
    assert not found[:, 2].any() and not found[len(OUTPUTS) :].any()


def test_saved_state_continues_with_the_same_bits(open_fmu: Callable[..., object]) -> None:
    inputs = excitation(300, 9)
    with open_fmu("A", tuple(inputs[0])) as (fmu, _):
        run(fmu, inputs[:100])
        fmu.doStep(99 * STEP, STEP)
        saved = fmu.serializeFMUstate(fmu.getFMUstate())
        expected = run(fmu, inputs[100:], 100)
        fmu.setFMUstate(fmu.deSerializeFMUstate(saved))
        assert run(fmu, inputs[100:], 100).tolist() == expected.tolist()


@pytest.mark.parametrize("height", [0.05, 3.6, -1.0, 1e9])
def test_height_out_of_reach_is_refused_at_the_start(open_fmu: Callable[..., object], height: float) -> None:
    reach = native.reach(parameter_sets()["A"])
    with open_fmu("A", (height, 1310.9), ready=False) as (fmu, log), pytest.raises(FMICallException):
        fmu.exitInitializationMode()
    text = log[-1]
    assert f"eta = {height:.6g}".replace("e+0", "e") in text
    assert f"{reach.height_low:.6g} m to {reach.height_high:.6g} m" in text


def test_height_out_of_reach_is_refused_in_a_step(open_fmu: Callable[..., object]) -> None:
    with open_fmu() as (fmu, log):
        before = run(fmu, np.tile((1.5, 1310.9), (5, 1)))[-1]
        fmu.setReal(INPUT_REFERENCES, [3.6, 1310.9])
        with pytest.raises(FMICallException):
            fmu.doStep(4 * STEP, STEP)
        assert "eta = 3.6 m is out of reach" in log[-1]
        assert "0.131234 m to 3.42244 m" in log[-1]
        assert sum("out of reach" in entry for entry in log) == 1
        after = np.array(fmu.getReal(OUTPUT_REFERENCES))
        assert np.isfinite(after).all()
        assert after[OUTPUTS.index("xi")] == before[OUTPUTS.index("xi")]


@pytest.mark.parametrize(
    ("preset", "changes"),
    [("Blow", {"k_E": 2e5}), ("A", {"mC": 9.0, "c_d": 60.0, "l1": 1.64}), ("B", {"m1": 21.0, "g": 9.7})],
)
def test_what_is_given_another_value_overrides_the_preset(
    fmu_path: Path, open_fmu: Callable[..., object], preset: str, changes: dict[str, float]
) -> None:
    inputs = excitation(80, 9)
    with open_fmu(preset, tuple(inputs[0]), ready=False) as (fmu, _):
        fmu.setReal([REFERENCE[name] for name in changes], list(changes.values()))
        fmu.exitInitializationMode()
        found = run(fmu, inputs)
        assert fmu.getReal([REFERENCE["k_E"]]) == [changes.get("k_E", 1e5)]
    expected = native.simulate(parameter_sets()[preset].changed(**changes), inputs, STEP)
    assert np.array_equal(found, expected)
    assert not np.array_equal(expected, native.simulate(parameter_sets()[preset], inputs, STEP))


def test_every_parameter_is_shown_with_its_limits() -> None:
    known = parameter_sets()["A"].values()
    shown = [v for v in interface().variables if v.causality == "parameter" and v.name in known]
    assert [v.name for v in shown] == list(known)
    for chosen in parameter_sets().values():
        assert all(v.variability == "fixed" for v in shown)
        numbers = [v for v in shown if v.type != "Boolean"]
        assert all(v.minimum <= chosen[v.name] <= v.maximum for v in numbers)
        assert [v.name for v in shown if v.type == "Boolean"] == ["unilateral"]


def test_impossible_parameters_are_refused(open_fmu: Callable[..., object]) -> None:
    with open_fmu(ready=False) as (fmu, log):
        with pytest.raises(FMICallException):
            fmu.setReal([REFERENCE["mC"]], [-1.0])
        assert "mC = -1 is outside [1, 30]" in log[-1]
        fmu.setReal([REFERENCE["c"]], [2.6])
        with pytest.raises(FMICallException):
            fmu.exitInitializationMode()
        assert "these link lengths do not close to a linkage" in log[-1]
        fmu.setReal([REFERENCE["c"]], [parameter_sets()["A"]["c"]])
        fmu.exitInitializationMode()
        with pytest.raises(FMICallException):
            fmu.setReal([REFERENCE["k_E"]], [2e5])
        assert "k_E is a fixed parameter" in log[-1]


def test_inner_step_out_of_range_is_refused(open_fmu: Callable[..., object]) -> None:
    with pytest.raises(FMICallException), open_fmu(inner_step=0.05):
        pass
