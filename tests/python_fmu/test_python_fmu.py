"""The Python FMU against the native one: the same numbers by other arithmetic, the same rule of time."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import fmpy
import networks
import numpy as np
import pytest
import theta_networks
from fmpy.validation import validate_fmu
from fmu_runner import opened, run_fmu

import tolerances
from cosim.test_command import refused
from fmu_builder.check import Options, check_fmu
from fmu_builder.compiler import host_platform
from fmu_builder.errors import BuildError
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn
from fmu_builder.parameter_set import ParameterSet, TrainedRegion
from fmu_builder.python_fmu import PLATFORMS, build_python_fmu

pytestmark = [
    pytest.mark.skipif(host_platform() not in PLATFORMS, reason="pythonfmu has no binary for this machine"),
    pytest.mark.skipif(find_spec("pythonfmu") is None, reason="pythonfmu is not installed: run make"),
]

INHERENT = {"python-symbol", "wrong-guid"}
"""Errors of pythonfmu's binary that no Python file can mend."""
STEPS = (1e-3, 0.4e-3, 0.6e-3, 2.5e-3, 0.3e-3, 0.2e-3, 1e-3, 5e-3)


def with_deviation(seed: int) -> ParameterSet:
    """A network whose schedule also sees the deviation of an output, from a table of warped cubics."""
    content = networks.network(
        seed, "scheduled_equilibrium", "parameter", "hat", feedthrough=False
    ).model_dump()
    named = {"validity": "cubic_warp", "warp": (0.1, -0.05)}
    content["partition"] |= named | {"deviation_output": "y_2", "deviation_gain": 0.002}
    return ParameterSet(**content)


def different(found: networks.Array, expected: networks.Array) -> bool:
    """Whether a column differs by more than rounding."""
    size = np.abs(expected).max(axis=0)
    return bool((np.abs(found - expected).max(axis=0) > tolerances.KERNEL_VECTORISED * size).any())


def built(parameter_set: ParameterSet, folder: Path) -> Path:
    return build_python_fmu(parameter_set, folder / "python.fmu", (host_platform(),))


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return built(networks.network(43), tmp_path_factory.mktemp("python fmu"))


@pytest.mark.parametrize("feedthrough", [False, True])
@pytest.mark.parametrize("variant", networks.VARIANTS, ids="-".join)
def test_numpy_in_the_fmu_agrees_with_the_kernel(
    variant: tuple[str, str, str], feedthrough: bool, tmp_path: Path
) -> None:
    parameter_set = networks.network(17, *variant, feedthrough)
    inputs = networks.inputs_of(7, 200, 3)
    path = built(parameter_set, tmp_path)
    found = run_fmu(path, inputs, parameter_set.output_names, parameter_set.sample_time)
    assert not different(found, simulate(parameter_set, inputs))


def by_uneven_steps(path: Path, inputs: networks.Array, names: list[str]) -> networks.Array:
    """Rows of `names`, read before and after every step, and in_range in the last column."""
    rows, time = [], 0.0
    with opened(path, inputs[0]) as (slave, references):
        wanted = [references[name] for name in names]
        for k, row in enumerate(inputs):
            slave.setReal(list(range(len(row))), row.tolist())
            rows.append([*slave.getReal(wanted), *slave.getBoolean([references["in_range"]])])
            slave.doStep(currentCommunicationPoint=time, communicationStepSize=STEPS[k % len(STEPS)])
            time += STEPS[k % len(STEPS)]
            rows.append([*slave.getReal(wanted), *slave.getBoolean([references["in_range"]])])
    return np.array(rows)


@pytest.mark.parametrize(
    "parameter_set",
    [
        networks.network(41, "affine", "output", "gaussian"),
        networks.network(41, "low_pass", "parameter", "hat"),
        with_deviation(41),
        networks.network(41, "affine", "output", "hat").replaced(
            trained_region=TrainedRegion(rate=130.0, derived_outputs={"sum": (80.0, 125.0)})
        ),
    ],
    ids=["affine", "low_pass", "deviation", "region"],
)
def test_both_fmus_agree_through_fmpy_at_uneven_steps(parameter_set: ParameterSet, tmp_path: Path) -> None:
    """Steps that end between ticks, before them and on them; validities and in_range among the outputs."""
    inputs = networks.inputs_of(41, 120, 3)
    names = [*parameter_set.output_names, *(f"validity_{number}" for number in range(1, 5))]
    native = build_llmn(parameter_set, tmp_path / "native.fmu", (host_platform(),))
    expected = by_uneven_steps(native, inputs, names)
    assert not different(by_uneven_steps(built(parameter_set, tmp_path), inputs, names), expected)
    assert len(set(expected[:, -1])) == 2 and different(expected[:-1], expected[1:])


@pytest.mark.parametrize("gain", [0.0, 0.1])
def test_both_fmus_agree_through_fmpy_on_a_surrogate(gain: float, tmp_path: Path) -> None:
    """Theta blended over a node table of unequal steps, a stiff contact, with and without the deviation."""
    parameter_set = theta_networks.theta_network("chain8", gain=gain)
    native = build_llmn(parameter_set, tmp_path / "native.fmu", (host_platform(),))
    inputs, names = theta_networks.inputs_of(600), parameter_set.output_names
    expected = run_fmu(native, inputs, names, parameter_set.sample_time)
    found = run_fmu(built(parameter_set, tmp_path), inputs, names, parameter_set.sample_time)
    assert not different(found, expected)


def test_fmpy_finds_nothing_wrong_and_the_check_nothing_that_python_could_mend(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []
    report = check_fmu(fmu, Options(time_limit=10.0))
    assert {finding.rule for finding in report.findings if finding.severity == "error"} == INHERENT
    assert {"reset", "two instances", "illegal calls", "state in another process"} <= set(report.checked)


def test_the_description_promises_what_pythonfmu_can_do(fmu: Path) -> None:
    description = fmpy.read_model_description(str(fmu))
    stepping = description.coSimulation
    assert description.modelExchange is None
    assert stepping.needsExecutionTool and stepping.canGetAndSetFMUstate and stepping.canSerializeFMUstate
    assert not stepping.canInterpolateInputs and not stepping.providesDirectionalDerivative
    with zipfile.ZipFile(fmu) as archive:
        assert b"SourceFiles" not in archive.read("modelDescription.xml")
    assert "fmpy" in description.description


def test_the_archive_holds_the_parameter_set_and_the_python_file(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        names = archive.namelist()
        assert archive.read("resources/parameter_set.json").decode() == networks.network(43).compact_json()
        assert archive.read("resources/slavemodule.txt") == b"random_network_slave"
        assert b"class Network:" in archive.read("resources/random_network_network.py")
        slave = archive.read("resources/random_network_slave.py")
        assert b"from random_network_network import Network" in slave and b"fmu_builder" not in slave
        assert b"MIT License" in archive.read("documentation/licenses/pythonfmu.txt")
    assert names[0] == "modelDescription.xml" and "resources/pythonfmu/fmi2slave.py" in names


def test_the_same_parameter_set_gives_the_same_bytes(fmu: Path, tmp_path: Path) -> None:
    assert built(networks.network(43), tmp_path).read_bytes() == fmu.read_bytes()
    native = build_llmn(networks.network(43), tmp_path / "native.fmu", (host_platform(),))
    guids = {fmpy.read_model_description(str(path)).guid for path in (fmu, native)}
    assert len(guids) == 2


def test_an_edited_fmu_computes_what_was_written_into_it(fmu: Path, tmp_path: Path) -> None:
    edited = tmp_path / "edited.fmu"
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(edited, "w") as new:
        for name in old.namelist():
            text = old.read(name)
            new.writestr(name, text.replace(b"np.array([*y, *derived])", b"2.0 * np.array([*y, *derived])"))
    code = (
        "import sys, fmpy; r = fmpy.simulate_fmu(sys.argv[1], stop_time=0.001, output_interval=0.001,"
        " output=['y_0', 'force']); print(r['y_0'][-1], r['force'][-1])"
    )
    values = [
        [float(text) for text in subprocess.check_output([sys.executable, "-c", code, path]).split()]
        for path in (fmu, edited)
    ]
    assert values[0][0] != 0.0
    np.testing.assert_array_equal(values[1], 2.0 * np.array(values[0]))


def test_a_saved_state_goes_on_to_the_same_bits_in_another_instance(fmu: Path) -> None:
    inputs = networks.inputs_of(3, 40, 3)
    outputs = [3, 4, 5, 6, 7, 8]

    def steps(slave: fmpy.fmi2.FMU2Slave, first: int) -> list[list[float]]:
        rows = []
        for k in range(first, first + 20):
            slave.setReal([0, 1, 2], inputs[k].tolist())
            slave.doStep(currentCommunicationPoint=k * 0.7e-3, communicationStepSize=0.7e-3)
            rows.append(slave.getReal(outputs))
        return rows

    with opened(fmu, inputs[0]) as (slave, _):
        steps(slave, 0)
        state = slave.getFMUState()
        saved = slave.serializeFMUState(state)
        expected = steps(slave, 20)
        slave.setFMUState(state)
        assert steps(slave, 20) == expected
    with opened(fmu, inputs[1]) as (slave, _):
        slave.setFMUState(slave.deSerializeFMUstate(saved))
        assert steps(slave, 20) == expected


def test_a_state_of_another_model_is_refused(fmu: Path, tmp_path: Path) -> None:
    with opened(fmu, np.ones(3)) as (slave, _):
        saved = slave.serializeFMUState(slave.getFMUState())
    other = built(networks.network(44), tmp_path)
    with opened(other, np.ones(3)) as (slave, _), pytest.raises(Exception, match="fatal"):
        slave.setFMUState(slave.deSerializeFMUstate(saved))


def test_wrong_calls_are_refused_and_the_process_lives_on(fmu: Path) -> None:
    """More of them than pythonfmu's wrapper survives by itself."""
    for _ in range(5):
        with opened(fmu, np.ones(3)) as (slave, _):
            for call in (
                lambda slave=slave: slave.getReal([99]),
                lambda slave=slave: slave.setReal([3], [1.0]),
                lambda slave=slave: slave.getInteger([0]),
                lambda slave=slave: slave.setBoolean([12], [True]),
                lambda slave=slave: slave.deSerializeFMUstate(b'{"mode": "st'),
            ):
                with pytest.raises(Exception, match="fatal"):
                    call()


@pytest.mark.parametrize(
    ("time", "step"), [(0.0, 0.0), (0.0, -1e-3), (0.0, np.nan), (0.01, 1e-3), (0.0, 1e300)]
)
def test_steps_that_cannot_be_taken_are_discarded_and_change_nothing(
    fmu: Path, time: float, step: float
) -> None:
    with opened(fmu, np.ones(3)) as (slave, _):
        slave.setReal([1], [1.7])
        before = slave.getReal([3, 4, 5, 6])
        with pytest.raises(Exception, match="discard"):
            slave.doStep(currentCommunicationPoint=time, communicationStepSize=step)
        assert slave.getReal([3, 4, 5, 6]) == before
        slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=1e-3)
        assert slave.getReal([3, 4, 5, 6]) != before


def test_an_input_that_is_no_number_stops_the_next_step(fmu: Path) -> None:
    with opened(fmu, np.ones(3)) as (slave, _):
        slave.setReal([1], [np.nan])
        assert slave.getReal([1]) == [1.0]
        with pytest.raises(Exception, match="discard"):
            slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=1e-3)
        slave.setReal([1], [1.5])
        slave.doStep(currentCommunicationPoint=0.0, communicationStepSize=1e-3)


def test_platforms_and_models_it_cannot_serve_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="darwin64"):
        build_python_fmu(networks.network(43), tmp_path / "python.fmu", ("linux64", "darwin64"))
    assert "white-box" in refused(tmp_path, "build", "wbm", "--backend", "pythonfmu")
    assert "pythonfmu" in refused(tmp_path, "build", "wbm", "--backend", "pythonfum")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_it_beside_the_parameter_set(tmp_path: Path) -> None:
    networks.network(43).save(tmp_path / "mine.json")
    command = [sys.executable, "-m", "cosimulation", "build", "mine.json", "--backend", "pythonfmu"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    with zipfile.ZipFile(tmp_path / "mine_python.fmu") as archive:
        found = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
    assert found == set(PLATFORMS)
