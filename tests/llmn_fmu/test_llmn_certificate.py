"""The FMU of a network whose stability is proved: outside_certificate, log and model card."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import certified_networks as networks
import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu
from fmu_runner import run_fmu
from theta_networks import theta_network

import tolerances
from fmi.raw import MODEL_EXCHANGE, OK, WARNING, Slave, load
from fmu_builder.compiler import host_platform
from fmu_builder.errors import BuildError
from fmu_builder.kernel import simulate
from fmu_builder.llmn_fmu import build_llmn, interface, model_card
from fmu_builder.parameter_set import ParameterSet, StabilityProof
from identification.stability import found_certificate, proved

RATE, TICK = 4.0, 0.01
STEP = RATE * TICK
MESSAGE = (
    "the scheduling variable has moved faster than stability is proved for, or the contact has opened"
    " (reported once)"
)
New = Callable[..., tuple[Slave, dict[str, int]]]


@pytest.fixture(scope="module")
def certified() -> ParameterSet:
    plain = networks.oscillators()
    return plain.replaced(certificate=found_certificate(plain, RATE))


@pytest.fixture(scope="module")
def proof(certified: ParameterSet) -> StabilityProof:
    found = proved(certified)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def fmu(certified: ParameterSet, proof: StabilityProof, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certified")
    return build_llmn(certified, folder / "certified.fmu", (host_platform(),), proof=proof)


def maker(path: Path, folder: Path) -> Iterator[New]:
    description = fmpy.read_model_description(str(path))
    references = {v.name: v.valueReference for v in description.modelVariables}
    library: ctypes.CDLL = load(path, folder)
    made: list[Slave] = []

    def new(**options: object) -> tuple[Slave, dict[str, int]]:
        made.append(Slave(library, description.guid, **options))
        return made[-1], references

    yield new
    for slave in made:
        slave.free()


@pytest.fixture
def new(fmu: Path, tmp_path: Path) -> Iterator[New]:
    yield from maker(fmu, tmp_path)


def ticked(slave: Slave, reference: int, heights: list[float], begin: int = 0, ticks: int = 1) -> list[int]:
    """outside_certificate after every step of so many ticks, each with its height."""
    flags = []
    for k, height in enumerate(heights):
        assert slave.set([0], [height]) == OK
        assert slave.step((begin + k * ticks) * TICK, ticks * TICK) == OK
        flags.append(slave.get_integer(reference, "GetBoolean"))
    return flags


def test_fmpy_finds_nothing_wrong(fmu: Path) -> None:
    assert validate_fmu(str(fmu)) == []


def test_the_outputs_are_those_of_the_kernel_without_a_certificate(
    fmu: Path, certified: ParameterSet
) -> None:
    rows = np.random.default_rng(5).uniform([0.4, -1.0], [2.6, 1.0], (60, 2))
    found = run_fmu(fmu, rows, certified.output_names, TICK)
    assert np.abs(found - simulate(certified.replaced(certificate=None), rows)).max() == tolerances.BITS


def test_the_flag_rises_with_the_first_tick_that_is_faster_and_stays(new: New) -> None:
    slave, references = new()
    slave.start(v0=1.0)
    flag = references["outside_certificate"]
    assert slave.get_integer(flag, "GetBoolean") == 0
    # up and down again at the rate: 4 m/s * 10 ms, rounded as it comes
    heights = [1.0 + STEP * k for k in range(10)]
    heights += heights[::-1]
    assert ticked(slave, flag, heights) == [0] * 20
    assert slave.log == []
    assert ticked(slave, flag, [1.0 + 1.01 * STEP, 1.0, 1.0], 20) == [1, 1, 1]
    assert slave.log == [(WARNING, "logStatusWarning", f"fmi2DoStep: {MESSAGE}")]
    assert slave.Reset() == OK
    slave.start(v0=1.0)
    assert slave.get_integer(flag, "GetBoolean") == 0


def test_an_input_held_over_a_long_step_jumps(new: New) -> None:
    slave, references = new()
    slave.start(v0=1.0)
    flag = references["outside_certificate"]
    # 1 m/s on average, in jumps of 0.1 m: the first of the ten ticks of a step is too fast
    assert ticked(slave, flag, [1.1, 1.2], ticks=10) == [1, 1]
    assert len(slave.log) == 1


def test_input_derivatives_keep_a_long_step_inside(new: New) -> None:
    slave, references = new()
    slave.start(v0=1.0)
    for k in range(3):
        assert slave.set([0], [1.0 + 0.1 * k]) == OK
        assert slave.slope([0], [1.0]) == OK
        assert slave.step(0.1 * k, 0.1) == OK
    assert slave.get_integer(references["outside_certificate"], "GetBoolean") == 0


def test_beyond_the_range_weights_are_held_and_nothing_is_outside(new: New) -> None:
    slave, references = new()
    slave.start(v0=2.5)
    assert ticked(slave, references["outside_certificate"], [2.5, 4.0, 2.6, 2.5 - 0.99 * STEP]) == [0] * 4


def test_in_model_exchange_an_event_raises_it(new: New) -> None:
    slave, references = new(kind=MODEL_EXCHANGE)
    slave.start(v0=1.0)
    slave.run()
    flag = references["outside_certificate"]
    for k, height in enumerate([1.0 + STEP, 1.0 + 3.0 * STEP, 1.0 + 3.0 * STEP], start=1):
        slave.event(TICK * k, [0], [height])
    assert slave.get_integer(flag, "GetBoolean") == 1
    assert slave.log == [(WARNING, "logStatusWarning", f"fmi2NewDiscreteStates: {MESSAGE}")]


def test_changed_physical_parameters_have_no_certificate(tmp_path: Path) -> None:
    network = theta_network("chain8")
    proof = StabilityProof(network.model_hash(), 6.0, 0.006, 0.1, "Proved: x.", "Not proved: y.")
    path = build_llmn(network, tmp_path / "theta.fmu", (host_platform(),), proof=proof)
    makers = maker(path, tmp_path)
    slave, references = next(makers)()
    slave.start()
    flag, stiffness = references["outside_certificate"], references["k_E"]
    assert slave.get_integer(flag, "GetBoolean") == 0
    assert slave.set([stiffness], [9e4]) == OK
    assert [status for status, *_ in slave.log] == [WARNING]  # said once: no certificate applies any more
    assert slave.get_integer(flag, "GetBoolean") == 1
    assert slave.set([stiffness], [1e5]) == OK
    assert slave.step(0.0, 0.001) == OK
    assert slave.get_integer(flag, "GetBoolean") == 0
    makers.close()


def test_parameters_changed_to_and_fro_hide_no_movement(tmp_path: Path) -> None:
    """With a deviation in the schedule the next tick moves further than the height: all of it counts."""
    network = theta_network("chain8", gain=5.0)
    proof = StabilityProof(network.model_hash(), 1e-3, 1e-6, 0.1, "Proved: x.", "Not proved: y.")
    path = build_llmn(network, tmp_path / "theta.fmu", (host_platform(),), proof=proof)
    makers = maker(path, tmp_path)
    new = next(makers)
    for value in (1e5, 9e4):
        slave, references = new()
        slave.start()
        assert slave.set([1], [1350.0]) == OK
        flags = []
        for k in range(3):
            assert slave.set([references["k_E"]], [value]) == OK
            assert slave.set([references["k_E"]], [1e5]) == OK
            assert slave.step(k * 1e-3, 1e-3) == OK
            flags.append(slave.get_integer(references["outside_certificate"], "GetBoolean"))
        assert flags == [0, 1, 1]
    makers.close()


def test_without_a_proof_the_fmu_says_nothing_of_stability(certified: ParameterSet) -> None:
    names = [one.name for one in interface(certified).variables]
    assert "outside_certificate" not in names
    card = model_card(certified, interface(certified))
    assert "Nothing is proved. A certificate stored with the model was not proved" in card
    plain = certified.replaced(certificate=None)
    assert "not proved when this FMU was built" not in model_card(plain, interface(plain))


def test_the_model_card_has_rate_decay_and_fit_on_one_line(
    certified: ParameterSet, proof: StabilityProof
) -> None:
    shown = interface(certified, proof=proof)
    (line,) = [one for one in model_card(certified, shown, proof).splitlines() if "Proved:" in one]
    for part in (f"exp(-{proof.decay:g} t)", "at most 4 m/s", "y 97.25 %"):
        assert part in line
    assert "Not proved: accuracy, the real pantograph, any loop through a controller" in model_card(
        certified, shown, proof
    )


def test_the_rate_is_part_of_the_identity_of_the_fmu(certified: ParameterSet, proof: StabilityProof) -> None:
    slower = replace(proof, rate=3.0, move=0.03)
    guids = {interface(certified, proof=one).guid(certified.model_hash()) for one in (None, proof, slower)}
    assert len(guids) == 3


def test_a_proof_of_another_model_is_refused(
    certified: ParameterSet, proof: StabilityProof, tmp_path: Path
) -> None:
    other = replace(proof, model_hash="0" * 64)
    with pytest.raises(BuildError, match="is of another model"):
        build_llmn(certified, tmp_path / "other.fmu", (host_platform(),), proof=other)
    assert list(tmp_path.iterdir()) == []


def test_a_proof_for_any_movement_needs_no_watch(certified: ParameterSet, proof: StabilityProof) -> None:
    any_movement = replace(proof, rate=None, move=None)
    assert "outside_certificate" not in [v.name for v in interface(certified, proof=any_movement).variables]


def test_a_proof_for_any_movement_says_nothing_of_other_parameters_and_of_flight(tmp_path: Path) -> None:
    network = theta_network("chain8")
    any_movement = StabilityProof(network.model_hash(), None, None, 0.1, "Proved: x.", "Not proved: y.")
    shown = interface(network, proof=any_movement)
    (flag,) = [one for one in shown.variables if one.name == "outside_certificate"]
    assert "m/s" not in flag.description
    told = "the contact has opened since the start, or physical parameters are not those identified"
    assert told in flag.description and told in model_card(network, shown, any_movement)
    path = build_llmn(network, tmp_path / "theta.fmu", (host_platform(),), proof=any_movement)
    makers = maker(path, tmp_path)
    slave, references = next(makers)()
    switch, one = (ctypes.c_uint * 1)(references["unilateral"]), ctypes.c_size_t(1)
    assert slave.SetBoolean(switch, one, (ctypes.c_int * 1)(1)) == OK
    slave.start(v0=1.5)
    reference = references["outside_certificate"]
    # down fast, in contact; then the wire goes where the pan-head is not
    for tick, (height, expected) in enumerate(((1.49, 0), (1.48, 0), (1.6, 1), (1.4, 1))):
        assert slave.set([0], [height]) == OK
        assert slave.step(tick * 1e-3, 1e-3) == OK
        assert slave.get_integer(reference, "GetBoolean") == expected, tick
    assert slave.Reset() == OK
    slave.start(v0=1.5)
    assert slave.get_integer(reference, "GetBoolean") == 0
    assert slave.set([references["theta_m_H_2"]], [8.5]) == OK
    assert slave.get_integer(reference, "GetBoolean") == 1
    makers.close()
